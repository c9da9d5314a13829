"""Stacks of bodies between a floor and a ceiling, drawn at random, and the laws that every motion keeps."""

from __future__ import annotations

from functools import cache

import numpy as np

from filippov import EventKind, Solution, Surface, System, parameters, states


@cache
def stack(n: int, order: tuple[int, ...] | None = None) -> System:
    """n bodies one above the other: states y (heights), v; floor at a, ceiling at a + c, contacts between.

    Restitutions e0 (floor), e1 ... (contacts), en (ceiling); masses m0 ...; gravity g. order: the number of
    each body from below among the states, 0 ... n - 1 where it is not given; surfaces are declared likewise.
    """
    order = order or tuple(range(n))
    told = {i: states(f"y{i} v{i}") for i in range(n)}
    y, v = ([told[i][k] for i in range(n)] for k in (0, 1))
    values = {f"e{i}": 0.5 for i in range(n + 1)} | {f"m{i}": 1.0 for i in range(n) if n > 1}
    p = parameters(g=10.0, a=0.0, c=100.0, **values)
    e = [getattr(p, f"e{i}") for i in range(n + 1)]
    m = [getattr(p, f"m{i}") for i in range(n) if n > 1]
    surfaces = [Surface("floor", y[0] - p.a, reset={v[0]: -e[0] * v[0]})]
    for i in range(1, n):
        low, high, total = v[i - 1], v[i], m[i - 1] + m[i]
        mean = (m[i - 1] * low + m[i] * high) / total
        closing = e[i] * (low - high) / total
        after = {low: mean - m[i] * closing, high: mean + m[i - 1] * closing}
        surfaces.append(Surface(f"contact {i}", y[i] - y[i - 1], reset=after))
    surfaces.append(Surface("ceiling", p.a + p.c - y[-1], reset={v[-1]: -e[n] * v[-1]}))
    place = np.argsort(order).tolist()
    equations = {y[i]: v[i] for i in place} | {v[i]: -p.g for i in place}
    return System(equations, surfaces=[surfaces[i] for i in [*place, n]])


def split(n: int, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Heights and velocities out of states, shape (2 n, ...)."""
    return x[:n], x[n:]


def gaps(n: int, x: np.ndarray, values: dict[str, float]) -> np.ndarray:
    """h of every surface, shape (n + 1, ...)."""
    y, _ = split(n, x)
    low = np.full_like(y[:1], values["a"])
    return np.diff(np.concatenate([low, y, low + values["c"]]), axis=0)


def energy(n: int, x: np.ndarray, values: dict[str, float]) -> np.ndarray:
    """Kinetic and potential energy, in the terms of the bodies."""
    y, v = split(n, x)
    m = np.array([values.get(f"m{i}", 1.0) for i in range(n)])
    return np.asarray(np.tensordot(m, v**2 / 2 + values["g"] * (y - values["a"]), 1))


def draw(random: np.random.Generator, n: int) -> tuple[np.ndarray, dict[str, float]]:
    """A start and parameters: bodies apart, touching or at rest; restitutions 0, 1 and between."""
    values = {"g": float(random.choice([0.0, 1.0, 10.0], p=[0.15, 0.15, 0.7]))}
    values["a"] = float(random.choice([0.0, 1.3]))
    values["c"] = float(random.choice([n + 0.5, 100.0]))
    kind = random.integers(4)
    for i in range(n + 1):
        e = random.choice([0.0, 1.0, random.uniform(0, 1), random.uniform(0, 1)])
        values[f"e{i}"] = float(e) if kind else 0.5
    equal = random.random() < 0.5
    for i in range(n if n > 1 else 0):
        values[f"m{i}"] = 1.0 if equal else float(np.exp(random.uniform(-2, 2)))
    apart = random.choice([0.0, random.uniform(0, 0.3), 0.25, random.uniform(0.1, 1)], n)
    y = values["a"] + np.cumsum(apart)
    v = np.where(random.random(n) < 0.5, 0.0, random.uniform(-3, 3, n))
    if random.random() < 0.3:
        v[:] = random.choice([0.0, -2.0])
    if random.random() < 0.3:
        v[-1] = -3.0
    return np.concatenate([y, v]), values


def faults(run: Solution, n: int, values: dict[str, float]) -> list[str]:
    """What the run does that no stack does."""
    found = []
    times = np.unique(np.concatenate([np.linspace(run.t[0], run.t_end, 1201), run.t]))
    x = run.sol(times, side="+")
    least = float(np.min(gaps(n, x, values)))
    if least < -1e-9:
        found.append(f"gap {least:.3g}")
    power = energy(n, x, values)
    if np.max(np.diff(power), initial=0.0) > 1e-8 * (1 + np.max(np.abs(power))):
        found.append(f"energy grows by {np.max(np.diff(power)):.3g}")
    groups: dict[int, list] = {}
    touched: dict[int, set[str]] = {}
    for event in run.events:
        # What comes to rest at this instant is held with it.
        touched.setdefault(event.group, set()).add(event.surface)
        if event.kind is EventKind.RESET:
            groups.setdefault(event.group, []).append(event)
    for number, group in groups.items():
        before, after = group[0].x, group[-1].x_after
        # Where rounding of the heights hides the order of impacts, they rest together: cycles of 1e-12.
        rests = 0 in group[-1].after
        slow = float(np.sqrt(2e-12 * values["g"] * (1 + values["a"]))) if rests else 0.0
        found += pushes(n, before, after, touched[number], values, slow)
        if energy(n, after, values) > energy(n, before, values) * (1 + 1e-9) + 1e-12:
            found.append(f"energy grows at the impact at {group[0].t:.6g}")
    return found


def pushes(
    n: int, before: np.ndarray, after: np.ndarray, touched: set[str], values: dict[str, float], slow: float
) -> list[str]:
    """What is wrong with the impulses of an instant: each pushes, where there is contact, and none elsewhere.

    Body i is pushed up by contact i and down by contact i + 1: m_i dv_i = I_i - I_(i + 1). slow: a speed
    that counts as none.
    """
    m = np.array([values.get(f"m{i}", 1.0) for i in range(n)])
    change = np.concatenate([[0.0], np.cumsum(m * (after[n:] - before[n:]))])  # I_0 - I_i
    names = ["floor", *[f"contact {i}" for i in range(1, n)], "ceiling"]
    free = [i for i, name in enumerate(names) if name not in touched]
    if not free:
        return []  # floor and ceiling may push against each other as hard as they like
    little = 1e-9 * float(m @ np.abs(before[n:]) + 1e-3) + slow * float(np.sum(m))
    impulse = change[free[0]] - change
    if np.max(np.abs(impulse[free])) > little:
        return [f"an impulse without a contact: {impulse}, touched {sorted(touched)}"]
    return [f"an impulse that pulls: {impulse}"] if np.min(impulse) < -little else []
