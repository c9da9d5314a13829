"""Friction from measurements: records, fits, misfit, intervals."""
