# What this package offers, for type checkers and editors: a name is imported at its first use.

from filippov.graphs.graph import observed_graph, possible_graph, recurrent_part
from filippov.graphs.graph_io import load_graph, save_graph
from filippov.graphs.word import mode_word

__all__ = [
    "load_graph",
    "mode_word",
    "observed_graph",
    "possible_graph",
    "recurrent_part",
    "save_graph",
]
