"""Bifurcation diagram by running the event map: where a parameter leads after a transient, chaos included."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from filippov import System, UsageError
from filippov.analysis.maps.find_section import find_section
from filippov.analysis.maps.map_rows import MapRows
from filippov.analysis.maps.returns import Returns, coordinate_of, returns
from filippov.analysis.maps.section import Section
from filippov.analysis.maps.stroboscope import Stroboscope, clock_times
from filippov.analysis.steady.forcing import is_forced
from filippov.base.arrays import Array
from filippov.base.given import Amount, Count, Natural, Positive, as_float, shown
from filippov.base.keywords import keywords
from filippov.base.names import unknown
from filippov.base.shown import Told
from filippov.plot.style import axis_label, coordinate_labels
from filippov.solving.uncut import solve

REST = 1e-8
# What a coordinate may be wrong by, in units of rtol of its size.
NOISE = 10.0
# What an orbit of period p does after fewer iterates falls by no more than to this part over those kept.
LASTS = 0.9
# It is more than so many times what counts as none.
CLEAR = 4.0


@dataclass(frozen=True)
class BruteForce(Told):
    """Iterates of the map after a transient.

    parameter, values   what is varied, (k,)
    d        iterates kept, (k, keep); NaN after a solution that does not return; where a solution without a
             parametrisation comes to rest, the coordinate at which it does
    period   least p with d[i + p] = d[i] to 1e-6 of the range of d or 10 rtol of its size along
             the solution, 0 where there is none up to half of keep, or where a shorter one still settles:
             a longer transient tells it
    complete False where it was interrupted
    notes    for each value, of a solution without a parametrisation, why it did not return so often; "" where
             it did
    section    where the iterates are read; parameters: the values of all others
    labels     of the axes, "parameter" and "d"
    """

    parameter: str
    values: Array
    d: Array
    period: npt.NDArray[np.int64]
    complete: bool = True
    notes: tuple[str, ...] = ()
    section: Section | Stroboscope | None = None
    parameters: Mapping[str, float] = field(default_factory=dict)
    labels: Mapping[str, str] = field(default_factory=dict)

    def __str__(self) -> str:
        lines = []
        for period, count in zip(*np.unique(self.period, return_counts=True), strict=True):
            what = f"period {period}" if period else "no period found"
            lines.append(f"{count} of {self.period.size} values: {what}")
        told = [(v, note) for v, note in zip(self.values, self.notes, strict=False) if note][:5]
        return "\n".join([*lines, *(f"{self.parameter} = {value:.6g}: {note}" for value, note in told)])


@keywords()
def brute_force(
    system: System,
    section: Section | Stroboscope | None,
    parameter: str,
    values: Sequence[float],
    start: Any,
    *,
    transient: Natural = 200,
    keep: Amount = 64,
    parameters: Mapping[str, float] | None = None,
    follow: bool = False,
    rtol: Positive = 1e-8,
    threads: Count | None = None,
    max_events: Count = 1_000_000,
    progress: Callable[[int, int], None] | None = None,
) -> BruteForce:
    """Iterate the event map from `start` for every value of a parameter, all values side by side.

    section          where the map is taken; without a parametrisation (or a `Stroboscope`) one solution is
                     followed from event to event at each value; None: found
                     (`filippov.analysis.maps.find_section`)
    start            the first coordinate; without a parametrisation the initial state, in order or by name
    transient, keep  iterates that are dropped, and those that are kept
    follow           start each value at the last iterate of the one before it: branches are followed, one
                     value after the other
    rtol             of a return; threads: of all values side by side
    max_events       of all kinds in one solution, without a parametrisation

    An excursion below 1e-8 of the start is taken for rest. Ctrl-C returns what there is. Raises UsageError.
    """
    if parameter not in system.parameters:
        raise UsageError(unknown("parameter", parameter, system.parameters))
    if transient < 0 or keep < 1:
        raise UsageError(f"transient {transient}, keep {keep}: expected at least 0 and 1.")
    if not isinstance(section, Section) or section.parametrisation is None:
        chosen = section or first_section(system, start, parameter, values, parameters)
        return _along_solutions(
            system, chosen, parameter, np.asarray(values, dtype=float), start, transient, keep,
            dict(parameters or {}), follow, {"rtol": rtol, "max_events": max_events}, progress,
        )  # fmt: skip
    if as_float(start) is None:
        raise UsageError(
            f"start is {shown(start)}, expected the coordinate {section.coordinate} of the first return, as "
            "the section has a parametrisation. A solution from a state is followed on a section without "
            "one: replace(section, parametrisation=None), or None to find one."
        )
    event_maps = MapRows(system, section, rtol=rtol, threads=threads)
    grid = np.asarray(values, dtype=float)
    rows = event_maps.rows({parameter: grid}, parameters)
    event_maps.suited(rows, float(start), 1.0)
    d = np.full((grid.size, keep), np.nan)
    parts = [slice(k, k + 1) for k in range(grid.size)] if follow else [slice(0, grid.size)]
    here = np.full(grid.size, float(start))
    total, done, complete = (transient + keep) * len(parts), 0, True
    try:
        for number, part in enumerate(parts):
            if follow and number and np.isfinite(here[number - 1]):
                here[number] = here[number - 1]
            for k in range(transient + keep):
                here[part] = event_maps(rows[part], here[part][:, None])[:, 0]
                # Below the accuracy of a return there is nothing left to follow.
                here[part] = np.where(np.abs(here[part]) < REST * abs(start), 0.0, here[part])
                if k >= transient:
                    d[part, k - transient] = here[part]
                done += 1
                if progress is not None:
                    progress(done, total)
    except KeyboardInterrupt:
        complete = False
    periods = _periods(d, np.array([max(abs(float(start)), _largest(row)) for row in d]), rtol)
    return _result(system, section, parameter, grid, d, periods, complete, (), parameters)


def _result(
    system: System, section: Section | Stroboscope, parameter: str, grid: Array, d: Array,
    periods: npt.NDArray[np.int64], complete: bool, notes: tuple[str, ...],
    parameters: Mapping[str, float] | None,
) -> BruteForce:  # fmt: skip
    others = system.parameters.others(parameters, (parameter,))
    labels = {"parameter": axis_label(system, parameter), "d": coordinate_labels(system, section)["d"]}
    return BruteForce(parameter, grid, d, periods, complete, notes, section, others, labels)


def first_section(
    system: System, x0: Any, parameter: str, values: Sequence[float], parameters: Mapping[str, float] | None,
    coordinate: Any = None,
) -> Section | Stroboscope:  # fmt: skip
    """The section found at the first of a parameter's values (both ends, the middle) where one is.

    Raises UsageError where nothing recurs at any of them.
    """
    ordered = sorted(float(v) for v in values)
    for number, value in enumerate((ordered[0], ordered[-1], ordered[len(ordered) // 2])):
        try:
            here = {**(parameters or {}), parameter: value}
            return find_section(system, x0, parameters=here, coordinate=coordinate)
        except UsageError as error:
            if number == 2:
                raise UsageError(f"{parameter} = {value:g}: {error}") from None
    raise AssertionError


def _along_solutions(
    system: System, section: Section | Stroboscope, parameter: str, grid: Array, x0: Any, transient: int,
    keep: int, parameters: dict[str, float], follow: bool, options: dict[str, Any],
    progress: Callable[[int, int], None] | None,
) -> BruteForce:  # fmt: skip
    """The iterates of one solution, followed from event to event, at each value."""
    if follow:
        _same_phase(system, section, [{**parameters, parameter: value} for value in grid.tolist()])
    d, notes, state = np.full((grid.size, keep), np.nan), [""] * grid.size, x0
    reach = np.zeros(grid.size)
    complete = True
    try:
        for k, value in enumerate(grid.tolist()):
            here = {**parameters, parameter: value}
            found = returns(system, section, state, transient + keep, parameters=here, **options)
            got = found.d[transient:]
            d[k, : len(got)] = got
            if found.rests:
                d[k, len(got) :] = coordinate_of(section, system).read(found.x_end[None])[0]
            notes[k] = found.message
            reach[k] = _reach(system, section, found, here, options["rtol"])
            if follow and (len(got) or found.rests):
                state = found.x[-1] if len(got) else found.x_end
            if progress is not None:
                progress(k + 1, grid.size)
    except KeyboardInterrupt:
        complete = False
    periods = _periods(d, reach, options["rtol"])
    return _result(system, section, parameter, grid, d, periods, complete, tuple(notes), parameters)


def _same_phase(
    system: System, section: Section | Stroboscope, parameters: Sequence[Mapping[str, float]]
) -> None:
    """Refuse to begin at t = 0 where another ended, unless the forcing stands there as it does at t = 0."""
    fits = not is_forced(system) or (isinstance(section, Stroboscope) and not section.clock)
    fits = fits and (not system.clocked or not isinstance(section, Stroboscope))
    if isinstance(section, Stroboscope) and section.clock:
        times = [clock_times(system, section.clock, system.parameters.resolve(p)) for p in parameters]
        fits = all(abs(start / period - round(start / period)) <= 1e-9 for start, period in times)
    if not fits:
        raise UsageError(
            "follow=True starts a value at t = 0 from where the one before it ended, which needs a forcing "
            "that stands there as at t = 0: a Stroboscope, after a clock that ticks at t = k T where there "
            "are clocks. Leave follow out, or take another section."
        )


def _largest(d: Array) -> float:
    return float(np.max(np.abs(d[np.isfinite(d)]), initial=0.0))


def _reach(
    system: System, section: Section | Stroboscope, found: Returns, parameters: Mapping[str, float],
    rtol: float,
) -> float:  # fmt: skip
    """The largest coordinate along one return from the last event: it may be small at the events alone."""
    reach = _largest(found.d)
    if len(found.t) < 2:
        return reach
    try:
        run = solve(
            system, found.x[-1], (found.t[-1], 2 * found.t[-1] - found.t[-2]), parameters=parameters,
            rtol=rtol, zeno="continue", dense_output=False,
        )  # fmt: skip
    except UsageError:  # an input that is known no further
        return reach
    return max(reach, _largest(coordinate_of(section, system).read(run.y.T)))


def _periods(d: Array, reach: Array, rtol: float) -> npt.NDArray[np.int64]:
    """reach: the largest coordinate of the solution of each row, whose errors are of rtol of it."""
    known = d[np.isfinite(d)]
    size = float(np.max(known)) - float(np.min(known)) if known.size else 0.0
    # On the scale of the diagram, but a row that escapes has no part in the scale of the others. A coordinate
    # that is the same at every event, as where a slide ends, differs by what the runs leave.
    limits = np.maximum(1e-6 * np.minimum(size, reach), NOISE * rtol * reach)
    out = np.zeros(len(d), dtype=np.int64)
    for i, (row, same) in enumerate(zip(d, limits, strict=True)):
        for p in range(1, row.size // 2 + 1):
            if np.all(np.abs(row[p:] - row[:-p]) <= same):
                out[i] = p if all(_lasts(row, p, q, same) for q in range(1, p)) else 0
                break
    return out


def _lasts(row: Array, p: int, q: int, same: float) -> bool:
    """Whether what changes after q iterates does so at the end as at the start, as it does with the period p.

    What decays by a multiplier near -1, or near another root of 1, repeats to the limit before it is gone;
    so do errors of the size of the limit.
    """
    change = np.abs(row[q:] - row[:-q])
    return bool(np.max(change[-p:]) >= max(LASTS * np.max(change[:p]), CLEAR * same))
