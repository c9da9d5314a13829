"""Sections and event maps: turns, slopes, fixed points."""
