"""Polynomials, inequalities, Routh-Hurwitz, exact numbers, and budgets for such work."""
