"""Which mode goes on from a point: corners, folds, sliding of higher order, ambiguity."""
