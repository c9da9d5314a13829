"""Arrays in, arrays out: what the solver compiles."""
