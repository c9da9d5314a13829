"""The solutions and iterates of a view, each within a budget, the last of each cached."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from filippov import Parameter, Solution, System, UsageError, parameters, solve
from filippov.app.explorer.subject import Subject
from filippov.app.explorer.view import EXACT, View
from filippov.base.arrays import Array
from filippov.model.comparator import NAMES
from filippov.plot.maps import bisected

T = TypeVar("T")
# The budget of a redraw; a solution that needs more ends early, with a message.
MOST_STEPS, MOST_EVENTS = 40_000, 2_000
KEPT = 8
# Events of all kinds for one return, at most, of those after which a solution without a parametrisation ends.
EVENTS_EACH = 15
MAP_POINTS, COBWEB, DIAGRAM_VALUES, TRANSIENT, KEEP = 121, 24, 41, 24, 12
RTOL, ATOL = 1e-8, 1e-10  # of the returns of a map


class PostponedError(Exception):
    """A diagram was interrupted by a redraw."""


@dataclass(frozen=True)
class MapData:
    """The event map, iterates from a start, and those that show their limit.

    d, image  on an interval, or of a section without a parametrisation the pairs along the solution
    note      why the solution has fewer of them, or ""
    """

    d: Array
    image: Array
    orbit: Array
    last: Array
    note: str = ""


class Solutions:
    """The solutions of a view of one subject, computed at first use."""

    def __init__(self, subject: Subject) -> None:
        self.subject = subject
        # Set while a redraw waits, which interrupts a diagram.
        self.hurry = threading.Event()
        self._found: dict[Any, Any] = {}
        self._systems: dict[str, tuple[System, str]] = {}
        self._map: Any = None

    def exact(self, view: View) -> Solution:
        """The solution of the inclusion."""
        key = ("exact", *self._solution_key(view))
        return self._kept(key, lambda: self._solve(self.subject.system, view, {}))

    def other(self, view: View) -> Solution | None:
        """The comparator's solution, or None. Raises ModelError where it does not fit."""
        kind = view["against"]
        if kind == EXACT:
            return None
        key = ("other", kind, view["width"], *self._solution_key(view))

        def run() -> Solution:
            system, width = self._system(kind)
            return self._solve(system, view, {width: view["width"]})

        return self._kept(key, run)

    def map(self, view: View) -> MapData | None:
        """The event map with a cobweb, None where the subject has no section."""
        if self.subject.section is None:
            return None
        if self.subject.interval is None:
            return self._kept(("returns", *self._map_key(view)), lambda: self._followed(view))
        return self._kept(("map", *self._map_key(view)), lambda: self._sampled(view))

    def diagram(self, view: View) -> tuple[Array, Array] | None:
        """Values of the parameter and iterates after a transient, (k,) and (k, KEEP); None without a section.

        Raises UsageError, ModelError.
        """
        if self.subject.section is None or "over" not in view.values:
            return None
        over, low, high = view["over"], view["low"], view["high"]
        for value in (low, high):
            view.but({f"p.{over}": value})
        fixed = view.but({f"p.{over}": low, "over": over, "low": low, "high": high})
        key = ("diagram", over, low, high, *self._map_key(fixed))
        return self._kept(key, lambda: self._swept(view))

    # -- work ---------------------------------------------------------------------------------------------

    def _solve(self, system: System, view: View, more: dict[str, float]) -> Solution:
        own = [0.0] * (system.dimension - len(view.x0))  # states that a comparator adds
        solution: Solution = solve(
            system, [*view.x0, *own], view.t_span, parameters={**view.parameters, **more},
            max_steps=MOST_STEPS, max_events=MOST_EVENTS,
        )  # fmt: skip
        return solution

    def _system(self, kind: str) -> tuple[System, str]:
        """The system under a comparator whose width is a parameter: built and compiled once."""
        if kind not in self._systems:
            name = "comparator_width"
            while name in self.subject.system.parameters:
                name += "_"
            (width,) = parameters(**{name: Parameter(0.01, lower=np.finfo(float).tiny)})
            comparator: Any = NAMES[kind]
            self._systems[kind] = self.subject.system.with_comparator(comparator(width)), name
        return self._systems[kind]

    def _event_map(self, view: View) -> Any:
        from filippov.analysis.maps.event_map import EventMap
        from filippov.analysis.maps.section import Section

        if self._map is None:
            assert isinstance(self.subject.section, Section)
            self._map = EventMap(self.subject.system, self.subject.section, rtol=RTOL, atol=ATOL)
        return self._map.remake(parameters=view.parameters, order=view["order"])

    def _sampled(self, view: View) -> MapData:
        event_map = self._event_map(view)
        orbit = event_map.iterate(view["d"], TRANSIENT + KEEP)
        assert self.subject.interval is not None
        seen = [*self.subject.interval, *orbit[: COBWEB + 1][np.isfinite(orbit[: COBWEB + 1])]]
        d = np.linspace(min(seen), max(seen), MAP_POINTS)
        return MapData(*bisected(event_map, d, event_map(d)), orbit[: COBWEB + 1], orbit[-KEEP:])

    def _followed(self, view: View) -> MapData:
        """The pairs along one solution from t = 0, as at the start of a diagram."""
        from filippov.analysis.maps.returns import coordinate_of, returns

        section, order = self.subject.section, view["order"]
        assert section is not None
        count = (TRANSIENT + KEEP) * order
        found = returns(
            self.subject.system, section, view.x0, count, parameters=view.parameters, rtol=RTOL,
            max_events=EVENTS_EACH * count,
        )  # fmt: skip
        orbit = found.d[order - 1 :: order]
        last = orbit[TRANSIENT:]
        if found.rests:
            last = np.append(last, coordinate_of(section, self.subject.system).read(found.x_end[None]))
        return MapData(found.d[:-order], found.d[order:], orbit[: COBWEB + 1], last, found.message)

    def _swept(self, view: View) -> tuple[Array, Array]:
        from filippov.analysis.diagrams.brute_force import brute_force

        order = view["order"]
        values = np.linspace(view["low"], view["high"], DIAGRAM_VALUES)
        assert self.subject.section is not None
        start = view.x0 if self.subject.interval is None else view["d"]
        found = brute_force(
            self.subject.system, self.subject.section, view["over"], values.tolist(), start,
            transient=TRANSIENT * order, keep=KEEP * order, parameters=view.parameters, threads=1,
            rtol=RTOL, max_events=EVENTS_EACH * order * (TRANSIENT + KEEP), progress=self._go_on,
        )  # fmt: skip
        if not found.complete:
            raise UsageError("the diagram was interrupted.")
        return found.values, found.d[:, order - 1 :: order]

    def _map_key(self, view: View) -> tuple[Any, ...]:
        start = tuple(view.x0) if self.subject.interval is None else (view["d"],)
        return (view["order"], *start, *view.parameters.values())

    def _go_on(self, *_: int) -> None:
        if self.hurry.is_set():
            raise PostponedError("A redraw came first: ask for the diagram again.")

    def _solution_key(self, view: View) -> tuple[Any, ...]:
        return (*view.parameters.values(), *view.x0, *view.t_span)

    def _kept(self, key: Any, make: Callable[[], T]) -> T:
        if key not in self._found:
            made = make()
            while len(self._found) >= KEPT:
                del self._found[next(iter(self._found))]
            self._found[key] = made
        found: T = self._found[key]
        return found
