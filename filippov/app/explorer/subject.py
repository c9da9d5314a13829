"""The subject of the explorer: a system with its initial values and a section."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from filippov import Problem, System, UsageError
from filippov.io.stored_system import system_data
from filippov.plot.style import axis_label
from filippov.solving.state.options import check_state

if TYPE_CHECKING:
    from filippov.analysis.maps.section import Section
    from filippov.analysis.maps.stroboscope import Stroboscope

# Spans of the solution in which a section is searched for; the budget relative to its longest return.
SPANS, WAIT = 10.0, 10.0
# The system from a file next to the script.
STORED = "from filippov import Solution\n\nsystem = Solution.load('solution.npz').system"


@dataclass(frozen=True)
class Subject:
    """A system to explore.

    x0, t_span   where the solution starts, and how long it is followed
    parameters   values by name, one for every parameter of the system
    section      the event map that is shown; None for none
    interval     of the section's coordinate; None for a section without a parametrisation
    origin       lines of Python that make `system`, for the script; "" where none are known
    """

    name: str
    system: System
    x0: tuple[float, ...]
    t_span: tuple[float, float]
    parameters: Mapping[str, float]
    section: Section | Stroboscope | None = None
    interval: tuple[float, float] | None = None
    origin: str = STORED

    def label(self, name: str) -> str:
        """The label of an axis, with its unit."""
        return axis_label(self.system, name)

    @property
    def quantities(self) -> tuple[str, ...]:
        """States and outputs."""
        return (*self.system.states, *self.system.outputs)


def subject(
    system: Any,
    x0: Any = None,
    t_span: Any = None,
    *,
    parameters: Mapping[str, float] | None = None,
    section: Section | Stroboscope | None = None,
    interval: tuple[float, float] | None = None,
    name: str = "",
    origin: str = "",
) -> Subject:
    """A checked subject; system: a System, a Problem or a registered Model.

    Given x0, t_span, parameters and section take precedence over those of a Problem or a Model. A System
    alone starts at 0 and is followed to t = 10. Without a section one is searched for along the solution
    (`find_section`); there is none where nothing recurs. Raises UsageError, ModelError.
    """
    made = system
    if isinstance(system, Problem):
        made = system.system
        x0, t_span = system.x0 if x0 is None else x0, system.t_span if t_span is None else t_span
        parameters = {**system.parameters, **(parameters or {})}
    elif hasattr(system, "build") and hasattr(system, "section"):
        made = system.build()
        x0, t_span = system.x0 if x0 is None else x0, system.t_span if t_span is None else t_span
        parameters = {**getattr(system, "parameters", {}), **(parameters or {})}
        name = name or system.name
        origin = (
            origin
            or f"from filippov.models import registry\n\nsystem = registry.get({system.name!r}).build()"
        )
        if section is None and system.section is not None:
            from filippov.analysis.maps.section import Section as Found

            section, interval = Found.from_model(system), interval or system.section.interval
    if not isinstance(made, System):
        raise UsageError(f"the system is {system!r}, expected a System, a Problem or a registered Model.")
    if section is not None:
        interval = _checked(made, section, interval)
    start = check_state([0.0] * made.dimension if x0 is None else x0, made)
    numbers = made.parameters.resolve(parameters).tolist()
    values = dict(zip(made.parameters.names, numbers, strict=True))
    given = Problem(made, start, (0.0, 10.0) if t_span is None else t_span)
    low, high = given.t_span
    if not low < high:
        raise UsageError(f"t_span is ({low:g}, {high:g}), expected its end after its beginning.")
    if section is None:
        section, interval = _found(made, start, values, SPANS * (high - low)), None
    return Subject(
        name or "system", made, tuple(start.tolist()), (float(low), float(high)),
        values, section, interval, origin or _origin(made),
    )  # fmt: skip


def _origin(system: System) -> str:
    """Lines that make a system: out of the file beside the script, else from the module that names it.

    "" for plain functions that no module has by name; the one that is run now would run again.
    """
    if system_data(system) is not None:
        return STORED
    name = getattr(system.exact.field, "__module__", None)
    module = None if name in (None, "__main__") else sys.modules.get(str(name))
    file = getattr(module, "__file__", None)
    if file is None:
        return ""
    for known, value in vars(module).items():
        if value is system or (isinstance(value, Problem) and value.system is system):
            return of_file(f"{Path(file).resolve()}:{known}")
    return ""


def of_file(name: str) -> str:
    """Lines that make the system of `file.py:name`."""
    return f"from filippov.app.cli.model import load_model\n\nsystem = load_model({name!r}).system"


def _checked(
    system: System, section: Section | Stroboscope, interval: tuple[float, float] | None
) -> tuple[float, float] | None:
    """The interval of a section that fits the system; None without a parametrisation. Raises UsageError."""
    from filippov.analysis.maps.stroboscope import Stroboscope as Periods

    if isinstance(section, Periods):
        section.period_on(system)
        return None
    section.bind(system)
    if section.parametrisation is None:
        return None
    if interval is None or not interval[0] < interval[1]:
        raise UsageError(f"interval is {interval!r}, expected (lo, hi) of the section's coordinate, lo < hi.")
    return interval


def _found(
    system: System, x0: Any, parameters: Mapping[str, float], length: float
) -> Section | Stroboscope | None:
    """The section on which the solution returns within a time, None where nothing recurs."""
    from filippov.analysis.maps.find_section import find_section
    from filippov.analysis.maps.section import Section as Events

    try:
        found = find_section(system, x0, parameters=parameters, t_max=length)
    except Exception:  # noqa: BLE001  # also a function of the user's: the page itself tells of it
        return None
    # A redraw does not wait for a hundred times the longest return so far.
    return replace(found, t_max=found.t_max / WAIT) if isinstance(found, Events) else found
