"""Orbits and branches from files: an altered one is refused by name, and what it holds is checked."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from filippov import System, UsageError, cos, parameters, sign, states, t
from filippov.analysis import Branch, Orbit, continuation, find_orbit

X, V = states("x v")
P = parameters(F=1.0, mu=0.3)
S = System({X: V, V: -X - 0.1 * V - P.mu * sign(V) + P.F * cos(1.4 * t)})


@pytest.fixture(scope="module")
def orbit() -> Any:
    return find_orbit(S, (0, 0))


@pytest.fixture(scope="module")
def branch(orbit: Any) -> Any:
    return continuation(S, orbit, parameter="F", bounds=(1.0, 1.1), direction=1).run()


READ: dict[str, Callable[[Path], Any]] = {"orbit": Orbit.load, "branch": Branch.load}


@pytest.mark.parametrize("what", READ)
def test_16_g_digits_that_were_altered(what: str, request: pytest.FixtureRequest, tmp_path: Path) -> None:
    made = request.getfixturevalue(what)
    path = made.save(tmp_path / "made.json")
    text = path.read_text()
    same = READ[what](path)
    assert np.array_equal(same.x0, made.x0) if what == "orbit" else np.array_equal(same.values, made.values)
    digits = [k for k, c in enumerate(text) if c.isdigit()]
    named = [k for k in digits if text[k - 3 : k] == "sha"]
    for k in [*named, *np.random.default_rng(3).choice(digits, 40, replace=False).tolist()]:
        altered = text[:k] + str((int(text[k]) + 1) % 10) + text[k + 1 :]
        if json.loads(altered) == json.loads(text):  # the 17th digit may not count
            continue
        path.write_text(altered)
        with pytest.raises(UsageError, match=r"made\.json"):
            READ[what](path)


@pytest.mark.parametrize("period", [None, "x", -1.0, 0.0, [1.0]])
def test_16_g_an_orbit_without_a_digest(period: Any, orbit: Any, tmp_path: Path) -> None:
    path = orbit.save(tmp_path / "made.json")
    data = json.loads(path.read_text())
    del data["sha256"]
    path.write_text(json.dumps(data))
    assert Orbit.load(path).period == orbit.period
    data["orbit"]["period"] = period
    path.write_text(json.dumps(data))
    with pytest.raises(UsageError, match="describe no orbit"):
        Orbit.load(path)


def test_16_g_spacing_is_no_content(orbit: Any, tmp_path: Path) -> None:
    path = orbit.save(tmp_path / "made.json")
    path.write_text(json.dumps(json.loads(path.read_text()), indent=7, sort_keys=True))
    assert Orbit.load(path).period == orbit.period


def test_an_orbit_with_a_tolerance_for_each_state_is_read_again(tmp_path: Path) -> None:
    x, v = states("x v")
    orbit = find_orbit(System({x: v, v: (1 - x**2) * v - x}), (2.0, 0.0), atol=[1e-12, 1e-13])
    assert Orbit.load(orbit.save(tmp_path / "orbit.json")).atol == (1e-12, 1e-13)


WRONG: list[tuple[str, tuple[Any, ...], Any]] = [
    ("orbit", ("system", "field", 1), ["float", [0, "1", 0, 1.5], 53]),
    ("orbit", ("system", "states"), "nan"), ("orbit", ("system", "surfaces", 0, "kind"), ""),
    ("orbit", ("orbit",), 1),
    ("orbit", ("orbit", "x0"), {"number": []}), ("orbit", ("orbit", "margin"), None),
    ("branch", ("points", 1, "value"), "x"), ("branch", ("points", 1, "value"), None),
    ("branch", ("points", 1, "coordinates"), {}), ("branch", ("points", 1, "coefficients"), None),
    ("branch", ("points", 0, "u"), ["x"]), ("branch", ("points", 0, "verdict"), 3),
    ("branch", ("points",), 7), ("branch", ("parameters",), {"mu": "0.3"}),
]  # fmt: skip


@pytest.mark.parametrize(("what", "place", "value"), WRONG)
def test_16_g_what_is_wrong_in_a_file_is_said_with_its_name(
    what: str, place: tuple[Any, ...], value: Any, request: pytest.FixtureRequest, tmp_path: Path
) -> None:
    path = request.getfixturevalue(what).save(tmp_path / "made.json")
    data = json.loads(path.read_text())
    del data["sha256"]
    inner = data
    for key in place[:-1]:
        inner = inner[key]
    inner[place[-1]] = value
    path.write_text(json.dumps(data))
    with pytest.raises(UsageError, match=r"made\.json"):
        READ[what](path)
