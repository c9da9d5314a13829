"""A surface has the orientation in which it is written, and answers to both."""

import copy

import numpy as np
import pytest
import sympy
from hypothesis import given
from hypothesis import strategies as st
from sympy import Heaviside, Piecewise, sign

from filippov import Problem, Solution, Stop, Sweep, System, parameters, solve, solve_many, states, t
from filippov.analysis.maps.event_map import EventMap
from filippov.analysis.maps.section import Section
from filippov.base.errors import UsageError

x, v = states("x v")
p = parameters(vb=0.4, P=1, F=1.3, k=2)


@pytest.mark.parametrize(
    ("written", "name", "h"),
    [
        (sign(v - p.vb), "v - vb", v - p.vb),
        (sign(p.vb - v), "vb - v", p.vb - v),
        (Heaviside(p.P - x), "P - x", p.P - x),
        (Heaviside(x - p.P), "x - P", x - p.P),
        (Heaviside(-x), "-x", -x),
        (sign(-x - 2 * v), "-2*v - x", -x - 2 * v),
        (sign(sympy.cos(t) - x), "cos(t) - x", sympy.cos(t) - x),
        (abs(v - p.vb) * sign(v - p.vb) + 3 * sign(v - p.vb), "v - vb", v - p.vb),
        (abs(v - p.vb) * sign(p.vb - v) + sign(p.vb - v), "vb - v", p.vb - v),
        (sympy.Max(v, p.vb) + sign(v - p.vb), "v - vb", v - p.vb),
        (Piecewise((1, x < p.k), (2, True)), "x - k", x - p.k),
        (Piecewise((1, p.k < x), (2, True)), "x - k", x - p.k),
        (Piecewise((1, v > x), (2, True)), "v - x", v - x),
    ],
)
def test_11_9_the_surface_is_the_argument_as_it_is_written(written, name, h):
    """Its name and its h; an |u| or Max beside it, which sympy turns round, takes the same."""
    system = System({x: v, v: -x - written})
    assert system.surface_names == (name,)
    assert sympy.expand(system.symbolic.plain_h()[0] - h) == 0


def test_11_9_of_two_orientations_the_first_is_taken():
    """The equations are read in their order."""
    first = System({x: v - sign(p.vb - v), v: -x - sign(v - p.vb)})
    second = System({v: -x - sign(v - p.vb), x: v - sign(p.vb - v)})
    assert first.surface_names == ("vb - v",)
    assert second.surface_names == ("v - vb",)


def belt():
    return System({x: v, v: -x - p.F * sign(v - p.vb)})


def test_11_9_friction_on_a_belt_has_the_sign_of_the_slip():
    """While the block sticks its friction F s balances the spring, s = -x/F, s the sign of v - vb."""
    solution = solve(belt(), (0.2, 0.4), (0.0, 1.0))
    assert solution.modes == ("0",)
    s = solution.multiplier("v - vb", [0.3, 0.8])
    assert np.allclose(s, -(0.2 + 0.4 * np.array([0.3, 0.8])) / 1.3, atol=1e-12)
    assert np.array_equal(solution.multiplier("vb - v", [0.3, 0.8]), -s)
    assert np.array_equal(solution.multiplier(" -v+ vb ", [0.3, 0.8]), -s)
    with pytest.raises(UsageError, match="unknown surface 'v'; known: v - vb"):
        solution.multiplier("v", 0.3)


def test_11_9_events_stops_sections_and_measures_take_either_spelling():
    """What rises for v - vb falls for vb - v."""
    system = belt()
    solution = solve(system, (8.0, 1.0), (0.0, 20.0))
    one, other = solution.events.of("v - vb"), solution.events.of("vb - v")
    assert len(one) > 3
    assert list(one.t) == list(other.t)
    up = solution.events.of("v - vb", "crossing", 1)
    down = solution.events.of("v - vb", "crossing", -1)
    assert (len(up), len(down)) == (1, 2)
    assert list(solution.events.of("vb - v", "crossing", -1).t) == list(up.t)
    assert list(solution.events[0:].of("vb - v", "crossing", 1).t) == list(down.t)
    again = copy.deepcopy(solution.events)
    assert list(again.of("vb - v", "crossing", 1).t) == list(down.t)
    ended = solve(system, (8.0, 1.0), (0.0, 20.0), stop=Stop("vb - v", "crossing up"))
    assert ended.t_end == pytest.approx(down.t[0], rel=1e-12)
    many = solve_many(system, [(8.0, 1.0)] * 3, (0.0, 20.0), stop=Stop("vb - v", "crossing down"))
    assert np.allclose(many.t, up.t[0], rtol=1e-12)
    assert list(many.events("vb - v", "crossing down")) == list(many.events("v - vb", "crossing up"))
    table = Sweep(
        Problem(system, (8.0, 1.0), (0.0, 3.0)), {"F": [0.5, 1.0]},
        measure=("mode(v - vb)", "mode(vb - v)", "events(vb - v, crossing down)"),
    ).run()  # fmt: skip
    assert np.array_equal(table["mode(v - vb)"], -table["mode(vb - v)"])
    assert list(table["events(vb - v, crossing down)"]) == [
        len(solve(system, (8.0, 1.0), (0.0, 3.0), parameters={"F": F}).events.of("v - vb", "crossing", 1))
        for F in (0.5, 1.0)
    ]
    with pytest.raises(UsageError, match="unknown surface 'v - w'"):
        solve(system, (8.0, 1.0), (0.0, 20.0), stop=Stop("v - w"))


def test_11_9_a_section_takes_either_spelling():
    """The map from one passage of x = vb, upwards, to the next is the same."""
    system = System({x: v, v: -x - 0.1 * v + 0.2 * sign(v - p.vb)}, surfaces=())
    lift = {"x": "d", "v": "vb"}
    maps = [
        EventMap(system, Section(name, kind, "x", lift))
        for name, kind in (("v - vb", "crossing up"), ("vb - v", "crossing down"))
    ]
    values = [m([-2.0, -1.5, -1.2]) for m in maps]
    assert np.all(np.isfinite(values[0]))
    assert np.array_equal(*values)


def test_11_9_a_stored_solution_takes_either_spelling(tmp_path):
    """As before it was stored."""
    solution = solve(belt(), (8.0, 1.0), (0.0, 10.0))
    read = Solution.load(solution.save(tmp_path / "belt.npz"))
    falls = solution.events.of("v - vb", "crossing", -1)
    assert list(read.events.of("vb - v", "crossing", 1).t) == list(falls.t)
    assert np.array_equal(read.multiplier("vb - v", [1.0]), -solution.multiplier("v - vb", [1.0]))


a = parameters(a=1, b=1, c=1, k=1)
SLOPE = a.a * x + a.b * v + a.c + (x - t) / 7
TWINS = {
    step: [System({x: v - a.k * jump, v: -x - v / 5 - a.k * jump}) for jump in pair]
    for step, pair in {
        False: (sign(SLOPE), -sign(-SLOPE)),
        True: (Heaviside(SLOPE), 1 - Heaviside(-SLOPE)),
    }.items()
}
NUMBER = st.integers(-6, 6).map(lambda q: q / 2)


@given(st.tuples(NUMBER, NUMBER, NUMBER), st.integers(1, 4), st.tuples(NUMBER, NUMBER), st.booleans())
def test_11_9_writing_the_argument_the_other_way_mirrors_mode_and_multiplier(h, size, x0, step):
    """sign(u) = -sign(-u), H(u) = 1 - H(-u): the same motion, with modes and multipliers of opposite sign."""
    values = dict(zip("abck", (*h, size), strict=True))
    first, second = (
        solve(system, x0, (0.0, 4.0), parameters=values, nonunique="stick") for system in TWINS[step]
    )
    assert first.system.symbolic.h[0] == -second.system.symbolic.h[0]
    assert first.status == second.status
    assert first.t_end == pytest.approx(second.t_end, abs=1e-9)
    assert np.allclose(first.x_end, second.x_end, atol=1e-8)
    turned = str.maketrans("+-", "-+")
    assert first.modes == tuple(mode.translate(turned) for mode in second.modes)
    name = first.system.surface_names[0]
    inner = [0.5 * (q.t0 + q.t1) for q in first.segments]
    asked = first.multiplier(name, inner)
    assert np.allclose(asked, second.multiplier(name, inner), atol=1e-7)
    assert np.allclose(asked, -second.multiplier(second.system.surface_names[0], inner), atol=1e-7)
