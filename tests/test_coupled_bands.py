"""Switch and Karnopp on surfaces that share a rate: two frictions on one body, or between two bodies."""

from typing import Any

import numpy as np
import pytest

from filippov import (
    EventKind,
    Karnopp,
    ModelError,
    Parameter,
    Surface,
    Switch,
    System,
    cos,
    parameters,
    sign,
    sin,
    solve,
    states,
    t,
)  # fmt: skip
from filippov.analysis import compare

x, v, y, w = states("x v y w")
KINDS = [Switch, Karnopp]


def stacked(rng: np.random.Generator) -> System:
    """A body on the ground, pulled and shaken, and another on top of it that friction carries along."""
    m1, m2 = rng.uniform(0.7, 2, 2).tolist()
    f1, f2 = rng.uniform(0.4, 0.8), rng.uniform(0.3, 0.6)
    drive, k = rng.uniform(0.9, 1.4), rng.uniform(0.6, 1.5)
    ground, between = f1 * sign(v), f2 * sign(v - w)
    return System(
        {x: v, v: (-k * x - ground - between + drive * cos(t)) / m1, y: w, w: (between - 0.2 * y) / m2},
        surfaces=[Surface("ground", v), Surface("between", v - w)],
    )


def belts(rng: np.random.Generator) -> System:
    """A body held by two belts, one of them turning back and forth."""
    f1, f2, k = *rng.uniform(0.2, 0.5, 2), rng.uniform(0.8, 1.5)
    moving = rng.uniform(0.2, 0.5) * cos(rng.uniform(0.4, 0.8) * t)
    return System(
        {x: v, v: -k * x - f1 * sign(v) - f2 * sign(v - moving)},
        surfaces=[Surface("still", v), Surface("moving", v - moving)],
    )


def joined(rng: np.random.Generator) -> System:
    """Two bodies on springs with friction between them only: a relative velocity."""
    m1, m2 = rng.uniform(0.7, 2, 2).tolist()
    k1, k2, f = rng.uniform(0.5, 2), rng.uniform(0.5, 2), rng.uniform(0.2, 0.5)
    between = f * sign(v - w)
    return System(
        {x: v, v: (-k1 * x - between - 0.1 * v) / m1, y: w, w: (-k2 * y + between) / m2},
        surfaces=[Surface("between", v - w)],
    )


def errors_of(exact: System, made: System, x0: Any, end: float, widths: Any) -> list[float]:
    """Largest error of a state over time by half-width, against the exact run."""
    times = np.linspace(0, end, 801)
    known = solve(exact, x0, (0, end), rtol=1e-11, atol=1e-13)
    assert known.success, known.message
    assert known.sol is not None
    out = []
    for width in widths:
        run = solve(made, x0, (0, end), parameters={"eta": width}, rtol=1e-10, atol=1e-13)
        assert run.success, (width, run.message)
        assert run.sol is not None
        out.append(float(np.max(np.abs(known.sol(times) - run.sol(times)))))
    return out


ETA = parameters(eta=Parameter(1e-3, lower=1e-12)).eta


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("make", [stacked, belts, joined])
@pytest.mark.parametrize("seed", range(4))
def test_15_1_surfaces_that_share_a_rate_go_to_the_exact_solution(kind: Any, make: Any, seed: int) -> None:
    """The error is of first order in the width; every state sticks and slips on the way."""
    rng = np.random.default_rng(seed)
    exact = make(rng)
    x0 = [0.0 if name in "vw" and rng.random() < 0.5 else rng.uniform(-1, 1) for name in exact.states]
    errors = errors_of(exact, exact.with_comparator(kind(ETA)), x0, 12.0, (1e-2, 1e-3, 1e-4, 1e-5))
    assert errors[-1] < 1e-4
    assert np.log10(errors[1] / errors[-1]) / 2 > 0.8, errors


def test_15_1_the_solutions_above_stick_and_slip_on_both_surfaces_in_every_way() -> None:
    seen, entries = set(), 0
    for seed in range(4):
        rng = np.random.default_rng(seed)
        exact = stacked(rng)
        run = solve(exact, [rng.uniform(-1, 1) for _ in exact.states], (0, 12))
        seen |= {tuple(q == 0 for q in segment.mode) for segment in run.segments}
        entries += sum(event.kind is EventKind.ENTRY for event in run.events)
    assert entries > 8
    assert seen == {(False, False), (True, False), (False, True), (True, True)}


def by_enumeration(q: dict[str, float], at: dict[str, float], eta: float, alpha: float, karnopp: bool) -> Any:
    """The field of `statics` by trying all nine cases of its pair; None close to a border of them."""
    v, w = at["v"], at["w"]
    h = np.array([v, v - w])
    inside = np.abs(h) <= eta
    both = 1 / q["m1"] + 1 / q["m2"]
    matrix = -np.array([[q["F"] / q["m1"], q["G"] / q["m1"]], [q["F"] / q["m1"], q["G"] * both]])
    levels = np.array([q["S"] / q["F"], 1.0])

    def seen(still: Any) -> tuple[float, float]:
        """The velocities with h = 0 where still, along what the signs do."""
        if still.all():
            return 0.0, 0.0
        if still[0]:
            return 0.0, w
        share = q["m1"] / (q["m1"] + q["m2"])
        middle = share * v + (1 - share) * w
        return (middle, middle) if still[1] else (v, w)

    def free(v: float, w: float) -> Any:
        return np.array([-q["k"] * at["x"] / q["m1"] - q["c"] * v / q["m1"], -at["y"] / q["m2"]])

    def rates(v: float, w: float) -> Any:
        a, b = free(v, w)
        return np.array([a, a - b])

    found = []
    rest, moving = rates(*seen(inside)), rates(*(seen(inside) if karnopp else (v, w)))
    for case in np.ndindex(3, 3):
        if any(case[i] == 2 for i in (0, 1) if not inside[i]):
            continue
        # 0 and 1: at the lower and upper end, or outside below and above; 2: sticks
        s = np.where(inside, levels, 1.0) * (np.array(case) * 2.0 - 1)
        if any(case[i] != (h[i] > 0) for i in (0, 1) if not inside[i]):
            continue
        stuck = np.array(case) == 2
        tested = s.copy()
        if stuck.any():
            part = matrix[np.ix_(stuck, stuck)]
            others = matrix[np.ix_(stuck, ~stuck)] @ s[~stuck]
            tested[stuck] = np.linalg.solve(part, -rest[stuck] - others)
            s[stuck] = np.linalg.solve(part, -moving[stuck] - others - alpha * h[stuck])
        rate = rest + matrix @ tested
        margin = [
            levels[i] - abs(tested[i]) if stuck[i] else rate[i] * tested[i] if inside[i] else 1.0
            for i in (0, 1)
        ]
        if min(margin) > 0:
            found.append((s, min(margin)))
    if len(found) != 1 or found[0][1] < 1e-6:
        return None
    s = found[0][0]
    v, w = seen(inside) if karnopp else (v, w)
    a, b = free(v, w)
    return [v, a - (q["F"] * s[0] + q["G"] * s[1]) / q["m1"], w, b + q["G"] * s[1] / q["m2"]]


def value(system: System, at: dict[str, float], given: dict[str, float]) -> list[float]:
    """The field of a system at a state, its signs those of its own h."""
    form = system.symbolic
    assert form is not None
    known: dict[Any, Any] = {q: given[q.name] for q in form.p} | {q: at[q.name] for q in form.x}
    for s, a, h in zip(form.s, form.a, form.h, strict=True):
        number = float(h.xreplace(known))
        known[s], known[a] = (1 if number > 0 else -1), abs(number)
    return [float(f.xreplace({q: known[q] for q in (*form.s, *form.a)}).xreplace(known)) for f in form.field]


@pytest.mark.parametrize("kind", KINDS)
def test_15_1_the_stick_of_a_pair_is_the_one_of_its_nine_cases(kind: Any) -> None:
    """With a static level on the ground and damping; by enumeration at random states and parameters."""
    words = ("m1", "m2", "k", "c", "F", "S", "G")
    p = parameters(**{word: Parameter(1, lower=1e-9) for word in words})
    system = System(
        {
            x: v, v: (-p.k * x - p.c * v - p.F * sign(v) - p.G * sign(v - w)) / p.m1,
            y: w, w: (-y + p.G * sign(v - w)) / p.m2,
        },
        surfaces=[Surface("ground", v, radius=p.S / p.F), Surface("between", v - w)],
    )  # fmt: skip
    eta, alpha = 0.3, 7.0
    made = system.with_comparator(kind(eta, alpha))
    rng = np.random.default_rng(3)
    places, both = set(), 0
    for _ in range(80):
        given = dict(zip(words, rng.uniform(0.5, 2, 7).tolist(), strict=True))
        given["S"] += given["F"]
        at = dict(zip("xvyw", (rng.uniform(-1, 1, 4) * (3, 0.5, 3, 0.5)).tolist(), strict=True))
        expected = by_enumeration(given, at, eta, alpha, kind is Karnopp)
        if expected is None:
            continue
        assert value(made, at, given) == pytest.approx(expected, rel=1e-9, abs=1e-9)
        places.add((abs(at["v"]) <= eta, abs(at["v"] - at["w"]) <= eta))
        both += places != set() and abs(at["v"]) <= eta and abs(at["v"] - at["w"]) <= eta
    assert len(places) == 4
    assert both > 10


def inert(rng: np.random.Generator) -> System:
    """Two joints whose inertia is a full matrix M, each with friction: M (v', w') = forces."""
    a, b, c = *rng.uniform(1, 3, 2), rng.uniform(-0.8, 0.8)
    first = -5 * x + rng.uniform(0.6, 1) * cos(t) - rng.uniform(0.6, 0.9) * sign(v)
    second = -3 * y - rng.uniform(0.5, 0.8) * sign(w)
    det = a * b - c**2
    return System({x: v, v: (b * first - c * second) / det, y: w, w: (a * second - c * first) / det})


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("kind", ["switch", "karnopp"])
def test_15_1_friction_of_bodies_that_a_mass_matrix_couples(kind: str, seed: int) -> None:
    """A force on one joint acts on the rate of the other: of first order in the width, like any other."""
    table = compare(
        inert(np.random.default_rng(seed)), (0.5, 0.3, 0.8, -0.4), (0, 8), against=[kind],
        widths=(1e-3, 1e-4, 1e-5),
    )  # fmt: skip
    assert sum(table.rows[0]["entries"]) > 0
    _, wide, narrow = (row["error_state"] for row in table.of(kind))
    assert narrow < 1e-4
    assert wide / narrow == pytest.approx(10, rel=0.1)
    if kind == "karnopp":
        assert table.of(kind)[-1]["drift"] < 1e-13


def cart() -> System:
    """A cart with friction that carries a pendulum: its full equations."""
    M, m, long, g = 2, 0.5, 0.7, 9.81
    push = m * long * w**2 * sin(y) + 2.4 * sin(3 * t) - 1.5 * sign(v)
    turn = -m * g * long * sin(y)
    a, b, d = M + m, m * long * cos(y), m * long**2
    det = a * d - b**2
    return System({x: v, v: (d * push - b * turn) / det, y: w, w: (a * turn - b * push) / det})


@pytest.mark.parametrize("kind", ["switch", "karnopp"])
def test_15_1_friction_of_a_body_whose_inertia_depends_on_the_places(kind: str) -> None:
    """The impulse that stops the cart turns the pendulum by cos(y): of first order in the width."""
    table = compare(cart(), (0, 0.4, 0.3, 0), (0, 8), against=[kind], widths=(1e-4, 1e-5))
    assert table.rows[0]["entries"][0] > 1
    wide, narrow = (row["error_state"] for row in table.of(kind))
    assert narrow < 1e-4
    assert wide / narrow == pytest.approx(10, rel=0.1)


def test_15_1_karnopp_brings_a_coupled_velocity_to_rest_by_its_impulse() -> None:
    """v' = 2 f, w' = -f by the force f on v: at v = d within the band, w is taken at w + d/2."""
    f = -0.7 * x - sign(v)
    made = System({x: v, v: 2 * f, y: w, w: -f - w - 0.2 * y}).with_comparator(Karnopp(0.1, 0))
    short = 1e-6
    run = solve(made, (0.3, 0.05, 0, 2), (0, short))
    # Stuck: v' = 0 needs f = 0, and w' = -(w + 0.025).
    assert (run.x_end - [0.3, 0.05, 0, 2]) / short == pytest.approx([0, 0, 2.025, -2.025], abs=1e-4)


def test_15_1_what_no_group_of_bands_can_stand_for_is_refused() -> None:
    z, u = states("z u")
    # A pair that drives itself: each sign acts more on the other's rate than on its own.
    driven = System({x: v, v: -x - sign(v) - 2 * sign(w), y: w, w: -y - sign(w) - 2 * sign(v)})
    with pytest.raises(ModelError, match="so that the stick of all is unique"):
        driven.with_comparator(Switch(0.1))
    couple = 2 * sin(x)
    place = System({x: v, v: -x - sign(v) - couple * sign(w), y: w, w: -y - sign(w) - couple * sign(v)})
    with pytest.raises(ModelError, match=r"where .*x = -?\d.*so that the stick of all is unique"):
        place.with_comparator(Switch(0.1))
    loaded = System({x: v, v: -x - (1 + v**2) * sign(v - w), y: w, w: -y + sign(v - w), z: u, u: -z})
    with pytest.raises(ModelError, match="in a ratio that none of these changes"):
        loaded.with_comparator(Karnopp(0.1))
    third = System({x: v, v: -x - sign(v - w), y: w, w: -y + sign(v - w), z: sign(v - w) - z})
    with pytest.raises(ModelError, match="acts on other equations than that of v or w"):
        third.with_comparator(Karnopp(0.1))


@pytest.mark.parametrize("seed", range(3))
def test_15_1_compare_reads_the_stays_of_a_pair(seed: int) -> None:
    """Times and states of first order in the width; the drift of Switch is eta/alpha, Karnopp has none."""
    exact = stacked(np.random.default_rng(seed))
    table = compare(exact, (1, 0.5, 0, -0.5), (0, 12), against=["switch", "karnopp"], widths=(1e-3, 1e-4))
    assert not table.faults
    assert sum(event.kind is EventKind.ENTRY for event in table.exact.events) > 0
    for name in ("switch", "karnopp"):
        wide, narrow = table.of(name)
        for error in ("error_state", "error_times"):
            assert 0 < narrow[error] < wide[error] / 5, (name, error)
        assert narrow["drift"] < 1.1 * 1e-4 / 100
