"""A system as it is written: expressions, surfaces, parameters, events, and what they are made into."""
