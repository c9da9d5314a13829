"""Diagrams over parameters and states: bifurcation diagrams, regions, basins."""
