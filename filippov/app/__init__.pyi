# What this package offers, for type checkers and editors: a name is imported at its first use.

from filippov.app.explorer.explorer import Explorer

__all__ = [
    "Explorer",
]
