"""What analyses over parameters cost: python tests/benchmarks/analyses.py [NAME ...] [--of CHECKOUT]

Processor time of all threads and child processes, compiled code there already (each is run twice, the second
counts), and a figure of the result, which must be the same where two checkouts are compared.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

Axis = tuple[str, float, float]


def cells(system: Any, section: Any, x: Axis, y: Axis, high: float, **more: Any) -> str:
    """A map of 25 x 25 cells."""
    from filippov.analysis import regions

    axes = [(axis, np.linspace(a, b, 25)) for axis, a, b in (x, y)]
    found = regions(system, section, *axes, (0, high), **more)
    borders = ", ".join(f"{name} {len(points)} points" for name, points in found.borders)
    counts = np.bincount(found.cycles.ravel() + 1).tolist()
    return f"cells with -1, 0, 1, ... cycles {counts}, amplitudes {np.nansum(found.amplitude):.8f}; {borders}"


def hunting(**more: Any) -> str:
    """The hunting loop over its gains."""
    from filippov.analysis import Section
    from filippov.models import get

    model = get("hunting")
    gains = ("P", 4.0, 31.0), ("I", 4.0, 20.0)
    return cells(model.build(), Section.from_model(model), *gains, 0.5, **more)


def arm(**more: Any) -> str:
    """A model that no page has, over gain and stiffness: an arm on a spring, turned by a PID controller."""
    from filippov import Surface, System, exp, parameters, sign, sin, states
    from filippov.analysis import Section

    q, w, z = states("q w z")
    p = parameters(J=0.5, k=1.0, P=8.0, D=0.8, I=6.0, Ms=2.0, Mc=1.2, ws=0.15, b=0.4)
    dry = (p.Mc + (p.Ms - p.Mc) * exp(-((w / p.ws) ** 2))) * sign(w)
    pull = p.k * sin(q) + p.P * (q + p.D * w + p.I * z)
    system = System({q: w, w: (-pull - dry - p.b * w) / p.J, z: q}, surfaces=[Surface("pivot", w)])
    start = {"q": "d", "w": "0", "z": "(sign(d)*Ms - k*sin(d) - P*d)/(P*I)"}
    return cells(
        system, Section("pivot", "sliding entry", "q", start), ("P", 2.0, 30.0), ("k", -1.0, 4.0), 1.0, **more
    )


def fold() -> str:
    """The fold of the hunting loop over its gain, and from there over beta down to 1 and over I both ways."""
    from filippov.analysis import EventMap, Section, continuation, curve
    from filippov.models import get

    model = get("hunting")
    event_map = EventMap(model.build(), Section.from_model(model), order=2)
    run = continuation(event_map.system, (event_map, 0.2523), parameter="P", bounds=(10, 31), direction=1)
    (found,) = run.run().folds
    ends = []
    for parameter, bounds, way in (("beta", (1.0, 2.0), -1), ("I", (2.0, 20.0), 1), ("I", (2.0, 20.0), -1)):
        along = curve(run, found, parameter=parameter, bounds=bounds, direction=way).run()
        ends.append(f"{parameter} {len(along.points)} points to {along.coordinate('P')[-1]:.7f}")
    return f"fold at {found.value:.10f}; " + "; ".join(ends)


def border() -> str:
    """Friction at which a forced mass begins to stop at its turning points, over the frequency."""
    from filippov import System, cos, parameters, sign, states, t
    from filippov.analysis import continuation, curve, find_orbit

    x, v = states("x v")
    p = parameters(S=0.75, w=0.8)
    system = System({x: v, v: -x + cos(p.w * t) - p.S * sign(v)}, parameters=p)
    start = find_orbit(system, (1.5, 0.0), transient=40)
    run = continuation(system, start, parameter="S", bounds=(0.75, 0.85), direction=1)
    special = next(point for point in run if point.special)
    along = curve(run, special, parameter="w", bounds=(0.7, 0.9), direction=1).run()
    end = along.coordinate("S")[-1]
    return f"{special.special} at {special.value:.10f}; {len(along.points)} points to {end:.9f}"


def exponents(Vin: float) -> str:
    """Lyapunov exponents of the buck converter over 150 periods after 50."""
    from filippov.analysis import lyapunov
    from filippov.models import get

    model, T = get("buck_pwm"), 400e-6
    settings = {"stretch": T, "transient": 50 * T, "parameters": {"Vin": Vin}}
    return str(lyapunov(model.build(), model.x0, 150 * T, **settings))


def diagram() -> str:
    """The brute-force diagram of the page on Lyapunov exponents."""
    from filippov.analysis import Section, brute_force
    from filippov.models import get

    model = get("hunting")
    values = np.linspace(10, 24, 57)
    found = brute_force(model.build(), Section.from_model(model), "P", values, 0.2, transient=150, keep=8)
    return f"sum of d {np.sum(np.abs(found.d)):.8f}, periods {np.bincount(found.period).tolist()}"


def tuning() -> str:
    """`filippov tune` of the README with its picture."""
    from filippov.app.cli.main import main

    with tempfile.TemporaryDirectory() as folder:
        record = str(Path(__file__).resolve().parents[2] / "docs/_static/friction.csv")
        given = ["--fixed", "m=1", "--fixed", "beta=2", "-o", f"{folder}/friction"]
        main(["identify", record, *given])
        ranges = ["--over", "P=5:60", "--over", "I=2:20", "--t-max", "20", "--samples", "32"]
        law = ["--identified", f"{folder}/friction/identified.json"]
        main(["tune", "hunting", *law, *ranges, "-o", f"{folder}/tuning"])
        return (Path(folder) / "tuning/tuning.json").read_text(encoding="utf-8")[-400:].replace("\n", " ")


TASKS: dict[str, Callable[[], str]] = {
    "regions, hunting": hunting,
    "regions, hunting, exact borders": lambda: hunting(borders="exact"),
    "regions, arm": arm,
    "regions, arm, exact borders": lambda: arm(borders="exact"),
    "fold curves": fold,
    "border of sliding": border,
    "exponents, 20 V": lambda: exponents(20.0),
    "exponents, 33 V": lambda: exponents(33.0),
    "diagram": diagram,
    "tune": tuning,
}


def processor() -> float:
    """Seconds of this process and of children that have ended."""
    return sum(os.times()[:4])


def main() -> None:
    """Print a line for each task."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", help=f"known: {'; '.join(TASKS)}")
    parser.add_argument("--of", default=str(Path(__file__).resolve().parents[2]), help="the checkout to time")
    given = parser.parse_args()
    sys.path.insert(0, given.of)
    for name in given.names or TASKS:
        TASKS[name]()
        begun = processor()
        said = TASKS[name]()
        print(f"{name:35} {processor() - begun:8.2f} s  {said}", flush=True)


if __name__ == "__main__":
    main()
