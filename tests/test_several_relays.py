"""Several relays with hysteresis on one signal, as in a Preisach operator of few relays.

Each relay follows the signal u alone: its sign changes where u passes c - w or c + w. The oracle finds these
passages one relay at a time from the formula of u.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

from filippov import Surface, System, cos, sin, solve, states, t

x, y = states("x y")
END = 20.0


def passages(guard, width):
    """Times at which a relay switches, and the integral of its sign over the span."""
    times = np.linspace(0, END, 100001)
    h = guard(times)
    sign, last, total, out = (1.0 if h[0] > 0 else -1.0), 0.0, 0.0, []
    while True:
        beyond = np.flatnonzero((h * sign < -width) & (times > last))
        if beyond.size == 0:
            return out, total + sign * (END - last)
        k = beyond[0]
        at = brentq(lambda T, way: guard(T) * way + width, times[k - 1], times[k], (sign,), xtol=1e-14)
        total, last, sign = total + sign * (at - last), at, -sign
        out.append(at)


@pytest.mark.parametrize("seed", range(24))
def test_each_relay_keeps_its_own_thresholds(seed):
    """A relay inside its band, below h = 0, counted as passed when another was landed on."""
    draw = np.random.default_rng(seed)
    relays = [(draw.uniform(-1, 1), draw.uniform(0.05, 0.8)) for _ in range(draw.integers(2, 5))]
    if seed % 3 == 0:
        relays[1] = (relays[0][0] + 0.25, relays[0][1] + 0.25)  # both are left upwards at the same u
    a, b, w, r = draw.uniform(0.5, 2), draw.uniform(-0.3, 0.3), draw.uniform(0.5, 3), draw.uniform(0.5, 3)

    def signal(at, sine=np.sin, cosine=np.cos):
        return a * sine(w * at) * (1 + 0.3 * cosine(r * at)) + b * at / 5

    u = signal(t, sin, cos)
    of_state = seed % 2 == 1
    level = (lambda c: y**3 + y - c) if of_state else (lambda c: u - c)
    system = System(
        {x: sum((k + 1) * np.sign(level(c)) for k, (c, _) in enumerate(relays))}
        | ({y: u.diff(t)} if of_state else {}),
        surfaces=[Surface(f"r{k}", level(c), width=width) for k, (c, width) in enumerate(relays)],
    )
    run = solve(system, (0.0, 0.0) if of_state else (0.0,), (0, END))
    assert run.success
    expected, total = [], 0.0
    for k, (c, width) in enumerate(relays):

        def guard(at, c=c):
            value = signal(at)
            return (value**3 + value if of_state else value) - c

        switches, mean = passages(guard, width)
        assert np.allclose(run.events.of(f"r{k}").t, switches, rtol=0, atol=1e-7)
        expected, total = [*expected, *switches], total + (k + 1) * mean
    assert len(run.events) == len(expected)
    assert abs(run.x_end[0] - total) < 1e-7


def test_relay_that_no_signal_reaches():
    """u of 0.18 at most: a relay that is left at u = -0.6 was switched at t = 2.376, where u is 0.165."""
    u = t * sin(t) / 10
    system = System(
        {x: np.sign(u) + 2 * np.sign(u + 0.1)},
        surfaces=[Surface("a", u, width=0.3), Surface("b", u + 0.1, width=0.5)],
    )
    run = solve(system, (0.0,), (0, 9))
    first = brentq(lambda T: T * np.sin(T) / 10 + 0.3, 3, 4.5, xtol=1e-14)
    second = brentq(lambda T: T * np.sin(T) / 10 - 0.3, 6, 7, xtol=1e-14)
    assert [(e.surface) for e in run.events] == ["a", "a"]
    assert np.allclose(run.events.t, [first, second], rtol=0, atol=1e-9)
    assert abs(run.x_end[0] - (first - (second - first) + (9 - second) + 2 * 9)) < 1e-8
