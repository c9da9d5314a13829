"""Mechanical systems of the gallery: friction, impacts, rolling and rocking bodies."""
