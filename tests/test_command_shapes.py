"""The document of an analysis command is `to_dict` of what the function of the same name returns.

Names, shapes and numbers are the same; the command adds only which model it loaded.
"""

from __future__ import annotations

import json
import shlex
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from filippov import System, analysis, cos, models, parameters, sign, states, t
from filippov.app.cli.console import plain
from filippov.app.cli.main import main
from filippov.models.driven import driven_mass
from filippov.models.offered import LAWS

X, V = states("x v")
K = parameters(k=1.0, c=0.1, mu=0.3, F=1.0, w=1.5)
FORCED = System({X: V, V: -K.k * X - K.c * V - K.mu * sign(V) + K.F * cos(K.w * t)})
# x falls by 2 mu from a reversal to the next: a cycle of the relay's loop, with an exact parametrisation.
P = parameters(k=1.0, a=0.2, mu=0.3)
RELAY = System({X: V, V: -P.k * X + P.a * V - P.mu * sign(V)})
D = parameters(m=1.0, g=0.0)
DUFFING = System({X: V, V: D.m * X - X**3 - D.g * V})
Y, Z = states("y z")
Q = parameters(K=1.0)
THIRD = System({X: Y, Y: Z, Z: -3 * Z - 3 * Y - X - 20 * Q.K * sign(X)})
SECTION = analysis.Section("v", "crossing up", "x", {"x": "-d", "v": "0"})
FLAGS = "--surface v --event 'crossing up' --coordinate x --parametrisation x=-d,v=0 --interval 0 6"
CURVE = "v,friction\n" + "".join(f"{v},{1 + 0.5 * np.exp(-v)}\n" for v in np.linspace(0.1, 3, 12).tolist())


def values(low: float, high: float, count: int) -> list[float]:
    return np.linspace(low, high, count).tolist()


def branch() -> Any:
    orbit = analysis.find_orbit(FORCED, (0.0, 0.0), parameters={"F": 1.0})
    return analysis.continuation(FORCED, orbit, parameter="F", bounds=(1.0, 1.2), direction=1).run()


def axes(**named: tuple[float, float]) -> tuple[Any, Any]:
    one, two = ((name, values(low, high, 3)) for name, (low, high) in named.items())
    return one, two


CASES: dict[str, tuple[str, Callable[[], Any]]] = {
    "diagram": (
        "FORCED --over F=1:1.2:3 --x0 0,0 --transient 20 --keep 4",
        lambda: analysis.brute_force(FORCED, None, "F", values(1, 1.2, 3), (0, 0), transient=20, keep=4),
    ),
    "diagram of a coordinate": (
        f"RELAY --over mu=0.2:0.4 --count 3 --transient 5 --keep 4 {FLAGS} --start 1",
        lambda: analysis.brute_force(RELAY, SECTION, "mu", values(0.2, 0.4, 3), 1.0, transient=5, keep=4),
    ),
    "bifurcation": (
        "FORCED --over F=1:1.2 --count 3 --x0 0,0",
        lambda: analysis.bifurcation(FORCED, None, parameter="F", values=values(1, 1.2, 3), x0=(0, 0)),
    ),
    "bifurcation of a coordinate": (
        f"RELAY --over mu=0.2:0.4:3 --points 40 {FLAGS}",
        lambda: analysis.bifurcation(
            RELAY, SECTION, parameter="mu", values=values(0.2, 0.4, 3), interval=(0, 6), points=40
        ),
    ),
    "orbit": ("FORCED --x0 0,0", lambda: analysis.find_orbit(FORCED, (0, 0))),
    "continue": ("FORCED --x0 0,0 --parameter F --from 1 --to 1.2", branch),
    "lyapunov": (
        "FORCED --x0 0,0 --duration 20 --interval 2",
        lambda: analysis.lyapunov(FORCED, (0, 0), 20, interval=2),
    ),
    "regions": (
        f"RELAY --over mu=0.2:0.4:3 --over a=0.1:0.3:3 --points 20 {FLAGS}",
        lambda: analysis.regions(RELAY, SECTION, *axes(mu=(0.2, 0.4), a=(0.1, 0.3)), (0, 6), points=20),
    ),
    "basin": (
        f"RELAY --over x0.x=0.5:2:3 --over v=0.5:2:3 {FLAGS}",
        lambda: analysis.basin(RELAY, SECTION, *axes(x=(0.5, 2), v=(0.5, 2)), (-6, 6)),
    ),
    "tune": (
        f"RELAY --over k=0.5:2 --samples 16 --grid 4 {FLAGS}",
        lambda: analysis.tune(RELAY, SECTION, {"k": (0.5, 2)}, (0, 6), samples=16),
    ),
    "attractors": (
        "DUFFING -p g=0.3 --box x=-1.5:1.5 --box v=-1:1 --samples 20",
        lambda: analysis.attractors(
            DUFFING, {"x": (-1.5, 1.5), "v": (-1, 1)}, parameters={"g": 0.3}, samples=20
        ),
    ),
    "manifold": ("DUFFING --x0 0,0 --length 1", lambda: analysis.manifold(DUFFING, (0, 0), length=1)),
    "stability": ("RELAY", lambda: analysis.stability_report(RELAY)),
    "describing-function": ("THIRD -p K=2", lambda: analysis.describing_function(THIRD, parameters={"K": 2})),
    "compare": (
        "FORCED --x0 0,0 --t-span 0 3 --against tanh --widths 0.1,0.01",
        lambda: analysis.compare(FORCED, (0, 0), (0, 3), against=["tanh"], widths=(0.1, 0.01)),
    ),
    "homoclinic": (
        "DUFFING --x0 0,0 --free g -p g=0.05",
        lambda: analysis.find_homoclinic(DUFFING, (0, 0), free="g", parameters={"g": 0.05}),
    ),
}  # fmt: skip
# Times of a run are those of that run.
OF_A_RUN = ("seconds", "time_ratio")


def still(data: Any) -> Any:
    if isinstance(data, dict):
        return {key: still(value) for key, value in data.items() if key not in OF_A_RUN}
    return [still(value) for value in data] if isinstance(data, list) else data


@pytest.mark.parametrize("name", CASES)
def test_16_c_a_command_writes_what_the_function_returns(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words, call = CASES[name]
    model, *rest = shlex.split(words)
    made = [name.partition(" ")[0], f"{__file__}:{model}", *rest, "--json", "--quiet", "-o", str(tmp_path)]
    assert main(made) == 0
    told = json.loads(capsys.readouterr().out)
    assert told.pop("model", f"{__file__}:{model}") == f"{__file__}:{model}"
    if name == "continue":
        assert told.pop("switched") == told.pop("curves") == []
    assert still(told) == still(plain(call().to_dict()))


def test_16_c_a_curve_of_friction(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "curve.csv"
    file.write_text(CURVE, encoding="utf-8")
    words = ["identify", str(file), "--fixed", "m=1", "--fixed", "beta=1"]
    assert main([*words, "--json", "--quiet"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told.pop("data") == str(file)
    system = driven_mass(getattr(models, LAWS[told.pop("law")])())
    free, fixed = ["Fs", "Fc", "vs", "b"], {"m": 1, "beta": 1}
    found = analysis.identify_curve(analysis.read_record(file), system, free, fixed=fixed)
    assert told == plain(found.to_dict())


def test_16_c_both_manifolds_are_a_list_of_the_two(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["manifold", f"{__file__}:DUFFING", "--x0", "0,0", "--length", "1", "--side", "both",
                 "--json", "--quiet"]) == 0  # fmt: skip
    told = json.loads(capsys.readouterr().out)["manifolds"]
    both = [analysis.manifold(DUFFING, (0, 0), side, length=1) for side in ("unstable", "stable")]
    assert told == [plain(one.to_dict()) for one in both]


def test_16_c_the_map_of_a_section(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["event-map", f"{__file__}:RELAY", *shlex.split(FLAGS), "--points", "40",
                 "--json", "--quiet"]) == 0  # fmt: skip
    told = json.loads(capsys.readouterr().out)
    turn = analysis.EventMap(RELAY, SECTION)
    assert told["fixed_points"] == [plain(q.to_dict()) for q in turn.fixed_points(0, 6, 40)]
    assert told["section"] == SECTION.to_dict()
    image = np.array(told["R"], dtype=float)  # null where no solution returns
    assert np.allclose(image, turn(np.array(told["d"])), rtol=1e-12, atol=1e-12, equal_nan=True)
