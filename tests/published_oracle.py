"""Independent values of the published LuGre and relay runs: scipy on the plain formulas, and closed forms."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import brentq, minimize_scalar
from scipy.special import lambertw

# Table I of Canudas de Wit, Olsson, Astrom & Lischinsky 1995.
S0, S1, S2, FC, FS, VS = 1e5, math.sqrt(1e5), 0.4, 1.0, 1.5, 1e-3
KNOTS = (0, 10, 15, 35, 40, 60)


def deflection_rate(v: float, z: float) -> float:
    """Their (1) with (4)."""
    return v - S0 * abs(v) * z / (FC + (FS - FC) * math.exp(-((v / VS) ** 2)))


def friction(v: float, z: float) -> float:
    """Their (3) with a linear viscous part."""
    return S0 * z + S1 * deflection_rate(v, z) + S2 * v


def _jacobian(v: float, z: float) -> np.ndarray:
    """Of (v, -friction, deflection rate) in (x, v, z); scipy's differences overflow where x has no effect."""
    bump = (FS - FC) * math.exp(-((v / VS) ** 2))
    level = FC + bump
    by_z = -S0 * abs(v) / level
    by_v = 1 - S0 * z * (math.copysign(1, v) / level + 2 * abs(v) * v / VS**2 * bump / level**2)
    return np.array([[0, 1, 0], [0, -S1 * by_v - S2, -S0 - S1 * by_z], [0, by_v, by_z]])


def _under_force(force: Callable[[float], float], knots: tuple[float, ...], rtol: float) -> list[Any]:
    """A unit mass from rest under a force with corners at the knots, by scipy's Radau."""
    y, out = np.zeros(3), []
    for ends in itertools.pairwise(knots):
        run = solve_ivp(
            lambda t, y: [y[1], force(t) - friction(y[1], y[2]), deflection_rate(y[1], y[2])],
            ends, y, method="Radau", rtol=rtol, atol=(1e-15, 1e-12, 1e-15), dense_output=True,
            jac=lambda t, y: _jacobian(y[1], y[2]),
        )  # fmt: skip
        assert run.success
        y = run.y[:, -1]
        out.append(run.sol)
    return out


def presliding() -> list[float]:
    """Fig. 2: positions at the corners of the force, ramped to 1.425, -1.425 and 1.425 N."""
    def force(t: float) -> float:
        return 0.1425 * (min(t, 10) - min(max(t - 15, 0), 20) + min(max(t - 40, 0), 20))

    return [float(sol(t)[0]) for sol, t in zip(_under_force(force, KNOTS, 1e-10), KNOTS[1:], strict=True)]


def break_away(rate: float) -> float:
    """Fig. 4: the largest friction force under the force rate t."""
    (sol,) = _under_force(lambda t: rate * t, (0, 2 / rate), 1e-12)
    times = np.linspace(0, 2 / rate, 20001)
    k = int(np.argmax([friction(*sol(t)[1:]) for t in times]))
    top = minimize_scalar(
        lambda t: -friction(*sol(t)[1:]), bounds=(times[k - 1], times[k + 1]), method="bounded",
        options={"xatol": 1e-13},
    )  # fmt: skip
    return -float(top.fun)


def lag(omega: float) -> tuple[float, float]:
    """Fig. 3: friction at 1.5 mm/s while 1e-3 (1.5 + cos omega t) falls and rises, in the fourth period."""
    def v(t: float) -> float:
        return 1e-3 * (1.5 + math.cos(omega * t))

    begin = 6 * math.pi / omega
    times = begin + math.pi / 2 / omega, begin + 1.5 * math.pi / omega
    run = solve_ivp(
        lambda t, z: [deflection_rate(v(t), z[0])], (0, times[1]), [0.0], rtol=3e-14, atol=1e-20,
        method="DOP853", t_eval=times,
    )  # fmt: skip
    falls, rises = (friction(v(t), float(z)) for t, z in zip(times, run.y[0], strict=True))
    return falls, rises


# Siconos' default of the family of di Bernardo, Johansson & Vasca 2001: x' = A x + B u, u = -sgn x1.
A = np.array([[-3.0, 1, 0], [-3, 0, 1], [-1, 0, 0]])
B = np.array([1.0, -2, 1])


def hysteresis_switches(width: float, t_end: float) -> tuple[list[float], np.ndarray]:
    """Switches of a relay with hysteresis from (-1/50, 1/2, 0) on, u = 1 at first, and the state at t_end.

    Each arc is a matrix exponential of (x, 1), looked at in steps of width/2 before its end is solved for.
    """
    t, x, u, times = 0.0, np.array([-0.02, 0.5, 0, 1.0]), 1.0, []
    arcs = {sign: np.block([[A, sign * B[:, None]], [np.zeros((1, 4))]]) for sign in (1.0, -1.0)}
    steps = {sign: expm(0.5 * width * M) for sign, M in arcs.items()}
    while t < t_end:
        ahead = steps[u] @ x
        if u * ahead[0] < width:
            t, x = t + 0.5 * width, ahead
            continue
        s = brentq(lambda s, x=x, u=u: u * (expm(arcs[u] * s) @ x)[0] - width, 0, 0.5 * width, xtol=1e-15)
        t, x, u = t + s, expm(arcs[u] * s) @ x, -u
        times.append(t)
    return [q for q in times if q < t_end], (expm(arcs[u] * (t_end - t)) @ x)[:3]


def fast_switches(w: float) -> Iterator[float]:
    """Times of the switches of y'' = -y' - sgn y from y = 0, y' = w: arcs (w + 1)(1 - e^-s) = s."""
    t = 0.0
    while True:
        s = w + 1 + float(lambertw(-(w + 1) * math.exp(-(w + 1))).real)
        t += s
        yield t
        w = 1 - (w + 1) * math.exp(-s)
