"""Sections and event maps: returns, slopes, fixed points."""
