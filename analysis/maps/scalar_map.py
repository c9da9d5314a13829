"""What fixed points and slopes ask of an event map; `filippov.analysis.maps.event_map.EventMap` is one."""

from __future__ import annotations

from typing import Any, Protocol, Self

from filippov import Solution, Status, System
from filippov.analysis.maps.section import BoundSection, Section
from filippov.base.arrays import Array


class ScalarMap(Protocol):
    """R(d): from coordinate d on a section to that of its next event, or the order-th iterate of this."""

    system: System
    section: Section
    bound: BoundSection
    order: int
    p: Array
    parameters: dict[str, float]
    rtol: float
    atol: Any

    def __call__(self, d: Any) -> Any:
        """R(d), a number or an array like d; NaN where the solution does not return."""

    def returns(self, d: Any) -> tuple[Array, tuple[Status, ...]]:
        """Values at numbers (k,), and how each solution ended: STOPPED where it came back."""

    def derivative(self, d: float) -> float:
        """dR/dd; NaN where the map does not return."""

    def orbit(self, d: float) -> tuple[Solution, ...]:
        """The solution behind the map, one solution per return."""

    def remake(self, **changes: Any) -> Self:
        """The same map with other parameters, order or tolerances."""
