"""What is expected where the solution is a set: that it is reported, and what can be reached."""

from __future__ import annotations

import re
from typing import Any

import numpy as np

from filippov.app.bank.outcome import Ask, Outcome, reads
from filippov.app.bank.reason import MissingError, NotUnderstoodError
from filippov.base.status import Status

_NUMBERS = {"two": 2, "three": 3, "four": 4, "five": 5, "six": 6, "2": 2, "3": 3, "4": 4, "5": 5, "6": 6}
_NON_UNIQUE = r"non-?\s?uniq|not unique|ambiguous|multiple|several|repelling|escaping|branch|set-valued"
_REPORTS = (
    (_NON_UNIQUE, Status.NON_UNIQUE),
    (r"zeno|accumulat|chatter", Status.ZENO),
    (r"graz|touch|tangen", Status.GRAZING),
    (r"blow|infinite|finite escape|not finite|nan", Status.NOT_FINITE),
    (r"no (?:solution|continuation)", Status.NO_CONTINUATION),
)
RELEASES = 7  # departures sampled along sliding that can be left at any time
NEAR = 1e-8  # how near a time or a point named in a text has to be met, where it has no tolerance


@reads(
    r"must_report|must_name|report|reports|must_warn",
    "text that names what the run has to report (non-unique, Zeno, grazing, ...), when, and how many "
    "continuations there are",
)
def _must_report(ask: Ask, _match: re.Match[str]) -> Outcome:
    text = str(ask.entry.value).casefold()
    statuses = [status for words, status in _REPORTS if re.search(words, text)]
    if not statuses:
        raise NotUnderstoodError("the text names nothing that a run can report")
    status = statuses[0]
    options: dict[str, Any] = {"on_graze": "error"} if status is Status.GRAZING else {}
    run = ask.motion.solve(**options)
    if run.status is not status:
        return Outcome(1.0, 0.0, f"the run ends with {run.status.value}, expected {status.value}")
    tolerance = max(ask.entry.tol, NEAR)
    error = 0.0
    at = re.search(r"\bt\s*=\s*([^\s,;:)]+)", text)
    if at is not None:
        error = abs(run.t_end - ask.number(at[1].rstrip(".")))
        if error > tolerance:
            return Outcome(error, tolerance, f"reported at t = {run.t_end:.9g}")
    if status is Status.NON_UNIQUE:
        _, candidates = ask.motion.candidates()
        least = _at_least(text)
        if len(candidates) < least:
            return Outcome(
                float(least - len(candidates)), 0.0, f"{len(candidates)} continuations, expected {least}"
            )
    return Outcome(error, tolerance)


def _at_least(text: str) -> int:
    """How many continuations a text speaks of, at least two."""
    listed = re.search(r"\{([^{}]*)\}", text)
    if listed is not None:
        return len(listed[1].split(","))
    found = re.search(r"\b(\w+) (?:families|branches|solutions|continuations|continuation|modes)", text)
    count = _NUMBERS.get(found[1], 2) if found is not None else 2
    named = re.search(r"\b(\w+) codim-?\s?2 sliding", text)
    if named is not None:
        count = max(count, _NUMBERS.get(named[1], 1))
    return count + (1 if re.search(r"\band an? (?:direct )?exit|also (?:a |direct )?exit", text) else 0)


def reached(ask: Ask, time: float, releases: int) -> Any:
    """States at a time of all solutions, one a row. Raises MissingError where there is one only."""
    tree = ask.motion.tree(time, releases)
    if tree.unique:
        raise MissingError("the motion is unique")
    found = tree.reachable(time)
    if not found.complete:
        raise MissingError(f"not every solution was followed to t = {time:.9g}: {tree.message}")
    return found.x


@reads(
    r"reachable_(?:set_|interval_)?(?:(?P<state>{state})_)?at_(?P<time>[\d./]+)",
    "least and largest value of a state (the first) over all solutions at a time; or text with end points",
)
def _reachable(ask: Ask, match: re.Match[str]) -> Any:
    time = ask.number(match["time"])
    if isinstance(ask.entry.value, str):
        return _points(ask, reached(ask, time, 0))
    values = reached(ask, time, RELEASES)[:, ask.states.index(match["state"]) if match["state"] else 0]
    wanted = np.atleast_1d(ask.wanted())
    if wanted.shape != (2,):
        raise NotUnderstoodError("it is no interval")
    return [np.min(values), np.max(values)]


def _points(ask: Ask, ends: Any) -> Outcome:
    """Every point named in the text is the end of a branch, and every branch ends at one."""
    n = len(ask.states)
    found = [piece.split(",") for piece in re.findall(r"\(([^()]*,[^()]*)\)", str(ask.entry.value))]
    points = np.unique([[ask.number(v) for v in piece] for piece in found if len(piece) == n], axis=0)
    if points.size == 0:
        raise NotUnderstoodError("the text names no points")
    gaps = np.max(np.abs(ends[:, None, :] - points[None, :, :]), axis=2)
    error = float(max(np.max(np.min(gaps, axis=0)), np.max(np.min(gaps, axis=1))))
    tolerance = max(ask.entry.tol, NEAR)
    return Outcome(error, tolerance, "" if error <= tolerance else "the branches end elsewhere")
