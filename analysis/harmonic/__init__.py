"""Harmonic balance: describing functions and the cycles they predict."""
