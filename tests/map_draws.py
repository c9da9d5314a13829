"""Random maps and piecewise linear systems with closed forms, and what the analyses say of them.

The reset of a clock gives any map at all: x rests between the ticks of z' = 1 and jumps to image(x) at each.
Every function returns what is wrong, "" for nothing.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np
from scipy.linalg import expm
from scipy.optimize import brentq
from sympy import Abs, Expr, Rational

from filippov import Parameter, Surface, System, TimeEvent, exp, log, parameters, states
from filippov.analysis.diagrams.regions import regions
from filippov.analysis.gains.contraction import contraction
from filippov.analysis.gains.tuning import tune
from filippov.analysis.maps.event_map import EventMap
from filippov.analysis.maps.section import Section
from filippov.analysis.orbits.orbit_search import find_orbit
from filippov.analysis.sensitivity.lyapunov import lyapunov

x, y, z = states("x y z")
SECTION = Section("tick", "reset", "x", {"x": "d", "z": 0}, t_max=5)


def clock(images: dict[Expr, Expr]) -> System:
    """A system whose states rest between the ticks of z and then jump."""
    tick = Surface("tick", z - 1, reset={**images, z: 0 * z}, side="-")
    return System({**{q: 0 * q for q in images}, z: 1 + 0 * z}, surfaces=[tick])


@lru_cache(maxsize=1)
def quartic() -> System:
    """R(d) = d - c d (d - r0) (d - r1) (d - r2)."""
    p = parameters(c=1.0, r0=0.0, r1=0.0, r2=0.0)
    image = x - p.c * x * (x - p.r0) * (x - p.r1) * (x - p.r2)
    tick = Surface("tick", z - 1, reset={x: image, z: 0 * z}, side="-")
    return System({x: 0 * x, z: 1 + 0 * z}, surfaces=[tick], parameters=p)


def _roots(rng: np.random.Generator) -> tuple[np.ndarray, float, Callable[[np.ndarray], np.ndarray]]:
    """Roots in (0.1, 1.2), c with 0 < R' on [0, 1.3], and R."""
    r = np.sort(rng.uniform(0.1, 1.2, 3))
    while np.min(np.diff(r)) < 0.02:
        r = np.sort(rng.uniform(0.1, 1.2, 3))
    gap = np.polynomial.Polynomial.fromroots([0.0, *r])
    steepest = np.max(np.abs(gap.deriv()(np.linspace(0, 1.3, 2001))))
    c = float(rng.choice([-1, 1]) * rng.uniform(0.2, 0.9) / steepest)
    return r, c, lambda d: d - c * gap(d)


def basins(seed: int) -> str:
    """Increasing maps: where iterates go is decided by the fixed points beside them."""
    r, c, image = _roots(np.random.default_rng([61, seed]))
    given = {"c": c, **dict(zip(("r0", "r1", "r2"), r, strict=True))}
    event_map = EventMap(quartic(), SECTION, parameters=given)
    found = event_map.basins(0.0, 1.3, 120)
    for part in found:
        for d in part.lo + (part.hi - part.lo) * np.linspace(0.02, 0.98, 9):
            # However slowly: to the next fixed point on the side to which the map leads, or out.
            way = np.sign(image(d) - d)
            ahead = [q for q in (0.0, *r) if (q - d) * way > 0]
            goes = min(ahead, key=lambda q: abs(q - d)) if ahead else None
            same = goes is None or part.attractor is None or abs(goes - part.attractor) < 1e-4
            if not same or (goes is None) != (part.attractor is None):
                return f"[{part.lo}, {part.hi}]: from {d} to {goes}, said {part.attractor}"
    slopes = np.array([1 - c * np.prod(q - np.delete([0.0, *r], k)) for k, q in enumerate([0.0, *r])])
    borders = [q for q, slope in zip([0.0, *r], slopes, strict=True) if slope > 1 and q > 0]
    known = [0.0, *borders, 1.3]
    ends = [part.lo for part in found] + [found[-1].hi]
    return "" if len(ends) == len(known) and np.allclose(ends, known, atol=1e-8) else f"{ends}, known {known}"


def folded_basins(seed: int) -> str:
    """Maps that fold: where iterates of 20,000 coordinates go, by iterating."""
    rng = np.random.default_rng([68, seed])
    r = np.sort(rng.uniform(0.1, 1.2, 3))
    c = float(rng.choice([-1, 1]) * rng.uniform(1, 5))
    event_map = EventMap(quartic(), SECTION, parameters={"c": c, "r0": r[0], "r1": r[1], "r2": r[2]})
    points, every, d = 200, np.array([0.0, *r]), np.linspace(0, 1.3, 20_003)[1:-1]
    ahead = d.copy()
    with np.errstate(all="ignore"):
        for _ in range(3000):
            ahead -= c * ahead * (ahead - r[0]) * (ahead - r[1]) * (ahead - r[2])
    slopes = np.array([1 - c * np.prod(q - np.delete(every, k)) for k, q in enumerate(every)])
    if np.min(np.abs(np.abs(slopes) - 1)) < 0.01:
        return ""
    known = np.full(d.size, np.nan)
    for q in every[np.abs(slopes) < 1]:
        known[np.abs(ahead - q) < 1e-6] = q
    told = np.full(d.size, np.nan)
    for part in event_map.basins(0.0, 1.3, points):
        if part.attractor is not None:
            told[(d > part.lo) & (d < part.hi)] = part.attractor
    wrong = ~np.isclose(told, known, atol=1e-6, equal_nan=True)
    # What is narrower than the grid of the search is missed.
    run = np.diff(np.flatnonzero(np.diff(np.concatenate(([0], wrong, [0])))))[::2] * (d[1] - d[0])
    widest = float(np.max(run, initial=0.0))
    return f"{c}, {r}: wrong over {widest} at {d[wrong][:3]}" if widest > 2 * 1.3 / (points / 2) else ""


def cells(seed: int) -> str:
    """Cycles, stable ones and the verdict of the set over two parameters."""
    rng = np.random.default_rng([62, seed])
    r, c, _ = _roots(rng)
    factors, last = np.array([-3.0, -1.0, 1.0, 2.5]) * abs(c), np.sort(rng.uniform(0.1, 1.6, 3))
    while min(abs(q - p) for q in last for p in r[:2]) < 0.02:
        last = np.sort(rng.uniform(0.1, 1.6, 3))
    given = {"r0": r[0], "r1": r[1]}
    found = regions(quartic(), SECTION, ("c", factors), ("r2", last), (0, 1.3), order=1, parameters=given)
    for i, third in enumerate(last):
        every = np.array([0.0, r[0], r[1], third])
        for j, factor in enumerate(factors):
            slopes = np.array([1 - factor * np.prod(q - np.delete(every, k)) for k, q in enumerate(every)])
            inside = (every > 0) & (every < 1.3)
            wanted = inside.sum(), int(np.sum(np.abs(slopes[inside]) < 1)), bool(abs(slopes[0]) < 1)
            told = found.cycles[i, j], found.stable[i, j], bool(found.set_stable[i, j])
            if np.min(np.abs(np.abs(slopes) - 1)) > 1e-3 and (told != wanted or found.undecided[i, j]):
                return f"c = {factor}, r2 = {third}: {told}, known {wanted}"
    return ""


def exponents(seed: int) -> str:
    """Skew tents have -a log a - (1 - a) log(1 - a); those of Lozi's map add up to log |b|."""
    rng = np.random.default_rng([63, seed])
    if seed % 2:
        a = Rational(int(rng.integers(20, 80)), 100) + Rational(1, 997)
        # x/a below a, (1 - x)/(1 - a) above: the lesser of both.
        tent = (x / a + (1 - x) / (1 - a)) / 2 - Abs(x / a - (1 - x) / (1 - a)) / 2
        got = lyapunov(clock({x: tent}), (rng.uniform(0.1, 0.9), 0.25), 3000, interval=1.0, number=1)
        share = float(a)
        known = -share * math.log(share) - (1 - share) * math.log(1 - share)
        miss = abs(got.exponents[0] - known)
        return "" if miss < 6 * got.error[0] + 5e-3 and got.error[0] < 0.1 else f"{got}, known {known}"
    a, b = Rational(int(rng.integers(140, 170)), 100), Rational(int(rng.integers(20, 45)), 100)
    system = clock({x: 1 - a * Abs(x) + y, y: b * x})
    got = lyapunov(system, (0.1, 0.05, 0.25), 400, interval=1.0)
    total = float(np.sum(got.exponents))
    return "" if abs(total - math.log(float(b))) < 1e-6 else f"{got}, the sum is log {b}"


def multipliers(seed: int) -> str:
    """x' = A x + g with x+ = M x + r at a clock: fixed point and multipliers of the affine map."""
    rng = np.random.default_rng([64, seed])
    n = int(rng.integers(1, 4))
    names = (x, y, z)[:n]
    A, g, r = rng.uniform(-1, 1, (n, n)), rng.uniform(-1, 1, n), rng.uniform(-1, 1, n)
    M, period = rng.uniform(-1.2, 1.2, (n, n)), float(rng.uniform(0.5, 2))
    after = {q: sum(float(e) * p for e, p in zip(row, names, strict=True)) + float(k)
             for q, row, k in zip(names, M, r, strict=True)}  # fmt: skip
    field = {q: sum(float(e) * p for e, p in zip(row, names, strict=True)) + float(k)
             for q, row, k in zip(names, A, g, strict=True)}  # fmt: skip
    system = System(field, time_events=[TimeEvent("tick", period=period, start=period, reset=after)])
    whole = expm(period * np.block([[A, g[:, None]], [np.zeros((1, n + 1))]]))
    E, moved = whole[:n, :n], whole[:n, n]
    known = np.linalg.eigvals(M @ E)
    if np.min(np.abs(known - 1)) < 0.05:
        return ""
    just_after = np.linalg.solve(np.eye(n) - M @ E, M @ moved + r)
    orbit = find_orbit(system, just_after + 1e-2 * rng.uniform(-1, 1, n), period=period)
    far = max(np.min(np.abs(known - q)) for q in orbit.multipliers)
    if orbit.multipliers.size != n or far > 1e-7 * max(1.0, np.max(np.abs(known))):
        return f"{orbit.multipliers}, known {known}"
    verdict = "stable" if np.max(np.abs(known)) < 1 else "unstable"
    if abs(np.max(np.abs(known)) - 1) > 1e-6 and orbit.verdict != verdict:
        return f"{orbit.verdict}, known {verdict}: {known}"
    places = np.array([whole_state(A, g, t, just_after) for t in np.linspace(0, period, 2001)[:-1]])
    miss = np.min(np.max(np.abs(places - orbit.x0), axis=1))
    return "" if miss < 1e-2 * (1 + np.max(np.abs(places))) else f"{orbit.x0} is {miss} from the orbit"


def whole_state(A: np.ndarray, g: np.ndarray, t: float, start: np.ndarray) -> np.ndarray:
    """x(t) of x' = A x + g."""
    n = len(A)
    whole = expm(t * np.block([[A, g[:, None]], [np.zeros((1, n + 1))]]))
    return whole[:n, :n] @ start + whole[:n, n]


@lru_cache(maxsize=1)
def geared() -> System:
    """R(d) = (1 - K L) d + m d^3."""
    p = parameters(K=1.0, L=1.0, m=0.0)
    tick = Surface("tick", z - 1, reset={x: (1 - p.K * p.L) * x + p.m * x**3, z: 0 * z}, side="-")
    return System({x: 0 * x, z: 1 + 0 * z}, surfaces=[tick], parameters=p)


def gains(seed: int) -> str:
    """|R(d)/d| < 1 on (0, 1] where 0 < K L < 2 and |1 - K L + m| < 1; a box spans 4 log s in log K L."""
    rng = np.random.default_rng([65, seed])
    m, low = float(rng.uniform(-0.8, 0.8)), rng.uniform(0.2, 0.6, 2)
    ranges = {"K": (float(low[0]), float(low[0] * rng.uniform(4, 9))),
              "L": (float(low[1]), float(low[1] * rng.uniform(4, 9)))}  # fmt: skip
    found = tune(geared(), SECTION, ranges, (0, 1), parameters={"m": m}, samples=128, seed=seed)
    product = np.prod(found.gains, axis=1)
    known = np.maximum(np.abs(1 - product), np.abs(1 - product + m))
    if np.max(np.abs(found.ratio - known)) > 1e-5:
        return f"ratio off by {np.max(np.abs(found.ratio - known))}"
    lowest, highest = max(0.0, m), min(2.0, 2.0 + m)
    best = found.best["K"] * found.best["L"]
    box = best / found.margin**2, best * found.margin**2
    if not (lowest < box[0] and box[1] < highest):
        return f"products of the box {box}, free of cycles in ({lowest}, {highest})"
    ends = [sum(math.log(pair[k]) for pair in ranges.values()) for k in (0, 1)]
    middle = np.linspace(*ends, 4001)
    below = middle - math.log(lowest) if lowest else np.inf
    widest = min(math.log(5), float(np.max(np.minimum(below, math.log(highest) - middle))) / 2)
    if math.log(found.margin) < 0.97 * widest:
        return f"margin {found.margin}, possible {math.exp(widest)}"
    return ""


@lru_cache(maxsize=1)
def unimodal() -> System:
    """R(d) = s a d (1 - d) (1 + b d)."""
    p = parameters(a=2.8, b=0.0, s=1.0)
    tick = Surface("tick", z - 1, reset={x: p.s * p.a * x * (1 - x) * (1 + p.b * x), z: 0 * z}, side="-")
    return System({x: 0 * x, z: 1 + 0 * z}, surfaces=[tick], parameters=p)


def iterates(seed: int) -> str:
    """Cycles of up to three returns, each counted once, and their multipliers by the chain rule."""
    rng = np.random.default_rng([66, seed])
    order, s, b = int(rng.integers(2, 4)), float(rng.choice([-1, 1])), float(rng.uniform(-0.5, 0.5))
    factors = rng.uniform(2.4, 3.9, 5)
    found = regions(unimodal(), SECTION, ("a", factors), ("b", [b]), (0, 1), order=order, parameters={"s": s},
                    points=80)  # fmt: skip
    grid = np.append(np.geomspace(1.01e-5, 0.01, 400), np.linspace(0.01, 1, 40001)[1:])
    for j, a in enumerate(factors.tolist()):
        def orbit(d: np.ndarray | float, a: float = a) -> list:
            out = [d]
            for _ in range(order):
                out.append(s * a * out[-1] * (1 - out[-1]) * (1 + b * out[-1]))
            return out

        def gap(d: np.ndarray | float, orbit: Callable[..., list] = orbit) -> np.ndarray:
            return orbit(d)[-1] - d

        left = gap(grid)
        roots = [brentq(gap, *grid[k : k + 2], xtol=1e-15) for k in np.flatnonzero(left[:-1] * left[1:] < 0)]
        cycles: dict[float, float] = {}
        for root in roots:
            points = np.array(orbit(root)[:-1])
            slope = np.prod(s * a * ((1 - 2 * points) * (1 + b * points) + b * points * (1 - points)))
            inside = [q for q in roots if np.min(np.abs(points - q)) < 1e-7]
            cycles[max(inside)] = float(abs(slope))
        if any(abs(slope - 1) < 1e-3 for slope in cycles.values()):
            continue
        held = [d for d, slope in cycles.items() if slope < 1]
        told, wanted = (found.cycles[0, j], found.stable[0, j]), (len(cycles), len(held))
        if told != wanted or (held and abs(found.amplitude[0, j] / max(held) - 1) > 1e-6):
            return f"a = {a}, order {order}: {told}, {found.amplitude[0, j]}, known {cycles}"
    return ""


def peaks(seed: int) -> str:
    """R(d) = -d rho(d) with peaks of rho between the coordinates that are tried, over two bounded gains."""
    rng = np.random.default_rng([67, seed])
    bounds = [{"lower": float(low), "upper": float(high)} for low, high in
              zip(rng.uniform(0.1, 0.5, 2), rng.uniform(2, 20, 2), strict=True)]  # fmt: skip
    base, slopes = rng.uniform(0.5, 0.8), rng.normal(size=2) * 0.15
    hills = [(rng.uniform(0.15, 0.9), rng.uniform(0.04, 0.15), rng.uniform(0.1, 0.4), *rng.normal(size=3) / 4)
             for _ in range(int(rng.integers(1, 4)))]  # fmt: skip

    def rho(d: Any, a: Any, b: Any, e: Callable[[Any], Any]) -> Any:
        every = [h * (1 + f * a + g * b) * e(-(((d - m - s * a / 3) / w) ** 2)) for m, w, h, f, g, s in hills]
        return base + slopes[0] * a + slopes[1] * b + (a**2 + b**2) / 10 + sum(every)

    p = parameters(K=Parameter(1.0, **bounds[0]), L=Parameter(1.0, **bounds[1]))
    tick = Surface("tick", z - 1, reset={x: -x * rho(Abs(x), log(p.K), log(p.L), exp), z: 0 * z}, side="-")
    system = System({x: 0 * x, z: 1 + 0 * z}, surfaces=[tick], parameters=p)
    d = np.append(np.geomspace(1e-6, 5e-4, 30), np.linspace(5e-4, 1, 2000))

    def known(gains: np.ndarray) -> np.ndarray:
        a, b = np.log(gains.T)[:, :, None]
        return np.max(np.abs(rho(d, a, b, np.exp)), axis=1)

    low, high = (np.array([one[side] for one in bounds]) for side in ("lower", "upper"))
    some = rng.uniform(0.6, 1.8, (20, 2))
    told = contraction(system, SECTION, {"K": some[:, 0], "L": some[:, 1]}, (0, 1)).ratio
    if np.max(np.abs(told - known(some))) > 2e-3:
        return f"ratios {told}, known {known(some)}"
    found = tune(system, SECTION, {"K": (0.6, 1.8), "L": (0.6, 1.8)}, (0, 1), samples=64, seed=seed)
    if found.best is None:
        return ""
    best = np.array(list(found.best.values()))
    if abs(found.best_ratio - known(best[None])[0]) > 2e-3:
        return f"{found.best_ratio} at {best}, known {known(best[None])}"
    box = best * found.margin ** rng.uniform(-1, 1, (2000, 2))
    if np.any(known(box) >= 1) or np.any(box < low) or np.any(box > high):
        return f"the box {best}, {found.margin} is not free of cycles within {bounds}"
    for k, limit in enumerate(found.limits):
        for end, to in ((limit.lower, low[k]), (limit.upper, high[k])):
            line = np.tile(best, (2001, 1))
            line[:, k] *= np.clip(to / best[k], 0.2, 5.0) ** np.linspace(0, 1, 2001)
            grows = np.flatnonzero(known(line) >= 1)
            border = float(line[grows[0], k]) if grows.size else None
            if (border is None) != (end is None) or (border and abs(end / border - 1) > 3e-3):
                return f"{limit}, known {border}"
    return ""
