"""Sweeps: many points of one problem on many processes, with every finished point kept on disk."""
