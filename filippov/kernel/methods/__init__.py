"""Stages of methods without an explicit tableau: Radau IIA with its LU factors, Taylor series."""
