"""Periodic orbits: search, shooting, Floquet multipliers, files."""
