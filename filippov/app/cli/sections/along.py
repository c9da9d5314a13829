"""The section of a solution, and what is varied: shared by event-map, diagram and bifurcation."""

from __future__ import annotations

import shlex
from dataclasses import replace
from typing import Any

import numpy as np

from filippov.app.cli.console import Console
from filippov.app.cli.model import Loaded
from filippov.base.errors import ModelError, UsageError
from filippov.base.names import unknown
from filippov.solving.state.events import turned
from filippov.solving.state.options import check_state

# Settings of a section with a parametrisation.
OF_A_COORDINATE = ("interval", "start")
# Settings of the states once per period.
OF_A_STROBE = ("period", "clock")


def varied(loaded: Loaded, settings: dict[str, Any]) -> tuple[str, float, float]:
    """The parameter of --over NAME=LOW:HIGH, or of --parameter and --values. Raises UsageError."""
    over, parameter, values = settings["over"], settings["parameter"], settings["values"]
    if over and (parameter is not None or values is not None):
        raise UsageError("--over says what --parameter and --values say; give one or the other.")
    if len(over) > 1:
        raise UsageError(
            f"--over takes one parameter here, given {', '.join(over)}: leave one. Two: filippov regions."
        )
    name = next(iter(over), parameter)
    if name is None:
        raise UsageError(
            "which parameter? give --over NAME=LOW:HIGH, or --parameter NAME and --values LO HI."
        )
    if name not in loaded.system.parameters:
        raise UsageError(unknown("parameter", name, loaded.system.parameters))
    if not over and values is None:
        raise UsageError(f"over which values of {name}? give --over {name}=LOW:HIGH, or --values LO HI.")
    low, high = over.get(name, values)[:2]
    for value in (low, high):
        loaded.values({name: value})
    return name, low, high


def values_over(settings: dict[str, Any], low: float, high: float, count: int) -> list[float]:
    """Equally spaced values of what is varied; count: how many where neither --over nor --count says."""
    (said,) = [span[2] for span in settings["over"].values()] or [None]
    count = number_of(said, settings["count"], "count") or count
    values: list[float] = np.linspace(low, high, count).tolist()
    return values


def number_of(said: int | None, flag: int | None, name: str) -> int | None:
    """The number of values of --over, or of its flag. Raises UsageError where both are given."""
    if said is not None and flag is not None:
        raise UsageError(f"--over has {said} values, and --{name} is {flag}; give one or the other.")
    return flag if said is None else said


def follows_solution(loaded: Loaded, settings: dict[str, Any]) -> bool:
    """Whether the solution from one state is followed: no parametrisation is known, or a state is given."""
    if settings.get("parametrisation") is not None:
        if settings.get("x0") is not None:
            raise UsageError(
                "--parametrisation says where a solution starts, and so does --x0; give one of them."
            )
        return False
    if any(settings.get(name) is not None for name in ("x0", *OF_A_STROBE)):
        return True
    asked = any(settings.get(name) is not None for name in OF_A_COORDINATE)
    return getattr(loaded.model, "section", None) is None and not asked


def section_along(
    loaded: Loaded, settings: dict[str, Any], values: dict[str, float], console: Console,
    over: tuple[str, float, float] | None = None,
) -> tuple[Any, Any]:  # fmt: skip
    """(section, initial state): the section of the flags, else one found along the solution; says which.

    over: where the section is looked for at several values of a parameter. Raises UsageError.
    """
    from filippov.analysis.diagrams.brute_force import first_section
    from filippov.analysis.maps.find_section import find_section
    from filippov.analysis.maps.section import Section

    for name in OF_A_COORDINATE:
        if settings.get(name) is not None:
            raise UsageError(
                f"--{name} is a coordinate, and the section has no parametrisation: leave it out, and the "
                "solution from --x0 is followed, or give --parametrisation."
            )
    system, given = loaded.system, {k: settings.get(k) for k in ("surface", "event", "after", "t_max")}
    strobed = any(settings.get(name) is not None for name in OF_A_STROBE)
    if strobed and any(value is not None for value in given.values()):
        raise UsageError(
            "--period and --clock are of the states once per period, --surface, --event, --after and --t-max "
            "of an event; give one or the other."
        )
    if loaded.x0 is None and settings.get("x0") is None:
        raise UsageError(
            f"{loaded.name} proposes no section, and has no initial state to find one from. Give --x0 "
            f"{loaded.blanks()}: what recurs along the solution is the "
            "section; or give --surface, --event, --coordinate, --parametrisation "
            "and --interval."
        )
    x0 = check_state(loaded.state(settings.get("x0")), system)
    if given["surface"] is None and given["event"] is None and given["after"] is None:
        if strobed:
            found = _strobe(system, x0, settings, values)
        elif over is None:
            found = find_section(system, x0, parameters=values, coordinate=settings.get("coordinate"))
        else:
            name, low, high = over
            fixed = {key: value for key, value in values.items() if key != name}
            between = [low, 0.5 * (low + high), high]
            found = first_section(system, x0, name, between, fixed, settings.get("coordinate"))
    elif given["surface"] is None or given["event"] is None or settings.get("coordinate") is None:
        raise UsageError(
            "a section is given by --surface, --event and --coordinate together; without any of them it is "
            "found along the solution."
        )
    else:
        t_max = 100.0 if given["t_max"] is None else given["t_max"]
        found = Section(
            given["surface"], given["event"], settings["coordinate"], None, t_max, given["after"] or ""
        )
        try:
            found.bind(system)
        except ModelError as error:
            raise UsageError(str(error)) from None
        return found, x0
    console.say(f"section: {told(found)}, read: {found.coordinate}")
    console.say(f"the same by flags: {flags(found)} --x0={','.join(f'{v:.12g}' for v in x0)}")
    return found, x0


def _strobe(system: Any, x0: Any, settings: dict[str, Any], values: dict[str, float]) -> Any:
    """The states once per period, or per tick of a clock, that the flags describe."""
    from filippov.analysis.maps.find_section import find_section
    from filippov.analysis.maps.stroboscope import Stroboscope

    period, clock, read = (settings.get(name) for name in (*OF_A_STROBE, "coordinate"))
    if read is None:
        read = find_section(system, x0, parameters=values, period=period).coordinate
    made = Stroboscope(read, period, clock or "")
    made.period_on(system)
    return made


def told(section: Any) -> str:
    """A section in words."""
    return f"{section.kind} on '{section.surface}'" if hasattr(section, "kind") else str(section)


def flags(section: Any) -> str:
    """A section as flags of the command line."""
    read = str(section.coordinate)
    # "--coordinate -x" would read as two options.
    coordinate = [f"--coordinate={read}"] if read.startswith("-") else ["--coordinate", read]
    if not hasattr(section, "kind"):
        period = [] if section.period is None else ["--period", str(section.period)]
        clock = ["--clock", section.clock] if section.clock else []
        return shlex.join([*coordinate, *period, *clock])
    words = ["--surface", section.surface, "--event", section.kind, *coordinate,
             "--t-max", f"{section.t_max:.6g}"]  # fmt: skip
    return shlex.join(words)


def suggestion(loaded: Loaded, interval: str = "any") -> str:
    """A sentence with flags of a parametrised section, from a short run of the model; "" where none is seen.

    Of two states the parametrisation is exact: the section is a line. Of more it holds the others where they
    were at one event, which is one choice of many.

    interval  coordinates that the command takes: "any", "both" (lo <= 0 < hi), or "positive" (0, hi)
    """
    from filippov.analysis.maps.find_section import find_section
    from filippov.analysis.maps.returns import returns
    from filippov.analysis.maps.section import Section

    if loaded.x0 is None:
        return " Name a Problem, with an initial state, and a section is looked for along its solution."
    values = dict(loaded.parameters)
    try:
        section = find_section(loaded.system, loaded.x0, parameters=values)
        if not isinstance(section, Section):
            return (
                " It is forced: its section is its state once per period, and no solution starts there from "
                "one coordinate. `filippov attractors` tells basins, `filippov regions --x0` periods over "
                "two parameters, `filippov diagram` and `filippov bifurcation` orbits over one."
            )
        seen = returns(loaded.system, section, loaded.x0, 4, parameters=values)
        if interval != "any" and seen.d.size and not np.any(seen.d > 0):
            # The event the other way reads the coordinate on the other side; where none does, -x is read.
            other = replace(section, kind=turned(section.kind))
            back = returns(loaded.system, other, loaded.x0, 4, parameters=values)
            if back.d.size and np.any(back.d > 0):
                section, seen = other, back
    except (UsageError, ModelError):
        return ""
    if not seen.d.size:
        return ""
    last = dict(zip(loaded.system.states, seen.x[-1].tolist(), strict=True))
    mirrored = interval != "any" and not np.any(seen.d > 0)
    reads = "-d" if mirrored else "d"
    start = ",".join(f"{n}={reads if n == section.coordinate else f'{v:.6g}'}" for n, v in last.items())
    d, shown = seen.d, section
    if mirrored:
        d, shown = -d, replace(section, coordinate=f"-{section.coordinate}")
    reach = 2.0 * float(np.max(np.abs(d))) or 1.0
    low = -reach if interval != "positive" and np.any(d < 0) else 0.0
    high = reach if interval != "any" or not np.all(d < 0) else 0.0
    words = ["--parametrisation", start, "--interval", f"{low:.3g}", f"{high:.3g}"]
    note = "" if loaded.system.dimension == 2 else " (it holds the other states: one choice of many)"
    return f" From a short run: {flags(shown)} {shlex.join(words)}{note}"
