"""A problem, its options, and the state of a run of the compiled loop."""
