"""Equilibria and sets of equilibria: where they are, their linearisation, motion beside them."""
