"""Signals and curves from data: inputs from samples, lookup tables of a state, test signals."""
