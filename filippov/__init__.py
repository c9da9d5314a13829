"""Filippov differential inclusions: x' in { f(t, x, s; p) : s_i in Sgn(h_i(t, x; p)) }."""

from __future__ import annotations

from pathlib import Path

from filippov.base.delegates import register
from filippov.base.exports import short_names
from filippov.base.moved import install

# In a checkout the packages filippov.models and filippov.analysis lie beside this folder, not in it.
_above = Path(__file__).resolve().parent.parent
_beside = all((_above / name / "__init__.py").is_file() for name in ("models", "analysis"))
if _beside and not (_above / "filippov" / "models").exists():
    __path__.append(str(_above))

_SYMBOLS = "Abs Heaviside Max Min Piecewise cos exp log pi sign sin sqrt states t tan tanh"

# Public name -> module of this package; imported when first used, so that `import filippov` costs nothing.
EXPORTS: dict[str, str] = {
    **dict.fromkeys(_SYMBOLS.split(), "model.symbols"),
    **dict.fromkeys(("ModelError", "NonUniqueError", "SolveError", "UsageError"), "base.errors"),
    "Input": "model.signals.input",
    "Parameter": "model.parameter",
    "parameters": "model.parameter_symbol",
    **dict.fromkeys(("Band", "Exact", "Hysteresis", "Karnopp", "Smooth", "Switch"), "model.comparator"),
    **dict.fromkeys(("Ensemble", "solve_many"), "solving.ensemble"),
    "EventKind": "base.status",
    "export_system": "io.automaton.export",
    **dict.fromkeys(("chirp", "prbs", "square", "step"), "model.signals.waves"),
    "Events": "solving.state.events",
    "Problem": "solving.state.problem",
    "Solution": "solving.solution",
    "SolutionTree": "solving.solution_tree",
    "Status": "base.status",
    "Stop": "solving.state.events",
    "Surface": "model.surface",
    "Sweep": "sweep.plan",
    "System": "model.system",
    "Table": "model.signals.lookup",
    "TimeEvent": "model.time_event",
    "UserEvent": "model.user_event",
    "solve": "solving.solver",
}

# Methods that modules of floors above their class carry out (see `filippov.base.delegates`).
METHODS: dict[str, str] = {
    "Solution.mode_graph": "filippov.graphs.graph:observed_graph",
    "Solution.plot": "filippov.plot.solution:plot_solution",
    "Solution.animate": "filippov.plot.animation:animate",
    "Solution.__getitem__": "filippov.solving.reading:series",
    "Solution.evaluate": "filippov.solving.reading:evaluate",
    "Solution.multiplier": "filippov.solving.reading:multiplier",
    "Solution._repr_html_": "filippov.io.notebook:solution_html",
    "Solution.to_pandas": "filippov.io.export:frame",
    "Events._repr_html_": "filippov.io.notebook:events_html",
    "Events.to_pandas": "filippov.io.export:event_frame",
    "System.export": "filippov.io.automaton.export:export_system",
    "System._repr_latex_": "filippov.io.notebook:system_latex",
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

# What people look for by another name.
_ELSEWHERE: dict[str, str] = {
    **dict.fromkeys(("solve_ivp", "odeint", "simulate", "ode45"), "solve(system, x0, t_span) is what solves"),
    **dict.fromkeys(("sgn", "relay"), "write sign(v); with hysteresis Surface('relay', v, width=w)"),
    **dict.fromkeys(("clip", "sat", "saturation", "saturate"), "write Max(-1, Min(u, 1))"),
    **dict.fromkeys(("deadzone", "dead_zone"), "write Max(u - w, 0) + Min(u + w, 0)"),
    "backlash": "filippov.interop.backlash is a block; in an elastic shaft: the dead zone of its twist",
    **dict.fromkeys(("where", "select", "ifthenelse"), "write Piecewise((a, v > 0), (b, True))"),
    **dict.fromkeys(("symbols", "symbol", "variables"), "states('x v') and parameters(m=1.0) make them"),
    "time": "time is filippov.t",
    **dict.fromkeys(("plot", "plot_solution", "plot_phase"), "solution.plot(), and filippov.plot for more"),
}

__all__ = sorted(EXPORTS)  # noqa: PLE0605
__getattr__, __dir__ = short_names(__name__, EXPORTS, _ELSEWHERE)
