"""np.piecewise, match, np.vdot, np.amax, np.nan_to_num and divmod in programs: the field at random states."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from filippov.analysis import diagnose
from filippov.analysis.programs.agreement import disagreement
from filippov.analysis.programs.notes import ReadingError
from filippov.analysis.programs.reader import read_program
from filippov.analysis.programs.translation import translate

GEAR, RISE, FALL = 2, 1.5, -0.75


def two_pieces(t, y):
    return [y[1], -np.piecewise(y[1], [y[1] < 0, y[1] >= 0], [-1.0, 0.5])]


def with_default(t, y):
    return [y[1], np.piecewise(y[0], [y[0] < -0.5, y[0] > 0.5], [RISE, FALL, lambda u: u**2])]


def zero_elsewhere(t, y):
    return [y[1], np.piecewise(y[0], [y[0] > 0.3], [lambda u: -u])]


def later_ones_win(t, y):
    return [y[1], np.piecewise(y[0], [y[0] > -0.5, y[0] > 0.5], [1.0, 2.0, 3.0])]


def of_an_array(t, y):
    return np.piecewise(y, [y < -0.2, y > 0.2], [lambda u: u + 1, np.sin, 0.25])


def one_condition(t, y):
    return np.piecewise(y, y < 0.1, [-1.0, 1.0])


def with_arguments(t, y):
    pieces = [lambda u, k, c=0: k * u + c, lambda u, k, c=0: -k]
    return [y[1], np.piecewise(y[0], [y[0] < 0], pieces, 3.0, c=0.5)]


def named_pieces(t, y):
    def drag(u):
        return 0.3 * u if u > -1 else -0.3

    pieces = np.piecewise(x=y[1], condlist=[y[1] < -0.2], funclist=[drag, math.sin])
    return [y[1], -pieces]


def of_time(t, y):
    return [np.piecewise(t, [t < 1, t >= 2], [1.0, -1.0, 0.0]), -y[1]]


def gears(t, y):
    match int(y[1] > 0) + int(y[1] > 0.5):
        case 0:
            force = -1.0
        case 1:
            force = 0.25
        case _:
            force = 2.0
    return [y[1], force]


def returning(t, y):
    match np.sign(y[0]):
        case 1:
            return [y[1], -1.0]
        case -1.0:
            return [y[1], 1.0]
    return [y[1], 0.0]


def either(t, y):
    match int(t) % 4:
        case 0 | 2:
            push = 1.0
        case 1:
            push = -1.0
        case other:
            push = other / 2
    return [y[1], push - y[1]]


def guarded(t, y):
    match y[1]:
        case w if w > 0.5:
            return [w, -w]
        case w if w < -0.5 or y[0] > 0:
            return [w, 1.0]
        case _ if t > 1:
            return [y[0], 0.5]
        case w:
            return [w, 2 * w]


def on_a_number(t, y):
    match GEAR:
        case 1:
            return [y[1], -1.0]
        case 2:
            return [y[1], -np.sign(y[1])]


def on_text(t, y, law="coulomb"):
    match law:
        case "viscous":
            force = -y[1]
        case "coulomb" | "dry":
            force = -np.sign(y[1])
        case None:
            force = 0.0
    return [y[1], force]


def on_a_pair(t, y):
    match int(y[0] > 0), int(y[1] > 0):
        case 1, 1:
            return [1.0, 2.0]
        case [0, k]:
            return [3.0, k]
        case (1, 0, _):
            return [9.0, 9.0]
        case (1, _) | _:
            return [5.0, y[0]]


def names_are_kept(t, y):
    k, n = 7.0, 3.0
    match int(y[0] > 0), y[1]:
        case (0, k):
            pass
        case (1, n) if n > 0.3:
            k = 1.0
    return [k, n]


def in_a_loop(t, y):
    out = 0.0
    for k in range(4):
        match k:
            case 0:
                continue
            case 3:
                break
            case _:
                out += np.sign(y[0] - 0.2 * k) * k
    return [y[1], -out]


def whole_product(t, y):
    force = np.array([0.4, -0.7])
    return [y[1], -np.sign(np.vdot(force, y)) + np.vdot(2.0, y[0])]


def matrix_product(t, y):
    return [y[1], -np.vdot(np.array([[1.0, 2.0]]), y.reshape(1, 2))]


def extremes(t, y):
    return [np.amax(y), np.amin([y[0], y[1], 0.2]) - np.amax(np.array([y[1], -0.1]))]


def cleaned(t, y):
    y = np.nan_to_num(y)
    return [y[1], -np.nan_to_num(np.sign(y[1]), nan=0.0, posinf=1e9) - np.nan_to_num(y[0], copy=True)]


def quotient_and_rest(t, y):
    turns, rest = divmod(t, 1.5)
    return [y[1], 1.0 if rest < 0.5 else -0.25 * (turns > 0)]


def numpys_quotient(t, y):
    turns, rest = np.divmod(t + 0.25, 0.75)
    n, r = divmod(7, 3)
    return [rest * n + r, turns]


FOLLOWED = [
    two_pieces, with_default, zero_elsewhere, later_ones_win, of_an_array, one_condition, with_arguments,
    named_pieces, of_time, gears, returning, either, guarded, on_a_number, on_text, on_a_pair, names_are_kept,
    in_a_loop,    whole_product, matrix_product, extremes, cleaned, quotient_and_rest, numpys_quotient,
]  # fmt: skip


@pytest.mark.parametrize("f", FOLLOWED, ids=lambda f: f.__name__)
def test_the_field_that_is_read_is_that_of_the_program(f: Callable[..., Any]) -> None:
    """At 40 states and times, and at those beside each surface that `disagreement` looks at."""
    translation = translate(read_program(f, 2), (0.1, 0.2), (0.0, 4.0))
    states = np.random.default_rng(3).normal(size=(2, 40))
    said, compared = disagreement(f, translation, np.linspace(0.01, 3.9, 40), states)
    assert not said
    assert compared >= 40


def test_a_motion_through_pieces_and_one_through_cases_are_the_known_ones() -> None:
    """v' = 1 below 0 and -0.5 above: from v = 1 at rest after 2, and it stays; 3 gears in v' = 0.25 and 2."""
    still = diagnose(two_pieces, (0.0, 1.0), (0, 5), max_calls=3000)
    assert still.solution is not None, str(still)
    assert still.solution.x_end == pytest.approx([1.0, 0.0], abs=1e-9)
    assert [event.t for event in still.solution.events] == pytest.approx([2.0], abs=1e-9)
    shifted = diagnose(gears, (0.0, 0.1), (0, 2), max_calls=3000)
    assert shifted.solution is not None, str(shifted)
    assert shifted.solution.x_end[1] == pytest.approx(0.5 + 2.0 * (2 - 1.6), abs=1e-9)


def asks_for_true(t, y):
    match y[0] > 0:
        case True:
            return [-1.0, 0.0]
    return [1.0, 0.0]


def asks_for_a_class(t, y):
    match y[0]:
        case float():
            return [-1.0, 0.0]
    return [1.0, 0.0]


def asks_for_the_rest(t, y):
    match (1, 2, 3):
        case (1, *rest):
            return [-y[0], rest[0]]
    return [1.0, 0.0]


def asks_for_keys(t, y):
    match {"a": 1}:
        case {"a": k}:
            return [-y[0], k]
    return [1.0, 0.0]


def asks_for_names_in_either(t, y):
    match int(y[0] > 0), y[1]:
        case (0, k) | (k, 0):
            return [-y[0], k]
    return [1.0, 0.0]


def asks_an_array(t, y):
    match y:
        case (a, b):
            return [b, a]
    return [1.0, 0.0]


def too_many_pieces(t, y):
    return [y[1], np.piecewise(y[0], [y[0] > 0], [1.0, 2.0, 3.0])]


def of_a_whole_number(t, y):
    return [y[1], np.piecewise(2, [y[0] > 0], [1.5, 2.5])]


def sorted_ones(t, y):
    return [y[1], np.argsort(y)[0]]


def wound(t, y):
    return [y[1], divmod(y[0], 1.5)[1]]


REFUSED = [
    (asks_for_true, 2, "case True"), (asks_for_a_class, 2, "write its cases with if"),
    (asks_for_the_rest, 2, "write its cases with if"), (asks_for_keys, 2, "write its cases with if"),
    (asks_for_names_in_either, 2, "write its cases with if"), (asks_an_array, 2, "an array"),
    (too_many_pieces, 1, "1 condition"), (of_a_whole_number, 1, "whole number"),
    (sorted_ones, 1, "write its cases with if"), (wound, 1, "steps without end"),
]  # fmt: skip


@pytest.mark.parametrize(("f", "line", "said"), REFUSED, ids=lambda f: getattr(f, "__name__", ""))
def test_what_is_not_followed_is_refused_by_line(f: Callable[..., Any], line: int, said: str) -> None:
    with pytest.raises(ReadingError) as caught:
        translate(read_program(f, 2), (0.1, 0.2), (0.0, 4.0))
    assert said in str(caught.value)
    assert caught.value.line == f.__code__.co_firstlineno + line
