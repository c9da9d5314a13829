"""Sections of the command line that no lift is given for: the solution from one initial state is the lift."""
