"""Reference solvers, run on the same cases."""
