"""Branches of cycles that end in an equilibrium, at values in closed form; nothing beyond is a branch."""

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq

from filippov import Heaviside, System, parameters, states
from filippov.analysis import continuation, find_orbit
from filippov.analysis.bifurcations.branch import Branch

x, y, z = states("x y z")
p = parameters(m=0.1)
END, VALUE = "cycle shrinks into an equilibrium", 0.013
m = p.m - VALUE
r2 = x**2 + y**2
rate = m + r2 - r2**2
UP = Heaviside(y)
CASES = {
    # r' = m r + r^3 - r^5: a fold at -1/4, a Hopf point at 0.
    "Hopf": (System({x: x * rate - y, y: x + y * rate}), (1.0, 0), 6.28, ["fold", END]),
    # A focus above y = 0 at height m, below (1, 1): a sliding cycle in proportion to m.
    "boundary": (
        System({x: UP * (x / 5 - y + m) + 1 - UP, y: UP * (x + (y - m) / 5) + 1 - UP}), (0, 0.1), None, [END],
    ),
    # Folds at x = 0 below and beside m above, invisible both: a crossing cycle of size root m.
    "pseudo-Hopf": (
        System({x: 2 * UP - 1, y: UP * (m - x - x**2 / 2 - 0.3 * x**3) - (1 - UP) * x}), (0.5, 0),
        None, [END],
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", CASES)
def test_12_13_a_branch_of_cycles_ends_where_they_shrink_into_an_equilibrium(kind: str, tmp_path) -> None:
    system, near, period, special = CASES[kind]
    orbit = find_orbit(system, near, transient=60, period=period)
    run = continuation(system, orbit, parameter="m", bounds=(-0.4, 0.11), direction=-1, max_points=60)
    branch = run.run()
    assert [q.special for q in branch.special] == special
    end = branch.points[-1]
    assert end.special == END
    assert kind in end.note
    assert abs(end.value - VALUE) < 1e-12
    assert END in branch.message
    assert max(abs(end.coordinates[f"max {name}"]) for name in "xy") < 1e-12
    sizes = branch.coordinate("amplitude x")
    assert np.all(np.diff(sizes) < 0)
    branch.save(tmp_path / "branch.json")
    assert Branch.load(tmp_path / "branch.json").points[-1].special == END


def test_12_13_the_unstable_cycle_of_the_lorenz_equations_ends_at_470_19() -> None:
    """The Hopf point r = s (s + b + 3)/(s - b - 1) (Sparrow 1982)."""
    q = parameters(r=24.0)
    lorenz = System({x: 10 * (y - x), y: q.r * x - y - x * z, z: x * y - 8 * z / 3})
    orbit = find_orbit(lorenz, (8.73, 8.73, 23.0), period=0.68)
    end = continuation(lorenz, orbit, parameter="r", bounds=(20, 26), direction=1).run().points[-1]
    assert end.special == END
    assert abs(end.value - 470 / 19) < 1e-10
    assert abs(end.period - 2 * np.pi / np.sqrt(8 / 3 * (470 / 19 + 10))) < 1e-9


@pytest.mark.parametrize("seed", [0, 1, 10, 12])
def test_cycles_about_two_affine_folds_end_where_the_folds_collide(seed: int) -> None:
    """Folds of both sides at x = 0 and x = m, invisible: whatever the affine fields, the end is m = 0."""
    rng = np.random.default_rng(seed)
    value, (x0, y0) = float(rng.normal()), rng.normal(size=2).tolist()
    a1, b1, g1, a2, b2, g2 = rng.uniform(-0.8, 0.8, 6).tolist()
    k1, k2, v1, v2 = rng.uniform(0.5, 2, 4).tolist()
    q, r, gap = x - x0, y - y0, p.m - value
    up, on = (v1 + a1 * q + b1 * r, -k1 * (q - gap) + g1 * r), Heaviside(r)
    down = (-v2 + a2 * q + b2 * r, -k2 * q + g2 * r)
    rows = [on * i + (1 - on) * j for i, j in zip(up, down, strict=True)]
    system = System({x: rows[0], y: rows[1]})

    def back(gap: float) -> float:
        """Where the solution from q = -0.3 on the line is after a return, by exponentials."""
        q = -0.3
        for A, f in (([[a1, b1], [-k1, g1]], [v1, k1 * gap]), ([[a2, b2], [-k2, g2]], [-v2, 0.0])):
            M = np.zeros((3, 3))
            M[:2, :2], M[:2, 2] = A, f
            sense = np.sign(f[1] + A[1][0] * q)
            times = np.linspace(0, 6, 301)[1:]
            high = [sense * (expm(M * t) @ [q, 0, 1])[1] for t in times]
            k = next(k for k, h in enumerate(high) if h < 0)
            t = brentq(lambda t, M=M, q=q: (expm(M * t) @ [q, 0, 1])[1], times[k - 1], times[k], xtol=1e-14)
            q = float((expm(M * t) @ [q, 0, 1])[0])
        return q

    start = brentq(lambda gap: back(gap) + 0.3, -0.08, 0.08)
    orbit = find_orbit(system, (x0 - 0.3, y0), parameters={"m": value + start})
    assert orbit.low[0] == pytest.approx(x0 - 0.3, abs=1e-7)
    way = -1 if start > 0 else 1
    branch = continuation(system, orbit, parameter="m", bounds=(value - 1, value + 1), direction=way,
                          max_points=60).run()  # fmt: skip
    end = branch.points[-1]
    assert end.special == END, branch.message
    assert "pseudo-Hopf" in end.note
    assert abs(end.value - value) < 1e-11
