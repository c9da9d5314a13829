"""Relays with hysteresis that switch while other surfaces are slid on, against straight lines."""

from __future__ import annotations

import os
from typing import NamedTuple

import numpy as np
import pytest

from filippov import Status, Surface, System, parameters, sign, solve, solve_many, states

DRAWS = {"nightly": 1500}.get(os.environ.get("FILIPPOV_PROFILE", ""), 18)
END = 8.0
NAMES = "a b e q c k l w"

x, y = states("x y")
p = parameters(**dict.fromkeys(NAMES.split(), 1.0))
r, s = sign(x), sign(y)
# The relay r acts on the rate of y, on which s = Sgn(y) may be slid on, and s on the rate of the relay.
PLANE = System(
    {x: p.a - p.b * r + p.e * s, y: p.q + p.c * r - (p.k + p.l * r) * s},
    surfaces=[Surface("relay", x, width=p.w), Surface("y", y)],
)


class Draw(NamedTuple):
    """Rates of the plane, and where it starts."""

    values: dict[str, float]
    start: tuple[float, float]


def drawn(seed: int) -> Draw:
    rng = np.random.default_rng((7, seed))
    b = rng.uniform(0.5, 2.0)
    near = rng.uniform(-1.0, 1.0, 5) * (0.6 * b, 0.7 * b, 0.8, 1.2, 0.6)
    numbers = (near[0], b, *near[1:4], 1.0, near[4], rng.uniform(0.1, 0.5))
    return Draw(dict(zip(NAMES.split(), map(float, numbers), strict=True)), (1.0, float(rng.uniform(-1, 1))))


def along_lines(draw: Draw) -> tuple[list[tuple[float, str]], np.ndarray] | None:
    """Times and surfaces of the events and the end, by rates that are constant from event to event."""
    a, b, e, q, c, k, l, w = draw.values.values()

    def slope(relay: int, side: float) -> float:
        return q + c * relay - (k + l * relay) * side

    t, z, relay = 0.0, np.array(draw.start), 1
    side = 1 if z[1] > 0 else -1
    found: list[tuple[float, str]] = []
    while True:
        held = (q + c * relay) / (k + l * relay) if side == 0 else float(side)
        rates = np.array([a - b * relay + e * held, slope(relay, held) if side else 0.0])
        waits = [-(relay * z[0] + w) / (relay * rates[0]) if relay * rates[0] < 0 else np.inf]
        waits.append(-z[1] / rates[1] if side * rates[1] < 0 else np.inf)
        wait = min(waits)
        if abs(waits[0] - waits[1]) < 1e-6 or abs(t + wait - END) < 1e-6 or len(found) > 200:
            return None
        if t + wait > END:
            return found, z + (END - t) * rates
        t, z = t + wait, z + wait * rates
        if waits[0] < waits[1]:
            found.append((t, "relay"))
            z[0], relay = -relay * w, -relay
            if side == 0:
                up, down = slope(relay, 1.0), slope(relay, -1.0)
                if min(abs(up), abs(down)) < 1e-2:
                    return None
                side = 0 if up < 0.0 < down else 1 if up > 0.0 else -1
                if side:
                    found.append((t, "y"))
        else:
            found.append((t, "y"))
            beyond, z[1] = slope(relay, -side), 0.0
            if abs(beyond) < 1e-2:
                return None
            side = 0 if beyond * side > 0.0 else -side


@pytest.mark.parametrize("method", ["DOP853", "Radau", "Taylor"])
def test_relays_switch_beside_a_slide(method: str) -> None:
    seen = 0
    for seed in range(DRAWS if method == "DOP853" else DRAWS // 6):
        draw = drawn(seed)
        known = along_lines(draw)
        if known is None:
            continue
        events, end = known
        run = solve(PLANE, draw.start, (0, END), parameters=draw.values, method=method)
        assert run.success, (seed, run.message)
        told = [(event.t, event.surface) for event in run.events]
        assert sorted(name for _, name in told) == sorted(name for _, name in events), seed
        assert np.allclose(sorted(t for t, _ in told), [t for t, _ in events], rtol=0, atol=1e-9), seed
        assert np.allclose(run.x_end, end, rtol=0, atol=1e-8), seed
        seen += any(name == "relay" for _, name in events)
    assert seen > (DRAWS if method == "DOP853" else DRAWS // 6) // 2


def test_relays_switch_beside_a_slide_for_many_and_for_functions() -> None:
    given = [(draw, known) for draw in map(drawn, range(DRAWS)) if (known := along_lines(draw)) is not None]
    columns = {name: [draw.values[name] for draw, _ in given] for name in NAMES.split()}
    many = solve_many(PLANE, [draw.start for draw, _ in given], (0, END), parameters=columns, lanes=8)
    assert np.all(many.success)
    assert np.allclose(many.x, [end for _, (_, end) in given], rtol=0, atol=1e-8)

    for draw, (_, end) in given[:5]:
        relay = Surface("relay", lambda t, x, p: x[0], width=draw.values["w"])
        functions = System(
            field=lambda t, x, p, s: [
                p["a"] - p["b"] * s[0] + p["e"] * s[1],
                p["q"] + p["c"] * s[0] - (p["k"] + p["l"] * s[0]) * s[1],
            ],
            surfaces=[relay, Surface("y", lambda t, x, p: x[1])], states="x y", parameters=draw.values,
        )  # fmt: skip
        run = solve(functions, draw.start, (0, END))
        assert run.success
        assert np.allclose(run.x_end, end, rtol=0, atol=1e-8)


def test_a_slide_that_a_relay_turns_round_is_not_unique() -> None:
    """y' = -r s is a slide that attracts before the relay switches, and one that repels after it."""
    turned = System({x: -1 + 0 * x, y: -r * s}, surfaces=[Surface("relay", x, width=0.5), Surface("y", y)])
    run = solve(turned, (1.0, 0.2), (0, 3))
    assert run.status is Status.NON_UNIQUE
    assert abs(run.t_end - 1.5) < 1e-12
    assert sorted(candidate.mode for candidate in run.candidates) == [(-1, -1), (-1, 0), (-1, 1)]
