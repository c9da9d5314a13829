"""Bodies on two supports, rocking blocks, stacks on a moving table: laws of impact, closed forms."""

import itertools
import math
import os
from functools import cache

import numpy as np
import pytest

from filippov import Solution, Status, Surface, System, cos, parameters, sin, solve, states, t

DRAWS = {"default": 6, "ci": 20, "nightly": 1000}[os.environ.get("FILIPPOV_PROFILE", "default")]
NAMED = (Status.NON_UNIQUE, Status.MAX_EVENTS)
SIDES = (("left", -1), ("right", 1))


@cache
def block() -> System:
    """A block of mass 1, width 2 b and height 2 d on a floor without friction: y its centre, q its angle.

    Corners at y + side b sin(q) - d cos(q); d = 0 is a seesaw, a bar that lies on two supports. L = dh/dt is
    v + k w, an impact on one corner changes v by l and w by k l/J.
    """
    y, q, v, w = states("y q v w")
    p = parameters(e_left=0.5, e_right=0.5, g=10.0, b=1.0, d=0.0, J=0.5)
    supports = []
    for name, side in SIDES:
        e, k = getattr(p, f"e_{name}"), side * p.b * cos(q) + p.d * sin(q)
        impulse = -(1 + e) * (v + k * w) / (1 + k**2 / p.J)
        h = y + side * p.b * sin(q) - p.d * cos(q)
        supports.append(Surface(name, h, reset={v: v + impulse, w: w + k * impulse / p.J}))
    return System({y: v, q: w, v: -p.g, w: 0 * w}, surfaces=supports)


def broken(run: Solution, values: dict[str, float]) -> list[str]:
    """The laws that a run of the block breaks: no corner below the floor, energy does not grow."""
    times = np.unique(np.concatenate([np.linspace(0, run.t_end, 1001), run.t]))
    y, q, v, w = run.sol(times, side="+")
    found = []
    for name, side in SIDES:
        least = float(np.min(y + side * values["b"] * np.sin(q) - values["d"] * np.cos(q)))
        if least < -1e-9:
            found.append(f"{name} at {least:.3g}")
    energy = v**2 / 2 + values["J"] * w**2 / 2 + 10 * y
    if np.max(np.diff(energy)) > 1e-8 * (1 + np.max(np.abs(energy))):
        found.append(f"energy grows by {np.max(np.diff(energy)):.3g}")
    return found


@pytest.mark.parametrize("shape", ["seesaw", "block"])
def test_11_2_bodies_on_two_supports_stay_above_them_and_come_to_rest(shape: str) -> None:
    random = np.random.default_rng(2)
    for k in range(DRAWS):
        b, d = random.uniform(0.3, 1), (random.uniform(0.5, 1.5) if shape == "block" else 0.0)
        e = random.choice([0.0, 0.8, random.uniform(0, 0.8)], 2)
        inertia = (b**2 + d**2) / 3 if shape == "block" else random.uniform(0.1, 1.2)
        values = {"e_left": float(e[0]), "e_right": float(e[1]), "b": b, "d": d, "J": inertia}
        # It stands on one corner, or is in the air; tilted by so little that it comes back.
        q = random.uniform(-0.2, 0.2)
        lowest = abs(b * math.sin(q)) + d * math.cos(q)
        lifted = random.choice([0.0, random.uniform(0, 0.3)])
        start = (lowest + lifted, q, 0.0, 0.0 if lifted == 0.0 else random.uniform(-0.3, 0.3))
        # Between its steps a run is exact to a few times its tolerance: by default 5e-9 for such bodies.
        options = {"zeno": "continue", "max_events": 20_000, "rtol": 1e-10}
        run = solve(block(), start, (0, 2), parameters=values, **options)
        assert run.success or run.status in NAMED, (k, run.message)
        assert not broken(run, values), (k, start, values)


def test_dense_output_of_a_flight_that_ends_at_an_impact_is_its_parabola() -> None:
    """Whether the step to the impact was found at once or corrected: to rounding, not only to rtol."""
    random = np.random.default_rng(2)
    for k in range(max(DRAWS, 30)):
        b, d, e = random.uniform(0.3, 1), random.uniform(0.5, 1.5), random.uniform(0.0, 0.8, 2)
        values = {"e_left": e[0], "e_right": e[1], "b": b, "d": d, "J": (b**2 + d**2) / 3}
        q = random.uniform(-0.2, 0.2)
        start = (abs(b * math.sin(q)) + d * math.cos(q) + 0.2, q, 0.0, random.uniform(-2, 2))
        run = solve(block(), start, (0, 2), parameters=values, max_events=20_000, zeno="stop")
        flights = [event for event in run.events if event.after == (1, 1)]
        ends = [(0.0, np.array(start)), *((event.t, event.x_after) for event in flights)]
        for (t0, x0), (t1, _) in itertools.pairwise(ends):
            later = np.linspace(t0, t1, 13)[1:-1] - t0
            exact = x0[0] + x0[2] * later - 5 * later**2
            np.testing.assert_allclose(run.sol(t0 + later)[0], exact, rtol=0, atol=1e-12, err_msg=f"draw {k}")


def test_11_2_a_seesaw_let_down_on_its_other_support() -> None:
    """Plastic supports: one impact, after which both hold it, whatever the inertia and the tilt are."""
    random = np.random.default_rng(4)
    for inertia in random.uniform(0.05, 0.95, DRAWS):
        q, values = random.uniform(0.01, 0.3), {"e_left": 0.0, "e_right": 0.0, "J": inertia}
        start = (math.sin(q), q, 0.0, 0.0)
        run = solve(block(), start, (0, 2), parameters=values)
        assert run.success
        # Tilted upwards on the right: it turns about the left end until the right one lands.
        landing = run.events.of("right", "reset")[0]
        lost = 10 * math.sin(q)
        assert landing.x[2] ** 2 / 2 + inertia * landing.x[3] ** 2 / 2 == pytest.approx(lost, rel=1e-8)
        # The right end stops; what is left turns about it, or presses on both supports at once.
        v, w = landing.x[2:]
        impulse = -(v + w) / (1 + 1 / inertia)
        after = np.array([v + impulse, w + impulse / inertia])
        if after[0] - after[1] > 0:
            assert landing.x_after[2:] == pytest.approx(after, abs=1e-9)
        else:
            assert landing.x_after[2:] == pytest.approx([0, 0], abs=1e-9)


def test_11_2_a_bar_dropped_flat_bounces_like_a_ball_under_the_law_for_all_contacts_at_once() -> None:
    random = np.random.default_rng(3)
    for e in random.uniform(0.1, 0.8, DRAWS):
        height, values = random.uniform(0.2, 1), {"e_left": e, "e_right": e, "J": random.uniform(0.1, 2)}
        span, law = (0, 1.5), "generalised Newton"
        start = (height, 0, 0, 0)
        run = solve(block(), start, span, parameters=values, simultaneous=law, zeno="continue")
        fallen = math.sqrt(2 * height / 10)
        rest = fallen + 2 * e * fallen / (1 - e)
        assert run.success
        first = run.events.of("left", "reset")[0]
        assert first.x_after[2:] == pytest.approx([e * 10 * fallen, 0], abs=1e-9)
        if rest < 1.4:
            assert run.end_mode == (0, 0)
            assert run.x_end == pytest.approx([0, 0, 0, 0], abs=1e-9)


@cache
def shaken(n: int) -> System:
    """n bodies on a table at A sin(w t): states y, v; restitutions e0 (table), e1 ...; masses m0 ...."""
    names = [states(f"y{i} v{i}") for i in range(n)]
    y, v = [a for a, _ in names], [b for _, b in names]
    values = {f"e{i}": 0.5 for i in range(n)} | {f"m{i}": 1.0 for i in range(n) if n > 1}
    p = parameters(A=0.5, w=3.0, **values)
    speed = p.A * p.w * cos(p.w * t)
    surfaces = [Surface("table", y[0] - p.A * sin(p.w * t), reset={v[0]: speed - p.e0 * (v[0] - speed)})]
    for i in range(1, n):
        a, b, e = getattr(p, f"m{i - 1}"), getattr(p, f"m{i}"), getattr(p, f"e{i}")
        low, high = v[i - 1], v[i]
        mean, part = (a * low + b * high) / (a + b), e * (low - high) / (a + b)
        after = {low: mean - b * part, high: mean + a * part}
        surfaces.append(Surface(f"contact {i}", y[i] - y[i - 1], reset=after))
    return System(dict(zip(y, v, strict=True)) | dict.fromkeys(v, -10.0), surfaces=surfaces)


@pytest.mark.parametrize("n", [1, 2, 3])
def test_11_2_stacks_on_a_shaken_table(n: int) -> None:
    random = np.random.default_rng(n)
    for k in range(max(DRAWS // 2, 3)):
        values = {"A": random.uniform(0.1, 1), "w": random.uniform(1, 6)}
        for i in range(n):
            values |= {f"e{i}": float(random.choice([0.0, random.uniform(0, 0.9)]))}
            values |= {f"m{i}": float(np.exp(random.uniform(-1, 1)))} if n > 1 else {}
        y = np.cumsum(random.choice([0.0, 0.2, random.uniform(0, 0.5)], n))
        start = np.concatenate([y, random.choice([0.0, values["A"] * values["w"]], n)])
        options = {"zeno": "continue", "max_events": 20_000, "rtol": 1e-10}
        run = solve(shaken(n), start, (0, 3), parameters=values, **options)
        assert run.success or run.status in NAMED, (k, run.message)
        times = np.unique(np.concatenate([np.linspace(0, run.t_end, 1201), run.t]))
        table = values["A"] * np.sin(values["w"] * times)
        h = np.diff(np.vstack([table, run.sol(times, side="+")[:n]]), axis=0)
        assert np.min(h) > -1e-9, (k, start, values)
        m = np.array([values.get(f"m{i}", 1.0) for i in range(n)])
        for event in run.events.of(kind="reset"):
            # Seen from the table, no impact gives energy to the stack.
            speed = values["A"] * values["w"] * math.cos(values["w"] * event.t)
            before, after = event.x[n:] - speed, event.x_after[n:] - speed
            assert m @ after**2 <= m @ before**2 * (1 + 1e-9) + 1e-10, (k, event)


def test_11_2_a_stack_that_sticks_together_leaves_the_table_where_it_falls_faster() -> None:
    """Plastic contacts: the stack leaves a table A sin(w t) as one body, where A w**2 sin(w t) = g."""
    random = np.random.default_rng(7)
    for _ in range(DRAWS):
        w = random.uniform(4, 8)
        values = {"A": random.uniform(1.1, 2) * 10 / w**2, "w": w, "e0": 0.0, "e1": 0.0, "m0": 0.5, "m1": 2.0}
        speed = values["A"] * w
        leaves = math.asin(10 / (values["A"] * w**2)) / w
        end = leaves + 0.02
        run = solve(shaken(2), (0, 0, speed, speed), (0, end), parameters=values)
        assert run.success
        assert run.events.of("table", "sliding exit")[0].t == pytest.approx(leaves, abs=1e-8)
        y, v = 10 / w**2, speed * math.cos(w * leaves)
        expected = y + v * 0.02 - 10 * 0.02**2 / 2
        assert run.x_end == pytest.approx([expected] * 2 + [v - 0.2] * 2, abs=1e-8)
