"""Analysis of any system: sections, event maps, equilibria, stability, bifurcations."""
