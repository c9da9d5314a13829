"""Stick and slip end where the slip grazes the belt, with static friction above the sliding one.

x'' = -x - c x' - Fc sgn(x' - V), Fs in stick. Slip begins at x = Fs - c V, v = V and is linear: it comes
back to the belt while the first maximum of its speed exceeds V. The largest V is that at which it equals V.
"""

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from filippov import Surface, System, parameters, sign, states
from filippov.analysis import continuation, find_orbit

x, v = states("x v")
p = parameters(V=0.1, c=0.1, Fc=0.5, ratio=2.0)
belt = Surface("belt", v - p.V, radius=p.ratio)
block = System({x: v, v: -x - p.c * v - p.Fc * sign(v - p.V)}, surfaces=[belt])


def largest(c: float, fc: float, ratio: float) -> float:
    w = math.sqrt(1 - c * c / 4)

    def above(speed: float) -> float:
        y = fc * (ratio - 1) - c * speed  # from the middle of the slip, x = Fc
        b = -(y + c / 2 * speed) / w  # v = exp(-c t/2) (V cos wt + b sin wt)
        size, phase = math.hypot(speed, b), math.atan2(b, speed)
        top = 2 * math.pi + phase - math.atan2(c / 2, w)  # w t of the maximum behind the minimum
        return size * math.exp(-c / 2 * top / w) * math.cos(top - phase) - speed

    return float(brentq(above, 1e-6, 50, xtol=1e-14))


def test_the_branch_ends_at_the_largest_speed_and_is_named() -> None:
    random = np.random.default_rng(3)
    for _ in range(4):
        c, fc, ratio = random.uniform(0.05, 0.4), random.uniform(0.2, 2), random.uniform(1.3, 3)
        last = largest(c, fc, ratio)
        values = {"c": c, "Fc": fc, "ratio": ratio, "V": 0.7 * last}
        start = (values["Fc"] * values["ratio"] - values["c"] * values["V"], values["V"] * (1 - 1e-9))
        orbit = find_orbit(block, start, parameters=values)
        assert orbit.word == "stick slip-"
        run = continuation(block, orbit, parameter="V", bounds=(0.5 * last, 2 * last)).run()
        (point,) = run.special
        assert point.special == "grazing-sliding"
        assert point.value == pytest.approx(last, rel=1e-6)
