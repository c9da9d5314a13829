"""Curves of special points in other units of states, time and parameters: the points on them are the same."""

from __future__ import annotations

from collections.abc import Callable
from math import sqrt
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

from filippov import Surface, System, parameters, sign, states
from filippov.analysis.bifurcations.continuation import Continuation, continuation
from filippov.analysis.bifurcations.curve import curve
from filippov.analysis.maps.event_map import EventMap
from filippov.analysis.maps.section import Section
from filippov.analysis.orbits.orbit_search import find_orbit
from filippov.models import get

x, y, z = states("x y z")
FAR = {"step": 0.1, "max_step": 0.3}
PER_DRAW = 2


class Units:
    """Units drawn at will: of the states, the time and the parameters a and b."""

    def __init__(self, seed: int) -> None:
        drawn = 10.0 ** np.random.default_rng([seed, 29]).choice([-6.0, -3.0, 0.0, 3.0, 6.0], 5)
        self.x, self.y, self.t, self.a, self.b = (float(v) for v in drawn)

    def system(self, rates: Callable[[Any, Any, Any, Any], Any], a: float, b: float) -> System:
        """x' and y' of the system in these units, given in others."""
        p = parameters(a=a * self.a, b=b * self.b)
        found = rates(x / self.x, y / self.y, p.a / self.a, p.b / self.b)
        sizes = (self.x, self.y)
        return System({q: size * f / self.t for q, size, f in zip((x, y), sizes, found, strict=True)})

    def along(
        self, system: System, kind: str, start: float, bounds: tuple[float, float], over: tuple[float, float],
        way: int, mode: str = "",
    ) -> dict[str, tuple[float, float]]:  # fmt: skip
        """The points on the curve of a kind over b: values of b and a."""
        low, high = (self.a * v for v in bounds)
        run = continuation(
            system, (start * self.x, 0.0), parameter="a", bounds=(low, high), mode=mode, direction=way, **FAR
        )
        return self.points(run, kind, over)

    def points(self, run: Continuation, kind: str, over: tuple[float, float]) -> dict[str, Any]:
        """The same of a continuation over a."""
        at = next(q for q in run.run().special if q.special == kind)
        found = curve(run, at, parameter="b", bounds=(self.b * over[0], self.b * over[1]), **FAR).run()
        assert sorted(found.values[[0, -1]] / self.b) == pytest.approx(over) or kind == "fold"
        return {q.special: (q.value / self.b, q.coordinates["a"] / self.a) for q in found.special}


def bogdanov_takens(units: Units) -> None:
    system = units.system(lambda u, w, a, b: (w, a + b * u + u**2 + u * w), -0.5, -1.0)
    for kind in ("fold", "Hopf"):
        found = units.along(system, kind, (1 - sqrt(3)) / 2, (-0.5, 0.4), (-1.5, 1.0), 1)
        assert found == {"Bogdanov-Takens": pytest.approx((0, 0), abs=1e-5)}


def bautin(units: Units) -> None:
    def rates(u: Any, w: Any, a: Any, b: Any) -> Any:
        ring = a + b * (u**2 + w**2) - (u**2 + w**2) ** 2
        return ring * u - w, u + ring * w

    found = units.along(units.system(rates, -0.5, -1.0), "Hopf", 0.0, (-0.5, 0.5), (-1.0, 1.0), 1)
    assert found == {"Bautin": pytest.approx((0, 0), abs=1e-5)}


def cusp(units: Units) -> None:
    start = brentq(lambda u: 0.8 + 0.6 * u - u**3, 0.5, 2)
    system = units.system(lambda u, w, a, b: (a + b * u - u**3, -w), 0.8, 0.6)
    found = units.along(system, "fold", start, (-1.0, 0.8), (-1.0, 1.0), -1)
    assert found == {"cusp": pytest.approx((0, 0), abs=1e-5)}


def boundary(units: Units) -> None:
    def rates(u: Any, w: Any, a: Any, b: Any) -> Any:
        s = (1 + sign(x)) / 2
        plus = b * (u - a) - w, u - a + (b - 0.5) * w
        return s * plus[0] + (1 - s), s * plus[1] - (1 - s)

    system = units.system(rates, 0.5, -1.0)
    found = units.along(system, "boundary equilibrium", 0.5, (-0.5, 0.5), (-1.0, 2.0), -1, mode="+")
    assert found == {
        "boundary Hopf": pytest.approx((0.25, 0), abs=1e-5),
        "degenerate boundary equilibrium": pytest.approx((1.5, 0), abs=1e-5),
    }


@pytest.mark.parametrize("seed", range(PER_DRAW))
@pytest.mark.parametrize("check", [bogdanov_takens, bautin, cusp, boundary])
def test_12_13_points_on_curves_of_equilibria_in_any_units(check: Callable[..., None], seed: int) -> None:
    check(Units(seed + 1))


@pytest.mark.parametrize(("unit", "length"), [(1e-6, 1.0), (1e6, 1.0), (1.0, 1e-6)])
def test_12_13_points_on_a_fold_curve_of_orbits_in_any_units(unit: float, length: float) -> None:
    # (x, y) -> (y, a - b x - y^2): folds a = -(1 + b)^2/4, of which the other multiplier is b.
    units, p = Units(0), parameters(a=0.3 * unit, b=0.3 * unit)
    units.a = units.b = unit
    jump = {x: y, y: length * p.a / unit - p.b / unit * x - y**2 / length, z: 0 * z}
    tick = Surface("tick", z - 1, reset=jump, side="-")
    system = System({x: 0 * x, y: 0 * y, z: 1 + 0 * z}, surfaces=[tick])
    at = length * (-1.3 + sqrt(1.3**2 + 1.2)) / 2
    orbit = find_orbit(system, (at, at, 0.3), period=1.0)
    run = continuation(
        system, orbit, parameter="a", bounds=(-0.6 * unit, 0.3 * unit), direction=-1, **FAR
    )
    assert units.points(run, "fold", (-1.3, 1.4)) == {
        "fold-flip": pytest.approx((-1, 0), abs=1e-5), "resonance 1:1": pytest.approx((1, -1), abs=1e-5),
    }  # fmt: skip


@pytest.mark.parametrize("length", [1e-6, 1e3])
def test_12_13_the_fold_of_hunting_cycles_over_a_gain_in_any_unit_of_length(length: float) -> None:
    model = get("hunting")
    system, section = model.build(), Section.from_model(model)
    values = {"m": 1 / length, "P": 10 / length, "vs": 0.1 * length, "b": 1 / length}
    second = EventMap(system, section, order=2, parameters=values)
    bounds = (10 / length, 31 / length)
    run = continuation(system, (second, 0.2523 * length), parameter="P", bounds=bounds, direction=1)
    (fold,) = run.run().special
    found = curve(run, fold, parameter="I", bounds=(8, 12)).run()
    # Both ends are those in metres, and no cycle shrinks into the set.
    ends = zip(found.values[[0, -1]], found.coordinate("P")[[0, -1]] * length, strict=True)
    assert sorted(ends) == [pytest.approx((8, 18.996271), abs=1e-5), pytest.approx((12, 22.9949), abs=1e-5)]
    assert "shrinks" not in found.message
