# What this package offers, for type checkers and editors: a name is imported at its first use.

from filippov.base.errors import ModelError, NonUniqueError, SolveError, UsageError
from filippov.base.status import EventKind, Status
from filippov.io.automaton.export import export_system
from filippov.model.comparator import Band, Exact, Hysteresis, Karnopp, Smooth, Switch
from filippov.model.parameter import Parameter
from filippov.model.parameter_symbol import parameters
from filippov.model.signals.input import Input
from filippov.model.signals.lookup import Table
from filippov.model.signals.waves import chirp, prbs, square, step
from filippov.model.surface import Surface
from filippov.model.symbols import (
    Abs,
    Heaviside,
    Max,
    Min,
    Piecewise,
    cos,
    exp,
    log,
    pi,
    sign,
    sin,
    sqrt,
    states,
    t,
    tan,
    tanh,
)
from filippov.model.system import System
from filippov.model.time_event import TimeEvent
from filippov.model.user_event import UserEvent
from filippov.solving.ensemble import Ensemble, solve_many
from filippov.solving.solution import Solution
from filippov.solving.solution_tree import SolutionTree
from filippov.solving.solver import solve
from filippov.solving.state.events import Events, Stop
from filippov.solving.state.problem import Problem
from filippov.sweep.plan import Sweep

__all__ = [
    "Abs",
    "Band",
    "Ensemble",
    "EventKind",
    "Events",
    "Exact",
    "Heaviside",
    "Hysteresis",
    "Input",
    "Karnopp",
    "Max",
    "Min",
    "ModelError",
    "NonUniqueError",
    "Parameter",
    "Piecewise",
    "Problem",
    "Smooth",
    "Solution",
    "SolutionTree",
    "SolveError",
    "Status",
    "Stop",
    "Surface",
    "Sweep",
    "Switch",
    "System",
    "Table",
    "TimeEvent",
    "UsageError",
    "UserEvent",
    "chirp",
    "cos",
    "exp",
    "export_system",
    "log",
    "parameters",
    "pi",
    "prbs",
    "sign",
    "sin",
    "solve",
    "solve_many",
    "sqrt",
    "square",
    "states",
    "step",
    "t",
    "tan",
    "tanh",
]
