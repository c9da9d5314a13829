"""The runs behind a comparison: the exact solution, and those of an approximation at one width."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from filippov import ModelError, Solution, Status, System, UsageError
from filippov.analysis.comparisons.approximation import Approximation
from filippov.analysis.comparisons.solution_ending import Ending, ending
from filippov.analysis.comparisons.solution_events import EventReader, Read
from filippov.analysis.comparisons.solution_faults import Seen
from filippov.analysis.comparisons.solution_gaps import largest_gap
from filippov.base.arrays import Array
from filippov.solving.state.options import check_state
from filippov.solving.uncut import solve
from filippov.sweep.measure import Function, read_measures

GRID, TAIL, TIGHT = 2001, 0.25, 3e-14
# An explicit method takes about rate * span / 6 steps for stability: beyond so many the implicit one is taken
STIFF_STEPS = 2000.0
# Steps of time below the span by so many decades take longer than they tell.
MOST_DECADES = 6
# Of the accuracy: the error that a width is guessed for, and the one above which it is wide enough.
AIM, ENOUGH = 0.9, 0.75
EXPLICIT, IMPLICIT = "DOP853", "Radau"
ERRORS = ("error_state", "error_final", "error_times", "drift")
READ_KINDS = {None: None, "crossing": "crossing", "sliding entry": "entry", "sliding exit": "exit"}
TOO_MANY = {Status.MAX_STEPS: "steps", Status.MAX_EVENTS: "events"}


LISTS = ("stays", "event_times")  # of a row, not of a table
OWN = (
    "model", "width", "method", *ERRORS, "stick", "entries", "ending", "amplitude", "period", "field_calls",
    "jacobians", "factorisations", "calls_ratio", "seconds", "note", *LISTS,
)  # fmt: skip


def blank_row(name: str, width: float | None) -> dict[str, Any]:
    """A row without values."""
    return dict.fromkeys(OWN) | {"model": name, "width": width, "note": ""}


class ExactSolution:
    """The exact solution at two tolerances, and what every approximation is measured with."""

    def __init__(
        self, system: System, x0: Any, t_span: Any, parameters: Mapping[str, float] | None, measures: Any,
        rtol: float, atol: float, max_steps: int, max_events: int, repeats: int,
    ) -> None:  # fmt: skip
        self.system, self.x0, self.t_span = system, check_state(x0, system), t_span
        self.given = dict(parameters or {})
        self.p = system.parameters.resolve(parameters)
        self.options: dict[str, Any] = {
            "rtol": rtol, "atol": atol, "max_steps": max_steps, "max_events": max_events
        }  # fmt: skip
        self.repeats = repeats
        self.measures = read_measures(measures, system) if measures else ()
        tight = {"rtol": max(TIGHT, 1e-2 * rtol), "atol": 1e-2 * atol}
        self.coarse = self._solved({})
        self.fine = self._solved(tight)
        self.span = abs(self.fine.t_end - self.fine.problem.t_span[0])
        self.times = np.linspace(self.fine.problem.t_span[0], self.fine.t_end, GRID)
        assert self.fine.sol is not None
        self.extent = _extent(self.fine.sol(self.times))
        self.reader = EventReader(system, self.p)
        self.reads = self.reader.exact(self.fine)
        self.ending = ending(self.fine, system.dimension, self.extent)
        self.row = self._row()
        # The measures of an approximation that has none.
        self.blank = dict.fromkeys(name for name in self.row if name not in OWN)
        self.seen = Seen(self.row, self.ending, self.reads, self.fine.t_end)

    def _solved(self, tolerances: Mapping[str, float]) -> Solution:
        options = {**self.options, **tolerances}
        solution: Solution = solve(
            self.system, self.x0, self.t_span, parameters=self.given, zeno="continue", **options
        )
        if solution.status is not Status.SUCCESS:
            raise UsageError(
                f"the exact solution ends at t = {solution.t_end:.6g}, so nothing can be compared with it: "
                f"{solution.message} Compare over a shorter span, or from another state."
            )
        return solution

    def _row(self) -> dict[str, Any]:
        row = self.measured(self.coarse, self.reads_of(self.coarse), self.ending_of(self.coarse))
        given = {"parameters": self.given, "zeno": "continue", **self.options}
        seconds = self.clock(self.system, self.x0, given)
        return blank_row("exact", None) | row | {
            "method": EXPLICIT, "drift": max(read.drift for read in self.reads) if self.reads else None,
            "calls_ratio": 1.0, "seconds": seconds, "note": "errors: difference between two tolerances",
        }  # fmt: skip

    def reads_of(self, solution: Solution) -> tuple[Read, ...]:
        """What is read of an exact solution."""
        return self.reader.exact(solution)

    def ending_of(self, solution: Solution) -> Ending:
        """How a solution ends, by the state whose cycle the exact one has."""
        return ending(solution, self.system.dimension, self.extent, self.ending.follows)

    def measured(self, solution: Solution, reads: Sequence[Read], last: Ending) -> dict[str, Any]:
        """What a solution gives, compared with the exact one; last: how it ends."""
        n = self.system.dimension
        gap = largest_gap(self.fine, solution, self.times, self.extent)
        end = np.abs(solution.x_end[:n] - self.fine.x_end) / self.extent
        own, exact = (
            sorted(event for read in each for event in read.events(self.span)) for each in (reads, self.reads)
        )
        late = [] if gap.times is None else [gap.times]
        same = bool(self.reads or late) and [event[1:] for event in own] == [event[1:] for event in exact]
        late += [abs(a[0] - b[0]) for a, b in zip(own, exact, strict=True)] if same else []
        found = {
            "note": gap.note, "error_state": gap.states, "error_final": float(np.max(end)),
            "error_times": (max(late, default=0.0) if same else None),
            "drift": max((read.drift for read in reads if read.stays), default=None),
            "stick": sum(read.time for read in reads),
            "entries": [sum(not stay.from_start for stay in read.stays) for read in reads],
            "stays": {read.surface: [(stay.t0, stay.t1) for stay in read.stays] for read in reads},
            "event_times": own, "ending": last.kind, "amplitude": last.amplitude, "period": last.period,
            "field_calls": solution.nfev, "jacobians": solution.njev, "factorisations": solution.nlu,
        }  # fmt: skip
        return found | self._own_measures(solution, reads)

    def _own_measures(self, solution: Solution, reads: Sequence[Read]) -> dict[str, Any]:
        """The measures asked for; None where an approximation does not have what they name.

        The events of an approximation are those read of it, like its stays in stick.
        """
        found: dict[str, Any] = {}
        for measure in self.measures:
            if isinstance(measure, Function):
                found |= {name: float(value) for name, value in measure.call(solution).items()}
                continue
            own = None if solution.system is self.system else _of_reads(measure, reads, self.span)
            try:
                values: list[Any] = list(measure.of_solution(solution, TAIL)) if own is None else [own]
            except (ModelError, UsageError):
                if solution.system is self.system:
                    raise
                values = [None]
            found |= dict(zip(measure.columns(self.system), values, strict=True))
        return {name: value if value is None or np.isfinite(value) else None for name, value in found.items()}

    def clock(self, system: System, x0: Any, options: Mapping[str, Any]) -> float:
        """Median seconds of one run, compiled before."""
        spent = []
        for _ in range(self.repeats):
            begun = time.perf_counter()
            solve(system, x0, self.t_span, **options)
            spent.append(time.perf_counter() - begun)
        return statistics.median(spent)


def _of_reads(measure: Any, reads: Sequence[Read], span: float) -> float | None:
    """events(surface), events(surface, kind) and sliding(surface) of what was read; None for others."""
    surface, kind = (*measure.arguments, None, None)[:2]
    read = next((read for read in reads if read.surface == surface), None)
    if read is None or measure.name not in ("events", "sliding") or kind not in READ_KINDS:
        return None
    if measure.name == "sliding":
        return read.time
    return float(sum(READ_KINDS[kind] in (None, event[2]) for event in read.events(span)))


def _extent(x: Array) -> Array:
    """How far each state moves; of one that does not, but for rounding, its size, or 1 where it is 0."""
    moved, size = np.ptp(x, axis=1), np.max(np.abs(x), axis=1)
    return np.where(moved > TIGHT * size, moved, np.where(size > 0, size, 1.0))


class ModelSolutions:
    """An approximation over the same solution, at any width."""

    def __init__(
        self, exact: ExactSolution, model: Approximation, narrowest: float, theta: float | None = None
    ) -> None:
        self.exact, self.model, self.theta = exact, model, theta
        self.method = model.method or self._method(narrowest)
        self.solutions: dict[float, Solution] = {}
        self.seen: dict[float, Seen] = {}

    def _method(self, narrowest: float) -> str:
        """The explicit method where it is not held up by stability at the narrowest width, else Radau."""
        if not self.model.stiff:
            return EXPLICIT
        exact = self.exact
        steepest = max(exact.reader.jump(exact.fine, name) for name in exact.reader.readers)
        return IMPLICIT if steepest / narrowest * exact.span / 6.0 > STIFF_STEPS else EXPLICIT

    def solve(self, width: float) -> tuple[Solution, System, Array, dict[str, Any]]:
        """The solution, what was solved, from where and with which options.

        Where the method does not reach the end, the other one is tried.
        """
        exact, model = self.exact, self.model
        built = model.build(width)
        system, own = built if isinstance(built, tuple) else (built, {})
        if not isinstance(system, System):
            raise UsageError(f"{model.name}: build returned {type(system).__name__}, expected a System.")
        n = exact.system.dimension
        if system.states[:n] != exact.system.states:
            raise UsageError(
                f"{model.name}: the states are {' '.join(system.states)}, expected those of the exact system "
                f"first: {' '.join(exact.system.states)}."
            )
        start = np.zeros(system.dimension)
        start[:n] = exact.x0
        extra = list(model.start)[: system.dimension - n]
        start[n : n + len(extra)] = extra
        shared = {name: v for name, v in exact.given.items() if name in system.parameters}
        options: dict[str, Any] = {
            "parameters": {**shared, **own}, "method": self.method, "zeno": "continue", **exact.options
        }  # fmt: skip
        if model.timed:
            options = {k: v for k, v in options.items() if k not in ("rtol", "atol", "zeno")} | {"dt": width}
            options |= {} if self.theta is None else {"theta": self.theta}
        solution = solve(system, start, exact.t_span, **options)
        if solution.status in (Status.SUCCESS, Status.MAX_EVENTS) or model.timed:
            return solution, system, start, options
        instead = options | {"method": EXPLICIT if self.method == IMPLICIT else IMPLICIT}
        other = solve(system, start, exact.t_span, **instead)
        if other.status is not Status.SUCCESS:
            return solution, system, start, options
        return other, system, start, instead

    def row(self, width: float) -> dict[str, Any]:
        """Everything that is compared; a note, and no errors, where the run did not reach the end."""
        exact = self.exact
        solution, system, start, options = self.solve(width)
        blank = blank_row(self.model.name, width) | {"method": options["method"]}
        if solution.status is not Status.SUCCESS:
            what = TOO_MANY.get(solution.status)
            why = f"more than the {what} allowed" if what else f"ended with {solution.status.value}"
            return blank | {
                "field_calls": solution.nfev, "calls_ratio": solution.nfev / max(exact.coarse.nfev, 1),
                **exact.blank, "note": f"not computed: {why} at t = {solution.t_end:.4g}",
            }  # fmt: skip
        self.solutions[width] = solution
        found, last = exact.reader.model(solution, self.model, width), exact.ending_of(solution)
        reads = tuple(own.begun_as(theirs) for own, theirs in zip(found, exact.reads, strict=True))
        row = exact.measured(solution, reads if self.model.sticks else (), last)
        if not self.model.sticks:
            row |= dict.fromkeys(("error_times", "drift", "stick", *LISTS)) | {"entries": [None] * len(reads)}
        row["calls_ratio"] = solution.nfev / max(exact.coarse.nfev, 1)
        row["seconds"] = exact.clock(system, start, options)
        self.seen[width] = Seen(blank | row, last, reads, solution.t_end)
        return blank | row


def chosen_widths(
    exact: ExactSolution, given: Sequence[float] | None, decades: Sequence[int], timed: bool = False
) -> list[float]:
    """The widths from the widest on; by default decades of the largest |h| of the solution, or of its span.

    Raises UsageError.
    """
    if given is None and timed:
        return [exact.span * 10.0**-k for k in decades if k < MOST_DECADES]
    if given is None:
        magnitudes = [exact.reader.magnitude(exact.fine, name) for name in exact.reader.readers]
        scale = 10.0 ** round(np.log10(min((q for q in magnitudes if q > 0), default=1.0)))
        return [scale * 10.0**-k for k in decades]
    widths = sorted({float(width) for width in given}, reverse=True)
    if not widths or not all(0 < width < np.inf for width in widths):
        raise UsageError(f"widths are {list(given)!r}, expected one number or more, all > 0.")
    return widths


def needed_width(
    rows: Sequence[Mapping[str, Any]], quantity: str, accuracy: float,
    compute: Callable[[float], Mapping[str, Any]], tries: int = 8,
) -> tuple[float | None, Mapping[str, Any] | None]:  # fmt: skip
    """The widest width found whose error is within the accuracy, and its row: solved for, then run.

    The error is taken for a power of the width between the two computed widths around the accuracy, or beyond
    the last two; each guess is a run, until one is within the accuracy and above three quarters of it. Where
    all computed widths are, it is the widest of these.
    """
    known = {row["width"]: row for row in rows if row.get(quantity) is not None}
    for _ in range(tries):
        good = [w for w, row in known.items() if row[quantity] <= accuracy]
        bad = [w for w, row in known.items() if row[quantity] > accuracy]
        best = max(good, default=None)
        if best is not None and (known[best][quantity] >= ENOUGH * accuracy or best == max(known)):
            return best, known[best]
        above = min((w for w in bad if best is None or w > best), default=None)
        if above is None:
            return best, known[best] if best is not None else None
        low = best if best is not None else None
        if low is None:
            ends = sorted(known)[:2]
            if len(ends) < 2:
                break
            slope = np.log(known[ends[1]][quantity] / known[ends[0]][quantity]) / np.log(ends[1] / ends[0])
            if not slope > 0.1:
                break
            guess = above * (AIM * accuracy / known[above][quantity]) ** (1.0 / slope)
        elif known[low][quantity] > 0:
            slope = np.log(known[above][quantity] / known[low][quantity]) / np.log(above / low)
            guess = low * (AIM * accuracy / known[low][quantity]) ** (1.0 / slope)
        else:
            guess = np.sqrt(low * above)
        if not 0 < guess < np.inf or guess in known:
            break
        row = compute(float(guess))
        if row.get(quantity) is None:
            break
        known[float(guess)] = row
    good = [w for w, row in known.items() if row[quantity] <= accuracy]
    best = max(good, default=None)
    return best, None if best is None else known[best]
