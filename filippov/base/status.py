"""Outcomes of a run and kinds of event: every outcome carries its common causes and what to do."""

from __future__ import annotations

from collections.abc import Iterable
from enum import StrEnum
from typing import NoReturn

from filippov.base.errors import UsageError
from filippov.base.names import unknown


class Status(StrEnum):
    """How a run ended. `advice` says why that commonly happens and what to do about it."""

    SUCCESS = "success"
    STOPPED = "stopped"
    MAX_STEPS = "max_steps"
    MAX_EVENTS = "max_events"
    TIMEOUT = "timeout"
    INTERRUPTED = "interrupted"
    ZENO = "zeno"
    NON_UNIQUE = "non_unique"
    NO_CONTINUATION = "no_continuation"
    NO_SLIDING = "no_sliding"
    NOT_FINITE = "not_finite"
    MIN_STEP = "min_step"
    GRAZING = "grazing"
    NO_RETURN = "no_return"
    BRANCHES = "branches"
    ERROR = "error"

    @classmethod
    def _missing_(cls, value: object) -> NoReturn:
        raise UsageError(unknown("status", value, [str(status) for status in cls]))

    @property
    def ok(self) -> bool:
        """Whether the run reached its end, or the event at which it was to stop."""
        return self in (Status.SUCCESS, Status.STOPPED)

    @property
    def advice(self) -> str:
        """Common causes, and the fix for each."""
        return _ADVICE[self]


_ADVICE = {
    Status.SUCCESS: "The end of t_span was reached.",
    Status.STOPPED: "A terminal event was reached.",
    Status.MAX_STEPS: (
        "The budget of steps is used up. Common causes: a stiff field under an explicit method, or a "
        "tolerance below what double precision can give. Raise max_steps, or loosen rtol."
    ),
    Status.MAX_EVENTS: (
        "The budget of events is used up. Common causes: a fast periodic solution over a long span. Raise "
        "max_events."
    ),
    Status.TIMEOUT: "The time allowed by max_time is used up. Raise it, or shorten t_span.",
    Status.INTERRUPTED: "The run was interrupted; what it had computed is kept.",
    Status.ZENO: (
        "Events accumulate at a finite time. The estimated limit is in the message; pass zeno='continue' to "
        "go on in the limit mode."
    ),
    Status.NON_UNIQUE: (
        "Several continuations satisfy the inclusion from this point: its solution is a set. Choose one with "
        "nonunique='stick', 'slip', a list of modes or a function of the candidates; or follow all of them "
        "with nonunique='branch'."
    ),
    Status.NO_CONTINUATION: (
        "No mode is consistent at this point. Common causes: a tangency of higher order than the "
        "classification resolves, or a field that is discontinuous where no surface is declared."
    ),
    Status.NO_SLIDING: (
        "No multipliers hold the solution on its surfaces. Common causes: surfaces on which the signs do not "
        "act, or two surfaces whose gradients are parallel here."
    ),
    Status.NOT_FINITE: (
        "The field is not a finite number here. Common causes: a solution that grows without bound in finite "
        "time, a division by zero, or a field that is not defined for this state."
    ),
    Status.MIN_STEP: (
        "The step fell below the spacing of t, or far below the times of the run. Common causes: a field "
        "that is discontinuous where no surface is declared, a singularity, or a large t with fast changes "
        "(shift the origin of time)."
    ),
    Status.GRAZING: "The solution grazes a surface, and on_graze='error' is set.",
    Status.NO_RETURN: (
        "The solution does not return to the section. Common causes: it comes to rest, it goes elsewhere, "
        "or its return takes longer than t_max. Raise t_max, or start nearer to the orbit."
    ),
    Status.BRANCHES: (
        "The tree of solutions is cut: some of its branches are not followed to the end. Raise "
        "max_branches or max_depth, or shorten t_span."
    ),
    Status.ERROR: "A user function raised an exception, which is in the message. The other rows continued.",
}


class EventKind(StrEnum):
    """What happens at an event: named for the surface it happens on."""

    CROSSING = "crossing"
    ENTRY = "sliding entry"
    EXIT = "sliding exit"
    GRAZING = "grazing"
    RESET = "reset"
    TIME = "time event"
    USER = "user event"

    @classmethod
    def _missing_(cls, value: object) -> NoReturn:
        raise UsageError(no_kind(value, [str(kind) for kind in cls]))


# What the kinds of events are also called.
_CALLED = {
    **dict.fromkeys(("stick", "sticking", "sliding", "slide", "entry", "stop"), "sliding entry"),
    **dict.fromkeys(("slip", "slipping", "exit", "release", "breakaway"), "sliding exit"),
    **dict.fromkeys(("impact", "bounce", "jump", "hit"), "reset"), "tangency": "grazing", "zero": "crossing",
}  # fmt: skip


def no_kind(kind: object, known: Iterable[str]) -> str:
    """The sentence on a kind of event that there is not, with what it is called here."""
    here = _CALLED.get(str(kind))
    return unknown("kind of event", kind, known) + (f". Write {here!r} for {kind!r}." if here else "")


# The note of a crossing that a jump of the state makes, without h = 0.
JUMPED_OVER = "jumped over"
# Note of a change of mode at a knot of an input, which every neighbouring solution has at the same time.
AT_KNOT = "knot of an input"


def mode_text(mode: tuple[int, ...]) -> str:
    """A mode as text: '+0-' for (1, 0, -1); '.' where there is no surface."""
    return "".join("+0-"[1 - m] for m in mode) or "."


def stopped_at(t: float, mode: tuple[int, ...]) -> str:
    """Where a run has stopped."""
    return f"stopped at t = {t:.12g} in mode {mode_text(mode)}"
