"""Programs that choose by an index, a word, an order or a mask, and those that solve for their rates."""

import math
from enum import Enum
from typing import Any

import numpy as np
import pytest

from filippov.analysis import diagnose
from filippov.analysis.programs.agreement import disagreement
from filippov.analysis.programs.notes import ReadingError
from filippov.analysis.programs.reader import read_program
from filippov.analysis.programs.translation import translate

LEVELS = {1: 0.3, 0: 0.0, -1: -0.3}


def by_key(t, y):
    x, v = y
    return [v, -x - LEVELS[int(np.sign(v))]]


def by_condition(t, y):
    x, v = y
    return [v, -x + {True: -0.3, False: 0.3}[bool(v > 0)]]


def by_place(t, y):
    x, v = y
    return [v, -x - np.array([0.3, -0.3])[int(v < 0)]]


def by_word(t, y):
    x, v = y
    way = "ahead" if v > 0 else "back"
    match way:
        case "ahead":
            return [v, -x - 0.3]
        case _:
            return [v, -x + 0.3]


def by_word_of_a_helper(t, y):
    def way(speed):
        if speed > 0:
            return "ahead"
        return "back"

    x, v = y
    return [v, -x - {"ahead": 0.3, "back": -0.3}[way(v)]]


def by_largest(t, y):
    x, v = y
    return [v, -x + 0.3 * (np.argmax([v, -v]) - 0.5) * 2]


def by_table(t, y):
    x, v = y
    return [v, -x - (-0.3, 0.3)[np.searchsorted([0.0], v)]]


def by_mask(t, y):
    force = np.zeros(2)
    force[y > 0] += 0.3
    force[y < 0] = -0.3
    return [y[1], -y[0] - force[1]]


def by_norm(t, y):
    x, v = y
    with np.errstate(invalid="ignore"):
        return [v, -x - 0.3 * np.nan_to_num(v / np.linalg.norm([v], np.inf))]


def by_solving(t, y):
    x, v = y
    mass = np.array([[2.0, 0.5], [0.5, 1.0]])
    force = np.einsum("ij,j->i", mass, np.array([v, -x - 0.3 * np.sign(v)]))
    return np.linalg.solve(mass, force)


class Way(Enum):
    AHEAD = 1
    BACK = -1


def by_member(t, y):
    x, v = y
    way = Way.AHEAD if v > 0 else Way.BACK
    match way:
        case Way.AHEAD:
            level = 0.3
        case Way.BACK:
            level = -0.3
    return np.r_[v, -x - (level if way is not Way.BACK else -0.3)]


class Body:
    level = 0.15

    def friction(self, v):
        return self.level * np.sign(v)


class Heavy(Body):
    def friction(self, v):
        return 2 * super().friction(v)

    def rates(self, t, y):
        x, v = map(np.float64, np.split(y, 2))
        return np.r_[v, -x - self.friction(v)]


SAME = [
    by_member, Heavy().rates, by_key, by_condition, by_place, by_word, by_word_of_a_helper, by_largest,
    by_table, by_mask, by_norm, by_solving,
]  # fmt: skip


@pytest.mark.parametrize("program", SAME)
def test_15_5_dry_friction_is_found_however_it_is_chosen(program: Any) -> None:
    """x'' = -x - 0.3 sgn(x') from (1, 0) turns at -0.4 and stays at -0.2, half a period after that."""
    found = diagnose(program, (1, 0), (0, 8), max_calls=2000)
    assert found.solution is not None, str(found)
    assert [switch.slides for switch in found.switches].count(True) == 1
    times = [event.t for event in found.solution.events if abs(event.x[1]) < 1e-9]
    assert times == pytest.approx([math.pi, 2 * math.pi], abs=1e-9)
    assert found.solution.x_end == pytest.approx([-0.2, 0], abs=1e-9)


def double_pendulum(t, y):
    a, b, p, q = y
    mass = np.array([[2.0, np.cos(a - b)], [np.cos(a - b), 1.0]])
    force = np.array([-q**2 * np.sin(a - b) - np.sign(p), p**2 * np.sin(a - b) - np.sin(b) - np.sign(q - p)])
    return [p, q, *np.linalg.solve(mass, force)]


def ordered(t, y):
    least, second, *_, most = sorted(y)
    spread = np.std(y) + np.ptp(y[:2])
    return np.array([second - y[0], np.median(y) + least, -most - np.argmin(y), spread])


def placed(t, y):
    rates = -y
    rates[int(y[0] > 0) + int(y[1] > 0)] -= 1.0
    rates[np.digitize(y[3], [-0.5, 0.5])] += round(0.7 * np.sign(y[2]))
    return rates


def worded(t, y):
    way = "low" if y[0] < -0.3 else ("middle" if y[0] < 0.4 else "high")
    gain = {"low": 1.0, "middle": -2.0, "high": y[2]}[way]
    if way in {"low", "high"} and y[1] > 0:
        gain = 2 * gain
    det = np.linalg.det([[y[0], 1.0], [2.0, y[1]]])
    return [-gain, y[3] * (way != "high"), np.linalg.norm(y[:2], 1), det]


def masked(t, y):
    rates = y.copy()
    rates[rates < 0] *= -0.5
    rates[(y > 0.2) & (y < 1)] = y[0]
    return rates[[1, 0, 3, 2]]


def beyond(t, y):
    """What is 0 in a whole part of the states counts as >= 0, and not as > 0."""
    gap = 0.0 if abs(y[0]) < 0.5 else y[0] - 0.5 * np.sign(y[0])
    pull = 1.0 if gap >= 0 else -2.0
    push = y[1] if gap > 0 else 0.25
    over = max(abs(y[1]) - 0.5, 0.0)
    rest = np.sign(over) - np.sign(abs(y[2]) + y[2]) + (2.0 if over <= min(y[3], 0.0) else 0.0)
    return [pull, push, -1.0 if gap < 0 else 3.0, math.copysign(0.5, gap) + rest]


@pytest.mark.parametrize("program", [beyond, double_pendulum, ordered, placed, worded, masked])
def test_15_5_what_is_chosen_is_what_the_program_gives(program: Any) -> None:
    """At random states, by calls of the program itself."""
    translation = translate(read_program(program, 4), (0.1, 0.2, 0.3, 0.4), (0.0, 5.0))
    states = np.random.default_rng(1).normal(size=(4, 100))
    said, compared = disagreement(program, translation, np.linspace(0, 5, 100), states)
    assert not said, said
    assert compared > 100


def along_an_axis(t, y):
    return -y * np.linalg.norm(y.reshape(1, 4), axis=1)


def of_many(t, y):
    return np.sort(np.concatenate([y, -y]))[:4]


def singular(t, y):
    return np.linalg.solve(np.outer([1.0, 2, 3, 4], [1.0, 1, 1, 1]) * y[0], y)


def spectral(t, y):
    return -y * np.linalg.norm(y.reshape(2, 2), 2)


def endless(t, y):
    return [-[0.1, 0.2][min(1, int(abs(y[0])))], 0, 0, 0]


def into_an_array(t, y):
    out = np.zeros(4)
    np.multiply(y, -1, out=out)
    return out


def out_of_reach(t, y):
    return [math.sqrt(-2.0) * y[0], 0, 0, 0]


@pytest.mark.parametrize(
    ("program", "said"),
    [(into_an_array, "out= is not followed"), (out_of_reach, "ValueError"),
     (along_an_axis, "these arguments"), (of_many, "at most 4"), (singular, "singular"),
     (spectral, "order 1, 2 or inf"), (endless, "steps without end")],
)  # fmt: skip
def test_15_5_what_has_no_rule_is_refused_by_name(program: Any, said: str) -> None:
    with pytest.raises(ReadingError, match=said):
        read_program(program, 4)
