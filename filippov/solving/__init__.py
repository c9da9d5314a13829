"""From a problem to its solution: the event loop's Python side, solutions, trees, ensembles."""
