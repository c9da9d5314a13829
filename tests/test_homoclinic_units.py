"""Homoclinic orbits in other units of length, time and parameter: the value is known, whatever the units."""

from __future__ import annotations

from collections.abc import Callable
from math import sqrt
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq
from test_homoclinic import landing, right

from filippov import System, parameters, sign, states
from filippov.analysis.orbits.homoclinic import find_homoclinic

x, y = states("x y")
Case = tuple[Callable[[Any, Any, Any], Any], float, float, float, str | None]


def duffing(rng: np.random.Generator) -> Case:
    """u'' = u - u^3 + mu u'."""
    return lambda u, w, mu: (w, u - u**3 + mu * w), 0.0, rng.uniform(-0.05, 0.05), 0.01, None


def pieces(rng: np.random.Generator) -> Case:
    """A saddle at -1 in u < 0, a focus in u > 0."""
    c, k, centre = rng.uniform(-0.5, 0.1), rng.uniform(0.9, 2), rng.uniform(-0.2, 0.6)
    out, back = 0.5 * c + sqrt(0.25 * c**2 + 1), 0.5 * c - sqrt(0.25 * c**2 + 1)
    known = float(brentq(lambda mu: right(mu, k, centre, out) - back, -1.2, 1.2, xtol=1e-14))

    def field(u: Any, w: Any, mu: Any) -> Any:
        s = sign(x)
        return w, (1 - s) / 2 * (u + 1 + c * w) + (1 + s) / 2 * (mu * w - k * (u - centre))

    return field, known, 0.03, -1.0, None


def slides(rng: np.random.Generator) -> Case:
    """A pseudo-saddle, and a fold at which the orbit leaves its surface."""
    b = rng.uniform(0.5, 0.8)

    def rest(mu: float) -> float:
        return float(brentq(lambda u: mu * (u - 1) + b - (0.5 * u - b) * (u - 1 - mu * b), -0.4, 0.6))

    known = float(brentq(lambda mu: landing(mu, b) - rest(mu), 0.02, 0.6, xtol=1e-14))

    def field(u: Any, w: Any, mu: Any) -> Any:
        above, below, s = (mu * (u - 1) - (w - b), u - 1 + mu * (w - b)), (0.5 * u - b, 1.0), sign(y)
        return [(1 + s) / 2 * f + (1 - s) / 2 * g for f, g in zip(above, below, strict=True)]

    return field, known, -0.02, rest(known), "0"


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("draw", [duffing, pieces, slides])
def test_12_13_homoclinic_orbits_in_any_units(draw: Callable[..., Case], seed: int) -> None:
    rng = np.random.default_rng([seed, 17])
    field, known, beside, near, mode = draw(rng)
    length, time, unit = (float(10.0 ** rng.choice([-6, -3, 3, 6])) for _ in range(3))
    mu = parameters(mu=(known + beside) * unit).mu / unit
    rates = field(x / length, y / length, mu)
    system = System({q: rate * length / time for q, rate in zip((x, y), rates, strict=True)})
    found = find_homoclinic(system, (near * length, 0.0), free="mu", mode=mode, side=1)
    assert abs(found.value / unit - known) < 1e-8
