"""Attractors, their basins by recurrence, saddles and their manifolds."""
