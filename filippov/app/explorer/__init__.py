"""The explorer: a page on this machine with sliders for the parameters of one system and its pictures."""
