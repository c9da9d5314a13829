"""The scale of a solution: its absolute tolerance where none is given, and a note where that decides much."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from filippov.base.arrays import Array
from filippov.model.system import System
from filippov.solving.state.options import LARGEST_ATOL, Options
from filippov.solving.state.ready import put_back, ready

if TYPE_CHECKING:
    from filippov.solving.solution import Solution

# Of rtol times the scale; rtol is taken as this at least, below which rounding decides.
SHARE, FINEST = 1e-3, 1e-10
# Parts of the span at whose ends the field is looked at.
PARTS = 4
# A component below so many atol is one whose accuracy atol decides; below so many roundings, one that is 0.
LITTLE, ROUNDINGS = 1e3, 1e2 * float(np.finfo(float).eps)


def small(states: Array, rtol: float) -> npt.NDArray[np.bool_]:
    """Which initial states (k, n) are so small that atol = 1e-12 is more than rtol of every component."""
    largest = np.max(np.abs(states), axis=-1, initial=0.0)
    return np.asarray(rtol * largest < LARGEST_ATOL)


def default_atol(system: System, x0: Array, span: tuple[float, float], p: Array, options: Options) -> float:
    """Absolute tolerance of a run for which none is given: min(1e-12, rtol scale/1000), a power of ten.

    scale       the largest of |x0_i| and |f_i| |t1 - t0|, with f at x0 on the sides of the surfaces that it
                is on: a force of ordinary size makes a start at 0 an ordinary one. 0: nothing is known

    A start that is not small keeps 1e-12.
    """
    # Most starts are not small, which `small` tells of many at once.
    if options.rtol * max(map(abs, x0.tolist()), default=0.0) >= LARGEST_ATOL:
        return LARGEST_ATOL
    return float(default_atols(system, x0[None, :], span, p[None, :], options)[0])


def default_atols(
    system: System, states: Array, span: tuple[float, float], values: Array, options: Options
) -> Array:
    """The same for each of many starts (k, n) with rows of parameters (k, P): shape (k,)."""
    found = np.full(len(states), LARGEST_ATOL)
    rows = np.flatnonzero(small(states, options.rtol)).tolist()
    if not rows:
        return found
    share, length = SHARE * max(options.rtol, FINEST), abs(span[1] - span[0])
    fields = _functions if system.field is not None else _kernels
    for q, row in zip(rows, fields(system, states[rows], span, values[rows], options), strict=True):
        scale = max(map(abs, states[q].tolist()), default=0.0)
        for f in row:
            largest = max((abs(v) for v in f.tolist() if math.isfinite(v)), default=0.0)
            scale = max(scale, largest * length)
            if share * scale >= LARGEST_ATOL:
                break
        else:
            found[q] = LARGEST_ATOL if scale == 0.0 else 10.0 ** math.floor(math.log10(share * scale))
    return found


def _functions(
    system: System, states: Array, span: tuple[float, float], values: Array, options: Options
) -> Iterator[Iterator[Array]]:
    """For each start the field on the sides that it is on, by plain functions, where the run begins."""

    def sides(x0: Array, p: Array) -> Iterator[Array]:
        assert system.field is not None
        record = system.parameters.record(p)
        try:
            h = np.array([float(surface.h(span[0], x0.copy(), record)) for surface in system.surfaces])
            found = [np.asarray(system.field(span[0], x0.copy(), record, signs)) for signs in _sides(h)]
        except (Exception, SystemExit):  # noqa: BLE001  # what a function of the user's raises, the run says
            return
        yield from (f.astype(float) for f in found if f.dtype.kind in "fiu")

    return (sides(x0, p) for x0, p in zip(states, values, strict=True))


def _kernels(
    system: System, states: Array, span: tuple[float, float], values: Array, options: Options
) -> Iterator[Iterator[Array]]:
    """For each start the compiled field along the span."""
    run = ready(system, values[0], states[0], span, options)
    machine, step = run.machine, (span[1] - span[0]) / PARTS
    times = [*(span[0] + k * step for k in range(PARTS)), span[1]]
    # Arrays of these calls alone, so that their addresses are looked up once.
    x, f, h, mode, signs = np.empty(machine.n), np.empty(machine.n), *np.ones((3, machine.m))
    here = {"t": 0.0, "x": x, "p": machine.p, "m": mode, "ctx": machine.context}
    functions = machine.compiled.functions
    guarding = machine.compiled.arguments("guards", {"out": h, **here})[1:]
    moving = machine.compiled.arguments("rhs", {"out": f, "s": signs, **here | {"m": signs}})[1:]

    def sides() -> Iterator[Array]:
        for t in times:
            if machine.pieces is not None:
                machine.pieces.at(t, machine.side)
            functions["guards"](t, *guarding)
            for side in _sides(h):
                signs[:] = side
                functions["rhs"](t, *moving)
                yield f

    try:
        for q, p in enumerate(values):
            x[:] = states[q]
            if q > 0 and not np.array_equal(p, values[q - 1]):
                machine.again(p)
            yield sides()
    finally:
        put_back(run)


def _sides(h: Array) -> list[Array]:
    """Signs at a point: those of h, and on surfaces both."""
    if 0.0 not in h.tolist():
        return [np.sign(h)]
    return [np.where(h == 0, side, np.sign(h)) for side in (1.0, -1.0)]


def of_little_scale(solution: Solution) -> str:
    """A sentence where a component stayed so near to 0 that atol decided its accuracy; else ""."""
    atol = solution.options.tolerances(solution.system)
    largest = np.maximum(np.abs(solution.problem.x0), np.abs(solution.x_end))
    if np.all(largest >= LITTLE * atol):
        return ""
    largest = np.maximum(largest, np.max(np.abs(solution.y), axis=1, initial=0.0))
    floor = ROUNDINGS * float(np.max(largest, initial=0.0))
    little = (largest > floor) & (largest < LITTLE * atol)
    return _sentence(solution.system.states, largest, atol, little)


def of_little_ends(
    states: tuple[str, ...], x0: Array, x: Array, atol: Array
) -> Iterator[tuple[int, str]]:
    """The same for the rows of an ensemble that begin and end (k, n) near to 0 in every component."""
    bounds = LITTLE * atol
    # Hardly a row is small in every component: one component tells most of them.
    if not np.any(np.abs(x[:, 0]) < bounds[0]):
        return
    largest = np.maximum(np.abs(x0), np.abs(x))
    rows = np.all(largest < bounds, axis=1) & np.any(largest > 0, axis=1)
    for q in np.flatnonzero(rows).tolist():
        yield q, _sentence(states, largest[q], atol, largest[q] > 0).lstrip()


def _sentence(states: tuple[str, ...], largest: Array, atol: Array, little: Any) -> str:
    if not np.any(little):
        return ""
    which = ", ".join(
        f"{name} (at most {m:.2g}, atol {a:.2g})"
        for name, m, a, is_little in zip(states, largest, atol, little, strict=True)
        if is_little
    )
    return (
        f" Near to 0 throughout: {which}. There atol decides the accuracy, not rtol: give a smaller atol, or "
        "scale the states."
    )
