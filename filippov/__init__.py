"""Filippov differential inclusions: x' in { f(t, x, s; p) : s_i in Sgn(h_i(t, x; p)) }."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

from filippov.base.delegates import register
from filippov.base.moved import install

# In a checkout the packages filippov.models and filippov.analysis lie beside this folder, not in it.
_above = Path(__file__).resolve().parent.parent
_beside = all((_above / name / "__init__.py").is_file() for name in ("models", "analysis"))
if _beside and not (_above / "filippov" / "models").exists():
    __path__.append(str(_above))

_SYMBOLS = [
    "Abs",
    "Heaviside",
    "Max",
    "Min",
    "Piecewise",
    "cos",
    "exp",
    "log",
    "pi",
    "sign",
    "sin",
    "sqrt",
    "states",
    "t",
    "tan",
    "tanh",
]

# Public name -> module; imported when first used, so that `import filippov` costs nothing.
_EXPORTS: dict[str, str] = {
    **dict.fromkeys(_SYMBOLS, "filippov.model.symbols"),
    **dict.fromkeys(("ModelError", "NonUniqueError", "SolveError", "UsageError"), "filippov.base.errors"),
    "Parameter": "filippov.model.parameter",
    "parameters": "filippov.model.parameter_symbol",
    **dict.fromkeys(("Band", "Exact", "Hysteresis", "Smooth"), "filippov.model.comparator"),
    **dict.fromkeys(("Ensemble", "solve_many"), "filippov.solving.ensemble"),
    "EventKind": "filippov.base.status",
    "Problem": "filippov.solving.state.problem",
    "Solution": "filippov.solving.solution",
    "SolutionTree": "filippov.solving.solution_tree",
    "Status": "filippov.base.status",
    "Stop": "filippov.solving.state.events",
    "Surface": "filippov.model.surface",
    "Sweep": "filippov.sweep.plan",
    "System": "filippov.model.system",
    "TimeEvent": "filippov.model.time_event",
    "UserEvent": "filippov.model.user_event",
    "solve": "filippov.solving.solver",
}

# Methods that modules of floors above their class carry out (see `filippov.base.delegates`).
METHODS: dict[str, str] = {
    "Solution.mode_graph": "filippov.graphs.graph:observed_graph",
    "Solution.plot": "filippov.plot.solution:plot_solution",
    "Solution.save": "filippov.io.storage:save",
    "Solution.load": "filippov.io.storage:load",
    "Solution.to_xarray": "filippov.io.export:dataset",
    "SolutionTree.plot": "filippov.plot.tree:plot_branches",
    "SolutionTree.plot_tree": "filippov.plot.tree:plot_tree",
    "SolutionTree.save": "filippov.io.tree_storage:save_tree",
    "SolutionTree.load": "filippov.io.tree_storage:load_tree",
}
register(METHODS)
install()

__all__ = sorted(_EXPORTS)  # noqa: PLE0605


def __getattr__(name: str) -> Any:
    if name not in _EXPORTS:
        raise AttributeError(f"module 'filippov' has no attribute {name!r}")
    value = getattr(importlib.import_module(_EXPORTS[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *_EXPORTS})
