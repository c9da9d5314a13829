"""Random piecewise-linear systems, with and without resets: data of the oracle, systems of the package.

One symbolic system serves all members of a family: coefficients are its parameters.
"""

from functools import cache
from typing import Any

import numpy as np
from linear_oracle import Array, Linear, Resetting

from filippov import Solution, Surface, System, parameters, sign, solve, states

END, RTOL = 3.0, 1e-10
TIGHT: dict[str, Any] = {"rtol": RTOL, "atol": 1e-13}
SIZES = [(2, 1), (3, 1), (4, 1), (6, 1), (2, 2), (3, 2), (5, 2), (4, 3), (6, 3)]
# Sizes of systems with a jump x -> R x + r, and with an impact v -> -e v that also pushes the other states.
JUMPS = [(2, 1), (3, 2), (4, 3)]
IMPACTS = [(3, 1), (4, 2), (4, 3)]


@cache
def family(n: int, m: int, order: tuple[int, ...], spare: bool = False, wall: str = "") -> System:
    """x' = A x + b + sum_i s_i B_i, s_i the sign of c_i x - d_i; wall: "jump", "impact" or none."""
    x = states(" ".join(f"x{i}" for i in range(n)))
    one, square = [f"{i}" for i in range(n)], [f"{i}{j}" for i in range(n) for j in range(n)]
    names = [f"A{q}" for q in square] + [f"b{q}" for q in one] + [f"d{k}" for k in range(m)]
    names += [f"{letter}{k}{q}" for letter in "Bc" for k in range(m) for q in one]
    names += {"": [], "impact": ["e", "w0", *(f"r{q}" for q in one[1:])]}.get(
        wall, ["e", *(f"w{q}" for q in one), *(f"r{q}" for q in one), *(f"R{q}" for q in square)]
    )
    p = parameters(**dict.fromkeys(names, 1.0))
    h = [sum(getattr(p, f"c{k}{i}") * x[i] for i in range(n)) - getattr(p, f"d{k}") for k in range(m)]
    field = {
        x[i]: sum(getattr(p, f"A{i}{j}") * x[j] for j in range(n))
        + getattr(p, f"b{i}")
        + sum(getattr(p, f"B{k}{i}") * sign(h[k]) for k in range(m))
        for i in range(n)
    }
    if wall == "impact":
        # x1 is the speed at which the wall is met.
        field[x[0]] = p.A01 * x[1]
    surfaces = [Surface(f"h{k}", h[k]) for k in order]
    if wall == "impact":
        after = {x[i]: (x[i] if i != 1 else 0) + getattr(p, f"r{i}") * x[1] for i in range(1, n)}
        surfaces.append(Surface("wall", p.w0 * x[0] - p.e, reset=after))
    elif wall:
        lands = {
            x[i]: sum(getattr(p, f"R{i}{j}") * x[j] for j in range(n)) + getattr(p, f"r{i}") for i in range(n)
        }
        surfaces.append(Surface("wall", sum(getattr(p, f"w{i}") * x[i] for i in range(n)) - p.e, reset=lands))
    if spare:
        surfaces.insert(0, Surface("never", x[0] + 1e6, kind="observer"))
    return System(field, surfaces=surfaces)


def kind_of(a: Linear) -> str:
    """Which family a system belongs to."""
    if not isinstance(a, Resetting):
        return ""
    return "impact" if not np.any(a.A[0, [0, *range(2, len(a.b))]]) and not np.any(a.r) else "jump"


def values(a: Linear) -> dict[str, float]:
    """The parameters of a member."""
    n, m = len(a.b), len(a.d)
    out = {f"A{i}{j}": a.A[i, j] for i in range(n) for j in range(n)} | {f"b{i}": a.b[i] for i in range(n)}
    out |= {f"B{k}{i}": a.B[k, i] for k in range(m) for i in range(n)}
    out |= {f"c{k}{i}": a.c[k, i] for k in range(m) for i in range(n)} | {f"d{k}": a.d[k] for k in range(m)}
    if isinstance(a, Resetting):
        out["e"] = a.e
        if kind_of(a) == "impact":
            out |= {"w0": a.w[0]} | {f"r{i}": a.R[i, 1] for i in range(1, n)}
        else:
            out |= {f"w{i}": a.w[i] for i in range(n)} | {f"r{i}": a.r[i] for i in range(n)}
            out |= {f"R{i}{j}": a.R[i, j] for i in range(n) for j in range(n)}
    if kind_of(a) == "impact":
        first = {f"A0{j}" for j in range(n) if j != 1} | {"b0", "r0", *(f"B{k}0" for k in range(m))}
        out = {name: value for name, value in out.items() if name not in first}
    return {name: float(value) for name, value in out.items()}


def run(
    a: Linear,
    x0: Any,
    span: tuple[float, float] = (0.0, END),
    order: tuple[int, ...] | None = None,
    **more: Any,
) -> Solution:
    """The package's solution; order: in which the surfaces are given."""
    order = tuple(range(len(a.d))) if order is None else order
    system = family(len(a.b), len(a.d), order, more.pop("spare", False), kind_of(a))
    return solve(system, x0, span, parameters=values(a), **(TIGHT | more))


def drawn(rng: np.random.Generator, n: int, m: int, pulled: bool) -> tuple[Linear, Array]:
    """A member and a start; pulled: towards the surfaces, so that sliding is common."""
    c = rng.normal(size=(m, n))
    c /= np.linalg.norm(c, axis=1)[:, None]
    B = rng.normal(size=(m, n))
    if pulled:
        B -= (np.sum(B * c, axis=1) + rng.uniform(0.5, 2, m))[:, None] * c
    a = Linear(rng.normal(size=(n, n)) - 0.5 * np.eye(n), rng.normal(size=n), B, c, 0.3 * rng.normal(size=m))
    return a, rng.normal(size=n)


def drawn_jump(rng: np.random.Generator, n: int, m: int, pulled: bool) -> tuple[Resetting, Array]:
    """With a jump off the plane w x = e that also mixes the states."""
    a, x0 = drawn(rng, n, m, pulled)
    w = rng.normal(size=n)
    w /= np.linalg.norm(w)
    mixed = np.eye(n) + (np.eye(n) - np.outer(w, w)) @ rng.normal(size=(n, n)) * 0.3
    away = rng.normal(size=n)
    away += (rng.uniform(0.3, 1.5) - w @ away) * w
    e = float(w @ x0) - rng.uniform(0.1, 1)
    return Resetting(a.A, a.b, a.B, a.c, a.d, w, e, mixed, away), x0


def drawn_impact(rng: np.random.Generator, n: int, m: int, pulled: bool) -> tuple[Resetting, Array]:
    """x0' = x1 and a wall in x0: x1 -> -e x1 there, with friction impulses on the other states.

    The last state is pressed on by no impulse: a surface in it alone may be slid on through impacts.
    """
    a, x0 = drawn(rng, n, m, pulled)
    A, b, B, c = a.A.copy(), a.b.copy(), a.B.copy(), a.c.copy()
    A[0], b[0], B[:, 0] = np.eye(n)[1], 0.0, 0.0
    c[0] = np.eye(n)[-1]
    if pulled:
        B[0, -1] = -rng.uniform(0.5, 2)
    mixed = np.eye(n)
    mixed[1:-1, 1] += 0.3 * rng.normal(size=n - 2)
    mixed[1, 1] = -rng.uniform(0.2, 1)
    side = rng.choice([-1.0, 1.0])
    w = side * np.eye(n)[0]
    e = float(w @ x0) - rng.uniform(0.1, 1)
    return Resetting(A, b, B, c, a.d, w, e, mixed, np.zeros(n)), x0
