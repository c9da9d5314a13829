"""The command, banks of cases, studies and the explorer: the only code that sees both models and analysis."""

from __future__ import annotations

from filippov.base.exports import short_names

# Short name -> module of this package.
EXPORTS: dict[str, str] = {"Explorer": "explorer.explorer"}

__all__ = sorted(EXPORTS)  # noqa: PLE0605
__getattr__, __dir__ = short_names(__name__, EXPORTS)
