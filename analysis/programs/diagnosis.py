"""What switches in a program f(t, y), what goes wrong when it is run, and the System to use instead."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import sympy

from filippov import ModelError, Solution, System, UsageError
from filippov.analysis.programs.agreement import FEWEST, Numbers, disagreement
from filippov.analysis.programs.bands import band_of, without_bands, without_equalities
from filippov.analysis.programs.corners import continuous, jumped
from filippov.analysis.programs.findings import (
    Finding,
    Switch,
    difference,
    early,
    in_run,
    singular,
    switches,
)
from filippov.analysis.programs.naive_run import NaiveRun, run_naively
from filippov.analysis.programs.notes import Memory, ReadingError
from filippov.analysis.programs.reader import Reading, read_program
from filippov.analysis.programs.source import source_of
from filippov.analysis.programs.translation import Translation, formula, going_on, stiffly, translate
from filippov.base.arrays import Array
from filippov.base.escape import printable
from filippov.base.given import Count, NonNegative, Positive
from filippov.base.keywords import keywords
from filippov.base.names import Answering
from filippov.base.shown import Shown, plain_data
from filippov.base.status import Status, mode_text
from filippov.model.parameter_symbol import ParameterSymbol
from filippov.solving.uncut import solve

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Steps of the solution of the inclusion under one method.
STEPS = 400_000


@dataclass(frozen=True, eq=False)
class Diagnosis(Shown, Answering):
    """The diagnosis of a program.

    name, file  the program
    switches    surfaces with their places in the source, their kinds, and whether the solution stays on them
    findings    what is wrong or noteworthy, each with surface, time and lines
    run         scipy's run
    system      the System to use instead, None where there is none; x0: its initial state
    code        the text that makes it
    solution    of that System, None where there is no System or nothing switches
    compared    random states at which program and System were compared
    """

    name: str
    file: str
    switches: tuple[Switch, ...]
    findings: tuple[Finding, ...]
    run: NaiveRun
    system: System | None
    x0: tuple[float, ...]
    code: str
    solution: Solution | None
    compared: int

    @property
    def smooth(self) -> bool:
        """Whether nothing switches in the program."""
        return self.system is not None and not self.switches and not self.system.time_events

    @keywords()
    def of(self, kind: str) -> list[Finding]:
        """The findings of a kind."""
        return [finding for finding in self.findings if finding.kind == kind]

    @property
    def error(self) -> float | None:
        """The largest difference of scipy's curve from the solution; None without one."""
        if self.solution is None:
            return None
        return float(np.max(difference(self.run, self.solution)[1]))

    def to_dict(self) -> dict[str, Any]:
        """All of it as JSON takes it, but for the curves."""
        run, solution = self.run, self.solution
        return {
            "name": self.name, "file": self.file, "smooth": self.smooth, "code": self.code,
            "compared": self.compared,
            "switches": plain_data(self.switches), "findings": plain_data(self.findings),
            "scipy": {
                "method": run.method, "rtol": run.rtol, "atol": run.atol, "steps": run.steps,
                "field_calls": run.nfev,
                "t_end": float(run.t[-1]), "x_end": run.y[:, -1].tolist(), "ended": run.ended,
            },
            "motion": None if solution is None else {
                "status": solution.status.value, "message": solution.message, "field_calls": solution.nfev,
                "steps": solution.steps, "events": len(solution.events), "t_end": solution.t_end,
                "x0": list(self.x0), "x_end": solution.x_end.tolist(), "modes": list(solution.modes),
                "largest_difference": self.error,
            },
        }  # fmt: skip

    def to_text(self) -> str:
        """The diagnosis in sentences, with the System at the end."""
        lines = [f"{self.name} in {Path(self.file).name or '(no file)'}"]
        if self.smooth:
            smooth = ": an integrator of smooth equations is what it needs" if not self.run.ended else ""
            lines.append(f"nothing switches here{smooth}.")
        for switch in self.switches:
            what = {
                "jump": "the field jumps",
                "kink": "a corner, the field is continuous",
                "time": "time alone decides",
                "memory": "the memory changes",
            }
            stays = "; the solution stays on it (slides)" if switch.slides else ""
            lines.append(f"surface {switch.surface} = 0: {what[switch.kind]}, {switch.where}{stays}")
        lines += [f"{f.kind}: {f.sentence}." for f in self.findings]
        lines.append(self._cost())
        if self.code and not self.smooth:
            same = f" (the same at {self.compared} random states)" if self.compared else ""
            lines += [f"in its place{same}:", "", self.code.rstrip()]
        return "\n".join(printable(part) for line in lines for part in line.split("\n"))

    def _cost(self) -> str:
        run, solution = self.run, self.solution
        text = f"cost: scipy's {run.method} {run.nfev} calls of f in {run.steps} steps to t = {run.t[-1]:.6g}"
        if solution is None:
            return text
        end = "" if solution.success else f", ended as {solution.status.value}: {solution.message}"
        return (
            f"{text}; the inclusion {solution.nfev} in {solution.steps} steps and {len(solution.events)} "
            "events to t = "
            f"{solution.t_end:.6g}, ends in mode {mode_text(solution.end_mode)}{end}"
        )

    def __str__(self) -> str:
        return self.to_text()

    @keywords()
    def plot(self, *, title: str = "", figure: Figure | None = None) -> Figure:
        """Both solutions and the calls that each has spent, over time."""
        from filippov.plot.diagnosis import plot_diagnosis

        return plot_diagnosis(self, title=title, figure=figure)


@keywords()
def diagnose(
    f: Callable[..., Any], x0: Any, t_span: Sequence[float], *, args: Sequence[Any] = (),
    method: str = "RK45", rtol: Positive = 1e-3, atol: NonNegative = 1e-6, max_calls: Count = 20_000,
) -> Diagnosis:  # fmt: skip
    """Read a program f(t, y, *args), run it by scipy, and solve the inclusion that it means.

    x0, t_span         as of scipy's solve_ivp, forwards in time
    args               further arguments of f; method, rtol, atol: of scipy, with its defaults
    max_calls          calls of f after which scipy's run is ended

    The source of f is read and never changed; f is called by scipy and at random states, where its values are
    compared with those of the System. What it remembers (globals, attributes) is restored. If the source
    cannot be translated, the finding "not translated" names the line. Raises UsageError; ModelError where
    there is no source.
    """
    start, span = _checked(x0, t_span)
    budget: object = max_calls
    if isinstance(budget, bool) or not isinstance(budget, int) or budget < 1:
        raise UsageError(f"max_calls is {max_calls!r}, expected a whole number of at least 1.")
    findings: list[Finding] = []
    reading: Reading | None = None
    translation: Translation | None = None
    try:
        reading = read_program(f, len(start), args)
        translation = translate(reading, start, span)
    except ReadingError as error:
        findings.append(
            Finding("not translated", str(error).rstrip("."), lines=(error.line,) if error.line else ())
        )
    except ModelError as error:
        if reading is None:
            raise
        findings.append(Finding("not translated", str(error).rstrip(".")))
    memories, unread = (reading.memories, reading.unread) if reading else ((), ())
    run = run_naively(f, start, span, args, method=method, rtol=rtol, atol=atol, max_calls=max_calls)
    _put_back([*memories, *unread])
    compared = 0
    if translation is not None and not memories:
        sentence, compared = disagreement(lambda t, y: f(t, y, *args), translation, run.t, run.y)
        if sentence or compared < FEWEST:
            said = sentence or f"f and the System could be compared at {compared} random states only"
            findings.append(Finding("differs", said))
            translation = None if sentence else translation
    if reading is not None and translation is not None:
        plain = without_bands(without_equalities(reading, f, args))
        if plain.dropped or plain.held:
            translation = translate(plain, start, span)
    corners = continuous(translation, run.t, run.y) if translation else set()
    found = switches(translation, None, corners) if translation else ()
    solution = None
    if translation is not None and (found or translation.clocks):
        solution = solve(translation.system, translation.x0, span, zeno="continue", max_steps=STEPS)
        if solution.status is Status.MAX_STEPS:  # held up by a stiff field, such as that of a narrow band
            stiff = solve(
                translation.system, translation.x0, span, zeno="continue", max_steps=STEPS, method="Radau"
            )
            if stiff.success:
                solution, translation = stiff, replace(translation, code=stiffly(translation.code))
        found = switches(translation, solution, corners - jumped(translation, solution))
        if memories:
            findings += _replayed(f, args, reading, solution, translation)
            _put_back(memories)
        findings += in_run(run, solution, translation, found)
        if solution.accumulations:  # as the code is to run it, too
            translation = replace(translation, code=going_on(translation.code))
        findings += _at_start(f, args, solution, translation, found)
    elif run.ended:
        findings += [early(run), *(singular(run, translation) if translation else ())]
    if reading is not None:
        findings += _in_source(reading, translation, found)
    # What was compared has called f again.
    _put_back([*memories, *unread])
    source = reading.source if reading else source_of(f)
    name, file = source.name, source.file
    if run.written is not None:
        found_at = source.writes()
        findings.append(
            Finding(
                "writes into y", f"{found_at or 'f'} writes into y, the array of the integrator itself: that "
                f"changes trial points and the solution between its steps, at t = {run.written:.6g} first, "
                "and is no reset. A jump of the state is a Surface(name, h, reset={state: value}) here; for "
                "anything else begin with y = y.copy()", t=run.written,
            )
        )  # fmt: skip
    if translation is None:
        return Diagnosis(name, file, found, tuple(findings), run, None, tuple(start), "", solution, compared)
    return Diagnosis(
        name, file, found, tuple(findings), run, translation.system, translation.x0, translation.code,
        solution, compared,
    )  # fmt: skip


def _checked(x0: Any, t_span: Any) -> tuple[Array, tuple[float, float]]:
    try:
        start = np.atleast_1d(np.asarray(x0, dtype=float))
        first, last = (float(q) for q in t_span)
    except (TypeError, ValueError):
        raise UsageError(
            f"x0 is {x0!r} and t_span {t_span!r}, expected numbers, one per state, and (t0, t1)."
        ) from None
    if start.ndim != 1 or not np.all(np.isfinite(start)):
        raise UsageError(f"x0 is {x0!r}, expected one finite number per state.")
    if not (np.isfinite(first) and np.isfinite(last) and first < last):
        raise UsageError(f"t_span is {t_span!r}, expected two finite times, the first before the second.")
    return start, (first, last)


def _put_back(memories: Sequence[Memory]) -> None:
    for memory in memories:
        memory.put(memory.initial)


def _in_source(
    reading: Reading, translation: Translation | None, found: Sequence[Switch]
) -> Iterator[Finding]:
    """What the source says by itself: equalities, dead bands, memories, clocks."""
    equal = {(site.line, site.text): site for site in reading.sites if site.kind == "equality"}
    wide = translation is not None and any(s.radius[1] != 1.0 for s in translation.system.surfaces)
    more = "the System says so by a radius" if wide else "say so by Surface(..., radius=Fs/Fc)"
    for site in equal.values():
        yield Finding(
            "equality", f"line {site.line} `{site.text}` compares floats for equality: it never holds at "
            "the steps of an integrator. What holds on the surface is set by the inclusion; where more "
            f"is held at rest than in motion, {more}", lines=(site.line,),
        )  # fmt: skip
    sites = translation.sites if translation else ()
    dropped = {h: (u, width) for h, u, width in translation.dropped} if translation else {}
    for u, width in dict.fromkeys(dropped.values()):
        edges = {site.text: site.line for site in sites if dropped.get(site.h) == (u, width)}
        where = ", ".join(f"line {line} `{text}`" for text, line in edges.items())
        yield Finding(
            "dead band", f"{where} is a dead band written by hand, {width:.3g} wide to each side, for "
            f"{formula(u).replace('p.', '')} = 0: inside it the program creeps, drifts or is called on both "
            "sides of an edge in turn. The System has the sign alone, and holds it",
            lines=tuple(sorted(set(edges.values()))),
        )  # fmt: skip
    for site in sites:
        band = None if site.h in dropped else band_of(site.h, _default)
        # A play or a backlash is a dead band of the plant itself: its field is continuous at the ends.
        plays = any(switch.kind == "kink" and site in switch.sites for switch in found)
        if band is not None and not plays:
            yield Finding(
                "dead band", f"line {site.line} `{site.text}` is a dead band written by hand, {band[1]:.3g} "
                "wide to each side: inside it the solution creeps or drifts. Write sign(...) alone, and the "
                "inclusion holds it", lines=(site.line,),
            )  # fmt: skip
        norm = _norm_band(site.h)
        if norm is not None:
            yield Finding(
                "dead band", f"line {site.line} `{site.text}` is a dead band of a length, {norm:.3g} wide: "
                "inside it the solution creeps. At 0 a direction such as v/|v| jumps to all sides at once, "
                "which no sign of a surface describes, so the System has the band too. Friction in the plane "
                "is of this kind; where the slip keeps its direction, write it as the sign of one speed, as "
                "the gallery's model of friction in the plane does", lines=(site.line,),
            )  # fmt: skip
    for memory in reading.memories:
        yield Finding(
            "memory", f"line {memory.line}: {memory.label} keeps its value from call to call, and an "
            "integrator calls f at trial points and in rejected steps too. It is a state of its own here, "
            "which resets change", lines=(memory.line,),
        )  # fmt: skip
    for line in dict.fromkeys(clock.line for clock in reading.clocks):
        said = f"line {line} jumps at known times: a TimeEvent here, reached to the last bit"
        yield Finding("clock", said, lines=(line,))
    for remark in reading.remarks:
        yield Finding("remark", remark)


def _default(value: Any) -> float | None:
    """The number of an expression with its parameters at their defaults; None for another one."""
    given = {
        q: sympy.Float(q.parameter.default) for q in value.free_symbols if isinstance(q, ParameterSymbol)
    }
    number = value.xreplace(given)
    return float(number) if number.is_number else None


def _norm_band(h: Any) -> float | None:
    """The half-width of u^2 + v^2 < width^2, small against 1; None for another condition."""
    if not isinstance(h, sympy.Add):
        return None
    if all(q.could_extract_minus_sign() for q in h.args if q.free_symbols - h.atoms(ParameterSymbol)):
        h = -h
    squares = [q for q in h.args if q.is_Pow and q.exp == 2 and not isinstance(q.base, ParameterSymbol)]
    number = _default(h - sympy.Add(*squares))
    return (-number) ** 0.5 if len(squares) > 1 and number is not None and -0.01 <= number < 0 else None


def _at_start(
    f: Callable[..., Any],
    args: Sequence[Any],
    solution: Solution,
    translation: Translation,
    found: tuple[Switch, ...],
) -> list[Finding]:
    """Starts on a surface, where the value of a sign at 0 is used, and the solution that it makes."""
    numbers = Numbers(translation.system)
    t0, x0 = solution.problem.t_span[0], np.asarray(translation.x0)
    on = [i for i, h in enumerate(numbers.h(t0, x0)) if h == 0.0 and found[i].kind != "kink"]
    n = len(solution.problem.x0) - len(translation.clocks) - translation.remembered
    if not on or translation.remembered:
        return []
    try:
        own = np.asarray(f(t0, x0[:n].copy(), *args), dtype=float).ravel()
    except (ValueError, ZeroDivisionError, OverflowError):
        return []
    switch = found[on[0]]
    later = t0 + 1e-6 * (solution.problem.t_span[1] - t0)
    torn = solution.status is Status.NON_UNIQUE and solution.t_end == t0
    if np.all(own == 0.0) and torn:
        ways = ", ".join(mode_text(way.mode) for way in solution.candidates)
        return [Finding(
            "false rest", f"the start lies on {switch.surface} = 0, where {switch.where} gives 0 and with "
            "it f = 0: the program "
            "stays there forever; the inclusion can go on in the modes "
            f"{ways}", switch.surface, t0, switch.lines,
        )]  # fmt: skip
    leaves = solution.sol is not None and solution.t_end > later and solution.start_mode[on[0]] != 0
    if np.all(own == 0.0) and leaves:
        return [Finding(
            "false rest", f"the start lies on {switch.surface} = 0, where {switch.where} gives 0 and with "
            "it f = 0: the program "
            "stays there forever, the solution of the inclusion leaves", switch.surface, t0, switch.lines,
        )]  # fmt: skip
    if not leaves:
        return []
    there = numbers.field(t0, x0, solution.start_mode)[:n]
    if np.max(np.abs(there - own)) <= 1e-9 * (1 + np.max(np.abs(own))):
        return []
    return [Finding(
        "sign at 0", f"the start lies on {switch.surface} = 0, where {switch.where} takes a value that "
        "holds on neither side",
        switch.surface, t0, switch.lines,
    )]  # fmt: skip


def _replayed(
    f: Callable[..., Any], args: Sequence[Any], reading: Any, solution: Solution, translation: Translation
) -> list[Finding]:
    """Where a program with a memory, called in order along the solution, differs from the System."""
    _put_back(reading.memories)
    if solution.sol is None:
        return []
    n, numbers = len(reading.states), Numbers(translation.system)
    t0, t1 = solution.problem.t_span[0], solution.t_end
    short = 1e-6 * (t1 - t0)
    asked = [(float(t), solution.sol(float(t)), True) for t in np.linspace(t0, t1, 400)]
    # A step comes to lie a little beyond the surface on which the memory changes.
    asked += [
        (e.t, np.asarray(e.x) + short * numbers.field(e.t, e.x, e.before), False) for e in solution.events
    ]
    events = np.array([t0, *(e.t for e in solution.events), t1])
    for t, x, compared in sorted(asked, key=lambda item: item[0]):
        own = np.asarray(f(t, np.array(x[:n]), *args), dtype=float).ravel()
        theirs = numbers.field(t, x)[:n]
        away = np.min(np.abs(events - t)) > 2 * short
        if compared and away and np.max(np.abs(own - theirs)) > 1e-6 * (1 + np.max(np.abs(own))):
            return [Finding(
                "differs", f"called along the solution, f is {own} at t = {t:.6g}, the System's is {theirs}: "
                "the memory is not what the resets make of it", t=t,
            )]  # fmt: skip
    return []
