"""Verdicts of random systems do not change with the order, the senses and the units of states and time."""

import numpy as np
import pytest
from verdict_draws import Draw, draw

from filippov import Abs, Piecewise, Surface, System, sign, states
from filippov.analysis.local_stability.stability import stability_report
from filippov.analysis.steady.equilibrium import EquilibriumSet


def moved(a: Draw, T: np.ndarray, k: float) -> Draw:
    """The same in the states T x and the time t/k."""
    back = np.linalg.inv(T)
    clock = None if a.clock is None else (a.clock[0] / k, T @ a.clock[1] @ back)
    floor = None if a.floor is None else T @ a.floor @ back
    return Draw(k * T @ a.A @ back, k * T @ a.B, a.C @ back, a.phi, k * T @ a.g, clock, floor)


def verdicts(a: Draw, T: np.ndarray) -> list[tuple[int, tuple[float, ...], str]] | None:
    """Dimension, place of a point in the states T^-1 x, and answer of all equilibria; None where cut off."""
    report = stability_report(a.system(), budget=6.0)
    if "stopped" in report.to_text():
        return None
    found = []
    for item in report.items:
        e, at = item.equilibrium, ()
        if not isinstance(e, EquilibriumSet):
            at = tuple((np.round(np.linalg.solve(T, np.array(e.value)), 6) + 0.0).tolist())
        found.append((e.dimension if isinstance(e, EquilibriumSet) else 0, at, item.answer))
    return sorted(found)


# One of each kind.
@pytest.mark.parametrize("seed", range(60, 65))
def test_verdicts_do_not_change_with_the_order_senses_and_units_of_states(seed: int) -> None:
    a, rng = draw(seed), np.random.default_rng(seed)
    n, here = len(a.A), np.eye(len(a.A))
    known = verdicts(a, here)
    # The first state is that above the floor.
    first = int(a.floor is not None)
    order = np.append(np.arange(first), first + rng.permutation(n - first)).astype(int)
    senses, tens = rng.choice([-1.0, 1.0], n), 10.0 ** rng.integers(-1, 2, n)
    senses[:first] = 1.0
    for T, k in ((here[order], 1.0), (np.diag(senses), 1.0), (np.diag(tens), 1.0), (here, 10.0)):
        other = verdicts(moved(a, T, k), T)
        assert known is None or other is None or other == known


@pytest.mark.parametrize("c", [1, 10, -3])
def test_a_mass_in_any_unit_of_its_speed(c: int) -> None:
    """x' = c v: friction that outdoes the growth of a small speed stops it; an energy keeps a dead zone."""
    x, v = states("x v")
    (stops,) = stability_report(System({x: c * v, v: v - 2 * sign(v)})).items
    assert stops.answer == "asymptotically stable"
    dead = Piecewise((x - 1, x > 1), (x + 1, x < -1), (0, True))
    items = stability_report(System({x: c * v, v: -c * dead})).items
    assert [item.answer for item in items if len(getattr(item.equilibrium, "ends", ())) == 2] == ["stable"]


@pytest.mark.parametrize("c", [-1, -3, 2])
def test_the_energy_of_a_mass_in_any_unit_and_sense_of_its_speed(c: int) -> None:
    """x' = c v: the verdicts are those of x'' = F(x, x')."""
    x, v = states("x v")
    forces = {
        -x - v**3: "asymptotically stable", -x + v**3: "unstable", -(x**3): "stable",
        -sign(x) - v: "asymptotically stable", -sign(x) + v / 10: "unstable",
        -x - v * Abs(v): "asymptotically stable",
    }  # fmt: skip
    for force, answer in forces.items():
        (item,) = stability_report(System({x: c * v, v: force.subs(v, c * v) / c})).items
        assert item.answer == answer, force
    clegg = Surface("zero", x, reset={v: 0}, side="both")
    (item,) = stability_report(System({x: c * v, v: -x / c}, surfaces=[clegg])).items
    assert item.answer == "asymptotically stable"
