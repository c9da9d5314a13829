"""Studies that come with the package: declarations of what is computed and shown for a model."""
