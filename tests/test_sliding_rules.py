"""Rules of sliding: moments and equivalent control beside Filippov's, against closed forms and numpy."""

import itertools
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command import summary

from filippov import Surface, System, UsageError, parameters, sign, solve, states, t
from filippov.solving.solution import Solution

RULES = ("filippov", "moments", "utkin")
x, y, z, w = states("x y z w")

# C04 of the case bank: one nodally attractive line, fields of the modes --, -+, +-, ++.
NODAL = System.from_modes(
    [Surface("x", x), Surface("y", y)],
    {"--": [1, 1, -1], "-+": [2, -1, 0], "+-": [-1, 3, 0], "++": [-1, -2, 1]},
    [x, y, z],
)


def along(system: System, x0: Any, span: tuple[float, float], rule: str, **options: Any) -> Solution:
    got = solve(system, x0, span, sliding=rule, **options)
    assert got.success, got.message
    return got


def moments(vertices: dict[tuple[int, ...], np.ndarray], k: int) -> np.ndarray:
    """The vector field of the moments rule where h_i is state i, i < k: weights by numpy."""
    signs = sorted(vertices)
    rows = [np.ones(len(signs))]
    rows += [np.array([vertices[s][i] for s in signs]) for i in range(k)]
    for size in range(2, k + 1):
        for chosen in itertools.combinations(range(k), size):
            sizes = [np.linalg.norm(vertices[s][list(chosen)]) for s in signs]
            rows.append(np.array([math.prod(s[i] for i in chosen) for s in signs]) * sizes)
    weights = np.linalg.solve(np.array(rows), np.eye(len(signs))[0])
    assert weights.min() > 0
    return np.asarray(sum(lam * vertices[s] for lam, s in zip(weights, signs, strict=True)))


@pytest.mark.parametrize(
    ("rule", "rate", "multipliers"),
    [
        ("filippov", 0.19216833280906576, (2 * 0.61237243569579452 - 1, 2 * 0.57979589711327124 - 1)),
        (
            "moments",
            0.13808084038587663659,
            (
                2 * (0.22819737559239511201 + 0.36337217840217282514) - 1,
                2 * (0.18313910798913587430 + 0.36337217840217282514) - 1,
            ),
        ),
    ],
)
def test_nodal_corner_of_the_bank(rule: str, rate: float, multipliers: tuple[float, float]) -> None:
    got = along(NODAL, (0, 0, 0), (0, 1), rule)
    assert got.modes == ("00",)
    assert np.allclose(got.x_end, [0, 0, rate], rtol=0, atol=1e-10)
    for name, value in zip("xy", multipliers, strict=True):
        assert abs(got.multiplier(name, 0.5) - value) < 1e-10


def test_utkin_agrees_with_the_blend_where_the_branches_are_blended() -> None:
    """from_modes writes a branch a sign: its mean at signs in between is the multi-affine blend."""
    got = along(NODAL, (0, 0, 0), (0, 1), "utkin")
    assert abs(got.x_end[2] - 0.19216833280906576) < 1e-10


@pytest.mark.parametrize("rule", RULES)
def test_the_corner_attracts_under_every_rule(rule: str) -> None:
    got = along(NODAL, (0.3, -0.2, 0), (0, 3), rule)
    assert got.modes[-1] == "00"
    assert np.array_equal(got.x_end[:2], [0, 0])


@pytest.mark.parametrize("rule", RULES)
def test_rules_agree_where_signs_enter_as_a_sum(rule: str) -> None:
    """x slides with s = 0.3 cos-like terms: s_x = z/2, s_y = -z/4, z' = -z + s_x + s_y, closed form."""
    system = System({x: z / 2 - sign(x), y: -z / 4 - sign(y), z: -z + sign(x) + sign(y)})
    got = along(system, (0, 0, 1), (0, 2), rule)
    assert abs(got.x_end[2] - math.exp(-0.75 * 2)) < 1e-9
    assert got.modes == ("00",)


def test_moments_on_one_surface_is_filippov() -> None:
    system = System({x: -sign(x) + z / 2, z: sign(x) ** 2 + sign(x) - z})
    one, two = (along(system, (0.1, 0), (0, 2), rule) for rule in ("filippov", "moments"))
    assert np.array_equal(one.x_end, two.x_end)


@pytest.mark.parametrize("scale", [1.0, 7.0])
def test_moments_on_three_surfaces(scale: float) -> None:
    """Eight random fields that point to the line from all sides; scaling h changes nothing."""
    random = np.random.default_rng(3)
    vertices = {}
    for signs in itertools.product((-1, 1), repeat=3):
        inward = -np.array(signs) * random.uniform(0.5, 2, 3)
        vertices[signs] = np.append(inward, random.uniform(-1, 1))
    fields = {
        "".join("+" if s > 0 else "-" for s in signs): [float(v) for v in vector]
        for signs, vector in vertices.items()
    }
    surfaces = [Surface("x", x), Surface("y", scale * y), Surface("z", z)]
    got = along(System.from_modes(surfaces, fields, [x, y, z, w]), (0, 0, 0, 0), (0, 1), "moments")
    assert got.modes == ("000",)
    assert abs(got.x_end[3] - moments(vertices, 3)[3]) < 1e-10
    # What the multi-affine blend gives is another selection.
    other = along(System.from_modes(surfaces, fields, [x, y, z, w]), (0, 0, 0, 0), (0, 1), "filippov")
    assert abs(other.x_end[3] - got.x_end[3]) > 1e-4


@pytest.mark.parametrize(
    ("seed", "backend"), [(0, "compiled"), (1, "compiled"), (2, "compiled"), (3, "python")]
)
@pytest.mark.parametrize("k", [2, 3])
def test_13_4_both_rules_on_random_vertices_of_moving_oblique_surfaces(
    k: int, seed: int, backend: str
) -> None:
    """h = G q - r t with random G and r; the weights of both rules by numpy."""
    random = np.random.default_rng(seed)
    slopes, speeds = np.eye(k) + random.uniform(-0.4, 0.4, (k, k)), random.uniform(-1, 1, k)
    signs = list(itertools.product((-1, 1), repeat=k))
    rates = {s: -np.array(s) * random.uniform(0.5, 2, k) for s in signs}
    fields = {s: np.append(np.linalg.solve(slopes, rates[s] + speeds), random.uniform(-1, 1)) for s in signs}

    def blend(multipliers: np.ndarray, values: dict[tuple[int, ...], np.ndarray]) -> np.ndarray:
        return np.asarray(sum(np.prod((1 + multipliers * s) / 2) * values[s] for s in signs))

    held = np.zeros(k)
    for _ in range(30):
        columns = [blend(np.where(c == np.arange(k), 1, held), rates) for c in range(k)]
        columns = [
            column - blend(np.where(c == np.arange(k), 0, held), rates) for c, column in enumerate(columns)
        ]
        held = held - np.linalg.solve(np.array(columns).T, blend(held, rates))
    assert np.abs(blend(held, rates)).max() < 1e-14
    lengths = np.linalg.norm(slopes, axis=1)
    unit = {s: np.concatenate((rates[s] / lengths, fields[s])) for s in signs}
    expected = {"filippov": blend(held, fields), "moments": moments(unit, k)[k:]}
    q = (x, y, z)[:k]
    surfaces = [
        Surface(str(q[i]), sum(float(slopes[i, j]) * q[j] for j in range(k)) - float(speeds[i]) * t)
        for i in range(k)
    ]
    named = {"".join("+" if c > 0 else "-" for c in s): [float(v) for v in fields[s]] for s in signs}
    system = System.from_modes(surfaces, named, [*q, w])
    for rule, velocity in expected.items():
        got = along(system, np.zeros(k + 1), (0, 1), rule, backend=backend)
        assert got.modes == ("0" * k,)
        assert np.abs(got.x_end - velocity).max() < 1e-10


def test_moments_leaves_where_a_weight_pair_vanishes() -> None:
    """w1 .. w4 with one component of y growing in z: the exit is where both weights of y < 0 are 0.

    At z = 1 the fields with y > 0 alone hold x and y: sliding along x = 0, y > 0 becomes tangent there.
    """
    system = System.from_modes(
        [Surface("x", x), Surface("y", y)],
        {"--": [1, 1, 1], "-+": [1, z - 1, 1], "+-": [-1, 1, 1], "++": [-1, z - 1, 1]},
        [x, y, z],
    )
    got = along(system, (0, 0, 0), (0, 2), "moments")
    assert got.modes == ("00", "0+")
    assert abs(got.events[0].t - 1) < 1e-9
    assert abs(got.x_end[1] - 0.5) < 1e-9


# Utkin 1992: x' = 0.3 y + u x, y' = -0.7 x + 4 u^3 x, u = -sign(x (x + y)), in x > 0.
def cubic(plain: bool) -> System:
    if plain:

        def field(t: float, q: np.ndarray, p: Any, s: np.ndarray) -> list[float]:
            u = -s[0]
            return [0.3 * q[1] + u * q[0], -0.7 * q[0] + 4 * u**3 * q[0]]

        return System(field=field, surfaces=[Surface("s", lambda t, q, p: q[0] + q[1])], states=["x", "y"])
    u = -sign(x + y)
    return System({x: 0.3 * y + u * x, y: -0.7 * x + 4 * u**3 * x}, surfaces=[Surface("s", x + y)])


@pytest.mark.parametrize("plain", [False, True])
@pytest.mark.parametrize("method", ["DOP853", "Radau"])
@pytest.mark.parametrize(("rule", "u", "rate"), [("filippov", 0.2, -0.1), ("utkin", 0.5, 0.2)])
def test_equivalent_control_differs_where_f_is_cubic_in_the_sign(
    rule: str, u: float, rate: float, method: str, plain: bool
) -> None:
    """On x + y = 0: 4 u^3 + u = 1 gives u = 1/2 and x' = x/5; the hull gives u = 1/5 and x' = -x/10."""
    got = along(cubic(plain), (1, -1), (0, 3), rule, method=method)
    assert got.modes == ("0",)
    assert abs(got.multiplier("s", 1.0) + u) < 1e-9
    assert abs(got.x_end[0] - math.exp(3 * rate)) < 1e-8
    assert abs(got.x_end.sum()) < 1e-15


def test_equivalent_control_enters_and_leaves() -> None:
    """x' = z - s^3, z' = 1: sliding on x = 0 with s = z^(1/3), entered from above, left at z = 1."""
    system = System({x: z - sign(x) ** 3, z: 1 + 0 * x})
    got = along(system, (0.455, -0.4), (0, 2), "utkin")
    assert got.modes == ("+", "0", "+")
    entry = brent(lambda t: 0.455 - 1.4 * t + t**2 / 2)
    assert abs(got.events[0].t - entry) < 1e-9
    assert abs(got.events[1].t - 1.4) < 1e-7
    middle = 0.5 * (got.events[0].t + got.events[1].t)
    assert abs(got.multiplier("x", middle) - np.cbrt(middle - 0.4)) < 1e-7


def test_the_derivative_of_the_flow_is_that_of_the_default_rule() -> None:
    from filippov.analysis.sensitivity.saltation import flow_derivative

    with pytest.raises(UsageError, match="sliding='filippov', the solution has 'moments'"):
        flow_derivative(along(NODAL, (0, 0, 0), (0, 1), "moments"))


def brent(function: Any) -> float:
    from scipy.optimize import brentq

    return float(brentq(function, 0, 1, xtol=1e-15))


def test_equivalent_control_on_two_surfaces() -> None:
    """s_x^3 + s_x = 1/2 + s_y/4, s_y^3 + s_y = -1/4, z' = s_x s_y: by numpy's roots."""
    system = System(
        {
            x: 0.5 + sign(y) / 4 - sign(x) ** 3 - sign(x),
            y: -0.25 - sign(y) ** 3 - sign(y) + 0 * x,
            z: sign(x) * sign(y),
        }
    )
    got = along(system, (0, 0, 0), (0, 1), "utkin")
    real = lambda value: next(r.real for r in np.roots([1, 0, 1, -value]) if abs(r.imag) < 1e-12)  # noqa: E731
    second = real(-0.25)
    first = real(0.5 + second / 4)
    assert abs(got.x_end[2] - first * second) < 1e-10


def test_the_rule_is_checked_stored_and_part_of_the_command(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(UsageError, match="did you mean 'moments'"):
        solve(NODAL, (0, 0, 0), (0, 1), sliding="moment")
    got = along(NODAL, (0, 0, 0), (0, 1), "moments")
    again = Solution.load(got.save(tmp_path / "moments.npz"))
    assert again.options.sliding == "moments"
    assert again.multiplier("x", 0.5) == got.multiplier("x", 0.5)
    model = tmp_path / "nodal.py"
    model.write_text(
        "from filippov import Surface, System, states\n"
        "x, y, z = states('x y z')\n"
        "nodal = System.from_modes([Surface('x', x), Surface('y', y)], {'--': [1, 1, -1], '-+': [2, -1, 0],\n"
        "    '+-': [-1, 3, 0], '++': [-1, -2, 1]}, [x, y, z])\n"
    )
    told = summary(
        capsys, "simulate", f"{model}:nodal", "--x0", "0,0,0", "--t-span", "0", "1", "--sliding", "moments",
        "-o", str(tmp_path / "out"),
    )  # fmt: skip
    assert abs(told["x_end"]["z"] - 0.13808084038587663659) < 1e-10


def barely(end: int, plain: bool) -> System:
    """x' = s (1 + d - a (t - 1)^2) - sign(x), s = +-1: slides on x = 0 until a (t - 1)^2 = d."""
    if plain:
        return System(
            field=lambda t, x, p, s: [end * (1 + p.d - p.a * (t - 1) ** 2) - s[0]],
            surfaces=[Surface("x", lambda t, x, p: x[0], linear=True)],
            states="x",
            parameters={"a": 1.0, "d": 0.0},
        )
    p = parameters(a=1.0, d=0.0)
    return System({x: end * (1 + p.d - p.a * (t - 1) ** 2) - sign(x)}, parameters=p)


@pytest.mark.parametrize("plain", [False, True], ids=["symbolic", "plain"])
@pytest.mark.parametrize("end", [1, -1], ids=["upper", "lower"])
def test_multiplier_that_hardly_leaves_its_set_does_so_in_time(end: int, plain: bool) -> None:
    system, random = barely(end, plain), np.random.default_rng(5 + end)
    left = 0
    # Below 1e-10 of the rates it may stay; those just above were located where it was that far beyond.
    excess = np.concatenate([np.geomspace(1e-12, 1e-6, 40), np.linspace(1.9e-10, 2.1e-10, 40)])
    for d in excess:
        a = random.uniform(0.1, 1.9)
        run = solve(system, (0.0,), (0, 2), parameters={"a": a, "d": d}, rtol=1e-10, atol=1e-12)
        assert run.success, run.message
        times = [event.t for event in run.events]
        if d > 2.1e-10 or times:
            left += 1
            # What is rounding of the multiplier, 1e-15, over its slope there, a time of at most 1 apart.
            known = 1e-15 * (1 + 1 / math.sqrt(a * d))
            assert times[0] == pytest.approx(1 - math.sqrt(d / a), rel=0, abs=known)
            # With r^2 = d/a, T = t - 1: x = a (T + r)^2 (2 r - T)/3, back on the surface at T = 2 r.
            assert times[1] == pytest.approx(1 + 2 * math.sqrt(d / a), rel=0, abs=1e-2 * math.sqrt(d / a))
        assert len(times) in (0, 2), times
    assert left > 20
