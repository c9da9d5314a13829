"""Mode graphs, possible and observed, and words of modes."""

from __future__ import annotations

from typing import Any

from filippov.base.exports import exported, keep_names

# Short name -> module of this package.
EXPORTS: dict[str, str] = {
    **dict.fromkeys(("observed_graph", "possible_graph", "recurrent_part"), "graph"),
    **dict.fromkeys(("load_graph", "save_graph"), "graph_io"),
    "mode_word": "word",
}

__all__ = sorted(EXPORTS)  # noqa: PLE0605
keep_names(__name__)


def __getattr__(name: str) -> Any:
    return exported(__name__, EXPORTS, name)


def __dir__() -> list[str]:
    return sorted({*globals(), *EXPORTS})
