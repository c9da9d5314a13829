# What this package offers, for type checkers and editors; at run time names are imported at first use.

from filippov.app.explorer.explorer import Explorer

__all__ = [
    "Explorer",
]
