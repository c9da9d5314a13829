"""Values of states, outputs and expressions along the solution.

A sign in an expression is that of the mode; while the solution slides on the surface, the multiplier.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from filippov.base.arrays import Array
from filippov.base.errors import ModelError, UsageError
from filippov.base.given import number_array
from filippov.base.names import unknown
from filippov.base.signature import check_signature
from filippov.base.symbolic_value import is_expression, single
from filippov.model.system import System
from filippov.solving.selection.candidate import sliding_solutions
from filippov.solving.selection.higher_order import multipliers
from filippov.solving.solution import Solution
from filippov.solving.state.machine import Machine
from filippov.solving.state.point import Point

if TYPE_CHECKING:
    from sympy import Expr

# What a multiplier may be beyond its set by the error of the dense output.
OUTSIDE = 1e-6


def series(solution: Solution, name: Any) -> Array:
    """The values of a state, an output or "t" at solution.t; where the state jumps, before and after."""
    name = single(name)
    if isinstance(name, int | float | np.generic | slice | tuple):
        raise UsageError(
            f"a solution is read by name, not by {name!r}: solution[{solution.system.states[0]!r}], or "
            "solution.y[i] for the state number i."
        )
    key = getattr(name, "name", name)
    if isinstance(key, str) and key == "t":
        return solution.t
    if isinstance(key, str) and key in solution.system.states:
        return np.asarray(solution.y[solution.system.states.index(key)])
    named = (*solution.system.outputs, *(samples.name for samples in solution.system.inputs))
    if isinstance(key, str) and key not in named and key.isidentifier():
        known = ("t", *solution.system.states, *named)
        raise UsageError(f"{unknown('name', key, known)}. Formulas: solution.evaluate('x - v', t).")
    again = np.append(False, np.diff(solution.t) == 0)
    out = values(solution, key, solution.t, solution.y, _modes(solution, solution.t, "-"))
    if np.any(again):
        t, y = solution.t[again], solution.y[:, again]
        out[again] = values(solution, key, t, y, _modes(solution, t, "+"), "+")
    return out


def evaluate(solution: Solution, what: Any, t: Any = None, side: str = "-") -> Any:
    """The value of an expression at times, as an array like t; without times as `series`.

    what    an expression in states, parameters and time, its formula as text, the name of a state or output,
            or, of a system of functions, f(t, x, p, s) -> float. Signs and conditions in it are those of the
            equations: while the solution slides, the multiplier replaces sign(h), and its negative replaces
            sign(-h)
    side    at an event "-" (before, in the direction of integration) or "+" (after)

    Raises UsageError without dense output and outside the span, ModelError for anything but an expression.
    """
    if t is None:
        return series(solution, what)
    if solution.sol is None:
        raise UsageError("evaluate needs the dense output; solve without dense_output=False.")
    times = np.atleast_1d(number_array("t", t))
    flat = times.ravel()
    x = solution.sol(flat, side=side).reshape(len(solution.problem.x0), flat.size)
    out = values(solution, what, flat, x, _modes(solution, flat, side), side)
    return out.reshape(times.shape) if np.ndim(t) else float(out[0])


def multiplier(solution: Solution, surface: str, t: Any = None) -> Any:
    """Value of a surface's sign: +-1 off it, the multiplier of Filippov's combination while sliding.

    t           times; default those of the solution
    surface     its name, or the formula of its h; for h = v - vb "vb - v" gives the sign of vb - v
    """
    try:
        i, sense = solution.system.surface_place(surface)
    except ModelError as error:
        raise UsageError(str(error)) from None
    if solution.sol is None:
        raise UsageError("the multiplier needs the dense output; solve without dense_output=False.")
    t = solution.t if t is None else t
    times = np.atleast_1d(number_array("t", t)).ravel()
    states = solution.sol(times).reshape(len(solution.problem.x0), times.size)
    out = _signs(solution, times, states, _modes(solution, times, "-"), [i])[:, i] * sense
    return out.reshape(np.shape(t)) if np.ndim(t) else out[0]


def values(
    solution: Solution, what: Any, t: Array, x: Array, modes: npt.NDArray[np.int64], side: str = "-"
) -> Array:
    """The values of a quantity at times (k,), states (n, k) and modes (k, m)."""
    system = solution.system
    if isinstance(what, str) and what in system.states:
        return np.array(x[system.states.index(what)])
    what = system.outputs.get(what, what) if isinstance(what, str) else what
    if callable(what) and not is_expression(what):
        check_signature(what, ("t", "x", "p", "s"), "the function", "a number", UsageError)
        every = [i for i, surface in enumerate(system.surfaces) if surface.kind == "switching"]
        signs = _signs(solution, t, x, modes, every, side)
        record = system.parameters.record(solution.problem.p)
        rows = zip(t.tolist(), x.T, signs, strict=True)
        return np.array([float(what(time, state.copy(), record, s)) for time, state, s in rows])
    expr, form = expression_of(system, what), system.symbolic
    assert form is not None
    from filippov.model.signals.input import sampled_in
    from filippov.solving.expressions import in_mode

    place = [i for i, s in enumerate(form.s) if s in expr.free_symbols]
    sliding = [i for i in place if system.surfaces[i].kind == "switching"]
    signs = _signs(solution, t, x, modes, sliding, side) if place else np.zeros(modes.shape)
    kept = np.zeros(modes.shape, dtype=np.int64)
    kept[:, place] = modes[:, place]
    out = np.empty(t.size)
    at_knots = "-" if (side == "-") != solution.problem.backward else "+"
    for mode in np.unique(kept, axis=0):
        rows_in = np.all(kept == mode, axis=1)
        function = in_mode(system, expr, tuple(mode.tolist()))
        signals = [node.samples.at(t[rows_in], node.order, at_knots) for node in sampled_in(expr)]
        with np.errstate(all="ignore"):
            out[rows_in] = function(t[rows_in], x[:, rows_in], solution.problem.p, signs[rows_in].T, signals)
    return out


def expression_of(system: System, what: Any) -> Expr:
    """An expression of the states, parameters and time, given as such, as text or as an output's name.

    The signs in it are symbols of the system's surfaces. Raises UsageError, ModelError.
    """
    form = system.symbolic
    if form is None:
        raise UsageError(
            f"{what!r} is a formula, but the system is made of functions: give f(t, x, p, s) -> float."
        )
    from filippov.model.check import as_expression
    from filippov.model.expression import parse_expression
    from filippov.solving.expressions import read_with_signs

    if isinstance(what, str):
        what = system.outputs.get(what, what)
    symbols = form.names()
    if isinstance(what, str):
        outputs = {name: e for name, e in system.outputs.items() if name not in symbols}
        expr = parse_expression(what, {**symbols, **outputs})
    else:
        expr = as_expression(what, "the expression")
    for symbol in sorted(expr.free_symbols, key=str):
        if symbol.name != "t" and symbols.get(symbol.name) != symbol:
            raise ModelError(unknown("name", symbol.name, symbols))
    return read_with_signs(system, expr)


# -- signs -----------------------------------------------------------------------------------------------


def _modes(solution: Solution, t: Array, side: str) -> npt.NDArray[np.int64]:
    """The modes at times, (k, m); at an event the one before for "-", after for "+"."""
    segments = solution.segments
    direction = -1.0 if solution.problem.backward else 1.0
    ends = np.array([segment.t1 for segment in segments]) * direction
    place = np.searchsorted(ends, t * direction, side="left" if side == "-" else "right")
    modes = np.array([segment.mode for segment in segments], dtype=np.int64).reshape(len(segments), -1)
    return modes[np.minimum(place, len(segments) - 1)]


def _signs(
    solution: Solution, t: Array, x: Array, modes: npt.NDArray[np.int64], wanted: list[int], side: str = "-"
) -> Array:
    """What stands for the signs, (k, m): the modes, and the multipliers of wanted surfaces where they slide.
    """
    out = modes.astype(float)
    rows = np.flatnonzero(np.any(modes[:, wanted] == 0, axis=1))
    if not rows.size:
        return out
    options = solution.options
    machine = Machine(solution.system, options.stepper, solution.problem.p, sliding=options.sliding)
    machine.side = "-" if (side == "-") != solution.problem.backward else "+"
    for k in rows.tolist():
        time, mode, state = float(t[k]), out[k].copy(), np.ascontiguousarray(x[:, k])
        held = multipliers(machine, time, state, mode)
        found = _multipliers(solution, machine, time, state, mode, side) if held is None else held
        slides = [i for i in wanted if mode[i] == 0]
        out[k, slides] = np.asarray(found)[slides]
    return out


def _multipliers(
    solution: Solution, machine: Machine, t: float, x: Array, mode: Array, side: str
) -> Array:  # fmt: skip
    """Multipliers while sliding: where signs multiply, the root that the solution followed.

    That is the one in its set; of several, the one with the field of the solution.
    """
    direction = -1.0 if solution.problem.backward else 1.0
    point = Point(machine, t, x, direction, 0.0, np.zeros(mode.size))
    roots = sliding_solutions(point, mode, np.flatnonzero(mode == 0).tolist())
    if not roots:
        return np.asarray(machine.probe(t, 0.0, x, mode, point.guess)[2])
    if len(roots) == 1 or solution.sol is None:
        return roots[0][0]
    rate, radii, on = solution.sol.rate(t, side), machine.radii(t, x), mode == 0

    def misses(root: tuple[Array, Array]) -> tuple[float, float]:
        out = np.maximum(root[0] - radii[:, 1], radii[:, 0] - root[0])[on]
        return max(float(np.max(out)), OUTSIDE), float(np.linalg.norm(root[1] - rate))

    return min(roots, key=misses)[0]
