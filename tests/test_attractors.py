"""All attractors by recurrences: published counts, closed forms, and long runs of another solver."""

import json
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from scipy.integrate import solve_ivp

from filippov import Surface, System, TimeEvent, UsageError, parameters, sign, states, t
from filippov.analysis.diagrams.basin import basin
from filippov.analysis.invariant_sets.attractors import Attractors, attractors
from filippov.analysis.invariant_sets.identify_attractor import Identifier
from filippov.analysis.invariant_sets.state_map import StateMap
from filippov.analysis.maps.section import Section
from filippov.app.cli.main import main
from filippov.model.symbols import cos
from filippov.models import get

Array = npt.NDArray[np.float64]
X, Y, V = states("x y v")
BOX = {"x": (-2, 2), "v": (-2, 2)}
D = parameters(d=0.1, a=-1.0, F=0.3, w=1.0)
DUFFING = System({X: V, V: -D.d * V - D.a * X - X**3 + D.F * cos(D.w * t)})
W = parameters(mu=0.1, c=0.1)
# Henon's map as the reset of a clock.
HENON = System(
    {X: 0 * X, Y: 0 * Y},
    time_events=[TimeEvent("clock", period=1.0, start=0.5, reset={X: 1 - 1.4 * X**2 + Y, Y: 0.3 * X})],
)
WELL = System({X: V, V: X - X**3 - W.c * V - W.mu * sign(V)})


def rings(radii: list[float], rates: list[float], turn: float) -> System:
    """r' = r g(r), g constant between circles, angle' = turn: slides on circles where g falls through 0."""
    g: Any = (rates[0] + rates[-1]) / 2
    for k, radius in enumerate(radii):
        g = g + (rates[k + 1] - rates[k]) / 2 * sign(X**2 + Y**2 - radius**2)
    return System({X: X * g - turn * Y, Y: Y * g + turn * X})


def test_12_13_duffing_has_the_five_attractors_of_ueda() -> None:
    """x'' + 0.08 x' + x^3 = 0.2 cos t: Ueda 1980 names two of period 1, two of period 2, one of period 3."""
    got = attractors(
        DUFFING, {"x": (-1, 1), "v": (-1, 1)}, samples=250, parameters={"d": 0.08, "a": 0, "F": 0.2}
    )
    assert sorted((one.kind, one.period) for one in got.attractors) == [
        ("periodic", p) for p in (1, 1, 2, 2, 3)
    ]
    assert all(one.stable for one in got.attractors)
    assert np.all(got.label >= 0)
    for one in got.attractors:
        assert one.duration == pytest.approx(2 * np.pi * (one.period or 0))
        rows = _strobes(one.states[0], one.period or 1, 0.08, 0.0, 0.2, 1.0)
        np.testing.assert_allclose(rows[-1], one.states[0], atol=1e-8)


def _strobes(x0: Array, count: int, d: float, a: float, force: float, w: float) -> Array:
    """Strobes of the Duffing oscillator by scipy."""
    times = 2 * np.pi / w * np.arange(count + 1)
    run = solve_ivp(
        lambda s, z: [z[1], -d * z[1] - a * z[0] - z[0] ** 3 + force * np.cos(w * s)], (0, times[-1]), x0,
        method="DOP853", rtol=1e-12, atol=1e-13, t_eval=times,
    )  # fmt: skip
    rows: Array = run.y.T
    return rows


@pytest.mark.parametrize("seed", range(3))
def test_12_13_labels_are_where_long_runs_of_another_solver_end(seed: int) -> None:
    rng = np.random.default_rng([5, seed])
    q = {"d": rng.uniform(0.1, 0.3), "a": float(rng.choice([-1, 0, 1])), "F": rng.uniform(0.05, 0.3),
         "w": rng.uniform(0.8, 1.6)}  # fmt: skip
    got = attractors(DUFFING, BOX, samples=60, seed=seed, parameters=q)
    assert np.all(got.label >= 0)
    for k in range(4):
        end = _strobes(got.states[k], 120, q["d"], q["a"], q["F"], q["w"])[-1]
        one = got.attractors[got.label[k]]
        assert one.kind == "periodic"
        assert np.min(np.linalg.norm(one.states - end, axis=1)) < 1e-3


def test_12_13_circles_of_sliding_and_their_basins_in_closed_form() -> None:
    """Stable circles 0.7 and 2.0 and the origin's repelling disc: the border of the basins is r = 1.3."""
    system = rings([0.7, 1.3, 2.0], [0.5, -0.4, 0.6, -0.3], 1.5)
    got = attractors(system, {"x": (-2.4, 2.4), "y": (-2.4, 2.4)},
                     samples=300)  # fmt: skip
    assert [one.kind for one in got.attractors] == ["periodic", "periodic"]
    radius = [float(np.hypot(*one.states[0])) for one in got.attractors]
    assert radius == pytest.approx([2.0, 0.7], abs=1e-9)
    assert [one.duration for one in got.attractors] == pytest.approx([2 * np.pi / 1.5] * 2)
    inside = np.hypot(*got.states.T) < 1.3
    assert np.array_equal(got.label == 1, inside)
    share, error = got.shares[1]
    assert abs(share - np.pi * 1.3**2 / 4.8**2) < 4 * error


@pytest.mark.parametrize(("mu", "count"), [(0.1, 3), (0.3, 3), (0.45, 1)])
def test_12_13_every_connected_set_of_stick_is_one_attractor(mu: float, count: int) -> None:
    """|x - x^3| <= mu, v = 0: three intervals below mu = 2/(3 sqrt 3) = 0.385, one above."""
    got = attractors(WELL, BOX, samples=200, parameters={"mu": mu}, plane=("x", "v"), resolution=40)
    real = [q.real for c in (mu, -mu) for q in np.roots([-1, 0, 1, c]) if abs(q.imag) < 1e-12]
    held = [(a, b) for a, b in pairwise(sorted(real)) if abs((a + b) / 2 - ((a + b) / 2) ** 3) < mu]
    assert len(held) == count == len(got.attractors)
    where = set()
    for one in got.attractors:
        assert one.kind == "equilibrium set"
        where |= {k for k, (a, b) in enumerate(held) if a - 1e-7 <= one.low[0] and one.high[0] <= b + 1e-7}
    assert len(where) == count
    assert np.all(got.label >= 0)
    assert np.all(got.picture >= 0)


def _impacts(x: float, v: float, end: float, q: dict[str, float]) -> tuple[float, float]:
    """x'' + 2 z x' + x = F cos(w t), x < wall, v+ = -e v- : flights in closed form, impacts by bisection."""
    z, w = q["zeta"], q["omega"]
    r = q["F"] / (1 - w**2 + 2j * z * w)
    wd = np.sqrt(1 - z * z)

    def flight(s: Any, a: complex, t0: float) -> tuple[Any, Any]:
        free = np.exp((-z + 1j * wd) * (s - t0)) * a
        forced = r * np.exp(1j * w * s)
        return (free + forced).real, ((-z + 1j * wd) * free + 1j * w * forced).real

    now = 0.0
    while True:
        one = r * np.exp(1j * w * now)
        a0 = x - one.real
        a = a0 - 1j * (v - (1j * w * one).real + z * a0) / wd
        s = np.arange(now + 1e-6, min(now + 30.0, end) + 1e-3, 1e-3)
        hit = np.flatnonzero(flight(s, a, now)[0] >= q["wall"])
        if not hit.size or s[hit[0]] >= end:
            return flight(end, a, now)
        high = float(s[hit[0]])
        low = max(high - 1e-3, now + 1e-6)
        for _ in range(60):
            middle = 0.5 * (low + high)
            low, high = (low, middle) if flight(middle, a, now)[0] >= q["wall"] else (middle, high)
        x, v, now = q["wall"], -q["e"] * float(flight(high, a, now)[1]), high


def test_12_13_impact_oscillator_with_two_attractors_against_flights_in_closed_form() -> None:
    model = get("impact_oscillator")
    got = attractors(model.build(), {"x": (-2, 0), "v": (-2, 2)}, samples=60)
    assert sorted((one.kind, one.period) for one in got.attractors) == [("periodic", 1), ("periodic", 3)]
    q = {"zeta": 0.05, "F": 1.0, "omega": 2.6, "wall": 0.0, "e": 0.8}
    for k in range(6):
        end = np.array(_impacts(*got.states[k], 60 * 2 * np.pi / 2.6, q))
        one = got.attractors[got.label[k]]
        assert np.min(np.linalg.norm(one.states - end, axis=1)) < 2e-3


def test_12_13_smooth_cycle_equilibria_escape_and_chaos() -> None:
    # r' = -r (r - 1)(r - 2)(r - 3), turned into x, y: circles 1 and 3 attract, 2 repels.
    r2 = X**2 + Y**2
    r = r2 ** (1 / 2)
    g = -(r - 1) * (r - 2) * (r - 3)
    two = attractors(System({X: X * g - Y, Y: Y * g + X}), {"x": (-4, 4), "y": (-4, 4)}, samples=150)
    assert sorted(float(np.hypot(*one.states[0])) for one in two.attractors) == pytest.approx(
        [1, 3], abs=1e-8
    )
    assert np.array_equal(
        two.label == two.label[np.argmin(np.hypot(*two.states.T))], np.hypot(*two.states.T) < 2
    )
    # x' = x^3 - x: |x| > 1 goes away in finite time.
    gone = attractors(System({X: X**3 - X}), {"x": (-2, 2)}, samples=80)
    assert [one.kind for one in gone.attractors] == ["equilibrium"]
    assert np.array_equal(gone.label == -2, np.abs(gone.states[:, 0]) > 1)
    # Henon's map is chaotic, largest exponent 0.4192 (Sprott 2003, table of maps).
    chaos = attractors(HENON, {"x": (-0.5, 0.5), "y": (-0.2, 0.2)}, samples=1, rtol=1e-6)
    assert [one.kind for one in chaos.attractors] == ["chaotic"]
    assert chaos.attractors[0].exponent[0] == pytest.approx(0.4192, abs=0.05)


def test_12_13_hunting_cycle_by_steps_and_by_events_as_the_basins_of_the_event_map() -> None:
    """Rest is reached in ever longer stops: undecided and said, or told as the set; the cycle is told."""
    model = get("hunting")
    system, section = model.build(), Section.from_model(model)
    box = {"x": (-0.1, 0.1), "v": (-0.3, 0.3), "z": (-0.3, 0.3)}
    options: dict[str, Any] = {"samples": 0, "plane": ("x", "v"), "resolution": 10, "parameters": {"P": 20}}
    steps = attractors(system, box, step=2.0, most=300, **options)
    events = attractors(system, box, section=section, **options)
    for got in (steps, events):
        cycle, *rest = got.attractors
        assert cycle.kind == "periodic"
        assert all(one.kind == "equilibrium set" for one in rest)
        assert all(np.max(np.abs(one.states[:, 0])) < 1e-12 for one in rest)
        assert set(got.picture.ravel().tolist()) <= {0, 1, -1, -3}
    assert events.attractors[0].duration == pytest.approx(steps.attractors[0].duration, rel=1e-9)
    known = basin(
        system, section, ("x", steps.x.tolist()), ("v", steps.y.tolist()), (-0.6, 0.6), parameters={"P": 20}
    )
    cycles = np.array([d != 0 for d in known.attractors])[known.label] & (known.label >= 0)
    assert 0.5 < cycles.mean() < 1
    assert np.array_equal(steps.picture == 0, cycles)
    assert np.array_equal(events.picture == 0, cycles)
    assert set(events.failures) == {"no_return"}


def test_12_13_what_conserves_has_no_attractors() -> None:
    got = attractors(System({X: V, V: -X + 0 * V}), BOX, samples=20, most=400)
    assert got.attractors == ()
    assert set(got.label.tolist()) <= {-1, -4, -5}


def test_12_13_results_are_kept_and_repeat(tmp_path: Path) -> None:
    first = attractors(WELL, BOX, samples=40, plane=("x", "v"), resolution=12)
    second = attractors(WELL, BOX, samples=40, plane=("x", "v"), resolution=12)
    assert json.dumps(first.to_dict()) == json.dumps(second.to_dict())
    read = Attractors.load(first.save(tmp_path / "found.json"))
    assert json.dumps(read.to_dict()) == json.dumps(first.to_dict())
    assert read.system == WELL
    assert first.picture.shape == (12, 12)
    (tmp_path / "other.json").write_text("{}")
    with pytest.raises(UsageError, match="no filippov attractors file"):
        Attractors.load(tmp_path / "other.json")


LONG: dict[str, tuple[System, dict[str, Any]]] = {
    "subharmonics": (DUFFING, {"box": BOX, "samples": 8, "parameters": {"d": 0.08, "a": 0, "F": 0.2}}),
    "sets": (WELL, {"box": BOX, "samples": 10}),
    "chaos": (HENON, {"box": {"x": (-0.5, 0.5), "y": (-0.2, 0.2)}, "samples": 1, "most": 200, "rtol": 1e-6}),
    "cycles": (rings([0.7, 1.3, 2.0], [0.5, -0.4, 0.6, -0.3], 1.5),
               {"box": {"x": (-2.4, 2.4), "y": (-2.4, 2.4)}, "samples": 5}),
}  # fmt: skip


@pytest.mark.parametrize("name", LONG)
def test_12_13_a_search_that_was_ended_goes_on_and_finds_the_same(name: str, tmp_path: Path) -> None:
    """Ended after 7, 23 and 61 iterates, and once while it looked at a motion."""
    system, options = LONG[name]
    whole = attractors(system, **options)
    store = tmp_path / "search.npz"
    for stop in (7, 23, 61):
        calls: list[tuple[int, int]] = []

        def progress(done: int, total: int, stop: int = stop, calls: Any = calls) -> None:
            calls.append((done, total))
            if len(calls) >= stop:
                raise KeyboardInterrupt

        part = attractors(system, **options, store=store, progress=progress)
        assert part.complete == (len(calls) < stop)
        assert all(a[0] <= b[0] for a, b in pairwise(calls))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Identifier, "run", _interrupted)
        attractors(system, **options, store=store)
    last = attractors(system, **options, store=store)
    assert last.complete
    assert json.dumps(last.to_dict()) == json.dumps(whole.to_dict())


def _interrupted(*_: object) -> None:
    raise KeyboardInterrupt


def test_12_13_a_search_on_file_is_of_one_system_and_its_settings(tmp_path: Path) -> None:
    store = tmp_path / "search.npz"
    first = attractors(WELL, BOX, samples=10, most=8, store=store)
    assert np.any(first.label == -1)
    # More iterates go on from there; anything else is another search.
    assert attractors(WELL, BOX, samples=10, store=store).iterates > 8
    for changed in ({"samples": 11}, {"parameters": {"mu": 0.2}}, {"cells": 50}):
        with pytest.raises(UsageError, match="keeps a search with another"):
            attractors(WELL, BOX, **{"samples": 10, "store": store} | changed)
    with pytest.raises(UsageError, match="another system"):
        attractors(System({X: V, V: -X - W.c * V - W.mu * sign(V)}), BOX, samples=10, store=store)
    data = bytearray(store.read_bytes())
    data[len(data) // 2] ^= 1
    store.write_bytes(bytes(data))
    with pytest.raises(UsageError, match="damaged"):
        attractors(WELL, BOX, samples=10, store=store)
    plain = System(field=lambda _t, x, _p, _s: np.array([x[1], -x[0] - 0.1 * x[1]]), states=("x", "v"))
    with pytest.raises(UsageError, match="system of expressions"):
        attractors(plain, BOX, samples=10, store=tmp_path / "other.npz")


def test_12_13_bad_requests_are_named() -> None:
    with pytest.raises(UsageError, match="no range for state v"):
        attractors(WELL, {"x": (-1, 1)})
    with pytest.raises(UsageError, match="unknown state 'w'"):
        attractors(WELL, {"x": (-1, 1), "v": (-1, 1)}, plane=("x", "w"))
    with pytest.raises(UsageError, match="least, greatest"):
        attractors(WELL, {"x": (1, -1), "v": (-1, 1)})
    with pytest.raises(UsageError, match="depends on time"):
        attractors(DUFFING, BOX, step=0.1)
    relay = System({X: -sign(X)}, surfaces=[Surface("h", X, width=0.1)])
    with pytest.raises(UsageError, match="hysteresis"):
        attractors(relay, {"x": (-1, 1)})
    with pytest.raises(UsageError, match="cells is 1"):
        attractors(WELL, BOX, cells=1)


def test_12_13_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run = ["attractors", "impact_oscillator", "--box", "x=-2:0", "--box", "v=-2:2", "--samples", "30"]
    assert main([*run, "--plane", "x,v", "--resolution", "8", "--json", "--quiet", "-o", str(tmp_path)]) == 0
    found = json.loads(capsys.readouterr().out)
    assert sorted(one["period"] for one in found["attractors"]) == [1, 3]
    assert {path.name for path in tmp_path.iterdir()} == {
        f"attractors.{end}" for end in ("json", "csv", "png")
    }
    store = ["--store", str(tmp_path / "search.npz"), "--json", "--quiet"]
    assert main([*run, "--most", "5", *store]) == 0
    begun = json.loads(capsys.readouterr().out)
    assert main([*run, *store]) == 0
    last = json.loads(capsys.readouterr().out)
    assert begun["iterates"] == 5 < last["iterates"]
    assert last["label"] == found["label"]
    assert main(["attractors", "impact_oscillator"]) == 2


@pytest.mark.parametrize("damping", [0.0, 0.3])
def test_all_states_go_to_where_twisting_comes_to_rest(damping: float) -> None:
    """x'' = -2 sgn x - sgn x' - c x' is at rest in finite time, on two surfaces and one rate."""
    system = System({X: V, V: -2 * sign(X) - sign(V) - damping * V})
    found = attractors(system, {"x": (-1, 1), "v": (-1, 1)}, samples=16)
    assert [one.kind for one in found.attractors] == ["equilibrium"]
    assert found.attractors[0].states[0] == pytest.approx([0, 0], abs=1e-12)
    assert np.all(found.label == 0)


@pytest.mark.parametrize("seed", range(4))
def test_directions_off_a_slide_have_the_multiplier_zero(seed: int) -> None:
    """x' = A x - b sign(c x): on the surface the flow is exp(P A T), P = I - b c/(c b), in any units."""
    rng = np.random.default_rng([17, seed])
    unit, duration = 10.0 ** rng.integers(-4, 5, 3), 0.7
    a, c, b = rng.normal(size=(3, 3)), rng.normal(size=3), rng.normal(size=3)
    b *= np.sign(c @ b)
    q = states("q0 q1 q2")
    side = sign(sum(float(k) * x for k, x in zip(c / unit, q, strict=True)))
    inner = a * unit[:, None] / unit
    push = b * unit
    rows = [sum(float(w) * x for w, x in zip(row, q, strict=True)) for row in inner]
    system = System({q[i]: rows[i] - float(push[i]) * side for i in range(3)})
    got = np.linalg.eigvals(StateMap(system, step=duration).derivative(np.zeros(3), unit))
    along = (np.eye(3) - np.outer(b, c) / (c @ b)) @ a
    rates = sorted(np.linalg.eigvals(along), key=abs)[1:]
    want = np.append(np.exp(np.array(rates) * duration), 0.0)
    assert np.max(np.min(np.abs(got[:, None] - want), axis=1)) < 1e-7 * np.max(np.abs(want))
    assert np.min(np.abs(got)) < 1e-12


def test_equilibria_that_slide_or_rest_are_stable_by_their_multipliers() -> None:
    """A ball on the floor beside z' = -z: its two directions are lost, exp(-T) is left. A relay likewise."""
    ball = System({X: V, V: -1 - 0.1 * V, Y: -Y},
                  surfaces=[Surface("floor", X, reset={V: -0.5 * V})])  # fmt: skip
    for system, zeros in ((ball, 2), (System({X: -2 * sign(X) + Y, Y: -Y}), 1)):
        box = {"x": (0.1, 1), "v": (-1, 1), "y": (-1, 1)}
        got = attractors(system, {name: box[name] for name in system.states}, samples=10)
        (one,) = got.attractors
        assert one.kind == "equilibrium"
        assert one.stable is True
        assert one.multipliers[0] == pytest.approx(np.exp(-got.duration), abs=1e-9)
        np.testing.assert_allclose(one.multipliers[1:], 0.0, atol=1e-12)
        assert len(one.multipliers) == 1 + zeros


def test_corners_with_ever_more_events_on_the_way_are_attractors() -> None:
    """x'' = -2 sgn x - 0.4 x' and x' = -sgn y - x, y' = sgn x - y: all go to 0, d as exp(-c t/3), exp(-t)."""
    relay = System({X: V, V: -2 * sign(X) - 0.4 * V})
    loop = System({X: -sign(V) - X, V: sign(X) - V})
    for system in (relay, loop):
        got = attractors(system, BOX, samples=12)
        (one,) = got.attractors
        assert (one.kind, one.stable) == ("equilibrium", True)
        np.testing.assert_allclose(one.states, [[0.0, 0.0]], atol=1e-9)
        assert np.all(got.label == 0)
        assert one.from_dict(json.loads(json.dumps(one.to_dict())), system).stable is True
    # A state off by x comes to speeds of sqrt x: there is no derivative.
    assert np.all(np.isnan(StateMap(relay, step=0.5).derivative(np.zeros(2), np.full(2, 4.0))))
