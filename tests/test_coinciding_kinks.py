"""Kinks that coincide with a surface slid on, alone and with a second surface, against regularised fields."""

import os

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from filippov import Abs, Status, System, parameters, sign, solve, states

DRAWS = {"default": 30, "ci": 80}.get(os.environ.get("FILIPPOV_PROFILE", "default"), 2000)
END = 4.0
x, y, z = states("x y z")
NAMES = [f"a{i}{j}" for i in range(3) for j in range(3)]
p = parameters(
    **dict.fromkeys(NAMES, 0.0),
    **dict.fromkeys(("b", "c", "k", "d", "off", "u1", "u2", "v0", "v2"), 0.0),
    u0=1.0, v1=1.0,
)  # fmt: skip


def _system() -> System:
    """Two relays, one on a curved surface that touches x = 0, and abs(x), whose surface it is there."""
    rows = [sum(getattr(p, f"a{i}{j}") * s for j, s in enumerate((x, y, z))) for i in range(3)]
    one, two = sign(x + p.c * x**2 - p.off), sign(y + p.d * x)
    return System(
        {
            x: rows[0] - p.u0 * one + p.v0 * two + p.b * y * z,
            y: rows[1] - p.u1 * one - p.v1 * two + p.k * Abs(x),
            z: rows[2] + p.u2 * one + p.v2 * two - z**3 + Abs(x),
        },
        parameters=p,
    )


SYSTEM = _system()


def _draw(random: np.random.Generator) -> tuple[dict[str, float], np.ndarray]:
    values = {name: float(random.normal()) for name in NAMES}
    some = ("b", "c", "k", "d", "u1", "u2", "v0", "v2")
    values |= {name: float(random.normal() * random.integers(2)) for name in some}
    values |= {"u0": float(random.uniform(0.5, 3)), "v1": float(random.uniform(0.5, 3))}
    return values, random.normal(size=3)


def _regularised(v: dict[str, float], start: np.ndarray, eps: float) -> np.ndarray | None:
    """x(t) at 21 instants with tanh(h/eps) in place of sign(h)."""
    matrix = np.array([[v[f"a{i}{j}"] for j in range(3)] for i in range(3)])

    def field(_: float, s: np.ndarray) -> np.ndarray:
        one = np.tanh((s[0] + v["c"] * s[0] ** 2) / eps)
        two = np.tanh((s[1] + v["d"] * s[0]) / eps)
        out = matrix @ s
        out[0] += -v["u0"] * one + v["v0"] * two + v["b"] * s[1] * s[2]
        out[1] += -v["u1"] * one - v["v1"] * two + v["k"] * abs(s[0])
        out[2] += v["u2"] * one + v["v2"] * two - s[2] ** 3 + abs(s[0])
        return out

    times = np.linspace(0, END, 21)
    run = solve_ivp(field, (0, END), start, method="LSODA", rtol=1e-9, atol=1e-11, t_eval=times)
    return run.y if run.success else None


@pytest.mark.parametrize("rtol", [1e-6, 1e-10])
def test_11_B_a_kink_on_a_surface_slid_on_neither_stops_the_motion_nor_stays_behind_it(rtol: float) -> None:
    judged = 0
    for k in range(DRAWS):
        random = np.random.default_rng(k)
        values, start = _draw(random)
        options = {"rtol": rtol, "atol": rtol / 100, "max_steps": 20_000, "zeno": "continue"}
        run = solve(SYSTEM, start, (0, END), parameters=values, **options)
        # Fields of cubes may run away; where sliding repels, there is more than one solution.
        away = run.status in (Status.MAX_STEPS, Status.NON_UNIQUE, Status.NOT_FINITE)
        if away or np.max(np.abs(run.y)) > 50:
            continue
        assert run.success, (k, run.message)
        if rtol > 1e-9:
            continue
        wide, narrow = (_regularised(values, start, eps) for eps in (1e-3, 1e-4))
        if wide is None or narrow is None or np.max(np.abs(wide - narrow)) > 0.05:
            continue
        judged += 1
        miss = np.max(np.abs(run.sol(np.linspace(0, END, 21)) - narrow))
        assert miss <= np.max(np.abs(wide - narrow)) + 1e-5, (k, miss, values)
    assert rtol > 1e-9 or judged > DRAWS // 2
