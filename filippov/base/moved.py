"""Where modules stood before the rooms: the old import path of a module gives the very same module.

`filippov.solver` is `filippov.solving.solver`, and so on; what is new has one path only. The table says for
each pair (old package, room) which modules moved; a>b where the last name changed, too. A package that moved
takes along what is in it.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Sequence
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Any

_MOVED: dict[tuple[str, str], str] = {
    ("filippov", "filippov"): ("_kernels>kernel"),
    ("filippov", "filippov.app"): ("bank commands>cli report"),
    ("filippov", "filippov.app.cli"): ("cli>main configuration"),
    ("filippov", "filippov.base"): (
        "csv_text errors escape failure json_text names progress status symbolic_value user_file version "
        "whole_file"
    ),
    ("filippov", "filippov.graphs"): ("graph graph_io guards reset_guards word"),
    ("filippov", "filippov.io"): ("archive export storage stored_system tree tree_storage"),
    ("filippov", "filippov.model"): (
        "assemble check comparator contact equations expression extract kinds parameter "
        "parameter_symbol reduction size spelling surface symbolic symbols system table "
        "time_event user_event"
    ),
    ("filippov", "filippov.model.comparators"): ("hysteresis regularize"),
    ("filippov.plot", "filippov.plot"): ("motions>solution_comparison"),
    ("filippov", "filippov.plot"): (
        "plot_branch>branch plot_comparison>comparison plot_describing>describing plot_graph>graph "
        "plot_identification>identification plot_lyapunov>lyapunov plot_maps>maps plot_orbits>orbits "
        "plot_regions>regions plot_tree>tree plot_tuning>tuning plotting>solution style"
    ),
    ("filippov", "filippov.solving"): (
        "branching diagnosis ensemble loop patience scale settling solution solution_tree solver stiffness"
    ),
    ("filippov", "filippov.solving.resets"): ("impact_law jumps passed reset_cycle slow_spiral zeno"),
    ("filippov", "filippov.solving.selection"): (
        "ambiguity attraction candidate complementarity corner fold_point higher_order modes slide_again "
        "two_fold"
    ),
    ("filippov", "filippov.solving.state"): (
        "batch change clocks event_log events gradients interpolant leading machine options point problem "
        "rates run watched"
    ),
    ("filippov._kernels", "filippov.kernel.codegen"): (
        "build cache callback generate generate_events generate_resets generated hoist jit "
        "method plain_contact purity replacement structure"
    ),
    ("filippov._kernels", "filippov.kernel.derivative"): ("difference"),
    ("filippov._kernels", "filippov.kernel.lanes"): (
        "lane_field lane_functions lane_run lane_seat>lane_slot lane_step"
    ),
    ("filippov._kernels", "filippov.kernel.language"): (
        "compiler language>primitives operand translate unit"
    ),
    ("filippov._kernels", "filippov.kernel.loop"): (
        "advance control dense elementary ensemble field land lap>event_cycle model "
        "multiplier>gradients probe record reset resolve rules segment start turn>ensemble"
    ),
    ("filippov._kernels", "filippov.kernel.loop.roots"): ("bernstein locate points"),
    ("filippov._kernels", "filippov.kernel.methods"): ("dense_lu radau"),
    ("filippov._kernels", "filippov.kernel.tables"): (
        "codes layout radau_tables tableaus tables>root_tables"
    ),
    ("filippov.analysis", "filippov.analysis.algebra"): (
        "budget deadline exact_form exponents inequalities number_text polynomial routh_array routh_hurwitz "
        "routh_result routh_text time_bounds"
    ),
    ("filippov.analysis", "filippov.analysis.bifurcations"): (
        "branch branch_point branch_problem continuation corrector crossing curve equilibrium_branch "
        "sliding_border special_points switch"
    ),
    ("filippov.analysis.bifurcations", "filippov.analysis.bifurcations"): ("touching>tangency"),
    ("filippov.analysis.comparisons", "filippov.analysis.comparisons"): (
        "motions>solutions motion_ending>solution_ending motion_events>solution_events "
        "motion_page>solution_page motion_result>solution_result motion_run>solution_run"
    ),
    ("filippov.analysis", "filippov.analysis.comparisons"): (
        "band_model comparison comparison_result comparison_run"
    ),
    ("filippov.analysis", "filippov.analysis.diagrams"): (
        "basin bifurcation borders brute_force cell_work cells regions"
    ),
    ("filippov.analysis", "filippov.analysis.estimation"): (
        "driven_run force_input friction_curve identification identify_fit misfit record residual_noise"
    ),
    ("filippov.analysis", "filippov.analysis.gains"): ("contraction gain_map tuning"),
    ("filippov.analysis", "filippov.analysis.harmonic"): ("control_link describing_function quasi_linear"),
    ("filippov.analysis", "filippov.analysis.local_stability"): (
        "certificates contact_stability kink_stability periodic_stability planar_cone set_parts "
        "set_stability sliding_stability smooth_stability stability stability_context stability_result "
        "stability_text stick_parts"
    ),
    ("filippov.analysis", "filippov.analysis.maps"): (
        "event_map fixed_points linear_turn>linear_return map_rows section set_slope turn>first_return"
    ),
    ("filippov.analysis.maps", "filippov.analysis.maps"): ("linear_turn>linear_return turn>first_return"),
    ("filippov.analysis", "filippov.analysis.orbits"): (
        "floquet margin oddness orbit orbit_file orbit_search shooting"
    ),
    ("filippov.analysis", "filippov.analysis.sensitivity"): (
        "lyapunov plain_variation reset_slopes saltation variation"
    ),
    ("filippov.analysis", "filippov.analysis.steady"): (
        "branches clocks drift_map equilibria equilibria_numeric equilibrium existence forcing "
        "linearisation rest_map"
    ),
    ("filippov.analysis", "filippov.models"): ("static_cycle"),
    ("filippov.analysis.harmonic", "filippov.models"): ("static_cycle"),
    ("filippov.bank", "filippov.app.bank.reference"): (
        "peer>solver peer_diffrax>solvers peer_heyoka>solvers peer_process>process peer_row>row "
        "peer_scipy>solvers"
    ),
}


def _table() -> dict[str, str]:
    """Old path -> new path."""
    table = {}
    for (package, room), names in _MOVED.items():
        for name in names.split():
            old, _, new = name.partition(">")
            table[f"{package}.{old}"] = f"{room}.{new or old}"
    return table


MOVED = _table()


def moved(name: str) -> str | None:
    """The new path of a module that moved, alone or with its package; None for any other name."""
    if name in MOVED:
        return MOVED[name]
    package, _, last = name.rpartition(".")
    above = moved(package) if package else None
    return None if above is None else f"{above}.{last}"


class Moved:
    """A finder and loader of modules under their old paths (importlib.abc has the protocols; it is slow)."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """The spec of a module that moved, if it is one."""
        if not fullname.startswith("filippov."):
            return None
        new = moved(fullname)
        loader: Any = self
        return None if new is None else ModuleSpec(fullname, loader, origin=new)

    def create_module(self, spec: ModuleSpec) -> None:
        """An empty module, as for any other."""

    def exec_module(self, module: ModuleType) -> None:
        """Put the module itself in place of the empty one that the import system made."""
        sys.modules[module.__name__] = importlib.import_module(moved(module.__name__) or "")


def install() -> None:
    """Have old paths found, once; first, as a package that moved lists its folder for its old name, too."""
    if not any(isinstance(finder, Moved) for finder in sys.meta_path):
        sys.meta_path.insert(0, Moved())
