"""Errors of approximations along solutions with impacts, cycles and sticks, against what is known of them."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from filippov import Surface, System, exp, parameters, sign, states, t
from filippov.analysis import compare
from filippov.app.cli.main import main
from filippov.base.errors import UsageError


def driven(e: float, load: float) -> System:
    """A block with friction on a wall: x'' = -load - 0.2 sgn v + 0.9 cos 2t, v+ = -e v at x = -1."""
    from filippov import cos

    x, v = states("x v")
    wall = Surface("wall", x + 1, reset={v: -e * v})
    return System({x: v, v: -load - 0.2 * sign(v) + 0.9 * cos(2 * t)}, surfaces=[Surface("slip", v), wall])


@pytest.mark.parametrize("seed", range(6))
def test_15_4_an_impact_that_comes_later_is_an_error_of_time(seed: int) -> None:
    """Between two impacts the velocity is off by the whole jump; elsewhere errors go with the width, as does
    that time. The grid of a comparison hit or missed it by chance."""
    rng = np.random.default_rng(seed)
    system = driven(rng.uniform(0.3, 0.9), rng.uniform(0.3, 0.6))
    table = compare(
        system, (rng.uniform(0.2, 0.8), 0.0), (0, rng.uniform(3, 5)), against=["tanh", "switch"],
        widths=(1e-2, 1e-3, 1e-4),
    )  # fmt: skip
    impacts = [e for e in table.exact.events if e.kind == "reset"]
    for model in ("tanh", "switch"):
        rows = table.of(model)
        if impacts and not any(row["note"] for row in rows):
            errors = [row["error_state"] for row in rows]
            assert errors[2] < errors[1] < errors[0], (model, errors)
            assert errors[2] < 0.02, (model, errors)


@pytest.mark.parametrize("e", [0.5, 0.8, 1.0])
def test_15_4_time_stepping_of_a_ball_converges_with_its_impacts(e: float) -> None:
    """Three flights: both errors fall by at least 4 where dt falls by 10; the impacts are within a step."""
    y, v = states("y v")
    ball = System({y: v, v: -10.0}, surfaces=[Surface("floor", y, reset={v: -e * v})])
    fall = math.sqrt(0.2)
    end = fall * (1 + 2 * e + 1.2 * e**2)
    table = compare(ball, (1, 0), (0, end), against=["moreau"], widths=(1e-3, 1e-4, 1e-5))
    rows = table.of("moreau")
    for quantity in ("error_state", "error_times"):
        errors = [row[quantity] for row in rows]
        assert errors[1] < errors[0] / 3, errors
        assert errors[2] < errors[1] / 3, errors
    assert rows[-1]["error_times"] < 1e-4


def test_15_4_an_impact_that_is_missed_counts_with_its_jump() -> None:
    """With its wall lower by the width, the other ball has not arrived when the run ends."""
    y, v = states("y v")
    p = parameters(deep=0.0)

    def ball(deep: float) -> System:
        return System({y: v, v: -10.0}, surfaces=[Surface("floor", y + deep, reset={v: -v})], parameters=p)

    table = compare(ball(0.0), (1, 0), (0, 0.45), against={"lower": ball}, widths=(0.05,))
    (row,) = table.of("lower")
    assert row["error_state"] > 0.9
    assert "1 impacts of one solution alone" in row["note"]


def belt() -> System:
    """A block on a belt of speed 0.2 with friction that falls: stick-slip."""
    from filippov import Abs, exp

    x, v = states("x v")
    law = 0.3 + 0.3 * exp(-Abs(v - 0.2) / 0.1)
    return System({x: v, v: -x - law * sign(v - 0.2)}, surfaces=[Surface("b", v - 0.2)])


@pytest.mark.parametrize("end", [25.0, 33.0, 40.0, 47.0])
def test_15_4_a_cycle_of_another_period_has_lost_no_stick(end: float) -> None:
    """Switch at 0.1 has a longer period, so that in some spans fewer sticks begin; the amplitude is that of
    the same state in every row."""
    table = compare(
        belt(), (0.1, 0.2), (0, end), against=["switch", "karnopp", "moreau"], widths=(0.1, 0.01),
        measures=["amplitude(x)", "amplitude(v)"],
    )  # fmt: skip
    assert not [said for said in table.faults if "stick" in said or "invents a cycle" in said]
    exact = table.rows[0]
    if exact["amplitude"] is None:
        return
    name = min(("amplitude(x)", "amplitude(v)"), key=lambda key: abs(exact[key] - exact["amplitude"]))
    for row in table.rows[1:]:
        if row["amplitude"] is not None:
            assert row["amplitude"] == pytest.approx(row[name], rel=1e-3)


def test_15_4_a_stick_that_only_the_wide_one_loses_is_said_with_its_width() -> None:
    table = compare(belt(), (0.1, 0.2), (0, 40), against=["tanh"], widths=(0.1, 0.01, 0.001))
    (said,) = [text for text in table.faults if "stick" in text]
    assert said.startswith("tanh at width 0.1 loses stick on 'b'")
    assert said.endswith("At narrower ones it does not.")


def test_15_4_chattering_is_no_period() -> None:
    """Hysteresis goes to and fro at each stick of a cycle of the forcing's period."""
    from filippov import cos

    x, v = states("x v")
    forced = System({x: v, v: -x - 0.3 * sign(v) + 0.5 * cos(0.6 * t)})
    table = compare(forced, (0, 0), (0, 60), against=["hysteresis"], widths=(1e-2, 1e-3))
    for row in table.rows:
        assert row["period"] == pytest.approx(2 * math.pi / 0.6, rel=1e-3)
        assert row["amplitude"] == pytest.approx(table.rows[0]["amplitude"], rel=0.02)


def test_15_4_what_is_met_by_every_width_is_not_needed() -> None:
    x, v = states("x v")
    block = System({x: v, v: -x - 0.2 * sign(v)})
    table = compare(block, (1.1, 0), (0, 6), against=["switch", "tanh"], widths=(1e-3, 1e-4), accuracy=0.1)
    for item in table.needed:
        assert item.every
        assert "met by every width computed, up to 0.001" in item.sentence
    table = compare(block, (1.1, 0), (0, 30), against=["switch"], widths=(1e-1, 1e-2, 1e-3), accuracy=1e-3)
    (item,) = table.needed
    assert not item.every
    assert item.error is not None
    assert 0.75e-3 <= item.error <= 1e-3


def test_15_4_where_one_integrator_gives_up_the_other_is_tried() -> None:
    """Radau ends with min_step where the lag of a narrow memory model is 0 in stick; the order is 1."""
    table = compare(belt(), (0.1, 0.2), (0, 40), against=["memory"], widths=(0.1, 0.01, 0.001))
    assert [row["method"] for row in table.of("memory")][1:] == ["DOP853", "DOP853"]
    assert table.trend("memory", "error_state").order == pytest.approx(1, abs=0.2)


def test_15_2_bristles_of_a_level_that_depends_on_the_state_take_a_time() -> None:
    """A level 0.3 + 0.1 x^2 has no default time; with one each model's error falls with its width."""
    x, v = states("x v")
    block = System({x: v, v: -x - (0.3 + 0.1 * x**2) * sign(v)})
    names = ["lugre", "elasto-plastic", "maxwell-slip", "seven-parameter"]
    with pytest.raises(UsageError, match="tau"):
        compare(block, (1, 0), (0, 4), against=names, widths=(1e-2, 1e-3))
    table = compare(block, (1, 0), (0, 4), against=names, widths=(1e-2, 1e-3), tau=0.02)
    for name in names:
        wide, narrow = (row["error_state"] for row in table.of(name))
        assert narrow < wide / 2, name


def test_15_4_sliding_of_order_two_with_the_implicit_steps() -> None:
    """Twisting rests after a finite time; steps with theta = 0.5 swing about that rest, with 1 not."""
    x, v = states("x v")
    twisting = System({x: v, v: -2 * sign(x) - sign(v)})
    rests = {}
    for theta in (0.5, 1.0):
        table = compare(twisting, (1, 0), (0, 12), against=["moreau"], widths=(1e-3,), theta=theta)
        rests[theta] = table.of("moreau")[0]["error_final"]
    assert rests[1.0] < 1e-5
    assert rests[1.0] < rests[0.5]


def test_15_4_the_command_has_the_same_options(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model = tmp_path / "block.py"
    model.write_text(
        "from filippov import System, sign, states\nx, v = states('x v')\n"
        "block = System({x: v, v: -x - (0.3 + 0.1*x**2)*sign(v)})\n", encoding="utf-8",
    )  # fmt: skip
    words = ["compare", f"{model}:block", "--x0", "1,0", "--t-span", "0", "2", "--against", "lugre,moreau"]
    more = ["--widths", "1e-2,1e-3", "--tau", "0.02", "--theta", "1", "--max-steps", "5000", "--json"]
    assert main([*words, *more, "--quiet"]) == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert [row["model"] for row in rows] == ["exact", "lugre", "lugre", "moreau", "moreau"]
    assert all(row["error_state"] is not None for row in rows)


def test_15_4_a_smooth_sign_leaves_stick_with_the_attraction() -> None:
    """v' = t - x - sgn v sticks at 0 until t = 1, where a smooth sign still lacks something to 1 beyond any
    number of its widths: read at ten widths, arctan left at s = 0.96, at every width."""
    x, v = states("x v")
    pulled = System({x: v, v: t - x - sign(v)}, surfaces=[Surface("slip", v)])
    table = compare(pulled, (0, 0), (0, 3), against=["tanh", "arctan", "sqrt"], widths=(1e-3, 1e-5))
    for model in ("tanh", "arctan", "sqrt"):
        wide, narrow = (row["error_times"] for row in table.of(model))
        assert narrow < 1e-4, (model, wide, narrow)
        assert narrow < wide / 20, (model, wide, narrow)


def test_15_4_what_begins_in_stick_on_one_of_two_surfaces_has_no_entry() -> None:
    """From v = w = 0 on w = -t, so v' = 0.5 + t - 1.2 s sticks until t = 0.7; with the sign that w has at 0
    it would not, nor while w is in its band."""
    v, w = states("v w")
    system = System({v: 1 + t + 0.5 * sign(w) - 1.2 * sign(v), w: -2 - sign(w)})
    table = compare(system, (0, 0), (0, 1), against=["band", "tanh", "hysteresis"], widths=(1e-3, 1e-5))
    for model in table.models:
        for row in table.of(model):
            assert row["entries"] == [0, 0], row
            assert row["error_times"] < 30 * row["width"], row


def test_15_4_events_of_approximations_are_those_read_of_them() -> None:
    """The block rests after two turns. Its surface is none of most approximations'; naming it in a measure
    ended the comparison."""
    x, v = states("x v")
    block = System({x: v, v: -x - 0.3 * sign(v)}, surfaces=[Surface("slip", v)])
    named = ["events(slip)", "events(slip, crossing)", "events(slip, sliding entry)", "sliding(slip)",
             "period(slip)", "mode(slip)"]  # fmt: skip
    table = compare(
        block, (2, 0), (0, 12), against=["switch", "band", "tanh", "moreau", "lugre"], widths=(1e-4,),
        measures=named,
    )  # fmt: skip
    stops = 3 * math.pi  # from 2 to -1.4, 0.8 and -0.2, where it rests
    for row in table.rows:
        counts = [row[name] for name in named[:3]]
        assert counts == ([3, 2, 1] if row["model"] != "lugre" else [None] * 3), row
        if row["model"] != "lugre":
            assert row["sliding(slip)"] == pytest.approx(12 - stops, abs=5e-3)
            assert [event[2] for event in row["event_times"]] == ["crossing", "crossing", "entry"]
            assert [event[0] for event in row["event_times"]] == pytest.approx(
                [math.pi, 2 * math.pi, stops], abs=5e-3
            )
            assert np.array(row["stays"]["slip"]) == pytest.approx(np.array([[stops, 12]]), abs=5e-3)
        else:
            assert row["stays"] is None
    assert "stays" not in table.to_csv()
    assert json.loads(table.to_json())["rows"][0]["event_times"][-1][1:] == ["slip", "entry"]
    assert table.of("tanh")[0]["period(slip)"] is None


def test_15_4_a_shorter_cycle_in_a_short_span_has_invented_no_stick() -> None:
    """Four sticks of the belt, every 1.53, against five of tanh at 1e-2, every 1.43: there is one in each
    cycle, though the span is too short for the cycles to be told from its last quarter."""
    x, v = states("x v")
    rel = v - 0.3
    block = System(
        {x: v, v: -25 * x - 2 * (1 + exp(-abs(rel) / 0.1)) * sign(rel)}, surfaces=[Surface("belt", rel)]
    )
    table = compare(block, (0, 0), (0, 6), against=["tanh"], widths=(1e-2,))
    assert table.rows[0]["entries"] != table.rows[1]["entries"]
    assert not [said for said in table.faults if "stick" in said]


def test_approximations_go_on_after_impacts_have_accumulated() -> None:
    """A ball of e = 0.6 slides with v' = -0.8 sgn v from v = 2 to its stop at 2.5, and has landed at
    sqrt(2/9.81) (1 + e)/(1 - e) = 1.8. The band of width w enters stick w/0.8 earlier and slips w^2/1.6."""
    x, v, y, w = states("x v y w")
    ball = System(
        {x: v, v: -0.8 * sign(v), y: w, w: -9.81}, surfaces=[Surface("floor", y, reset={w: -0.6 * w})]
    )
    models = ["switch", "karnopp", "tanh", "band", "hysteresis"]
    table = compare(ball, (0, 2, 1, 0), (0, 4), against=models, widths=(1e-2, 1e-3))
    for row in table.rows[1:]:
        assert not row["note"], row
        assert row["error_final"] < 1e-4
        if row["model"] == "band":
            assert row["error_times"] == pytest.approx(row["width"] / 0.8, rel=1e-6)
            assert row["error_final"] == pytest.approx(row["width"] ** 2 / 1.6 / 2.5, rel=1e-3)


def test_a_stay_under_hysteresis_ends_where_the_relay_attracts_no_more() -> None:
    """x' = -2 sgn x + f(t) leaves x = 0 where |f| = 2, three times; nearly all steps are those of the relay,
    few those of the way back, which was taken for stick where an even choice of steps held none of them."""
    from filippov import cos

    (x,) = states("x")
    relay = System({x: -2 * sign(x) + cos(t) + 1.5 * cos(2.3 * t)})
    table = compare(relay, (1,), (0, 10), against=["hysteresis"], widths=(1e-2, 1e-3))
    f = np.cos(q := np.linspace(0, 10, 100_001)) + 1.5 * np.cos(2.3 * q)
    leaves = q[1:][(np.abs(f[1:]) > 2) & (np.abs(f[:-1]) <= 2)]
    for row in table.of("hysteresis"):
        assert row["entries"] == [3]
        exits = np.array([event[0] for event in row["event_times"] if event[2] == "exit"])
        assert np.min(np.abs(exits[:, None] - leaves), axis=1) == pytest.approx(0, abs=2e-4)
        assert row["error_times"] < 5 * row["width"]
