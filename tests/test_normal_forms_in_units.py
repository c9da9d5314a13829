"""Normal forms of folds and Hopf points in any units of states, time and parameter, in closed form."""

from __future__ import annotations

import os
from math import sqrt

import numpy as np
import pytest
from test_codim2 import first

from filippov import System, parameters, states
from filippov.analysis.bifurcations.continuation import continuation

x, y = states("x y")
DRAWS = {"nightly": 200}.get(os.environ.get("FILIPPOV_PROFILE", ""), 12)


def _units(seed: int, key: int) -> list[float]:
    return (10.0 ** np.random.default_rng([seed, key]).integers(-7, 8, 4)).tolist()


@pytest.mark.parametrize("seed", range(DRAWS))
def test_folds_in_any_units(seed: int) -> None:
    """u' = m - a + s (u - c)^2, w' = -w + k u: u = c +- sqrt(-s (m - a))."""
    rng, (ux, uy, ut, um) = np.random.default_rng([31, seed]), _units(seed, 31)
    a, k, s = rng.uniform(0.1, 0.4), rng.uniform(0.5, 2), (-1, 1)[seed % 2]
    # Off 0, where a state does not tell its unit.
    c = rng.uniform(1, 2) * rng.choice([-1, 1])
    p = parameters(m=um)
    u, w, m = x / ux, y / uy, p.m / um
    system = System({x: (m - a + s * (u - c) ** 2) * ux / ut, y: (k * u - w) * uy / ut})
    start = a - 0.3 * s
    at = c + s * sqrt(0.3) if seed % 3 else c - s * sqrt(0.3)
    run = continuation(
        system, (at * ux, k * at * uy), parameter="m", value=start * um, direction=s, mode="",
        bounds=sorted((um * (a - 0.3 * s - s), um * (a + s))),
    )  # fmt: skip
    point = first(run, "fold")
    assert point.value == pytest.approx(a * um, rel=1e-9)
    inside, outside = point.predicts.split(", none for m ")
    assert inside.startswith(f"two solutions for m {'<' if s > 0 else '>'} ")
    assert float(outside.split()[-1]) == pytest.approx(a * um, rel=1e-5)
    assert point.coefficients["root x"] == pytest.approx(ux / sqrt(um), rel=1e-5)
    assert point.coefficients["root y"] == pytest.approx(k * uy / sqrt(um), rel=1e-5)


@pytest.mark.parametrize("seed", range(DRAWS))
def test_hopf_points_in_any_units(seed: int) -> None:
    """In the plane r' = (m - a) r - s r^3, turning at the rate b about (c, d): a cycle of r^2 = s (m - a)."""
    rng, (ux, uy, ut, um) = np.random.default_rng([37, seed]), _units(seed, 37)
    a, b, s = rng.uniform(0.1, 0.4), rng.uniform(0.5, 2), (-1, 1)[seed % 2]
    c, d = rng.uniform(-2, 2, 2) * (seed % 3 > 0)
    p = parameters(m=um)
    u, w, m = x / ux - c, y / uy - d, p.m / um
    ring = m - a - s * (u**2 + w**2)
    system = System({x: (ring * u - b * w) * ux / ut, y: (b * u + ring * w) * uy / ut})
    run = continuation(
        system, (c * ux, d * uy), parameter="m", value=0.0, direction=1, mode="", bounds=(-um, um)
    )
    point = first(run, "Hopf")
    assert point.value == pytest.approx(a * um, rel=1e-8)
    words = "supercritical: a stable cycle for m >" if s > 0 else "subcritical: an unstable cycle for m <"
    assert point.predicts.startswith(words)
    assert float(point.predicts.split()[-1]) == pytest.approx(a * um, rel=1e-5)
    assert point.coefficients["frequency"] * ut == pytest.approx(b, rel=1e-8)
    assert point.coefficients["rate"] * ut * um == pytest.approx(1, rel=1e-6)
    # Half the way from end to end of the cycle.
    assert point.coefficients["root x"] == pytest.approx(ux / sqrt(um), rel=1e-5)
    assert point.coefficients["root y"] == pytest.approx(uy / sqrt(um), rel=1e-5)
