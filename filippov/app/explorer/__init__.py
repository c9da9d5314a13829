"""The explorer: a local page with sliders for the parameters of one system, and its pictures."""
