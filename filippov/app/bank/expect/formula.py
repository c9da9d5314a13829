"""Formulas that are claimed to hold along the motion, and quantities that are claimed to be kept."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
from sympy import Expr, atan2, sqrt

from filippov.app.bank.expect.slide import sliding_stretches
from filippov.app.bank.notation import formula
from filippov.app.bank.outcome import Ask, Outcome, reads
from filippov.app.bank.reason import MissingError, NotUnderstoodError
from filippov.base.errors import ModelError
from filippov.base.status import EventKind
from filippov.solving.solution import Segment

_ASIDE = re.compile(r"\s+\([^()]*(?:\([^()]*\)[^()]*)*\)")
_PHRASE = re.compile(r"\b(?:while|during|in|along) (?:the )?(?:sliding|sliding motion|stick|sticking)\b")
_CONTROL = ("equivalent control", "u_eq", "ueq", "sign value", "multiplier")


def stretches(ask: Ask) -> list[Segment]:
    """What a claim is about: the first sliding, where its name or text say so, else the whole motion."""
    text = f"{ask.entry.name} {ask.entry.value}".casefold()
    run = ask.motion.main
    if re.search(r"slid|stick|after_ent", text):
        return sliding_stretches(run)[:1]
    return [s for s in run.segments if s.t1 != s.t0]


def known_names(ask: Ask) -> dict[str, Any]:
    """States, parameters, entry and exit times and states, polar coordinates of two states."""
    names = dict(ask.motion.built.names)
    events = ask.motion.events()
    states = ask.motion.built.states
    if len(states) == 2:
        x, y = states
        names = {"theta": atan2(y, x), "r": sqrt(x**2 + y**2)} | names
    for kind, times, mark in (
        (EventKind.ENTRY, ("t_enter", "t_entry", "t_e", "te"), ("_e", "e", "_enter", "_entry")),
        (EventKind.EXIT, ("t_exit", "t_x", "tx"), ("_exit",)),
        (EventKind.CROSSING, ("t_cross", "t_c", "tc"), ("_cross",)),
    ):
        event = next((e for e in events if e.kind is kind), None)
        if event is None:
            continue
        for name in times:
            names.setdefault(name, event.t)
        for symbol, value in zip(states, event.x, strict=True):
            for end in mark:
                names.setdefault(symbol.name + end, float(value))
    for symbol, value in zip(states, ask.motion.built.x0, strict=True):
        for end in ("_0", "0"):
            names.setdefault(symbol.name + end, value)
    return names


def claims(text: str) -> list[tuple[str, str]]:
    """The equations in a text, left and right sides, without asides in brackets."""
    found = []
    for clause in re.split(r";|\band\b", text):
        for piece in _at_commas(_PHRASE.sub("", clause)):
            sides = _ASIDE.sub("", " " + piece).split("=") if piece.count("=") != 1 else piece.split("=")
            if len(sides) != 2:
                raise NotUnderstoodError(f"{piece.strip()[:60]!r} is no equation")
            found.append((sides[0].strip(), sides[1].strip()))
    return found


def _at_commas(text: str) -> list[str]:
    pieces, depth = [""], 0
    for character in text:
        depth += (character in "([{") - (character in ")]}")
        if character == "," and depth == 0:
            pieces.append("")
        else:
            pieces[-1] += character
    return [piece for piece in pieces if piece.strip()]


def _read(text: str, names: dict[str, Any]) -> Expr:
    """A side of an equation, x(t) standing for x. Raises NotUnderstoodError."""
    plain = re.sub(r"\b(\w+)\(t\)", lambda m: m[1] if m[1] in names else m[0], text)
    for attempt in (plain, _ASIDE.sub("", " " + plain)):
        try:
            return formula(attempt.strip(), names)
        except ModelError:
            continue
    raise NotUnderstoodError(f"{text[:60]!r} is no formula in known names")


def error_of(ask: Ask, left: str, right: str, where: list[Segment]) -> float:
    """Largest difference of the two sides over stretches of the motion."""
    names = known_names(ask)
    run = ask.motion.main
    about = _ASIDE.sub("", " " + left).strip().casefold()
    wanted = _read(right, names)
    got = None if about in _CONTROL else _read(left, names)
    worst = 0.0
    for stretch in where:
        times = np.linspace(stretch.t0, stretch.t1, 101)
        target = ask.motion.values(run, wanted, times)
        if got is None:
            inner = times[1:-1:5]
            target = target[1:-1:5]
            on = [i for i, sign in enumerate(stretch.mode) if sign == 0]
            if not on:
                raise MissingError("the motion does not slide there")
            values = np.array([ask.motion.velocity(run, float(t))[1][on[0]] for t in inner])
        else:
            values = ask.motion.values(run, got, times)
        worst = max(worst, float(np.max(np.abs(values - target))))
    return worst


@reads(r"(?P<state>{state})\(t\)|(?P<state2>{state})_of_t", "a formula in t that a state follows")
def _of_time(ask: Ask, match: re.Match[str]) -> Any:
    state = match["state"] or match["state2"]
    run = ask.motion.main
    where = [s for s in run.segments if s.t1 != s.t0]
    return _judged(ask, error_of(ask, state, str(ask.entry.value).rpartition("=")[2], where))


def _judged(ask: Ask, error: float) -> Outcome:
    tolerance = max(ask.entry.tol, 1e-9 if ask.entry.tol == 0 else 0.0)
    return Outcome(error, tolerance, "" if error <= tolerance else "the formula does not hold")


@reads(
    r"\w*(?:_law|_invariant|_relation|_identity|_formula)|invariant|after_entry|while_sliding|sliding_solution|closed_form|\w+_is_conserved",
    "equations (left = right; ...) in t, states and parameters that hold along the motion or its first "
    "sliding; an expression without = is constant",
)
def _law(ask: Ask, match: re.Match[str]) -> Any:
    text = ask.entry.value
    if not isinstance(text, str):
        return _invariant_value(ask, match)
    if "=" not in text:
        return _constant(ask, match)
    where = stretches(ask)
    return _judged(ask, max(error_of(ask, left, right, where) for left, right in claims(text)))


@reads(
    r"first_integral(?!_value)\w*|conserved\w*|constant_of_motion\w*",
    "an expression that is constant along the motion, or along its first sliding",
)
def _constant(ask: Ask, _match: re.Match[str]) -> Any:
    if not isinstance(ask.entry.value, str):
        return _invariant_value(ask, _match)
    expression = _read(
        ask.entry.value.partition("=")[0]
        if "=" not in ask.entry.value
        else ask.entry.value.rpartition("=")[2],
        known_names(ask),
    )
    if not expression.free_symbols & set(ask.motion.built.states):
        raise NotUnderstoodError("it has no states")
    spread = 0.0
    for values in _along(ask, expression):
        spread = max(spread, float(np.ptp(values)))
    return _judged(ask, spread)


def _along(ask: Ask, expression: Expr) -> list[Any]:
    run = ask.motion.main
    return [ask.motion.values(run, expression, np.linspace(s.t0, s.t1, 401)) for s in stretches(ask)]


@reads(
    r"(?:first_integral|invariant|conserved)_value",
    "the value of the expression that another expectation names as a first integral",
)
def _invariant_value(ask: Ask, _match: re.Match[str]) -> Any:
    wanted = float(ask.wanted())
    for entry in ask.case.expected:
        if (
            re.search(r"first_integral|invariant|conserved", entry.name)
            and entry.name != ask.entry.name
            and isinstance(entry.value, str)
        ):
            about = Ask(ask.case, entry, ask.motion)
            values = np.concatenate(_along(about, _read(entry.value, known_names(ask))))
            return values[int(np.argmax(np.abs(values - wanted)))]
    raise NotUnderstoodError("no other expectation gives its expression")
