"""Stability of equilibria and of sets of equilibria, with what decides about it."""
