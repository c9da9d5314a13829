"""Derivatives along a solution: variation, saltation at events, Lyapunov exponents."""
