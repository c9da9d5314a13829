"""Events and modes as a user sees them: without the observer surfaces that stand for user events."""

from __future__ import annotations

from collections.abc import Sequence

from filippov.base.status import EventKind
from filippov.model.user_event import UserEvent
from filippov.solving.state.events import Event, Events
from filippov.solving.state.run import Run


class Watch:
    """The user events of a run: which roots count, and how they are shown."""

    def __init__(self, users: Sequence[UserEvent], surfaces: int, clocks: int) -> None:
        self.users, self.surfaces, self.clocks = tuple(users), surfaces, clocks
        # The loop has those with expressions first.
        self.order = sorted(range(len(users)), key=lambda k: not users[k].symbolic)
        self.count = [0] * len(users)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the user events, in the order in which they were given."""
        return tuple(user.name for user in self.users)

    def user(self, index: int) -> int | None:
        """The user event behind an index of the loop."""
        place = index - self.surfaces
        return self.order[place] if 0 <= place < len(self.users) else None

    def arm(self, run: Run) -> None:
        """Let the loop stop at every occurrence of a terminal event."""
        for place, k in enumerate(self.order):
            if self.users[k].terminal:
                run.stop_at(self.surfaces + place, self.users[k].direction)

    def ends(self, run: Run, event: Event) -> bool:
        """Whether the run ends at an event at which the loop stopped; if not, it stops at the next."""
        k = self.user(event.index)
        if k is None:
            return True
        self.count[k] += 1
        if self.count[k] >= self.users[k].terminal:
            return True
        run.stop_at(event.index, self.users[k].direction)
        return False

    def shown(self, event: Event) -> Event | None:
        """An event as it is shown; None for a root in a direction that was not asked for."""
        k = self.user(event.index)
        index, m = event.index, self.surfaces
        if k is not None:
            index = m + self.clocks + k
        elif index >= m:
            index -= len(self.users)
        kind, multiplier = event.kind, event.multiplier
        if k is not None and kind is EventKind.CROSSING:
            if self.users[k].direction not in (0, event.direction):
                return None
            kind, multiplier = EventKind.USER, float(event.direction)
        return event._replace(
            index=index, kind=kind, multiplier=multiplier, before=event.before[:m], after=event.after[:m]
        )

    def events(self, run: Run) -> Events:
        """All events of a run as they are shown."""
        if not self.users:
            return run.events
        return Events([event for event in map(self.shown, run.events) if event is not None])
