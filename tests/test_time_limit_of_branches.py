"""`max_time` of a continuation holds within a point too: where each takes long, what was found is kept."""

from __future__ import annotations

import math

import numpy as np
import sympy as sp

from filippov import System, parameters, sign, sqrt, states, t
from filippov.analysis import continuation, find_orbit
from filippov.analysis.orbits.time_limit import time_left

W, Z, STIFF = 0.8, 0.1, 10.0


def rotor() -> tuple[System, tuple[float, ...]]:
    """A rotor in a ring with clearance 1, and a state of its circular whirl: it touches all along at once."""
    p = parameters(e=0.3)
    x, y, u, v = states("x y u v")
    radius = sqrt(x**2 + y**2)
    push = STIFF * (1 - 1 / radius) * (1 + sign(radius - 1)) / 2
    field = {
        x: u,
        y: v,
        u: -2 * Z * u - x - push * x + p.e * W**2 * sp.cos(W * t),
        v: -2 * Z * v - y - push * y + p.e * W**2 * sp.sin(W * t),
    }
    r = 0.3 * W**2 / (1 - W**2 + 2j * Z * W)
    return System(field, parameters=p), (r.real, r.imag, (1j * W * r).real, (1j * W * r).imag)


def test_a_branch_ends_in_time_where_its_next_point_would_take_minutes() -> None:
    """The whirl fills the ring at e = |1 - w^2 + 2 i z w| / w^2 = 0.61555; beside it events never end."""
    system, x0 = rotor()
    orbit = find_orbit(system, x0, period=2 * math.pi / W)
    branch = continuation(system, orbit, parameter="e", bounds=(0.2, 0.61), max_time=4).run()
    assert branch.message.endswith("cut off by max_time = 4 s of the wall clock")
    values = np.array([point.value for point in branch.points])
    assert len(values) >= 3
    assert np.all(np.diff(values) > 0)
    assert values[-1] < abs(1 - W**2 + 2j * Z * W) / W**2
    # The limit was that of the branch: others go on.
    assert time_left() == math.inf
    assert branch.points[0].value == 0.3
