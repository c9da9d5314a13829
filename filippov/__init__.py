"""Filippov differential inclusions: x' in { f(t, x, s; p) : s_i in Sgn(h_i(t, x; p)) }."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

from filippov.delegates import register

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
    **dict.fromkeys(_SYMBOLS, "filippov.symbols"),
    **dict.fromkeys(("ModelError", "NonUniqueError", "SolveError", "UsageError"), "filippov.errors"),
    "Parameter": "filippov.parameter",
    "parameters": "filippov.parameter_symbol",
    **dict.fromkeys(("Band", "Exact", "Hysteresis", "Smooth"), "filippov.comparator"),
    **dict.fromkeys(("Ensemble", "solve_many"), "filippov.ensemble"),
    "EventKind": "filippov.status",
    "Problem": "filippov.problem",
    "Solution": "filippov.solution",
    "SolutionTree": "filippov.solution_tree",
    "Status": "filippov.status",
    "Stop": "filippov.events",
    "Surface": "filippov.surface",
    "Sweep": "filippov.sweep.plan",
    "System": "filippov.system",
    "TimeEvent": "filippov.time_event",
    "UserEvent": "filippov.user_event",
    "solve": "filippov.solver",
}

# Methods that modules of floors above their class carry out (see `filippov.delegates`).
METHODS: dict[str, str] = {
    "Solution.mode_graph": "filippov.graph:observed_graph",
    "Solution.plot": "filippov.plotting:plot_solution",
    "Solution.save": "filippov.storage:save",
    "Solution.load": "filippov.storage:load",
    "Solution.to_xarray": "filippov.export:dataset",
    "SolutionTree.plot": "filippov.plot_tree:plot_branches",
    "SolutionTree.plot_tree": "filippov.plot_tree:plot_tree",
    "SolutionTree.save": "filippov.tree_storage:save_tree",
    "SolutionTree.load": "filippov.tree_storage:load_tree",
}
register(METHODS)

__all__ = sorted(_EXPORTS)  # noqa: PLE0605


def __getattr__(name: str) -> Any:
    if name not in _EXPORTS:
        raise AttributeError(f"module 'filippov' has no attribute {name!r}")
    value = getattr(importlib.import_module(_EXPORTS[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *_EXPORTS})
