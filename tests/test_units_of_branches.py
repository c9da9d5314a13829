"""Branches of equilibria in any units of states, time and parameter, against closed forms.

Each member is a system with known special points over m, its states in units of 1e-6 to 1e6 in either order,
perhaps with a surface that it never reaches.
"""

from __future__ import annotations

import os

import numpy as np
import pytest

from filippov import Surface, System, parameters, sign, states
from filippov.analysis import continuation

DRAWS = 279 if os.environ.get("FILIPPOV_PROFILE") == "nightly" else 18
x, y, w = states("x y w")
# Equations by (m, x, y, w) in units of 1, a start, its m, bounds, special points.
KINDS = {
    "fold": (lambda m, a, b, c: [m - a * a + b, -2 * b], (1.0, 0.0), 1.0, (-1.0, 1.5), {"fold": [0.0]}),
    "hopf": (
        lambda m, a, b, c: [m * a - 3 * b - a * (a * a + b * b), 3 * a + m * b - b * (a * a + b * b)],
        (0.0, 0.0), -0.5, (-1.0, 1.0), {"Hopf": [0.0]},
    ),
    "hopf beside": (
        lambda m, a, b, c: [m * a - 3 * b + c, 3 * a + m * b - b * a * a, -1e5 * c],
        (0.0, 0.0, 0.0), -0.5, (-1.0, 1.0), {"Hopf": [0.0]},
    ),
    "pitchfork": (
        lambda m, a, b, c: [m * a - a**3 + b, -b], (0.0, 0.0), -0.5, (-1.0, 1.0), {"branch point": [0.0]},
    ),
    "friction": (
        lambda m, a, b, c: [b, -a - b - 2 * sign(b - 1) + m], (2.0, 0.0), 0.0, (-1.0, 1.0), {},
    ),
    "relay": (
        lambda m, a, b, c: [m - a + b, -b - 2 * sign(a)], (1.0, -2.0), 3.0, (-4.0, 4.0),
        {"boundary equilibrium": [-2.0, 2.0]},
    ),
}  # fmt: skip


# At 279 the contact of the far surface was sought with a singular matrix.
@pytest.mark.parametrize("seed", [*range(DRAWS), 279])
def test_special_points_do_not_depend_on_units(seed: int) -> None:
    rng = np.random.default_rng(seed)
    name = list(KINDS)[seed % len(KINDS)]
    equations, start, at, bounds, expected = KINDS[name]
    n = len(start)
    sizes, time, unit = 10.0 ** rng.uniform(-6, 6, n), 10.0 ** rng.uniform(-6, 6), 10.0 ** rng.uniform(-6, 6)
    q = parameters(m=1.0)
    scaled = [s / size for s, size in zip((x, y, w), sizes, strict=False)] + [0] * (3 - n)
    field = equations(q.m / unit, *scaled)
    rows = list(zip((x, y, w), sizes, field, strict=False))
    order = rng.permutation(n)
    far = [Surface("far", x / sizes[0] - 1e3, reset={x: 0 * x}, side="-")] if rng.random() < 0.4 else []
    system = System(
        {s: size / time * f for s, size, f in (rows[i] for i in order)}, surfaces=far, parameters=q
    )
    mode = "".join("-" if s == "far" or name == "friction" else "+" for s in system.surface_names)
    branch = continuation(
        system, tuple((np.array(start) * sizes)[order]), parameter="m", mode=mode, value=at * unit,
        bounds=(bounds[0] * unit, bounds[1] * unit), direction=-1 if name == "fold" else 0,
    ).run()  # fmt: skip
    got = {kind: [] for kind in expected}
    for point in branch.special:
        got.setdefault(point.special, []).append(point.value / unit)
    assert got.keys() == expected.keys(), branch.message
    for kind, values in expected.items():
        assert np.allclose(sorted(got[kind]), values, rtol=0, atol=1e-7)
    assert "bound reached" in branch.message
    assert len(branch.points) < 150
    if name == "fold":
        (turn,) = branch.special
        assert turn.coefficients["root x"] == pytest.approx(sizes[0] / np.sqrt(unit), rel=1e-5)
        assert "two solutions for m >" in turn.predicts
    if name == "hopf":
        (born,) = branch.special
        assert born.coefficients["frequency"] == pytest.approx(3.0 / time, rel=1e-6)
        assert born.predicts.startswith("supercritical: a stable cycle")
        assert born.coefficients["root x"] == pytest.approx(sizes[0] / np.sqrt(unit), rel=1e-4)


@pytest.mark.parametrize("states_", [12])
@pytest.mark.parametrize("rate", [1e-6, 1.0, 1e6])
def test_a_pair_beside_many_states(states_: int, rate: float) -> None:
    """The product of the sums of all pairs is 0 or infinite there."""
    q = parameters(m=1.0)
    names = states(" ".join(f"z{i}" for i in range(states_)))
    rest = {z: -rate * (1 + i) * z for i, z in enumerate(names[2:])}
    a, b = names[:2]
    system = System({a: rate * (q.m * a - b), b: rate * (a + q.m * b), **rest}, parameters=q)
    branch = continuation(
        system, (0.0,) * states_, parameter="m", bounds=(-0.7, 1.0), value=-0.5, mode=""
    ).run()
    assert [p.special for p in branch.special] == ["Hopf"]
    assert abs(branch.special[0].value) < 1e-9
