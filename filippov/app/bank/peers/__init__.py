"""Other solvers, run on the same cases."""
