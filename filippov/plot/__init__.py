"""Every picture: solutions, trees, graphs, and the results of the analysis."""

from __future__ import annotations

from filippov.base.exports import short_names

# Short name -> module of this package.
EXPORTS: dict[str, str] = {
    "plot_attractors": "attractors",
    "plot_branches": "branch",
    "plot_comparison": "comparison",
    "plot_describing_function": "describing",
    "plot_diagnosis": "diagnosis",
    "plot_graph": "graph",
    "plot_identification": "identification",
    **dict.fromkeys(("plot_brute_force", "plot_lyapunov"), "lyapunov"),
    "plot_manifold": "manifold",
    **dict.fromkeys(("plot_diagram", "plot_event_map", "plot_iterates"), "maps"),
    "plot_orbit": "orbits",
    **dict.fromkeys(("plot_basin", "plot_periods", "plot_regions"), "regions"),
    **dict.fromkeys(("plot_phase", "plot_solution"), "solution"),
    **dict.fromkeys(("plot_motions", "plot_solution_comparison"), "solution_comparison"),
    "plot_tree": "tree",
    "plot_gain_maps": "tuning",
}

__all__ = sorted(EXPORTS)  # noqa: PLE0605
__getattr__, __dir__ = short_names(__name__, EXPORTS)
