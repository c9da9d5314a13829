"""Measures of outputs in sweeps and comparisons, against closed forms."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from filippov import Problem, Surface, Sweep, System, TimeEvent, parameters, sign, solve, states
from filippov.analysis import compare
from filippov.base.errors import UsageError
from filippov.sweep.measure import read_measures

K = 0.4


def measured(system: System, x0: tuple[float, ...], end: float, text: str, tail: float = 1.0) -> float:
    """One measure of one run at tight tolerances."""
    run = solve(system, x0, (0, end), rtol=1e-11, atol=1e-13)
    (measure,) = read_measures(text, system)
    (value,) = measure.of_solution(run, tail)
    return value


def block() -> System:
    """x'' = -x - K sgn v with its force, its friction and its energy as outputs."""
    x, v = states("x v")
    outputs = {"force": -x, "friction": K * sign(v), "energy": (x**2 + v**2) / 2}
    return System({x: v, v: -x - K * sign(v)}, outputs=outputs)


@pytest.mark.parametrize("seed", range(20))
def test_16_2_outputs_of_a_block_that_comes_to_rest(seed: int) -> None:
    """From x = a the half turns end at 2 K - a, ...; the energy that is lost is K times the way."""
    rng = np.random.default_rng(seed)
    a, end = rng.uniform(1.5, 4), rng.uniform(0.5, 15)
    places, way = [a], 0.0
    while abs(places[-1]) > K and len(places) * math.pi <= end:
        places.append(2 * math.copysign(K, places[-1]) - places[-1])
        way += abs(places[-1] - places[-2])
    left, at = end - (len(places) - 1) * math.pi, places[-1]
    x = at
    if abs(at) > K:
        centre = math.copysign(K, at)
        x = centre + (at - centre) * math.cos(left)
        way += abs(x - at)
        friction = -math.copysign(K, at)
    else:
        friction = -at
    start = (a, 0.0)
    assert measured(block(), start, end, "end(energy)") == pytest.approx(a**2 / 2 - K * way, abs=1e-8)
    assert measured(block(), start, end, "end(friction)") == pytest.approx(friction, abs=1e-8)
    assert measured(block(), start, end, "end(force)") == pytest.approx(-x, abs=1e-8)
    assert measured(block(), start, end, "max(energy)") == pytest.approx(a**2 / 2, abs=1e-9)
    assert measured(block(), start, end, "min(friction)") == pytest.approx(-K, abs=1e-12)
    turned = len(places) > 2 or (len(places) == 2 and abs(at) > K and left > 1e-3)
    if turned:
        assert measured(block(), start, end, "amplitude(friction)") == pytest.approx(K, abs=1e-9)
    # The mean of the velocity is the way over the time, and that of the force the change of x' + friction.
    force = measured(block(), start, end, "mean(force)") - measured(block(), start, end, "mean(friction)")
    last = solve(block(), start, (0, end), rtol=1e-11, atol=1e-13).x_end[1]
    assert force * end == pytest.approx(last, abs=1e-7)


@pytest.mark.parametrize("e", [0.3, 0.5, 0.9])
def test_16_2_outputs_that_jump_at_impacts_count_on_both_sides(e: float) -> None:
    """A ball dropped from 1 m: v goes from -c to e c at once, c = sqrt(2 g)."""
    y, v = states("y v")
    ball = System(
        {y: v, v: -10.0}, surfaces=[Surface("floor", y, reset={v: -e * v})], outputs={"speed": v, "up": -y}
    )
    hit, c = math.sqrt(0.2), math.sqrt(20.0)
    end = hit * (1 + e)  # at the top of the first flight
    assert measured(ball, (1, 0), end, "min(speed)") == pytest.approx(-c, abs=1e-9)
    assert measured(ball, (1, 0), end, "max(speed)") == pytest.approx(e * c, abs=1e-9)
    assert measured(ball, (1, 0), end, "max(up)") == pytest.approx(0, abs=1e-9)
    assert measured(ball, (1, 0), end, "mean(speed)") == pytest.approx((e**2 - 1) / end, abs=1e-9)


def test_16_2_outputs_that_jump_with_a_clock() -> None:
    """A value that is sampled each second from x' = 1: held, it is 0, 1, 2."""
    x, held = states("x held")
    system = System(
        {x: 1.0, held: 0.0}, time_events=[TimeEvent("tick", period=1.0, reset={held: x})],
        outputs={"lag": x - held},
    )  # fmt: skip
    assert measured(system, (0, 0), 2.5, "max(lag)") == pytest.approx(1, abs=1e-9)
    assert measured(system, (0, 0), 2.5, "min(lag)") == pytest.approx(0, abs=1e-9)
    assert measured(system, (0, 0), 2.5, "mean(lag)") == pytest.approx((0.5 + 0.5 + 0.125) / 2.5, abs=1e-9)


def test_16_2_outputs_of_plain_functions() -> None:
    system = System(
        field=lambda t, x, p, s: [x[1], -x[0] - K * s[0]], states="x v",
        surfaces=[Surface("v", lambda t, x, p: x[1])], outputs={"friction": lambda t, x, p, s: K * s[0]},
    )  # fmt: skip
    assert measured(system, (3.0, 0.0), 20.0, "end(friction)") == pytest.approx(-0.2 * -1, abs=1e-8)
    assert measured(system, (3.0, 0.0), 6.0, "amplitude(friction)") == pytest.approx(K, abs=1e-12)


def test_16_2_a_sweep_over_an_output_knows_its_formula(tmp_path: Path) -> None:
    """Amplitudes of k x over k; the same folder is refused for another formula."""
    x, v = states("x v")
    p = parameters(k=1.0)

    def sweep(factor: float) -> Sweep:
        system = System({x: v, v: -p.k * x}, parameters=p, outputs={"force": factor * p.k * x})
        return Sweep(Problem(system, (1, 0), (0, 20)), {"k": [1.0, 4.0, 9.0]}, measure="amplitude(force)")

    table = sweep(1.0).run(tmp_path / "kept", jobs=1)
    assert np.allclose(table["amplitude(force)"], [1, 4, 9], atol=1e-7)
    assert not sweep(1.0).lanes
    with pytest.raises(UsageError):
        sweep(2.0).run(tmp_path / "kept", jobs=1, resume=True)


def test_16_2_a_sweep_says_what_it_cannot_see_of_an_output(tmp_path: Path) -> None:
    """A function that reads a file: resuming asks for trust, as it does for a measure of the user's."""
    file = tmp_path / "gain.txt"
    file.write_text("2", encoding="utf-8")
    system = System(
        field=lambda t, x, p, s: [-x[0]], states="x",
        outputs={"scaled": lambda t, x, p, s: float(file.read_text(encoding="utf-8")) * x[0]},
    )  # fmt: skip
    sweep = Sweep(Problem(system, (1.0,), (0, 1)), {"x0.x": [1.0, 2.0]}, measure="end(scaled)")
    assert sweep.unseen


def test_15_4_approximations_have_the_outputs_without_signs() -> None:
    """The energy of a pendulum, K times its way below that of the start; a bristle model has no friction."""
    (q, w), p = states("q w"), parameters(M=0.5)
    system = System({q: w, w: -q - p.M * sign(w)}, parameters=p,
                    outputs={"energy": (q**2 + w**2) / 2, "friction": p.M * sign(w)})  # fmt: skip
    table = compare(
        system, (3, 0), (0, 5), against=["switch", "lugre", "moreau"], widths=(1e-2, 1e-3),
        measures=["end(energy)", "min(friction)"],
    )  # fmt: skip
    place = -0.5 + (-2 + 0.5) * math.cos(5 - math.pi)
    exact = 4.5 - 0.5 * (5 + abs(place + 2))
    assert table.rows[0]["end(energy)"] == pytest.approx(exact, abs=1e-8)
    for name in ("switch", "lugre", "moreau"):
        coarse, fine = (abs(row["end(energy)"] - exact) for row in table.of(name))
        assert fine < coarse < 0.1
    assert {row["min(friction)"] for row in table.of("lugre")} == {None}
    assert all(row["min(friction)"] == pytest.approx(0.5, abs=1e-9) for row in table.of("switch"))


def test_16_4_what_a_measure_cannot_name_says_what_there_is() -> None:
    with pytest.raises(UsageError, match="enrgy"):
        read_measures("end(enrgy)", block())
