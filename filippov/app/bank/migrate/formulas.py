"""Names of formulas that should hold along the solution, and of quantities that should be constant."""

from __future__ import annotations

import re
from typing import Any

from filippov.app.bank.case_runs import CaseRuns
from filippov.app.bank.measures.along import Along
from filippov.app.bank.measures.events import OneEvent
from filippov.app.bank.measures.measure import Formula, Measure
from filippov.app.bank.migrate.rule import Groups, Old, Reading, enter
from filippov.app.bank.notation import formula
from filippov.app.bank.outcome import NotUnderstoodError
from filippov.base.errors import ModelError
from filippov.base.names import parts
from filippov.model.expression import FUNCTIONS

_ASIDE = re.compile(r"\s+\([^()]*(?:\([^()]*\)[^()]*)*\)")
_PHRASE = re.compile(r"\b(?:while|during|in|along) (?:the )?(?:sliding|sliding motion|stick|sticking)\b")
_CONTROL = ("equivalent control", "u_eq", "ueq", "sign value", "multiplier")
_WORD = re.compile(r"[^\W\d]\w*")
# Kind of event, names of its time, suffix of the names of states there.
_MARKS: tuple[tuple[Any, str, str], ...] = (
    ("slide", "t_enter t_entry t_e te", "_e e _enter _entry"), ("exit", "t_exit t_x tx", "_exit"),
    ("cross", "t_cross t_c tc", "_cross"),
)  # fmt: skip
_SIGN = "sgn_value"


def _over(old: Old) -> Any:
    """The range of a claim: the first sliding, where its name or text say so, else the whole solution."""
    text = f"{old.name} {old.value}".casefold()
    return "first_sliding" if re.search(r"slid|stick|after_ent", text) else "span"


def _known(old: Old) -> dict[str, Measure]:
    """Names of times and states at the first entry, exit and crossing, and of the start."""
    known: dict[str, Measure] = {}
    for kind, times, marks in _MARKS:
        known |= {name: OneEvent(kind) for name in times.split()}
        rows = [(state, state + mark) for state in old.states for mark in marks.split()]
        known |= {name: OneEvent(kind, take=state) for state, name in rows if name not in known}
    for state, value in zip(old.states, old.runs.built.x0, strict=True):
        for mark in ("_0", "0"):
            known.setdefault(state + mark, Formula(repr(value)))
    return {name: measure for name, measure in known.items() if name not in old.runs.names}


def _claims(text: str) -> list[tuple[str, str]]:
    """The equations in a text, left and right sides, without remarks in brackets."""
    found = []
    for clause in re.split(r";|\band\b", text):
        for piece in parts(_PHRASE.sub("", clause)):
            sides = _ASIDE.sub("", " " + piece).split("=") if piece.count("=") != 1 else piece.split("=")
            if len(sides) != 2:
                raise NotUnderstoodError(f"{piece.strip()[:60]!r} is no equation")
            found.append((sides[0].strip(), sides[1].strip()))
    return found


def _side(old: Old, text: str) -> tuple[str, dict[str, Measure]]:
    """A side of an equation as a formula, with x for x(t), and the meaning of its names."""
    names, known = old.runs.names, _known(old)
    polar = {}
    if len(old.states) == 2:
        x, y = old.states
        polar = {"theta": f"atan2({y},{x})", "r": f"sqrt({x}**2+{y}**2)"}
    plain = re.sub(r"\b(\w+)\(t\)", lambda m: m[1] if m[1] in names or m[1] in polar else m[0], text)
    for attempt in (plain, _ASIDE.sub("", " " + plain)):
        words = set(_WORD.findall(attempt)) - set(FUNCTIONS)
        where = {name: known[name] for name in sorted(words & set(known))}
        put = {name: value for name, value in polar.items() if name not in names}
        written = _WORD.sub(lambda m, put=put: f"({put[m[0]]})" if m[0] in put else m[0], attempt).strip()  # type: ignore[misc]
        try:
            formula(written, {**names, **dict.fromkeys(where, 1)})
        except ModelError:
            continue
        return written, where
    raise NotUnderstoodError(f"{text[:60]!r} is no formula in known names")


def _holds(old: Old, left: str, right: str, over: Any) -> Any:
    """That two sides are equal along the solution; the left one may be the value of the sign in words."""
    wanted, where = _side(old, right)
    atol = old.tol or 1e-9
    if _ASIDE.sub("", " " + left).strip().casefold() in _CONTROL:
        return old.e(Along(f"{_SIGN}-({wanted})", over=over, where=where, signs=(_SIGN,)), value=0, atol=atol)
    got, more = _side(old, left)
    return old.e(Along(f"({got})-({wanted})", over=over, where=where | more), value=0, atol=atol)


def _of_time(old: Old, g: Groups) -> list[Reading]:
    return [Reading((_holds(old, g["state"], old.text.rpartition("=")[2], "span"),))]


def _law(old: Old, _: Groups) -> list[Reading]:
    if not isinstance(old.value, str) or "=" not in old.value:
        return _kept(old, _)
    return [Reading(tuple(_holds(old, left, right, _over(old)) for left, right in _claims(old.value)))]


def _kept(old: Old, _: Groups) -> list[Reading]:
    """An expression that is constant along the solution, or along its first sliding."""
    if not isinstance(old.value, str):
        return _of_value(old, _)
    text, where = _side(old, old.text.rpartition("=")[2])
    if not set(_WORD.findall(text)) & set(old.states):
        raise NotUnderstoodError("it has no states")
    return old.one(Along(text, "spread", _over(old), where), value=0, atol=old.tol or 1e-9)


def _of_value(old: Old, _: Groups) -> list[Reading]:
    """The value of the expression that another expectation names as a first integral."""
    wanted = float(old.wanted())
    for entry in old.case.expected:
        about = Old(old.case, entry, entry.name, old.subject)
        integral = re.search(r"first_integral|invariant|conserved", entry.name)
        if integral and entry is not old.entry and isinstance(about.value, str):
            text, where = _side(about, about.value)
            return old.one(Along(f"({text})-({wanted!r})", over=_over(about), where=where), value=0)
    raise NotUnderstoodError("no other expectation gives its expression")


enter(
    CaseRuns,
    (r"(?P<state>{state})\(t\)|(?P<state2>{state})_of_t", _of_time),
    ((r"\w*(?:_law|_invariant|_relation|_identity|_formula)|invariant|after_entry|while_sliding"
     r"|sliding_solution|closed_form|\w+_is_conserved"),
     _law),
    (r"first_integral(?!_value)\w*|conserved\w*|constant_of_motion\w*", _kept),
    (r"(?:first_integral|invariant|conserved)_value", _of_value),
)  # fmt: skip
