"""A system's exact automaton as a file: a Python module, C, Modelica, or an FMU."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from filippov.base.errors import ModelError, UsageError
from filippov.base.keywords import keywords
from filippov.base.names import closest
from filippov.base.whole_file import write_whole
from filippov.io.automaton.c_text import c_file
from filippov.io.automaton.equations import Equations, equations
from filippov.io.automaton.fmu import write_fmu
from filippov.io.automaton.modelica_text import heights, modelica_text
from filippov.io.automaton.python_text import python_module
from filippov.model.system import System
from filippov.solving.solver import solve
from filippov.solving.state.options import check_state
from filippov.solving.state.problem import Problem

# What it is written to, and the suffix of its files.
TARGETS = {"python": ".py", "c": ".c", "modelica": ".mo", "fmu": ".fmu"}

# The exact run that tells how large h gets: its budget of steps, and the places where h is taken.
SCALE_STEPS, SAMPLES = 100_000, 64


@keywords()
def export_system(
    system: System | Problem, path: str | Path, to: str | None = None, *,
    parameters: Mapping[str, float] | None = None, x0: Any = None, t_span: tuple[float, float] | None = None,
) -> Path:  # fmt: skip
    """Write the exact automaton of a system: modes, fields, sliding fields, guards, resets and clocks.

    system       a System of expressions, or a Problem, whose parameters, x0 and t_span then count
    path         the file, replaced if it exists; the stem names a Modelica model and an FMU
    to           "python": a module that needs no package; "c": one file of C99; "modelica"; "fmu": FMI 3.0,
                 co-simulation (extra `fmu`). Default: by the suffix .py, .c, .mo, .fmu
    parameters   values that become defaults in the file; they can be changed there
    x0, t_span   start and span, increasing; "modelica" needs both, "fmu" x0, for the others they are defaults

    The Python module, the C file and the FMU locate events on a step of order 5 and land on them; they stop
    with a named status where the rates of a surface do not decide (corners of coupled surfaces, two-folds,
    tangencies, accumulations). In Modelica the tool locates them. Returns the path. Raises UsageError,
    ModelError for a system that cannot be exported, ImportError for an FMU without pythonfmu3.
    """
    if isinstance(system, Problem):
        given = {"parameters": parameters, "x0": x0, "t_span": t_span}
        for name, value in given.items():
            if value is not None:
                raise UsageError(f"{name} was given beside a Problem, which has its own. Use problem.remake.")
        problem = system
        system, parameters, x0, t_span = problem.system, problem.parameters, problem.x0, problem.t_span
    if not isinstance(system, System):
        raise UsageError(f"system is {system!r}, expected a System or a Problem.")
    target = _target(to, Path(path))
    if system.inputs:
        raise ModelError(
            f"the system holds the input {system.inputs[0].name!r}, whose samples are not written into the "
            "file. Put a formula in t, or a state that a clock resets, in its place."
        )
    values = [float(v) for v in system.parameters.resolve(parameters)]
    start = None if x0 is None else [float(v) for v in check_state(x0, system)]
    span = None if t_span is None else _span(t_span)
    eq = equations(system)
    if target == "python":
        return write_whole(path, python_module(eq, values, start, span))
    if target == "c":
        return write_whole(path, c_file(eq, values, start, span))
    if start is None or (target == "modelica" and span is None):
        need, flags = ("x0 and t_span", "--x0 and --t-span") if target == "modelica" else ("x0", "--x0")
        raise UsageError(f"{target} needs {need}: give the start, in the command by {flags}.")
    if target == "fmu":
        return write_fmu(eq, values, start, span, Path(path))
    assert span is not None
    mode = _first_mode(system, values, start, span)
    extents = _extents(eq, values, start, span)
    return write_whole(path, modelica_text(eq, Path(path).stem, values, start, span, mode, extents))


def _target(to: str | None, path: Path) -> str:
    if to is None:
        for name, suffix in TARGETS.items():
            if path.suffix == suffix:
                return name
        raise UsageError(
            f"{str(path)!r} has no suffix that says what to write ({', '.join(TARGETS.values())}); give "
            f"to=... (--to in the command), one of {', '.join(TARGETS)}."
        )
    if to not in TARGETS:
        hint = closest(str(to), TARGETS)
        raise UsageError(f"to is {to!r}; {hint + ' ' if hint else ''}known: {', '.join(TARGETS)}")
    return to


def _span(t_span: Sequence[float]) -> tuple[float, float]:
    start, stop = (float(q) for q in t_span)
    if not start < stop:
        raise UsageError(f"t_span is {tuple(t_span)}, expected increasing times: an automaton runs forwards.")
    return start, stop


def _first_mode(
    system: System, values: Sequence[float], x0: Sequence[float], span: tuple[float, float]
) -> tuple[int, ...]:
    """The mode at the start, as the exact run has it."""
    named = dict(zip(system.parameters.names, values, strict=True))
    short = (span[0], span[0] + 1e-9 * (span[1] - span[0]))
    solution = solve(system, x0, short, parameters=named)
    if not solution.success:
        raise ModelError(f"the mode at the start is not known: {solution.status.value}: {solution.message}")
    first: tuple[int, ...] = solution.segments[0].mode
    return tuple(int(sign) for sign in first)


def _extents(
    eq: Equations, values: Sequence[float], x0: Sequence[float], span: tuple[float, float]
) -> tuple[float, ...]:
    """The largest |h| of every surface in the exact run, as far as it gets: its scale."""
    system = eq.system
    named = dict(zip(system.parameters.names, values, strict=True))
    run = solve(system, x0, span, parameters=named, max_steps=SCALE_STEPS)
    if run.sol is None:
        return (0.0,) * len(eq.form.h)
    rows = []
    for k in range(SAMPLES + 1):
        place = float(run.t[0] + (run.t_end - run.t[0]) * k / SAMPLES)
        with suppress(ArithmeticError, TypeError, ValueError):  # no number there
            rows.append([abs(h) for h in heights(eq, values, [float(v) for v in run.sol(place)], place)])
    rows = [row for row in rows if all(math.isfinite(h) for h in row)]
    return tuple(max(column) for column in zip(*rows, strict=True)) or (0.0,) * len(eq.form.h)
