"""Branches over a parameter: continuation, special points, switching, curves of them."""
