"""Stages of methods that are no tableau written out: Radau IIA with its LU factors, Taylor series."""
