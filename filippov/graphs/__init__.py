"""Mode graphs, possible and observed, and words of modes."""

from __future__ import annotations

from filippov.base.exports import short_names

# Short name -> module of this package.
EXPORTS: dict[str, str] = {
    **dict.fromkeys(("observed_graph", "possible_graph", "recurrent_part"), "graph"),
    **dict.fromkeys(("load_graph", "save_graph"), "graph_io"),
    "mode_word": "word",
}

__all__ = sorted(EXPORTS)  # noqa: PLE0605
__getattr__, __dir__ = short_names(__name__, EXPORTS)
