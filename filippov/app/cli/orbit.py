"""filippov orbit, homoclinic: periodic orbits with their multipliers, orbits from a saddle to itself."""

from __future__ import annotations

from typing import Any

import numpy as np

from filippov.app.cli.console import Console
from filippov.app.cli.folder import Folder
from filippov.app.cli.model import loaded_of
from filippov.base.errors import UsageError

KEEP = ("period", "symmetry", "nodes", "transient", "t_max", "rtol", "atol", "method")
VERDICTS = {
    "stable": "stable orbit", "unstable": "unstable orbit",
    "undecided": "orbit with a multiplier on the unit circle, which decides nothing",
}  # fmt: skip
OF_HOMOCLINIC = ("free", "mode", "side", "t_max", "rtol", "atol")


def run(settings: dict[str, Any], console: Console) -> int:
    """Find the orbit from --x0, say what it is, write orbit.json, orbit.csv and orbit.png."""
    loaded = loaded_of(settings)
    problem = loaded.problem({**settings, "t_span": (0.0, 1.0)})
    folder = Folder(settings["output"], console)
    from filippov.analysis.orbits.orbit_search import find_orbit as find

    options = {name: settings[name] for name in KEEP if settings.get(name) is not None}
    with console.progress("orbit") as progress:
        orbit = find(
            problem.system, problem.x0, parameters=problem.parameters,
            progress=progress, **options,
        )  # fmt: skip
    data = {"model": loaded.name} | orbit.to_dict()
    console.result(data)
    tell(orbit, console)
    rows = [row for piece in orbit.pieces for row in _rows(piece, _count(piece, orbit.period))]
    folder.csv("orbit.csv", ("t", *problem.system.states), rows)
    folder.file("orbit.json", orbit.save)
    folder.picture("orbit.png", lambda: orbit.plot(title=""))
    folder.report()
    return 0


def run_homoclinic(settings: dict[str, Any], console: Console) -> int:
    """Find it near --x0, say where it is, write homoclinic.json, homoclinic.csv and homoclinic.png."""
    if settings.get("free") is None:
        raise UsageError("homoclinic needs the parameter that is solved for: --free NAME.")
    loaded = loaded_of(settings)
    problem = loaded.problem({**settings, "t_span": (0.0, 1.0)})
    folder = Folder(settings["output"], console)
    from filippov.analysis.orbits.homoclinic import find_homoclinic as find

    options = {name: settings[name] for name in OF_HOMOCLINIC if settings.get(name) is not None}
    found = find(problem.system, problem.x0, parameters=problem.parameters, **options)
    data = {"model": loaded.name} | found.to_dict()
    console.result(data)
    place = ", ".join(f"{n} = {v:.9g}" for n, v in zip(problem.system.states, found.saddle.x, strict=True))
    console.say(f"homoclinic orbit at {found.free} = {found.value:.12g}: {found.word}")
    console.say(f"saddle: {place}; eigenvalues: {', '.join(f'{v:.9g}' for v in found.saddle.eigenvalues)}")
    rows = [row for piece in found.pieces for row in _rows(piece, 9)]
    folder.csv("homoclinic.csv", ("t", *problem.system.states), rows)
    folder.json("homoclinic.json", data)
    folder.picture("homoclinic.png", found.plot)
    folder.report()
    return 0


def _rows(piece: Any, count: int) -> list[list[float]]:
    """Time and states along one of the solutions, at so many times."""
    t = np.linspace(piece.problem.t_span[0], piece.t_end, count)
    rows: list[list[float]] = np.vstack([t, piece.sol(t)]).T.tolist()
    return rows


def _count(piece: Any, period: float) -> int:
    """Its share of 401 times over a period."""
    length = float(piece.t_end - piece.problem.t_span[0])
    return max(2, round(401 * length / period))


def tell(orbit: Any, console: Console) -> None:
    """What an orbit is, in words."""
    console.say(f"{VERDICTS[orbit.verdict]}, period {orbit.period:.12g}: {orbit.word}")
    state = ", ".join(f"{n} = {v:.12g}" for n, v in zip(orbit.system.states, orbit.x0, strict=True))
    console.say(f"state on it: {state}" + (f" at t = {orbit.t0:.12g}" if orbit.forced else ""))
    console.say("multipliers: " + (", ".join(number(v) for v in orbit.multipliers) or "none besides 1"))
    if orbit.half_multipliers is not None:
        values = ", ".join(number(v) for v in orbit.half_multipliers) or "none"
        console.say(f"symmetric, x(t + T/2) = -x(t); multipliers of the half map: {values}")
    console.say("amplitude: " + ", ".join(f"{n} {a:.9g}" for n, a in orbit.amplitude.items()))
    edge = orbit.margin
    if np.isfinite(edge.distance):
        console.say(f"passes surface '{edge.surface}' at distance {edge.distance:.6g} (t = {edge.t:.6g})")
    if np.isfinite(edge.transversality):
        when = f"t = {edge.transversal_t:.6g}"
        console.say(f"least relative speed at an event {edge.transversality:.6g} ({when})")


def number(value: complex) -> str:
    """A multiplier in words."""
    if value.imag == 0:
        return f"{value.real:.10g}"
    return f"{value.real:.10g}{value.imag:+.10g}i"
