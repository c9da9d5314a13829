"""What is explored: a system with the values to start from and the section it proposes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from filippov.base.errors import UsageError
from filippov.model.system import System
from filippov.plot.style import axis_label
from filippov.solving.state.options import check_state
from filippov.solving.state.problem import Problem

if TYPE_CHECKING:
    from filippov.analysis.maps.section import Section

# The system out of a file that stands beside the script.
STORED = "from filippov import Solution\n\nsystem = Solution.load('solution.npz').system"


@dataclass(frozen=True)
class Subject:
    """A system to explore.

    x0, t_span   where the motion starts, and how long it is followed
    parameters   values by name, one for every parameter of the system
    section      the event map that is shown, with the interval of its coordinate; None for none
    origin       lines of Python that make `system`, for the script
    """

    name: str
    system: System
    x0: tuple[float, ...]
    t_span: tuple[float, float]
    parameters: Mapping[str, float]
    section: Section | None = None
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
    section: Section | None = None,
    interval: tuple[float, float] | None = None,
    name: str = "",
    origin: str = "",
) -> Subject:
    """A subject with everything checked; system: a System, a Problem or a registered Model.

    What a Problem or a Model has of x0, t_span, parameters and section goes after what is given. A System
    alone starts at 0 and is followed to t = 10. Raises UsageError, ModelError.
    """
    made = system
    if isinstance(system, Problem):
        made = system.system
        x0, t_span = system.x0 if x0 is None else x0, system.t_span if t_span is None else t_span
        parameters = {**system.parameters, **(parameters or {})}
    elif hasattr(system, "build") and hasattr(system, "section"):
        made = system.build()
        x0, t_span = system.x0 if x0 is None else x0, system.t_span if t_span is None else t_span
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
        section.bind(made)
        if interval is None or not interval[0] < interval[1]:
            raise UsageError(
                f"interval is {interval!r}, expected (lo, hi) of the section's coordinate, lo < hi."
            )
    start = check_state([0.0] * made.dimension if x0 is None else x0, made)
    values = made.parameters.resolve(parameters).tolist()
    given = Problem(made, start, (0.0, 10.0) if t_span is None else t_span)
    low, high = given.t_span
    if not low < high:
        raise UsageError(f"t_span is ({low:g}, {high:g}), expected its end after its beginning.")
    return Subject(
        name or "system", made, tuple(start.tolist()), (float(low), float(high)),
        dict(zip(made.parameters.names, values, strict=True)), section, interval, origin or STORED,
    )  # fmt: skip
