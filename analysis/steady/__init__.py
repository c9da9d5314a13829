"""Equilibria and sets of equilibria: where they are, their linearisation, solution beside them."""
