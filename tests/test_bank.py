"""The case bank: published systems against references computed to many digits."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from bank import CASES, FILE, case, event_word, expected, number, solved

from filippov import Solution, Status, solve
from filippov.app.bank import read_bank, run_case

BANK = {item.id: item for item in read_bank(FILE)}
# What people say to people; nobody may count it as passed.
NEVER = {"fact", "solutions", "escaping_segment", "bifurcation_value", "sliding_condition", "overshoot_ratio"}
EVENTFUL = [n for n, c in CASES.items() if {e["name"] for e in c["expected"]} & {"events", "final_state"}]


@pytest.mark.parametrize("name", CASES)
def test_runner(name: str) -> None:
    row = run_case(BANK[name])
    assert row.passed, row.message
    assert not NEVER & set(row.evaluated)


@pytest.mark.parametrize("name", EVENTFUL)
def test_events_and_final_state(name: str) -> None:
    wanted_of, got = expected(name), solved(name)
    assert got.status is Status.SUCCESS, got.message
    if "events" in wanted_of:
        wanted, tolerance = wanted_of["events"]["value"], number(wanted_of["events"]["tol"])
        assert len(got.events) >= len(wanted)
        for event, entry in zip(got.events, wanted, strict=False):
            assert (event_word(event), event.index) == (entry["type"], entry["surface"])
            assert abs(event.t - number(entry["t"])) <= tolerance
            np.testing.assert_allclose(event.x, [number(v) for v in entry["state"]], rtol=0, atol=tolerance)
    if "n_events" in CASES[name]:
        assert len(got.events) == CASES[name]["n_events"]
    if "final_state" in wanted_of:
        final = wanted_of["final_state"]
        assert got.t_end == pytest.approx(number(final["t"]), abs=1e-12)
        wanted_state = [number(v) for v in final["value"]]
        np.testing.assert_allclose(got.x_end, wanted_state, rtol=0, atol=number(final["tol"]))
        assert [i for i, sign in enumerate(got.end_mode) if sign == 0] == final["sliding_on"]


def first(kind: str) -> Callable[[Solution], float]:
    """The time of the first event of a kind."""
    return lambda s: s.events.of(kind=kind).t[0]


def at(t: float, i: int | None = None) -> Callable[[Solution], Any]:
    return lambda s: s.sol(t) if i is None else s.sol(t)[i]


def multiplier_at(t: float) -> Callable[[Solution], float]:
    return lambda s: float(s.multiplier("h0", t))


def last_period(s: Solution) -> float:
    """Time between the last two sliding exits."""
    return float(np.diff(s.events.of(kind="sliding exit").t)[-1])


SCALARS: dict[tuple[str, str], Callable[[Solution], Any]] = {
    ("S01_wolfram_circle", "t_enter"): first("sliding entry"),
    ("S01_wolfram_circle", "t_exit"): first("sliding exit"),
    ("S01_wolfram_circle", "exit_point"): lambda s: s.events[1].x,
    ("S01_wolfram_circle", "state_at_10"): lambda s: s.x_end,
    ("S02_filippov_speed5", "t_enter"): first("sliding entry"),
    ("S02_filippov_speed5", "x1_at_1"): at(1, 0),
    ("S02_filippov_speed5", "equivalent_control"): multiplier_at(0.75),
    ("S03_nosnoc_leave_sliding", "t_exit"): first("sliding exit"),
    ("S03_nosnoc_leave_sliding", "x_at_1.5"): at(1.5, 0),
    ("S04_nosnoc_test_sliding", "t_enter"): first("sliding entry"),
    ("S04_nosnoc_test_sliding", "x_at_2"): at(2, 0),
    ("S05_visible_fold_normal_form", "t_exit"): first("sliding exit"),
    ("S05_visible_fold_normal_form", "final"): lambda s: s.x_end,
    ("S06_stiff_sign", "t_enter"): first("sliding entry"),
    ("S06_stiff_sign", "x_for_t_enter<t<3"): lambda s: np.max(np.abs(s.sol(np.linspace(1.5718, 3, 50)))),
    ("S06_stiff_sign", "x_at_1"): at(1, 0),
    ("S09_shtessel_smc", "t_enter"): first("sliding entry"),
    ("S10_utkin_double_integrator", "t_enter"): first("sliding entry"),
    ("S10_utkin_double_integrator", "x1_enter"): lambda s: s.events[0].x[0],
    ("S10_utkin_double_integrator", "x1_at_3"): at(3, 0),
    ("S11_antiwindup_pi", "t_saturate"): first("sliding entry"),
    ("S11_antiwindup_pi", "t_release"): first("sliding exit"),
    ("S11_antiwindup_pi", "x_at_3"): at(3, 0),
    ("F01_coulomb_oscillator", "turning_points"): lambda s: np.append(s.problem.x0[0], s.events.x[:, 0]),
    ("F01_coulomb_oscillator", "t_stop"): first("sliding entry"),
    ("F01_coulomb_oscillator", "x_stop"): lambda s: s.x_end[0],
    ("F02_siconos_friction_oscillator", "first_turn_x"): lambda s: s.events[0].x[0],
    ("F02_siconos_friction_oscillator", "first_turn_t"): lambda s: s.events[0].t,
    ("F02_siconos_friction_oscillator", "x_stop"): lambda s: s.x_end[0],
    ("F02_siconos_friction_oscillator", "t_stop"): first("sliding entry"),
    ("F05_dieci_lopez_stick_slip", "sliding_exit_x1"): lambda s: s.events.of(kind="sliding exit").x[0, 0],
    ("F05_dieci_lopez_stick_slip", "sliding_speed"): lambda s: s.x_end[1],
    ("F05_dieci_lopez_stick_slip", "restick_x1"): lambda s: s.events.of(kind="sliding entry").x[-1, 0],
    ("F05_dieci_lopez_stick_slip", "limit_cycle_period"): last_period,
    ("F06_leine_alternate_friction", "stick_exit_x"): lambda s: s.events.of(kind="sliding exit").x[0, 0],
    ("F06_leine_alternate_friction", "restick_x"): lambda s: s.events.of(kind="sliding entry").x[-1, 0],
    ("F06_leine_alternate_friction", "limit_cycle_period"): last_period,
    ("R02_relay_siconos_aperiodic", "t_first_exit"): first("sliding exit"),
    ("R11_siconos_filippov", "t_first_crossing"): lambda s: s.events[0].t,
    ("R11_siconos_filippov", "point_first_crossing"): lambda s: s.events[0].x,
    ("R12_simple_relay_simultaneous", "t_enter_codim2"): lambda s: s.events[-1].t,
    ("R12_simple_relay_simultaneous", "final"): lambda s: s.x_end,
    ("R13_helical", "t_first_crossing"): lambda s: s.events[0].t,
    ("C03_two_gene_network", "t_first_12_3"): lambda s: s.events[0].t,
    ("C03_two_gene_network", "equilibrium"): lambda s: s.x_end,
    ("C04_nodal_bilinear_vs_moments", "x3dot_bilinear"): lambda s: s.x_end[2],
    ("C04_nodal_bilinear_vs_moments", "bilinear_weights"): lambda s: (1 + s.end_multipliers) / 2,
    ("A05_pounding_C0", "x(3)"): lambda s: s.x_end,
    ("A05_pounding_C0", "first_impact_velocity"): lambda s: s.events.of("h0").x[0, 1],
    ("A05_pounding_C0", "first_max_x"): lambda s: s.events.of("h1").x[1, 0],
    ("K01_detest_F", "F1_y(20)"): lambda s: s.x_end,
    ("K02_nosnoc_oscillator", "t_cross"): lambda s: s.events[0].t,
    ("K02_nosnoc_oscillator", "x(pi/2)"): lambda s: s.x_end,
    ("K03_ifdiff_canonical", "switch_1"): lambda s: s.events[0].t,
    ("K03_ifdiff_canonical", "switch_2"): lambda s: s.events[1].t,
    ("K03_ifdiff_canonical", "x(20)"): lambda s: s.x_end,
    ("K04_scipy_9228", "event_times"): lambda s: s.events.t,
    ("K04_scipy_9228", "y(4)"): at(4, 0),
}  # fmt: skip


@pytest.mark.parametrize(("name", "quantity"), SCALARS)
def test_number(name: str, quantity: str) -> None:
    entry = expected(name)[quantity]
    value = entry["value"]
    wanted = [number(v) for v in value] if isinstance(value, list) else number(value)
    got = SCALARS[name, quantity](solved(name))
    np.testing.assert_allclose(got, wanted, rtol=0, atol=max(number(entry["tol"]), 1e-14))


def test_s01_sliding_invariant() -> None:
    got = solved("S01_wolfram_circle")
    entry, leave = got.events[0].t, got.events[1].t
    times = np.linspace(entry, leave, 40)
    x, y = got.sol(times)
    theta = np.arctan2(y, x)
    law = (1 - 5 / np.sqrt(26)) * np.exp(times - entry)
    np.testing.assert_allclose(1 - np.sin(theta - np.pi / 4), law, atol=1e-8)
    np.testing.assert_allclose(np.hypot(x, y), np.sqrt(2), atol=1e-10)


def test_s05_sliding_law() -> None:
    times = np.linspace(0, 1.5, 20)
    x = solved("S05_visible_fold_normal_form").sol(times)[0]
    np.testing.assert_allclose(x - x**2 / 2 + 1.5, times, atol=1e-9)


def test_s09_equivalent_control() -> None:
    times = np.linspace(0.3, 2, 15)
    got = solved("S09_shtessel_smc")
    np.testing.assert_allclose(got.multiplier("h0", times), np.sin(2 * times) / 2, atol=1e-9)
    start = got.events[0]
    np.testing.assert_allclose(got.sol(times)[0], start.x[0] * np.exp(-1.5 * (times - start.t)), atol=1e-9)


def test_a01_first_integral() -> None:
    e1, l1, m, l2, r1, r2 = 0.2, 1.0, 0.1, 1.0, 1.5, 0.5
    got = solved("A01_krivan_switching_predator")
    prey, _, predator = got.sol(np.linspace(got.events[0].t, 60, 30))
    value = e1 * l1 * prey - m * np.log(prey) + l1 * l2 / (l1 + l2) * predator
    value -= (r1 * l2 + r2 * l1) / (l1 + l2) * np.log(predator)
    wanted = expected("A01_krivan_switching_predator")["first_integral_value"]["value"]
    np.testing.assert_allclose(value, number(wanted), atol=1e-8)


def test_a05_event_times() -> None:
    got = solved("A05_pounding_C0")
    times = np.sort([e.t for e in got.events if e.surface == "h0" or (e.surface == "h1" and e.x[0] > 0.005)])
    wanted = expected("A05_pounding_C0")["event_times"]
    np.testing.assert_allclose(times, [number(v) for v in wanted["value"]], atol=number(wanted["tol"]))


@pytest.mark.parametrize(
    ("name", "t_stop"),
    [("N01_sign_from_zero", 0.0), ("N02_visible_visible_two_fold", 1.0), ("N04_repelling_plane", 0.0),
     ("N05_time_dependent_two_fold", 4.7123889803846899), ("N06_codim2_ambiguous_exit", 0.0),
     ("C05_two_codim2_sliding_modes", 0.0)],
)  # fmt: skip
def test_what_is_not_unique_is_named(name: str, t_stop: float) -> None:
    got = solved(name)
    assert got.status is Status.NON_UNIQUE
    assert got.t_end == pytest.approx(t_stop, abs=1e-8)
    assert "can follow: +" in got.message


def test_c05_both_sliding_modes_and_the_exit_are_candidates() -> None:
    item = case("C05_two_codim2_sliding_modes")
    seen: list[Any] = []
    solve(item.system, item.x0, item.t_span, nonunique=seen.extend)
    assert [c.mode for c in seen] == [(1, 1), (0, 0), (0, 0)]
    multipliers = np.array(sorted(c.multipliers for c in seen[1:]))
    np.testing.assert_allclose(multipliers, [[-0.5, -0.5], [0.5, 0.5]], atol=1e-10)
    assert sorted(c.field[2] for c in seen[1:]) == pytest.approx([-1, 1], abs=1e-10)


def test_n04_repelling_sliding_field() -> None:
    item = case("N04_repelling_plane")
    got = solve(item.system, item.x0, item.t_span, nonunique="stick")
    np.testing.assert_allclose(got.x_end, [0, 1], atol=1e-10)


@pytest.mark.parametrize(
    "name", ["R07_twisting", "R09_fuller", "R10_filippov_spiral", "R11_siconos_filippov", "R13_helical"]
)
def test_accumulation(name: str) -> None:
    item = case(name)
    limit = number(expected(name)["t_converge"]["value"])
    got = solve(item.system, item.x0, (0, 2 * limit), rtol=1e-11, atol=1e-13)
    assert got.status is Status.ZENO
    assert got.t_end == pytest.approx(limit, rel=1e-6)
    assert float(got.message.split("t = ")[2].split()[0]) == pytest.approx(limit, rel=1e-8)
    if name not in ("R07_twisting", "R09_fuller"):
        onward = solve(item.system, item.x0, (0, 2 * limit), rtol=1e-11, atol=1e-13, zeno="continue")
        assert onward.status is Status.SUCCESS, onward.message
        assert onward.end_mode == (0, 0)
        np.testing.assert_allclose(onward.x_end[:2], 0, atol=1e-10)


def test_r09_switch_times() -> None:
    item, wanted_of = case("R09_fuller"), expected("R09_fuller")
    got = solve(item.system, item.x0, (0, 2.9159), rtol=1e-11, atol=1e-13)
    wanted = wanted_of["switch_times"]
    times = got.events.of("h0").t
    np.testing.assert_allclose(times, [number(v) for v in wanted["value"]], atol=number(wanted["tol"]))
    ratios = np.diff(times)[1:] / np.diff(times)[:-1]
    np.testing.assert_allclose(ratios, number(wanted_of["ratio_of_intervals"]["value"]), atol=1e-8)


def test_f10_multiplier_by_differences() -> None:
    """The Poincare map over a period has the multipliers 0 and 0.0478, not [0, 0]."""
    item, period = case("F10_two_stop_forced"), 10 * np.pi / 3
    settled = solve(item.system, item.x0, (0, 30 * period), rtol=1e-12, atol=1e-14)
    t0, x0 = settled.t_end, settled.x_end
    columns = []
    for step in (np.array([1e-4, 0.0]), np.array([0.0, 1e-4])):
        starts, span = (x0 + step, x0 - step), (t0, t0 + period)
        ends = [solve(item.system, x, span, rtol=1e-12, atol=1e-14).x_end for x in starts]
        columns.append((ends[0] - ends[1]) / 2e-4)
    found = sorted(abs(np.linalg.eigvals(np.array(columns).T)))
    wanted = expected("F10_two_stop_forced")["multipliers"]["value"]
    np.testing.assert_allclose(found, [number(v) for v in wanted], atol=2e-6)
