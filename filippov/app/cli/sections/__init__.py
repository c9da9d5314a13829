"""Sections of the command line; where none is parametrised, the solution from one state is followed."""
