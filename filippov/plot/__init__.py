"""Every picture: solutions, trees, graphs, and the results of the analysis."""

from __future__ import annotations

from typing import Any

from filippov.base.exports import exported, keep_names

# Short name -> module of this package.
EXPORTS: dict[str, str] = {
    "plot_attractors": "attractors",
    "plot_branches": "branch",
    "plot_comparison": "comparison",
    "plot_describing_function": "describing",
    "plot_graph": "graph",
    "plot_identification": "identification",
    **dict.fromkeys(("plot_brute_force", "plot_lyapunov"), "lyapunov"),
    "plot_manifold": "manifold",
    **dict.fromkeys(("plot_diagram", "plot_event_map", "plot_iterates"), "maps"),
    "plot_orbit": "orbits",
    **dict.fromkeys(("plot_basin", "plot_regions"), "regions"),
    **dict.fromkeys(("plot_phase", "plot_solution"), "solution"),
    "plot_tree": "tree",
    "plot_gain_maps": "tuning",
}

__all__ = sorted(EXPORTS)  # noqa: PLE0605
keep_names(__name__)


def __getattr__(name: str) -> Any:
    return exported(__name__, EXPORTS, name)


def __dir__() -> list[str]:
    return sorted({*globals(), *EXPORTS})
