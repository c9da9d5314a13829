"""Resets due at one instant: SUCCESS only where every order of them comes to the same state."""

import itertools
import math
import random
from fractions import Fraction

import pytest

from filippov import Status, Surface, System, TimeEvent, sign, solve
from filippov.model.symbols import Abs, Expr, Max, states


def random_map(rng: random.Random) -> tuple[int, int]:
    """z -> a z + b, as (a, b): mostly of a kind that commutes with the others."""
    a = rng.choice([1, 1, 1, 1, 1, 2, 0])
    return a, rng.choice([0, 0, 1, 2])


def ends(maps: list[tuple[int, int]], z: Fraction) -> set[Fraction]:
    """What z becomes by all orders of the maps."""
    found = set()
    for order in set(itertools.permutations(maps)):
        value = z
        for a, b in order:
            value = a * value + b
        found.add(value)
    return found


def at_once(maps: list[tuple[int, int]], timed: int) -> System:
    """Clocks x' = 1 that are reset at x = 1, and time events at t = 1: each has a map for z."""
    count = len(maps) - timed
    *x, z = states(" ".join([*(f"x{i}" for i in range(count)), "z"]))

    def moved(i: int) -> dict[Expr, Expr]:
        a, b = maps[i]
        return {z: a * z + b} if (a, b) != (1, 0) else {}

    surfaces = [Surface(f"g{i}", 1 - x[i], reset={x[i]: 0 * z, **moved(i)}) for i in range(count)]
    events = [TimeEvent(f"e{i}", times=[1.0], reset=moved(i)) for i in range(count, len(maps)) if moved(i)]
    return System({**{q: 1 + 0 * q for q in x}, z: 0 * z}, surfaces=surfaces, time_events=events)


@pytest.mark.parametrize("seed", range(40))
def test_resets_at_one_instant_in_every_order(seed: int) -> None:
    rng = random.Random(seed)  # noqa: S311
    maps = [random_map(rng) for _ in range(rng.randint(2, 7))]
    timed = rng.choice([0, 0, 1, 2]) if len(maps) > 3 else 0
    expected = ends(maps, Fraction(3))
    run = solve(at_once(maps, timed), [0.0] * (len(maps) - timed) + [3.0], (0, 1.5))
    if len(expected) > 1:
        assert run.status is Status.NON_UNIQUE, (maps, run.x_end)
        assert run.t_end == 1.0
        assert "order" in run.message
    else:
        assert run.success, (maps, run.message)
        assert run.x_end[-1] == pytest.approx(float(expected.pop()), abs=1e-14)


def test_a_hundred_resets_that_add_to_one_state() -> None:
    run = solve(at_once([(1, 1)] * 100, 0), [0.0] * 100 + [0.0], (0, 3.5))
    assert run.success
    assert run.x_end[-1] == 300.0
    assert len(run.events) == 300


@pytest.mark.parametrize("odd", [0, 5, 11])
def test_one_of_twelve_resets_that_does_not_commute(odd: int) -> None:
    maps = [(1, 1)] * 12
    maps[odd] = (2, 0)
    run = solve(at_once(maps, 0), [0.0] * 12 + [1.0], (0, 1.5))
    assert run.status is Status.NON_UNIQUE


def with_five(x: list[Expr], z: Expr, w: Expr, surfaces: list[Surface]) -> System:
    return System({**{q: 1 + 0 * q for q in x}, z: 0 * z, w: 0 * w}, surfaces=surfaces)


def test_a_reset_that_reads_a_state_through_an_absolute_value() -> None:
    """|z - 3| is read by one and z written by the others: the orders differ."""
    *x, z, w = states("x0 x1 x2 z w")
    surfaces = [
        Surface("g0", 1 - x[0], reset={x[0]: 0 * z, z: z + 1}),
        Surface("g1", 1 - x[1], reset={x[1]: 0 * z, w: w + Abs(z - 3)}),
        Surface("g2", 1 - x[2], reset={x[2]: 0 * z, z: z + 2}),
    ]
    run = solve(with_five(x, z, w, surfaces), [0] * 5, (0, 1.5))
    assert run.status is Status.NON_UNIQUE
    # Where max(z, 9) is 9 in every order what it reads makes no difference.
    surfaces[1] = Surface("g1", 1 - x[1], reset={x[1]: 0 * z, w: w + Max(z, 9)})
    run = solve(with_five(x, z, w, surfaces), [0] * 5, (0, 1.5))
    assert run.success
    assert run.x_end[-2:] == pytest.approx([3.0, 9.0], abs=1e-14)


@pytest.mark.parametrize("same", [True, False])
def test_plain_functions_that_are_applied_in_a_sample_of_orders(same: bool) -> None:
    """Products commute, though nothing but their values tells; one sum among them does not."""
    factors = [2.0, 3.0, 0.5] * 3 + ([] if same else [None])
    n = len(factors)

    def reset(i: int, factor: float | None):
        def after(t, x, p):
            x = list(x)
            x[i] = 0.0
            x[n] = x[n] + 1.0 if factor is None else factor * x[n]
            return x

        return after

    surfaces = [
        Surface(f"g{i}", lambda t, x, p, i=i: 1.0 - x[i], reset=reset(i, q)) for i, q in enumerate(factors)
    ]
    names = [*(f"x{i}" for i in range(n)), "z"]
    system = System(field=lambda t, x, s, p: [1.0] * n + [0.0], states=names, surfaces=surfaces)
    run = solve(system, [0.0] * n + [1.0], (0, 1.5))
    if same:
        assert run.success, run.message
        assert run.x_end[-1] == pytest.approx(math.prod(factors), rel=1e-13)
    else:
        assert run.status is Status.NON_UNIQUE


def test_where_the_order_of_resets_decides_no_choice_of_modes_is_advised() -> None:
    """nonunique='branch' ends there too, and the message advised it; other ends of this name still do."""
    x, n = states("x n")
    clocks = [TimeEvent(name, times=(1,), reset={n: e}) for name, e in (("a", n + 1), ("b", 2 * n))]
    run = solve(System({x: 1, n: 0}, time_events=clocks), (0, 1), (0, 2))
    assert run.status is Status.NON_UNIQUE
    assert "nonunique=" not in run.message
    assert "earlier or later decides it" in run.message
    fork = solve(System({x: sign(x)}), (0,), (0, 1))
    assert "nonunique='branch'" in fork.message
