"""method="Taylor": closed forms, events to rounding, sliding in series, and the same motions as DOP853."""

import math
from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.special import ellipj, ellipk

from filippov import (
    Abs,
    Max,
    Min,
    Stop,
    Surface,
    System,
    UsageError,
    cos,
    exp,
    models,
    parameters,
    sign,
    sin,
    solve,
    sqrt,
    states,
    t,
    tanh,
)
from filippov.app.cli.main import main
from filippov.kernel.codegen import jets
from filippov.kernel.tables.tableaus import SERIES_ORDERS, for_tolerance

x, v, y = states("x v y")
q = parameters(c=0.9, g=9.81)
at = parameters(c=2.0, w=0.1)
law = parameters(beta=2.0)
PENDULUM = System({x: v, v: -sin(x)})
BOUNCE = System({x: v, v: -sign(x)})


def taylor(system: System, x0: Any, end: float, **options: Any) -> Any:
    run = solve(system, x0, (0, end), method="Taylor", **options)
    assert run.success, run.message
    return run


def test_14_2_orders_go_with_the_tolerance() -> None:
    assert [for_tolerance("Taylor", r) for r in (1e6, 1e-4, 1e-9, 1e-10, 1e-13)] == [
        "Taylor8", "Taylor8", "Taylor14", "Taylor14", "Taylor18"
    ]  # fmt: skip
    assert for_tolerance("DP5", 1e-9) == "DP5"
    assert all(f"Taylor{order}" == for_tolerance("Taylor", 10.0 ** (4 - order)) for order in SERIES_ORDERS)


def test_14_2_a_pendulum_by_elliptic_functions() -> None:
    k, end, rtol = math.sin(0.5), 20.0, 1e-10
    run = taylor(PENDULUM, (1.0, 0.0), end, rtol=rtol, atol=rtol)
    sn = ellipj(ellipk(k * k) - np.asarray(run.t), k * k)[0]
    assert np.max(abs(run.sol(run.t)[0] - 2 * np.arcsin(k * sn))) < 40 * rtol
    # The dense output is the step's own polynomial, as accurate as its end.
    times = np.linspace(0, end, 301)
    sn = ellipj(ellipk(k * k) - times, k * k)[0]
    assert np.max(abs(run.sol(times)[0] - 2 * np.arcsin(k * sn))) < 40 * rtol


def test_14_2_crossings_of_parabolas_to_rounding() -> None:
    run = taylor(BOUNCE, (1, 0), 100, rtol=1e-10)
    times = math.sqrt(2) * (1 + 2 * np.arange(len(run.events)))
    assert len(run.events) == 35
    assert max(abs(run.events.t - times)) < 1e-12


def test_14_2_impacts_of_a_ball() -> None:
    ball = System(
        {x: v, v: -q.g},
        surfaces=[Surface("floor", x, kind="reset", side="+", reset={v: -q.c * v})],
    )
    first = math.sqrt(2 / 9.81)
    cycles = 2 * first * 0.9 ** np.arange(1, 40)
    times = first + np.concatenate([[0], np.cumsum(cycles)])
    run = taylor(ball, (1, 0), times[-1] + 1e-4, rtol=1e-10)
    assert max(abs(run.events.t - times)) < 1e-12


def test_14_2_a_slide_down_a_moving_ramp_and_off_it() -> None:
    moving = System({x: 0 * x - sign(x - 1 + t**2)}, surfaces=[Surface("ramp", x - 1 + t**2)])
    run = taylor(moving, (0.5,), 2)
    assert max(abs(run.events.t - [(math.sqrt(3) - 1) / 2, 0.5])) < 1e-12
    assert abs(run.x_end[0] + 0.75) < 1e-12


def test_14_2_the_sliding_field_is_a_series_of_its_own() -> None:
    # Off y = 0 the field is (1, -x) above and (0, 1) below; on it x' = 1/(1 + x).
    upper = (1 + sign(y)) / 2
    fold = System({x: upper, y: 1 - upper - x * upper}, surfaces=[Surface("y", y)])
    run = taylor(fold, (0, 0), 1, rtol=1e-10)
    assert run.modes == ("0",)
    assert abs(run.x_end[0] - (math.sqrt(3) - 1)) < 1e-11
    assert run.steps < 12
    assert max(abs(run.sol(s)[0] - (math.sqrt(1 + 2 * s) - 1)) for s in np.linspace(0, 1, 33)) < 1e-11


def test_14_2_what_the_series_does_not_show_shows_at_the_end_of_the_step() -> None:
    # A wall at x = 2 of width 1e-3, of which nothing is left in the series at 0; then the same with a peak.
    wall = System({x: 1 + 0 * x, y: tanh(1000 * (x - 2))})
    run = taylor(wall, (0, 0), 5, rtol=1e-10)
    assert abs(run.x_end[1] - 1) < 1e-8
    assert run.rejected > 0


def test_14_2_peaks_that_no_coefficient_knows_of() -> None:
    """Wider than the eight points of a step are apart: none is missed, wherever it is and however wide."""
    peak = System({x: 1 + 0 * x, y: exp(-(((x - at.c) / at.w) ** 2))})
    draw = np.random.default_rng(14)
    for c, w in [(2.0, 0.1), *draw.uniform((0.8, 0.1), (4.0, 0.4), (60, 2)).tolist()]:
        run = taylor(peak, (0, 0), 5, rtol=1e-10, parameters={"c": c, "w": w})
        area = math.sqrt(math.pi) * w / 2 * (math.erf(c / w) + math.erf((5 - c) / w))
        assert abs(run.x_end[1] - area) < 1e-8, (c, w)


@pytest.mark.parametrize("method", ["Taylor", "DP5", "DOP853"])
def test_14_2_a_power_that_ends_at_its_surface_costs_no_steps(method: str) -> None:
    """|v|**beta with beta = 2 is v**2 on both sides: an event is landed on in as many steps."""
    slip = {"Abs(v)**beta": (Abs(v) / 0.1) ** law.beta, "v**2": (v / 0.1) ** 2}
    steps, tried = [], []
    for part in slip.values():
        dry = sign(v) * (2 + 2 * exp(-part))
        loop = System({x: v, v: -10 * (x + v + 10 * y) - dry - v, y: x}, surfaces=[Surface("dry", v)])
        run = solve(loop, (0.1, 0, 0), (0, 30), rtol=1e-10, method=method)
        steps.append(run.steps)
        tried.append(run.steps + run.rejected)
    assert steps[0] <= 1.02 * steps[1]
    assert tried[0] <= 1.02 * tried[1]


@cache
def reference(name: str, rtol: float) -> Any:
    model = models.get(name)
    return solve(model.build(), model.x0, model.t_span, rtol=rtol, atol=rtol * 1e-3)


# Two surfaces that slide together; impacts and rest.
@pytest.mark.parametrize("name", ["two_blocks", "impact_oscillator"])
def test_14_2_the_same_motions_as_dop853(name: str) -> None:
    model, other = models.get(name), reference(name, 1e-12)
    run = solve(model.build(), model.x0, model.t_span, method="Taylor", rtol=1e-12, atol=1e-15)
    assert run.status is other.status
    assert [(e.kind, e.surface) for e in run.events] == [(e.kind, e.surface) for e in other.events]
    size = 1 + np.max(abs(other.sol(other.t)))
    assert np.max(abs(run.events.t - other.events.t)) < 1e-8 * size
    np.testing.assert_allclose(run.x_end, other.x_end, rtol=0, atol=1e-8 * size)


def test_14_2_large_fields_run_in_loops(monkeypatch: pytest.MonkeyPatch) -> None:
    written = taylor(PENDULUM, (1.0, 0.3), 10, rtol=1e-10)
    monkeypatch.setattr(jets, "WRITTEN_OUT", 0)
    loops = taylor(System({x: v, v: -sin(x) * 1.0, y: 0 * y}), (1.0, 0.3, 0.0), 10, rtol=1e-10)
    np.testing.assert_allclose(loops.x_end[:2], written.x_end, rtol=0, atol=1e-12)


@pytest.mark.parametrize("backend", ["compiled", "python"])
@pytest.mark.parametrize("count", [1, 3, 8, 11])
def test_14_2_operations_of_one_kind_side_by_side(
    count: int, backend: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every kind of recurrence in groups of any number: each copy moves as the one that is written out."""

    def field(a: Any, b: Any) -> tuple[Any, Any]:
        root = sqrt(2 + a**2)
        return b / root + sin(a * t), -a * b**2 / (1 + b**4) ** 1.3 + cos(b) * exp(-a * root) - 0.1 * b

    end, starts = 2.0 if backend == "compiled" else 0.4, np.linspace(0.3, 0.9, count)
    pair = System(dict(zip((x, v), field(x, v), strict=True)))
    known = [taylor(pair, (a, -a / 2), end, rtol=1e-12).x_end for a in starts]
    monkeypatch.setattr(jets, "WRITTEN_OUT", 0)
    names = states([f"a{i}" for i in range(count)] + [f"b{i}" for i in range(count)])
    rates = [field(a, b) for a, b in zip(names[:count], names[count:], strict=True)]
    many = System(dict(zip(names, [r[0] for r in rates] + [r[1] for r in rates], strict=True)))
    run = taylor(many, (*starts, *-starts / 2), end, rtol=1e-12, backend=backend)
    np.testing.assert_allclose(run.x_end.reshape(2, count).T, known, rtol=0, atol=2e-11)


# Each with a peak in a step, nothing at first, nor to its series: off all surfaces, on one, on a table.
PEAK = 1 - tanh(((t - 2) / 0.05) ** 2)
LOOKED_AT = {
    "crossings": (BOUNCE, (1, 0), 8),
    "free": (System({x: v, v: PEAK}), (0.3, 0.4), 4),
    "sliding": (System({x: 1 + y, v: PEAK * x - 2 * sign(v), y: -sign(v)}), (0.3, 0, 0.4), 4),
    "contact": (
        System(
            {x: v, v: -q.g - PEAK, y: PEAK * y},
            surfaces=[Surface("table", x, kind="reset", side="+", reset={v: -v / 2}, contact=True)],
        ),
        (0, 0, 1),
        4,
    ),
}


@pytest.mark.parametrize("name", LOOKED_AT)
def test_14_2_both_backends_take_the_same_steps(name: str) -> None:
    """Compiled, the points inside of a step are looked at side by side; Python takes one after the other."""
    system, x0, end = LOOKED_AT[name]
    runs = [
        solve(system, x0, (0, end), method="Taylor", rtol=1e-10, backend=b) for b in ("compiled", "python")
    ]
    assert (runs[0].steps, runs[0].rejected) == (runs[1].steps, runs[1].rejected)
    assert name == "crossings" or runs[0].rejected > 0
    np.testing.assert_allclose(runs[0].events.t, runs[1].events.t, rtol=1e-14)
    np.testing.assert_allclose(runs[0].x_end, runs[1].x_end, rtol=1e-12)


def test_14_2_backwards_and_stops() -> None:
    forth = taylor(PENDULUM, (1.0, 0.3), 10, rtol=1e-10)
    back = solve(PENDULUM, forth.x_end, (10, 0), backward=True, method="Taylor", rtol=1e-10)
    np.testing.assert_allclose(back.x_end, (1.0, 0.3), atol=1e-8)
    few = solve(BOUNCE, (1, 0), (0, 100), method="Taylor", stop=Stop("x", count=3), rtol=1e-10)
    assert few.t_end == pytest.approx(5 * math.sqrt(2), abs=1e-13)


def test_14_2_functions_are_refused_by_name() -> None:
    plain = System(field=lambda t, x, p, s: [-x[0]], states="x")
    with pytest.raises(UsageError, match="'Taylor', which needs the field as expressions"):
        solve(plain, (1,), (0, 1), method="Taylor")


def test_14_2_from_the_command(capsys: pytest.CaptureFixture[str]) -> None:
    words = ["simulate", "relay", "--t-span", "0", "1", "--method", "Taylor", "--rtol", "1e-10"]
    assert main(words) == 0
    assert "sliding exit on 'output'" in capsys.readouterr().err
    with pytest.raises(UsageError, match="'Tailor'; did you mean 'Taylor'"):
        solve(PENDULUM, (1, 0), (0, 1), method="Tailor")


@pytest.mark.parametrize("seed", range(3))
def test_it_slides_on_surfaces_with_sizes_in_them(seed: int) -> None:
    """On |x - r| + c |y| = 1/2 with x' = a - k s, y' = b: s keeps h' = 0, and x follows y."""
    random = np.random.default_rng(seed)
    for sides in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
        a, b, c, r = random.uniform(-0.3, 0.3, 4)
        h = Abs(x - r) + c * Abs(y) - 0.5
        system = System({x: a - sides[0] * sign(h), y: b, v: -v + 2 * sign(h) + sin(x)})
        y0 = sides[1] * 2.0
        x0 = r + sides[0] * (0.5 - c * 2.0)
        run = taylor(system, (x0, y0, 0.0), 2.0, rtol=1e-12, atol=1e-13)
        other = solve(system, (x0, y0, 0.0), (0, 2), rtol=1e-12, atol=1e-13)
        assert run.modes[0].count("0") == 1
        assert run.steps < 60
        drift = sides[0] * -c * sides[1] * b  # x' on the surface
        assert run.x_end[:2] == pytest.approx([x0 + 2 * drift, y0 + 2 * b], abs=1e-11)
        assert run.x_end == pytest.approx(other.x_end, abs=1e-10)


def test_it_slides_on_largest_and_smallest() -> None:
    """On max(x, y/2) = 1, first on one side of x = y/2 and then on the other: as the pair of order 5."""
    mode = Max(x, y / 2) - 1
    system = System({x: 1 - 2 * sign(mode), y: 3 - 4 * sign(mode) * Min(1, y), v: x})
    for method in ("DOP853", "Taylor"):
        run = solve(system, (0.5, 0.25, 0), (0, 3), method=method, rtol=1e-11, atol=1e-13)
        short = solve(system, (0.5, 0.25, 0), (0, 3), method="DP5", rtol=1e-11, atol=1e-13)
        assert run.success
        assert run.x_end == pytest.approx(short.x_end, abs=1e-8)
