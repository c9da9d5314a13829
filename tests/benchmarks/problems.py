"""Single runs beside other solvers: python tests/benchmarks/problems.py [part of a name ...]

Processor time of one run on one core without dense output, everything compiled before, the least of a few
calls, all solvers in turn; the error at the end, or of the times of events, beside it. filippov, heyoka,
CVODE (scikit-sundae), diffrax and scipy get the same problem and rtol, atol = rtol/100; solvers without
sliding are led from phase to phase in Python (`phases`). What is not installed is said.
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable, Iterator
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parents[2])]

from phases import ByDiffrax, ByHeyoka, Guard, Phase, Run, by_cvode, by_scipy  # noqa: E402

from filippov import Surface, System, cos, sign, sin, solve, states, t  # noqa: E402
from filippov.models import get  # noqa: E402

x, y, u, v = states("x y u v")


class Case(NamedTuple):
    """A problem: a system, for others the phases; the error of (state at the end, times of events)."""

    name: str
    system: System
    run: Run
    rtol: float
    error: Callable[[np.ndarray, Any], float]


def henon_heiles() -> Case:
    def field(t: Any, q: Any, f: Any) -> Any:
        return q[2], q[3], -q[0] - 2 * q[0] * q[1], -q[1] - q[0] * q[0] + q[1] * q[1]

    def energy(q: Any) -> float:
        return float((q @ q) / 2 + q[0] ** 2 * q[1] - q[1] ** 3 / 3)

    start = (0.1, 0.2, 0.3, 0.1)
    system = System({x: u, y: v, u: -x - 2 * x * y, v: -y - x * x + y * y})
    known = energy(np.array(start))
    run = Run({"": Phase(field)}, "", start, 5000.0)
    return Case("Hénon-Heiles, T = 5000", system, run, 1e-13, lambda q, _: abs(energy(q) / known - 1))


def bouncing_ball() -> Case:
    ball = System(
        {y: v, v: -9.81 + 0 * y}, surfaces=[Surface("floor", y, kind="reset", side="+", reset={v: -0.97 * v})]
    )
    first = math.sqrt(2 / 9.81)
    times = first + np.concatenate([[0], np.cumsum(2 * first * 0.97 ** np.arange(1, 157))])

    def turn(t: float, q: np.ndarray) -> str:
        q[1] *= -0.97
        return ""

    floor = Guard(lambda t, q: q[0], -1, turn)
    run = Run({"": Phase(lambda t, q, f: (q[1], -9.81), (floor,))}, "", (1.0, 0.0), float(times[-1]) + 1e-3)
    return Case("bouncing ball, 157 impacts", ball, run, 1e-10, lambda _, found: largest(found, times))


def wavy_ramp() -> Case:
    """Of heyoka's tutorials: a ball on y = 1 - x + cos(11 pi x)/20 that keeps 0.8 of its normal speed."""
    k = 11 * math.pi

    def turned(q: Any, f: Any) -> Any:
        # v - 1.8 (v . n) n, n = (a, 1) over its length.
        a = 1 + 0.05 * k * f.sin(k * q[0])
        part = 1.8 * (a * q[2] + q[3]) / (a * a + 1)
        return q[2] - part * a, q[3] - part

    class Symbols:
        sin = staticmethod(sin)

    after = turned((x, y, u, v), Symbols)
    gap = y - 1 + x - cos(k * x) / 20
    ramp = System(
        {x: u, y: v, u: 0 * x, v: -9.8 + 0 * x},
        surfaces=[Surface("ramp", gap, kind="reset", side="+", reset={u: after[0], v: after[1]})],
    )

    def h(t: Any, q: Any) -> Any:
        module = math if isinstance(q[0], float) else heyoka()
        return q[1] - 1.0 + q[0] - 0.05 * module.cos(k * q[0])

    def turn(t: float, q: np.ndarray) -> str:
        q[2], q[3] = turned(q.tolist(), math)
        return ""

    ends = (Guard(h, -1, turn),)
    run = Run({"": Phase(lambda t, q, f: (q[2], q[3], 0.0, -9.8), ends)}, "", (0.0, 1.2, 0.0, 0.0), 3.0)
    return known(Case("wavy ramp, {events} impacts", ramp, run, 1e-10, difference))


def outer_solar_system() -> Case:
    """Sun and outer planets (Applegate et al. 1986, Astron. J. 92, 176), as in heyoka's tutorials."""
    masses = np.array([1.00000597682, 1 / 1047.355, 1 / 3501.6, 1 / 22869, 1 / 19314, 7.4074074e-09])
    gravity = (0.01720209895 * 365) ** 2
    places = [
        (-4.06428567034226e-3, -6.08813756435987e-3, -1.66162304225834e-6),
        (3.40546614227466, 3.62978190075864, 3.42386261766577e-2),
        (6.60801554403466, 6.38084674585064, -1.36145963724542e-1),
        (11.1636331405597, 16.0373479057256, 3.61783279369958e-1),
        (-30.1777243405203, 1.91155314998064, -1.53887595621042e-1),
        (-21.3858977531573, 32.0719104739886, 2.49245689556096),
    ]
    speeds = [
        (6.69048890636161e-6, -6.33922479583593e-6, -3.13202145590767e-9),
        (-5.59797969310664e-3, 5.51815399480116e-3, -2.66711392865591e-6),
        (-4.17354020307064e-3, 3.99723751748116e-3, 1.67206320571441e-5),
        (-3.25884806151064e-3, 2.06438412905916e-3, -2.17699042180559e-5),
        (-2.17471785045538e-4, -3.11361111025884e-3, 3.58344705491441e-5),
        (-1.76936577252484e-3, -2.06720938381724e-3, 6.58091931493844e-4),
    ]

    def field(t: Any, q: Any, f: Any) -> Any:
        pull: list[Any] = [0.0] * 18
        for i in range(6):
            for j in range(i + 1, 6):
                d = [q[3 * j + a] - q[3 * i + a] for a in range(3)]
                cube = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]) ** -1.5
                for a in range(3):
                    pull[3 * i + a] = pull[3 * i + a] + gravity * masses[j] * cube * d[a]
                    pull[3 * j + a] = pull[3 * j + a] - gravity * masses[i] * cube * d[a]
        return *(q[18 + i] for i in range(18)), *pull

    def energy(q: np.ndarray) -> float:
        r, w = q[:18].reshape(6, 3), q[18:].reshape(6, 3)
        pairs = [(i, j) for i in range(6) for j in range(i)]
        bound = sum(gravity * masses[i] * masses[j] / np.linalg.norm(r[i] - r[j]) for i, j in pairs)
        return float(masses @ np.sum(w * w, axis=1) / 2 - bound)

    start = np.concatenate([np.ravel(places), 365 * np.ravel(speeds)])
    names = states([f"q{i}" for i in range(36)])
    system = System(dict(zip(names, field(t, names, None), strict=True)))
    run = Run({"": Phase(field)}, "", tuple(start.tolist()), 1000.0)
    first = energy(start)
    return Case(
        "outer solar system, 1000 years", system, run, 1e-13, lambda q, _: abs(energy(q) / first - 1)
    )


def relay_two_slides() -> Case:
    """On x1 = 0 it slides with the sign s = x2 while |x2| < 1."""

    def side(s: float) -> Phase:
        def field(t: Any, q: Any, f: Any) -> Any:
            return plant(q, s)

        def then(t: float, q: np.ndarray) -> str:
            q[0] = 0.0
            return "slide" if abs(q[1]) < 1 else "-" if s > 0 else "+"

        return Phase(field, (Guard(lambda t, q: q[0], -1 if s > 0 else 1, then),))

    def plant(q: Any, s: Any) -> Any:
        return -1.8 * q[0] + q[1] - s, -64.8 * q[0] + q[2] + 2 * s, -64.0 * q[0] - s

    def slide(t: Any, q: Any, f: Any) -> Any:
        return 0.0, q[2] + 2 * q[1], -1.0 * q[1]

    up = Guard(lambda t, q: q[1] - 1.0, 1, lambda t, q: "+")
    down = Guard(lambda t, q: q[1] + 1.0, -1, lambda t, q: "-")
    phases = {"+": side(1.0), "-": side(-1.0), "slide": Phase(slide, (up, down))}
    model = get("relay_two_slides")
    run = Run(phases, "slide", model.x0, 20.0)
    return known(Case("relay with two slides, {events} events", model.build(), run, 1e-10, difference))


def belt() -> Case:
    """Sticks while |x| < 1; slips with 1/(1 + 3 |v - 0.2|). Ten periods are 118.1 s."""
    stick = Phase(lambda t, q, f: (0.2, 0.0), (Guard(lambda t, q: q[0] - 1.0, 1, lambda t, q: "slip"),))

    def held(t: float, q: np.ndarray) -> str:
        q[1] = 0.2
        return "stick"

    slip = Phase(
        lambda t, q, f: (q[1], -q[0] + 1 / (1 + 3 * (0.2 - q[1]))), (Guard(lambda t, q: q[1] - 0.2, 1, held),)
    )
    model = get("belt")
    run = Run({"stick": stick, "slip": slip}, "slip", (0.0, 0.0), 118.1)
    return known(Case("block on a belt, 10 periods", model.build(), run, 1e-10, difference))


def driven_friction() -> Case:
    system = System({x: v, v: -x - v / 10 + cos(t) / 2 - 0.3 * sign(v)})

    def side(s: float) -> Phase:
        def then(t: float, q: np.ndarray) -> str:
            q[1], push = 0.0, -q[0] + math.cos(t) / 2
            return "stick" if abs(push) < 0.3 else "+" if push > 0 else "-"

        def field(t: Any, q: Any, f: Any) -> Any:
            return q[1], -q[0] - q[1] / 10.0 + 0.5 * f.cos(t) - 0.3 * s

        return Phase(field, (Guard(lambda t, q: q[1], -1 if s > 0 else 1, then),))

    def push(t: Any, q: Any) -> Any:
        return 0.5 * (math if isinstance(t, float) else heyoka()).cos(t) - q[0]

    up = Guard(lambda t, q: push(t, q) - 0.3, 1, lambda t, q: "+")
    down = Guard(lambda t, q: push(t, q) + 0.3, -1, lambda t, q: "-")
    stick = Phase(lambda t, q, f: (0.0, 0.0), (up, down))
    run = Run({"+": side(1.0), "-": side(-1.0), "stick": stick}, "-", (1.0, 0.0), 600.0)
    return known(Case("driven dry friction, T = 600, {events} events", system, run, 1e-10, difference))


def hunting() -> Case:
    """The reference loop; with longer steps than 0.1 s heyoka misses the friction curve's wall at v = 0."""

    def force(q: Any) -> Any:
        return 10.0 * (q[0] + 10.0 * q[2])

    def side(s: float) -> Phase:
        def field(t: Any, q: Any, f: Any) -> Any:
            g = 2.0 + 2.0 * f.exp(-((q[1] * 10.0) * (q[1] * 10.0)))
            return q[1], -force(q) - 11.0 * q[1] - s * g, q[0]

        def then(t: float, q: np.ndarray) -> str:
            q[1], push = 0.0, -force(q)
            return "stick" if abs(push) < 4 else "+" if push > 0 else "-"

        return Phase(field, (Guard(lambda t, q: q[1], -1 if s > 0 else 1, then),))

    def off(s: float) -> Callable[[float, np.ndarray], str]:
        def then(t: float, q: np.ndarray) -> str:
            # A rounding past break-away: exactly on it others find the event that ends the slip at once.
            q[1], q[2] = s * 1e-300, q[2] - s * 1e-16
            return "+" if s > 0 else "-"

        return then

    up, down = (Guard(lambda t, q, s=s: -force(q) - 4.0 * s, int(s), off(s)) for s in (1.0, -1.0))
    stick = Phase(lambda t, q, f: (0.0, 0.0, q[0]), (up, down))
    model = get("hunting")
    run = Run({"+": side(1.0), "-": side(-1.0), "stick": stick}, "stick", (0.1, 0.0, 0.0), 100.0, 0.1)
    return known(Case("hunting loop, 100 s, {events} events", model.build(), run, 1e-10, difference))


def heyoka() -> Any:
    import heyoka

    return heyoka


def largest(found: Any, times: np.ndarray) -> float:
    """The largest error of the times of events; inf where their number is not that of the known ones."""
    return float(np.max(np.abs(np.array(found) - times))) if len(found) == len(times) else math.inf


def difference(q: np.ndarray, truth: Any) -> float:
    return float(np.max(np.abs(q - truth)))


def known(case: Case) -> Case:
    """The same with errors against a run of Taylor's method at rtol 3e-14."""
    out = solve(
        case.system, case.run.x0, (0, case.run.end), method="Taylor", rtol=3e-14, atol=1e-16,
        dense_output=False,
    )  # fmt: skip
    return case._replace(
        name=case.name.format(events=len(out.events)), error=lambda q, _: case.error(q, out.x_end)
    )


def solvers(case: Case) -> Iterator[tuple[str, Callable[[], Callable[[], tuple[np.ndarray, Any]]]]]:
    """Every solver that has what the problem needs, and what makes it ready to be called."""
    run = case.run
    for method in ("DOP853", "Taylor"):

        def ours(method: str = method) -> tuple[np.ndarray, Any]:
            out = solve(
                case.system, run.x0, (0, run.end), method=method, rtol=case.rtol, atol=case.rtol / 100,
                dense_output=False,
            )  # fmt: skip
            return out.x_end, out.events.t

        yield f"filippov, {method}", lambda ours=ours: ours
    yield "heyoka", lambda: ByHeyoka(run, case.rtol)
    yield "CVODE", lambda: partial(by_cvode, run, case.rtol)
    if len(run.phases) == 1 and not run.phases[run.first].guards:
        yield "diffrax", lambda: ByDiffrax(run, case.rtol)
    yield "scipy", lambda: partial(by_scipy, run, case.rtol)


def timed(call: Callable[[], Any], most: float = 1.0, tries: int = 15) -> tuple[float, Any]:
    """Least processor time [ms] within a time for all, and the last result."""
    result, spent = call(), []
    while not spent or (len(spent) < tries and sum(spent) < most):
        begun = time.process_time()
        result = call()
        spent.append(time.process_time() - begun)
    return 1e3 * min(spent), result


def main(asked: list[str]) -> None:
    """Print a table."""
    for package in ("heyoka", "scikit-sundae", "diffrax", "jax", "scipy", "numpy", "llvmlite"):
        try:
            print(package, version(package), end=", ")
        except PackageNotFoundError:
            print(package, "is not installed", end=", ")
    print(f"Python {sys.version.split()[0]}\n")
    print("| problem | rtol | solver | time | error |\n|---|---|---|---|---|")
    makers = (
        henon_heiles, outer_solar_system, bouncing_ball, wavy_ramp, relay_two_slides, belt,
        driven_friction, hunting,
    )  # fmt: skip
    for maker in makers:
        if asked and not any(word in maker.__name__ for word in asked):
            continue
        case = maker()
        for name, ready in solvers(case):
            try:
                spent, (end, times) = timed(ready())
                cells = f"{spent:.2f} ms | {case.error(end, times):.0e}"
            except Exception as error:  # noqa: BLE001  # what another solver cannot do is a line of the table
                cells = f"{type(error).__name__}: {str(error)[:80]} |"
            print(f"| {case.name} | {case.rtol:g} | {name} | {cells} |", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
