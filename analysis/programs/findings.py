"""What is wrong with the run of a program, measured against the solution of the inclusion."""

from __future__ import annotations

import itertools
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy

from filippov import EventKind, Solution
from filippov import t as time
from filippov.analysis.programs.agreement import Numbers
from filippov.analysis.programs.naive_run import NaiveRun
from filippov.analysis.programs.notes import Site
from filippov.analysis.programs.translation import Translation
from filippov.base.arrays import Array
from filippov.model.extract import NONSMOOTH

# Changes of sign of h between steps, while the solution slides, from which a run chatters.
CHATTER = 3
# Of a run that does not end: its last calls, and from which share on they are said to change sides.
LAST, OFTEN = 1000, 0.02
# A curve is wrong where it is off by more than this many of its own tolerances.
WRONG = 10.0
# What is divided by is close to its zero below this part of its largest value.
CLOSE = 1e-6


@dataclass(frozen=True)
class Finding:
    """One thing that is wrong, or that the source does differently from what it says.

    kind      "chattering", "hang", "missed", "wrong curve", "exception", "false rest", "sign at 0",
              "equality", "dead band", "memory", "clock", "writes into y", "singular", "remark",
              "not translated", "differs"
    sentence  in words; surface: the surface, "" for none; t: when, None for always; lines: of the source
    """

    kind: str
    sentence: str
    surface: str = ""
    t: float | None = None
    lines: tuple[int, ...] = ()


@dataclass(frozen=True)
class Switch:
    """A surface of the System and the places in the source that made it.

    kind    "jump", "kink", "time" (nothing but time decides) or "memory" (what is remembered changes)
    slides  whether the solution stays on it for a while
    """

    surface: str
    kind: str
    sites: tuple[Site, ...]
    slides: bool = False

    @property
    def lines(self) -> tuple[int, ...]:
        """The lines of the source, in order."""
        return tuple(sorted({site.line for site in self.sites}))

    @property
    def where(self) -> str:
        """The lines in words."""
        found = {site.line: site.text for site in self.sites}
        return ", ".join(f"line {line} `{found[line]}`" for line in self.lines) or "a square root or power"


def switches(
    translation: Translation, solution: Solution | None, corners: Collection[int] = ()
) -> tuple[Switch, ...]:
    """The surfaces of the System with their places in the source; corners: where the field is continuous."""
    system = translation.system
    form = system.symbolic
    assert form is not None
    clocks = {c.symbol for c in translation.clocks}
    remembered = {form.x[-k - 1] for k in range(translation.remembered)}
    held = set() if solution is None else {
        i for segment in solution.segments if segment.t1 > segment.t0
        for i, m in enumerate(segment.mode) if m == 0
    }  # fmt: skip
    out = []
    for i, (surface, h) in enumerate(zip(system.surfaces, form.plain_h(), strict=True)):
        sites = tuple(
            s for s in translation.sites if s.h is not None and s.kind != "equality" and _same(s.h, h)
        )
        moving = h.free_symbols & (set(form.x) - clocks - remembered)
        kind = "kink" if surface.kind == "kink" or i in corners else "jump" if moving else "time"
        kind = "memory" if surface.reset is not None else kind
        out.append(Switch(surface.name, kind, sites, i in held))
    return tuple(out)


def _same(site: Any, h: Any) -> bool:
    """Whether h is a factor of the argument, or what it is on one side of others, found at random places."""
    rng = np.random.default_rng(1)
    symbols = sorted(site.free_symbols | h.free_symbols, key=str)
    places = [
        {q: sympy.Float(v) for q, v in zip(symbols, rng.normal(size=len(symbols)) + 0.1, strict=True)}
        for _ in range(16)
    ]
    if site.has(*NONSMOOTH):
        equal = 0
        for values in places:
            a, b = (e.xreplace(values) for e in (site, h))
            equal += bool(
                a.is_number
                and b.is_number
                and a.is_real
                and abs(abs(float(a)) - abs(float(b))) < 1e-12 * abs(float(b))
            )
        return equal >= 2
    for factor in sympy.Mul.make_args(sympy.factor_terms(site)):
        ratios = []
        for values in places[:3]:
            a, b = (e.xreplace(values) for e in (factor, h))
            if not (a.is_number and b.is_number) or not a.is_real or not b.is_real or float(b) == 0:
                break
            ratios.append(float(a) / float(b))
        if len(ratios) == 3 and ratios[0] != 0 and max(ratios) - min(ratios) < 1e-9 * abs(ratios[0]):
            return True
    return False


def in_run(
    run: NaiveRun, solution: Solution, translation: Translation, found: tuple[Switch, ...]
) -> list[Finding]:
    """What scipy's run does wrong, each with surface, time and line."""
    numbers = Numbers(translation.system)
    x = np.array([translation.extended(float(t), y) for t, y in zip(run.calls, run.asked.T, strict=True)]).T
    x = np.vstack([x, np.zeros((translation.remembered, len(run.calls)))])
    out = [*_chattering(run, solution, numbers, x, found), *_missed(run, solution, found)]
    if run.ended and not any(finding.kind == "hang" for finding in out):
        out.append(early(run, _at_end(run, numbers, x, found)))
    out += _wrong(run, solution)
    return out


def _stays(solution: Solution, i: int) -> Iterator[tuple[float, float]]:
    """Intervals in which the solution stays on the i-th surface, those that follow each other as one."""
    begin = end = None
    for segment in solution.segments:
        if segment.mode[i] == 0:
            begin, end = (segment.t0 if begin is None else begin), segment.t1
        elif begin is not None and end is not None:
            yield begin, end
            begin = end = None
    if begin is not None and end is not None:
        yield begin, end


def _chattering(
    run: NaiveRun, solution: Solution, numbers: Numbers, x: Array, found: tuple[Switch, ...]
) -> Iterator[Finding]:
    for i, switch in enumerate(found):
        if not switch.slides or switch.kind == "kink":
            continue
        total, calls, first, last, least = 0, 0, None, 0.0, np.inf
        h = numbers.h_along(run.calls, x, i)
        for begin, end in _stays(solution, i):
            asked = np.flatnonzero((run.calls >= begin) & (run.calls <= end))
            # A run that rests at h = 0 is on neither side.
            sides = np.sign(h[asked])
            sides = sides[sides != 0]
            turns = int(np.count_nonzero(sides[1:] * sides[:-1] < 0))
            if turns < CHATTER:
                continue
            steps = np.diff(run.t[(run.t >= begin) & (run.t <= end)])
            first, last = (float(begin) if first is None else first), float(run.calls[asked[-1]])
            total, calls, least = (
                total + turns,
                calls + len(asked),
                min(least, float(np.min(steps, initial=least))),
            )
        if first is None:
            continue
        stopped = run.ended == "budget"
        tail = (
            f" and has come no further than t = {run.t[-1]:.6g} when its budget of {run.nfev} calls is used "
            "up"
            if stopped
            else ""
        )
        yield Finding(
            "hang" if stopped else "chattering",
            f"from t = {first:.6g} the solution stays on {switch.surface} = 0 ({switch.where}); scipy's "
            f"{run.method} calls f on both "
            f"sides in turn, {total} changes of sign in {calls} calls until t = {last:.6g} (the shortest "
            f"step {least:.2g}){tail}",
            switch.surface, first, switch.lines,
        )  # fmt: skip


def _at_end(
    run: NaiveRun, numbers: Numbers, x: Array, found: tuple[Switch, ...]
) -> tuple[Switch, int] | None:
    """The surface that the last calls of a run change sides of most, and how often; None if none is."""
    turned = []
    for i in (i for i, switch in enumerate(found) if switch.kind != "kink"):
        sides = np.sign(numbers.h_along(run.calls[-LAST:], x[:, -LAST:], i))
        sides = sides[sides != 0]
        turned.append((int(np.count_nonzero(sides[1:] * sides[:-1] < 0)), i))
    most, i = max(turned, default=(0, -1))
    return (found[i], most) if most > OFTEN * min(LAST, run.nfev) else None


def early(run: NaiveRun, at: tuple[Switch, int] | None = None) -> Finding:
    """A run that did not reach its end; at: a surface whose sides its last calls have changed so often."""
    t = float(run.t[-1])
    if run.ended == "budget":
        said = (
            f"scipy's {run.method} has come no further than t = {t:.6g} when its {run.nfev} calls are used up"
        )
        if at is None:
            return Finding("hang", said, t=t)
        switch, often = at
        said += (
            f": the last {min(LAST, run.nfev)} change sides of {switch.surface} = 0 ({switch.where}) {often} "
            "times"
        )
        return Finding("hang", said, switch.surface, t, switch.lines)
    return Finding("exception", f"scipy's {run.method} ends at t = {t:.6g}: {run.ended}", t=t)


def singular(run: NaiveRun, translation: Translation) -> Iterator[Finding]:
    """What f divides by, where a run that did not end comes close to its zero: v/|v| has no value there."""
    form = translation.system.symbolic
    assert form is not None
    powers = {q for e in form.field for q in e.atoms(sympy.Pow) if q.exp.is_negative}
    x = np.array([translation.extended(float(t), y) for t, y in zip(run.calls, run.asked.T, strict=True)]).T
    p = translation.system.parameters.resolve({}).tolist()
    for base in sorted({q.base for q in powers if q.base.free_symbols & set(form.x)}, key=str):
        if base.free_symbols - {time, *form.x, *form.p}:
            continue
        size = np.abs(sympy.lambdify((time, *form.x, *form.p), base, "numpy")(run.calls, *x, *p))
        if np.nanmin(size) < CLOSE * np.nanmax(size):
            yield Finding(
                "singular", f"f divides by {base}, which comes down to {np.nanmin(size):.2g}: at 0 a "
                "direction such as v/|v| jumps to all sides at once, which no sign of a surface describes. "
                "Friction in the plane is of this kind; where the slip keeps its direction, write it as "
                "the sign of one speed, as the gallery's model of friction in the plane does",
                t=float(run.calls[int(np.nanargmin(size))]),
            )  # fmt: skip


def _missed(run: NaiveRun, solution: Solution, found: tuple[Switch, ...]) -> Iterator[Finding]:
    """Crossings of the exact solution, two or more in one step between which f was not called."""
    calls = np.sort(run.calls)
    for i, switch in enumerate(found):
        if switch.kind == "kink":
            continue
        times = [
            e.t for e in solution.events if e.index == i and e.kind in {EventKind.CROSSING, EventKind.RESET}
        ]
        lost: list[tuple[float, float]] = []
        for a, b in itertools.pairwise(times):
            k = int(np.searchsorted(run.t, a, side="right"))
            one_step = 0 < k < len(run.t) and b < run.t[k]
            unseen = np.searchsorted(calls, a, side="right") == np.searchsorted(calls, b, side="left")
            if one_step and unseen:
                lost.append((a, b))
        if not lost:
            # A pulse between two surfaces: the next crossing is one of another surface.
            lost = list(_pulses(run, solution, i, calls))
        if lost:
            more = f", and {len(lost) - 1} more like it" if len(lost) > 1 else ""
            yield Finding(
                "missed", f"the solution crosses {switch.surface} = 0 ({switch.where}) at t = "
                f"{lost[0][0]:.9g} and is back at "
                f"t = {lost[0][1]:.9g}; scipy's {run.method} steps over both without a call of f "
                f"between{more}",
                switch.surface, lost[0][0], switch.lines,
            )  # fmt: skip


def _pulses(run: NaiveRun, solution: Solution, i: int, calls: Array) -> Iterator[tuple[float, float]]:
    events = [e for e in solution.events if e.kind is EventKind.CROSSING]
    for first, second in itertools.pairwise(events):
        if first.index == i and second.index != i and second.t > first.t:
            k = int(np.searchsorted(run.t, first.t, side="right"))
            unseen = np.searchsorted(calls, first.t, side="right") == np.searchsorted(
                calls, second.t, side="left"
            )
            if 0 < k < len(run.t) and second.t < run.t[k] and unseen:
                yield first.t, second.t


def difference(run: NaiveRun, solution: Solution) -> tuple[Array, Array]:
    """|y - exact| at scipy's steps as far as both go, its largest component in tolerances, and as it is."""
    assert solution.sol is not None
    inside = run.t <= solution.t_end
    exact = np.atleast_2d(solution.sol(run.t[inside]))[: len(run.y)]
    gap = np.abs(run.y[:, inside] - exact)
    scale = run.atol + run.rtol * np.max(np.abs(exact), axis=1, initial=0.0)[:, None]
    return np.max(gap / scale, axis=0), np.max(gap, axis=0)


def _wrong(run: NaiveRun, solution: Solution) -> Iterator[Finding]:
    parts, gap = difference(run, solution)
    beyond = np.flatnonzero(parts > WRONG)
    if len(beyond):
        most = int(np.nanargmax(parts))
        success = "" if run.ended else ", and reports success"
        yield Finding(
            "wrong curve", f"from t = {run.t[beyond[0]]:.6g} scipy's curve leaves the solution: at t = "
            f"{run.t[most]:.6g} it is off by "
            f"{gap[most]:.3g}, {parts[most]:.3g} times its tolerance{success}", t=float(run.t[beyond[0]]),
        )  # fmt: skip
