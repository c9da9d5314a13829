# What this package offers, for type checkers and editors: a name is imported at its first use.

from filippov.plot.attractors import plot_attractors
from filippov.plot.branch import plot_branches
from filippov.plot.comparison import plot_comparison
from filippov.plot.describing import plot_describing_function
from filippov.plot.diagnosis import plot_diagnosis
from filippov.plot.graph import plot_graph
from filippov.plot.identification import plot_identification
from filippov.plot.lyapunov import plot_brute_force, plot_lyapunov
from filippov.plot.manifold import plot_manifold
from filippov.plot.maps import plot_diagram, plot_event_map, plot_iterates
from filippov.plot.orbits import plot_orbit
from filippov.plot.regions import plot_basin, plot_periods, plot_regions
from filippov.plot.solution import plot_phase, plot_solution
from filippov.plot.solution_comparison import plot_motions, plot_solution_comparison
from filippov.plot.tree import plot_tree
from filippov.plot.tuning import plot_gain_maps

__all__ = [
    "plot_attractors",
    "plot_basin",
    "plot_branches",
    "plot_brute_force",
    "plot_comparison",
    "plot_describing_function",
    "plot_diagnosis",
    "plot_diagram",
    "plot_event_map",
    "plot_gain_maps",
    "plot_graph",
    "plot_identification",
    "plot_iterates",
    "plot_lyapunov",
    "plot_manifold",
    "plot_motions",
    "plot_orbit",
    "plot_periods",
    "plot_phase",
    "plot_regions",
    "plot_solution",
    "plot_solution_comparison",
    "plot_tree",
]
