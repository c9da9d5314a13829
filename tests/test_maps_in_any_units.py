"""Event maps, fixed points, basins, regions and diagrams in any units of each state, of time and of force.

Every state has a unit of its own, drawn at will, so that no length or tolerance is common to them. In plain
units the figures are those of a 40-digit Taylor integration and of the closed form of a planar relay.
"""

from __future__ import annotations

import os
from math import log

import numpy as np
import pytest

from filippov import System, parameters, sign, states
from filippov.analysis.diagrams.basin import basin
from filippov.analysis.diagrams.bifurcation import bifurcation
from filippov.analysis.diagrams.regions import regions
from filippov.analysis.maps.event_map import EventMap
from filippov.analysis.maps.section import Section
from filippov.analysis.steady.drift_map import first_zero

x, v, z = states("x v z")
PER_DRAW = 200 if os.environ.get("FILIPPOV_PROFILE") == "nightly" else 3
# The cycles of the hunting loop at beta = 2, 1 and 0.5, and whether each is stable.
CYCLES = {
    2.0: [(0.003355834470, False), (0.252304806412, True)], 1.0: [(0.231364108104, True)],
    0.5: [(0.17858969124869, True)],
}  # fmt: skip


class Loop:
    """The hunting loop in units: of x, v and z, of time, of the force and of the gain."""

    def __init__(self, seed: int, beta: float = 2.0) -> None:
        drawn = 10.0 ** np.random.default_rng([seed, 71]).integers(-9, 10, 6)
        self.x, self.v, self.z, self.t, self.force, self.gain = map(float, drawn if seed else np.ones(6))
        p = parameters(P=10.0 * self.gain, I=10.0, beta=beta, Fs=4.0 * self.force)
        q, w, s = x / self.x, v / self.v, z / self.z
        u = p.P / self.gain * (q + w + p.I * s)
        g = 2 + (p.Fs / self.force - 2) * 2.718281828459045235 ** (-((abs(w) / 0.1) ** p.beta))
        rates = {x: w * self.x, v: (-u - g * sign(v) - w) * self.v, z: q * self.z}
        self.system = System({state: rate / self.t for state, rate in rates.items()})
        end = f"(sign(d)*Fs/P*{self.gain / self.force!r} - d/{self.x!r})/I*{self.z!r}"
        self.section = Section("v", "sliding entry", "x", {"x": "d", "v": "0", "z": end}, 100.0 * self.t)


@pytest.mark.parametrize("seed", range(PER_DRAW))
@pytest.mark.parametrize("beta", sorted(CYCLES))
def test_12_13_cycles_of_the_hunting_loop_in_any_units(beta: float, seed: int) -> None:
    loop = Loop(seed, beta)
    found = EventMap(loop.system, loop.section, order=2).fixed_points(0.0, 0.5 * loop.x, 60)
    assert [point.kind for point in found] == ["equilibrium set"] + ["limit cycle"] * len(CYCLES[beta])
    assert found[0].stable == (beta > 1)
    for point, (d, stable) in zip(found[1:], CYCLES[beta], strict=True):
        assert point.d / loop.x == pytest.approx(d, rel=5e-10)
        assert point.stable == stable
        assert point.hidden == 0


@pytest.mark.parametrize("seed", range(1, 1 + PER_DRAW))
def test_12_13_small_cycles_and_the_slope_at_the_set_in_any_units(seed: int) -> None:
    beta = float(np.random.default_rng([seed, 73]).uniform(1.2, 1.4))
    wanted, found = (EventMap(loop.system, loop.section, order=2).fixed_points(0.0, 0.5 * loop.x, 60)
                     for loop in (Loop(0, beta), Loop(seed, beta)))  # fmt: skip
    assert [point.d / Loop(seed).x for point in found] == pytest.approx([q.d for q in wanted], rel=1e-6)
    assert found[0].slope == pytest.approx(wanted[0].slope, rel=1e-8)
    assert [q.verdict for q in found] == [q.verdict for q in wanted] == ["stable", "unstable", "stable"]


@pytest.mark.parametrize("seed", range(1, 1 + max(1, PER_DRAW // 10)))
def test_12_13_regions_diagrams_and_basins_in_any_units(seed: int) -> None:
    plain, loop = Loop(0), Loop(seed)
    told = []
    for one in (plain, loop):
        hi = 0.5 * one.x
        at = ("P", np.array([13.0, 28.0]) * one.gain), ("I", np.array([10.0]))
        cells = regions(one.system, one.section, *at, (0.0, hi), points=12)
        change = bifurcation(
            one.system, one.section, parameter="P", values=(20 * one.gain, 22 * one.gain),
            interval=(0.0, hi), points=40,
        )  # fmt: skip
        lines = ("x", np.linspace(-0.4, 0.4, 6) * one.x), ("v", np.linspace(-2, 2, 6) * one.v)
        ends = basin(one.system, one.section, *lines, (-hi, hi), points=60)
        assert ends.attractors[0] / one.x == pytest.approx(CYCLES[2.0][1][0], rel=1e-7)
        (fold,) = change.special
        # Reference: the two cycles meet near P = 21.
        assert fold.kind == "fold"
        assert abs(fold.value / one.gain - 21.0149798) < 1e-6
        told.append((cells.cycles.tolist(), cells.stable.tolist(), ends.label.tolist()))
    assert told[0] == told[1]


@pytest.mark.parametrize("seed", range(20 * PER_DRAW))
def test_12_13_the_first_zero_of_a_linear_motion_in_any_units(seed: int) -> None:
    # c = x - e^-k y' of two decaying modes 1 and r: e^-t - a e^-r t falls through 0 at log(a)/(r - 1), r < 1.
    rng = np.random.default_rng([seed, 79])
    r, a = rng.uniform(0.2, 0.6), rng.uniform(0.2, 0.8)
    units, time = 10.0 ** rng.integers(-9, 10, 3), 10.0 ** rng.integers(-9, 10)
    frame = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    matrix = frame @ np.diag([-1.0, -r, -2.0]) @ frame.T
    row, y = frame @ np.array([1.0, -a, 0.0]), frame @ np.array([1.0, 1.0, 1.0])
    found = first_zero(matrix * units[:, None] / units / time, row / units, y * units)
    assert found is not None
    assert found / time == pytest.approx(log(1 / a) / (1 - r), rel=1e-8)
