"""Certificates: each family on random members, against motions, closed forms or another method."""

from __future__ import annotations

import itertools
import math
import os

import numpy as np
import pytest
import sympy
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.linalg import eigh, expm

from filippov import Abs, System, cos, exp, sign, sin, solve, sqrt, states, t
from filippov.analysis.algebra.time_bounds import bounds
from filippov.analysis.local_stability.certificates.centre import lyapunov_coefficient
from filippov.analysis.local_stability.stability import certify, stability_report

x, v, y, w, z, u = states("x v y w z u")
# A few draws of each family here, hundreds of them nightly: each makes a system and its report.
DRAWS = {"nightly": 300, "ci": 10}.get(os.environ.get("FILIPPOV_PROFILE", ""), 4)
few = settings(max_examples=DRAWS, deadline=None)
AS, ST, UN = "asymptotically stable", "stable", "unstable"
number = st.integers(-30, 30).map(lambda q: q / 10)
seeds = st.integers(0, 10**6)


def at_origin(system: System) -> str:
    """The verdict on x = 0; "missing" where it is not listed."""
    for item in stability_report(system, budget=60.0).items:
        value = getattr(item.equilibrium, "value", None)
        if value is not None and max(map(abs, value)) < 1e-9:
            return item.answer
    return "missing"


# -- the plane ---------------------------------------------------------------------------------------------


def constant_fields(M: np.ndarray, start: np.ndarray, corners: int = 40) -> float | None:
    """Size after some corners of x' = M (sign x, sign y), followed in closed form with sliding on the axes.

    0 where the origin is reached, inf where it runs off; None where a rate is too near to 0 to tell.
    """
    q = start.copy()
    for _ in range(corners):
        size = np.max(np.abs(q))
        s = np.where(np.abs(q) > 1e-13 * size, np.sign(q), 0.0)
        rate = M @ s
        for i in np.flatnonzero(s == 0):
            ends = rate[i] + M[i, i] * np.array([1.0, -1.0])
            if min(abs(ends)) < 1e-6:
                return None
            if ends[0] < 0 < ends[1]:
                slide = -rate[i] / M[i, i]
                rate = rate + M[:, i] * slide
                rate[i] = 0.0
            elif ends[0] > 0 and ends[1] < 0:
                return math.inf
            else:
                rate = rate + M[:, i] * np.sign(ends[0])
        if np.max(np.abs(rate)) < 1e-6:
            return None
        spans = [-q[i] / rate[i] for i in (0, 1) if q[i] * rate[i] < 0 and abs(q[i]) > 1e-13 * size]
        if not spans:
            return math.inf
        q = q + min(spans) * rate
        if np.max(np.abs(q)) < 1e-12 * np.max(np.abs(start)):
            return 0.0
    return float(np.max(np.abs(q)) / np.max(np.abs(start)))


@few
@given(a=number, b=number, c=number, d=number)
def test_12_11_corners_of_two_relays(a: float, b: float, c: float, d: float) -> None:
    M = np.array([[a, b], [c, d]])
    said = at_origin(System({x: a * sign(x) + b * sign(y), y: c * sign(x) + d * sign(y)}))
    angles = np.linspace(0.1, 2 * np.pi, 9)[:-1]
    ends = [constant_fields(M, np.array([math.cos(q), math.sin(q)])) for q in angles]
    if any(e is None for e in ends):
        return
    largest = max(e for e in ends if e is not None)
    if said == AS:
        assert largest < 1
    elif said == UN:
        assert largest > 1
    elif said == ST:
        assert 0.1 < largest < 10


def turned(side: dict[tuple[int, int], np.ndarray], turns: float = 60.0) -> float:
    """Largest log |q| at the end of q' = A q, A by the signs of the two states, over 6 starts."""
    ends = []
    for angle in np.linspace(0.2, 0.2 + 2 * np.pi, 7)[:-1]:
        run = solve_ivp(
            lambda _, q: side[1 if q[0] >= 0 else -1, 1 if q[1] >= 0 else -1] @ q, (0, turns),
            [math.cos(angle), math.sin(angle)], rtol=1e-7, atol=1e-200, method="DOP853",
        )  # fmt: skip
        ends.append(0.5 * math.log(float(np.sum(run.y[:, -1] ** 2)) + 1e-300))
    return max(ends)


@few
@given(p=st.floats(0.2, 4), q=st.floats(0.2, 4), damping=st.floats(-0.3, 0.5), more=st.floats(-0.3, 0.5))
def test_12_11_switched_foci(p: float, q: float, damping: float, more: float) -> None:
    """x' = y, y' = -k x - c y, k and c by the sign of x y: turns are followed."""
    p, q, damping, more = (round(e, 3) for e in (p, q, damping, more))
    odd = np.array([[0, 1], [-p, -damping]])
    even = np.array([[0, 1], [-q, -more]])
    side = {(1, 1): odd, (-1, -1): odd, (1, -1): even, (-1, 1): even}
    k = (p + q) / 2 + (p - q) / 2 * sign(x * v)
    c = (damping + more) / 2 + (damping - more) / 2 * sign(x * v)
    end = turned(side)
    said = at_origin(System({x: v, v: -k * x - c * v}))
    if abs(end) > 3:
        assert said == (AS if end < 0 else UN)


@few
@given(k1=st.floats(-3, 6), k2=st.floats(0.2, 6))
def test_12_11_super_twisting_for_all_gains(k1: float, k2: float) -> None:
    """k1 > 0: V = k2 |x| + y^2/2 has V' = -k1 k2 |x|^(1/2) (Levant 1998); it grows for k1 < 0."""
    k1, k2 = round(k1, 3), round(k2, 3)
    if abs(k1) > 0.05:
        said = at_origin(System({x: -k1 * sqrt(Abs(x)) * sign(x) + y, y: -k2 * sign(x)}))
        assert said == (AS if k1 > 0 else UN)


@few
@given(r1=st.floats(0.2, 5), share=st.floats(-0.95, 0.95))
def test_12_11_twisting_for_all_gains(r1: float, share: float) -> None:
    """Half turns multiply the speed by ((r1 - r2)/(r1 + r2))^(1/2) (Levant 1993)."""
    r1 = round(r1, 3)
    r2 = round(share * r1, 4)
    if abs(r2) > 1e-3:
        assert at_origin(System({x: v, v: -r1 * sign(x) - r2 * sign(v)})) == (AS if r2 > 0 else UN)


# -- smooth points -----------------------------------------------------------------------------------------


def shifted(field: sympy.Matrix, new: list, old: sympy.Matrix) -> sympy.Matrix:
    """The field of `new` where the old states, in which `field` is written, are old(new), up to order 5."""
    symbols = sorted(field.free_symbols, key=str)
    there = field.subs(dict(zip(symbols, old, strict=True)), simultaneous=True)
    return (old.jacobian(new).inv() * there).applyfunc(sympy.cancel)


@few
@given(seed=seeds, way=st.sampled_from([-1, 1]))
def test_12_11_weak_foci_in_three_dimensions(seed: int, way: int) -> None:
    """r' = way r^3 beside a stable third state, in other coordinates: the sign is that of the normal form."""
    rng = np.random.default_rng(seed)
    w0 = 1 + rng.random()
    T = np.eye(3) + 0.3 * rng.uniform(-1, 1, (3, 3))
    bend = 0.5 * rng.uniform(-1, 1, (3, 3, 3))
    bend += np.swapaxes(bend, 1, 2)
    # y = T^-1 x of the normal form y' = A y + way C(y); x = y + bend(y, y)/2 brings quadratic terms.
    A = np.array([[0, w0, 0], [-w0, 0, 0], [0, 0, -1.0]])
    cubic = np.zeros((3, 3, 3, 3))
    for i, j in ((0, 0), (0, 1), (1, 0), (1, 1)):
        for order in {(i, j, j), (j, i, j), (j, j, i)}:
            cubic[(i, *order)] += way * (6 / 3 if i != j else 6)
    # x = y + b(y, y), b = bend/2, and back y = x - b(x, x) + 2 b(x, b(x, x)) up to order 3.
    a, b = A, bend / 2

    def rate(q: np.ndarray) -> np.ndarray:
        p = q.copy()
        for _ in range(60):
            p = q - np.einsum("ijk,j,k", b, p, p)
        f = A @ p + np.einsum("ijkl,j,k,l", cubic, p, p, p) / 6
        return f + 2 * np.einsum("ijk,j,k", b, p, f)

    names = sympy.symbols("q0:3")
    p = sympy.Matrix(names)

    def squared(q: sympy.Matrix) -> sympy.Matrix:
        pairs = list(itertools.product(range(3), repeat=2))
        return sympy.Matrix([sum(b[i, j, k] * q[j] * q[k] for j, k in pairs) for i in range(3)])

    again = p - squared(p - squared(p))
    second, third = derivatives(again, a, b, cubic, names)
    inverse = np.linalg.inv(T)
    a = T @ a @ inverse
    second = np.einsum("ia,abc,bj,ck->ijk", T, second, inverse, inverse)
    third = np.einsum("ia,abcd,bj,ck,dl->ijkl", T, third, inverse, inverse, inverse)
    assert np.sign(lyapunov_coefficient(a, second, third, w0)) == way
    assert np.allclose(rate(np.zeros(3)), 0)


def derivatives(back: sympy.Matrix, a: np.ndarray, b: np.ndarray, cubic: np.ndarray, names: tuple) -> tuple:
    """Second and third derivatives at 0 of x' = (1 + 2 b(y, .)) (a y + cubic(y, y, y)/6), y = back(x)."""
    y_ = [sympy.Poly(sympy.expand(e), *names) for e in back]
    # Only what is of order 3 or less counts.
    def cut(e: sympy.Poly) -> sympy.Poly:
        low = {m: c for m, c in e.as_dict().items() if sum(m) <= 3}
        return sympy.Poly.from_dict(low or {(0, 0, 0): 0}, *names)

    y_ = [cut(e) for e in y_]
    zero = sympy.Poly(0, *names)
    f = []
    for i in range(3):
        total = zero
        for j in range(3):
            total += a[i, j] * y_[j]
            for k in range(3):
                for m in range(3):
                    if cubic[i, j, k, m]:
                        total += cubic[i, j, k, m] / 6 * cut(cut(y_[j] * y_[k]) * y_[m])
        f.append(total)
    g = []
    for i in range(3):
        total = f[i]
        for j in range(3):
            for k in range(3):
                total += 2 * b[i, j, k] * cut(y_[j] * f[k])
        g.append(total)
    second, third = np.zeros((3,) * 3), np.zeros((3,) * 4)
    for i, e in enumerate(g):
        for m, c in e.as_dict().items():
            places = [k for k, count in enumerate(m) for _ in range(count)]
            factor = math.prod(math.factorial(q) for q in m) * float(c)
            if len(places) == 2:
                for o in set(itertools.permutations(places)):
                    second[(i, *o)] = factor
            if len(places) == 3:
                for o in set(itertools.permutations(places)):
                    third[(i, *o)] = factor
    return second, third


@few
@given(a=st.sampled_from([-3, -1, 1, 2]), k=st.sampled_from([2, 3, 4, 5]), c=number, d=number, e=number)
def test_12_11_centre_manifolds_in_other_coordinates(a: int, k: int, c: float, d: float, e: float) -> None:
    """u' = a u^k, w' = -w beside w = 0, seen in x = u + d y, y = w + c u^2 + e u^3."""
    c, d, e = (sympy.Rational(str(q)) / 2 for q in (c, d, e))
    # With y as a state: u = x - d y, w = y - c u^2 - e u^3.
    place = x - d * y
    rate_u = a * place**k
    rate_y = -(y - c * place**2 - e * place**3) + (2 * c * place + 3 * e * place**2) * rate_u
    said = at_origin(System({x: sympy.expand(rate_u + d * rate_y), y: sympy.expand(rate_y)}))
    assert said == (AS if k % 2 and a < 0 else UN)


# -- masses with dry friction ------------------------------------------------------------------------------


def random_masses(rng: np.random.Generator) -> tuple[System, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """A chain or net of 2 or 3 masses with springs, and some contacts and dampers; (system, M, K, C, c)."""
    m = int(rng.integers(2, 4))
    q, s = states("x y z")[:m], states("u v w")[:m]
    M = rng.integers(1, 4, m)
    K = np.diag(rng.integers(1, 4, m))
    C = np.zeros((m, m), dtype=int)
    contacts = []
    for i in range(m):
        e = np.eye(m, dtype=int)[i]
        if rng.random() < 0.4:
            contacts.append(e)
        if rng.random() < 0.25:
            C += np.outer(e, e)
        for j in range(i):
            d = e - np.eye(m, dtype=int)[j]
            K += int(rng.integers(0, 3)) * np.outer(d, d)
            if rng.random() < 0.3:
                contacts.append(d)
            if rng.random() < 0.2:
                C += np.outer(d, d)
    if not contacts:
        contacts.append(np.eye(m, dtype=int)[0])
    pushes = rng.integers(1, 4, len(contacts))
    force = -K @ np.array(q) - C @ np.array(s)
    for c, k in zip(contacts, pushes, strict=True):
        force = force - k * c * sign(sum(int(a) * b for a, b in zip(c, s, strict=True) if a))
    rows = dict(zip(q, s, strict=True))
    rows |= {b: f / int(k) for b, f, k in zip(s, force, M, strict=True)}
    return System(rows), np.diag(M), K, C, np.array(contacts)


@few
@given(seed=seeds)
@example(seed=857)  # two masses with nothing but a damper between them
def test_12_11_masses_come_to_rest_where_no_mode_escapes(seed: int) -> None:
    """The modes of the masses without slip, one by one: a mode with C = 0 on it swings forever."""
    system, M, K, C, c = random_masses(np.random.default_rng(seed))
    _, sizes, rows = np.linalg.svd(c)
    N = rows[int(np.sum(sizes > 1e-9)) :].T
    free = 0
    if N.shape[1]:
        roots, modes = eigh(N.T @ K @ N, N.T @ M @ N)
        for root in np.unique(np.round(roots, 9)):
            space = N @ modes[:, np.abs(roots - root) < 1e-6]
            free += space.shape[1] - np.linalg.matrix_rank(C @ space, tol=1e-9)
    said = {item.answer for item in stability_report(system, budget=60.0).items if item.equilibrium.dimension}
    assert said <= {ST if free else AS}


def test_12_11_masses_at_the_end_of_their_set() -> None:
    """Motions from 20 states beside the set stop within it; the swinging pair does not."""
    rng = np.random.default_rng(2)
    pair = System({x: v, v: -2 * x + y - sign(v), y: w, w: x - y - 0.3 * w})
    for _ in range(5):
        end = solve(pair, rng.uniform(-2, 2, 4), (0, 60)).x_end
        assert abs(end[1]) < 1e-6
        assert abs(end[3]) < 1e-3


# -- positive real plants ----------------------------------------------------------------------------------


@few
@given(seed=seeds, n=st.integers(2, 5))
def test_12_11_positive_real_plants_need_no_other_argument(seed: int, n: int) -> None:
    """A = P^-1 (J - R), b = P^-1 c^T with P, R > 0, J skew is positive real; with -b the surface repels."""
    rng = np.random.default_rng(seed)
    L = np.tril(rng.integers(-2, 3, (n, n)), -1) + np.diag(rng.integers(1, 3, n))
    P = sympy.Matrix(L @ L.T)
    J = np.triu(rng.integers(-2, 3, (n, n)), 1)
    R = np.diag(rng.integers(1, 3, n))
    A = P.inv() * sympy.Matrix(J - J.T - R)
    c = sympy.Matrix([rng.integers(1, 4, n).tolist()])
    names = states("x1 x2 x3 x4 x5")[:n]
    column = sympy.Matrix(names)
    for sense, expected in ((1, AS), (-1, UN)):
        rows = A * column - sense * P.inv() * c.T * sign((c * column)[0])
        system = System(dict(zip(names, rows, strict=True)))
        ((found, certificate), *_) = [e for e in certify(system) if e[0].mode == "0"]
        assert at_origin(system) == expected
        assert found.dimension == 0
        # The lemma is one of minimal realisations: a zero on a pole leaves it out.
        reach = sympy.Matrix.hstack(*[A**k * P.inv() * c.T for k in range(n)])
        seen = sympy.Matrix.vstack(*[c * A**k for k in range(n)])
        if sense > 0 and reach.rank() == seen.rank() == n:
            assert certificate is not None
            assert certificate.answer == AS


@pytest.mark.parametrize("shift", [0.3, 3])
def test_12_11_a_plant_that_is_not_positive_real_has_no_such_certificate(shift: float) -> None:
    """(s^2 + s + q)/((s + 1)(s + 2)(s + 3)), its real part on a grid of frequencies."""
    num, den = np.array([1, 1, shift]), np.poly([-1, -2, -3])
    grid = 1j * np.linspace(0, 100, 20001)
    real = bool(np.min(np.real(np.polyval(num, grid) / np.polyval(den, grid))) >= 0)
    a = [sympy.Integer(round(q)) for q in den[1:]]
    b = [sympy.Rational(str(q)) for q in num]
    s = sign(x)
    rows = {x: -a[0] * x + v - b[0] * s, v: -a[1] * x + z - b[1] * s, z: -a[2] * x - b[2] * s}
    found = [certificate for e, certificate in certify(System(rows)) if e.mode == "0"]
    assert [q is not None and "circle" in q.theorem for q in found] == [real]


# -- relays ------------------------------------------------------------------------------------------------


def decay(a: np.ndarray, b: np.ndarray) -> float:
    """log of the ratio of the speed y' after 400 switches, from matrix exponentials."""
    A = np.array([[-a[0], 1, 0], [-a[1], 0, 1], [-a[2], 0, 0.0]])
    big = np.zeros((4, 4))
    big[:3, :3] = A
    q = np.array([0.0, 1e-3, 0.0])
    first = abs(q[1])
    for _ in range(400):
        s = np.sign((A @ q)[0])
        big[:3, 3] = -b * s
        span = 2 * abs((A @ q)[0]) / abs(b[1])
        if abs((A @ q)[0]) > 1e2 * first:  # what follows far away says nothing of the origin
            break
        for _ in range(30):  # Newton for y = 0 at the end of the half turn
            e = expm(big * span) @ np.append(q, 1.0)
            span -= (late := e[0] / (big @ e)[0])
            if abs(late) < 1e-16:
                break
        q = (expm(big * span) @ np.append(q, 1.0))[:3]
        q[0] = 0.0
    return math.log(abs((A @ q)[0]) / first)


@few
@given(a1=number, a2=number, a3=number, zero=number)
def test_12_11_relays_of_order_two_follow_their_switching(
    a1: float, a2: float, a3: float, zero: float
) -> None:
    from stability_models import relay_loop

    if abs(a1 - zero) < 0.2 or abs(zero) < 0.2:
        return
    said = at_origin(relay_loop((a1, a2, a3), (0, 1, zero)))
    if said == "missing":  # a3 = 0 and the like: a line of equilibria
        return
    grows = decay(np.array([a1, a2, a3]), np.array([0, 1.0, zero])) > 0
    assert said == (UN if grows or zero < 0 else AS)


@few
@given(seed=seeds)
def test_12_11_several_relays_follow_their_motions(seed: int) -> None:
    """h' = M s in dimension 3, solved from 6 states: to 2,000, for a slide may lead to rest at 0.003."""
    rng = np.random.default_rng(seed)
    M = np.round(rng.uniform(-1, 1, (3, 3)) - np.diag(rng.uniform(-0.5, 2, 3)), 2)
    s = sympy.Matrix([sign(x), sign(y), sign(z)])
    said = at_origin(System(dict(zip((x, y, z), sympy.Matrix(M) * s, strict=True))))
    if said not in {AS, UN}:
        return
    system = System(dict(zip((x, y, z), sympy.Matrix(M) * s, strict=True)))
    ends = []
    for _ in range(6):
        start = rng.uniform(-1, 1, 3)
        run = solve(system, start, (0, 2000), zeno="continue", nonunique="slip", max_events=3000)
        ends.append(float(np.max(np.abs(run.x_end))))
    if said == AS:
        assert max(ends) < 1e-3
    else:
        assert max(ends) > 0.05


# -- kinks -------------------------------------------------------------------------------------------------


@few
@given(seed=seeds)
def test_12_11_third_order_kinks_follow_their_motions(seed: int) -> None:
    """x' = A x + b |x1| in dimension 3: growth over a long time by matrix exponentials in small steps."""
    rng = np.random.default_rng(seed)
    A = np.round(rng.uniform(-1.5, 1.5, (3, 3)) - 0.8 * np.eye(3), 2)
    b = np.round(rng.uniform(-1, 1, 3), 2)
    rows = sympy.Matrix(A) * sympy.Matrix([x, y, z]) + sympy.Matrix(b) * Abs(x)
    said = at_origin(System(dict(zip((x, y, z), rows, strict=True))))
    if said not in {AS, UN}:
        return
    dt = 0.002
    step = {m: expm(dt * (A + m * np.outer(b, [1, 0, 0]))) for m in (1, -1)}
    growth = []
    for _ in range(6):
        q, total = rng.standard_normal(3), 0.0
        for k in range(30_000):
            q = step[1 if q[0] >= 0 else -1] @ q
            if k % 100 == 0:
                total += math.log(np.linalg.norm(q))
                q /= np.linalg.norm(q)
        growth.append(total)
    if abs(max(growth)) > 1.0:
        assert said == (AS if max(growth) < 0 else UN)


# -- the energy of one mass --------------------------------------------------------------------------------


@few
@given(
    spring=st.sampled_from([x, x**3, sign(x), x * Abs(x), 2 * x + Abs(x), sin(x)]),
    power=st.sampled_from([v, v**3, v * Abs(v), x**2 * v, v**5]),
    gain=st.sampled_from([-1, 1]),
    size=st.floats(0.3, 2),
)
def test_12_11_power_of_one_sign_decides(
    spring: sympy.Expr, power: sympy.Expr, gain: int, size: float
) -> None:
    """V = v^2/2 + the integral of the spring changes by the power: AS or unstable by its sign."""
    said = at_origin(System({x: v, v: -spring - gain * round(size, 2) * power}))
    assert said == (AS if gain > 0 else UN)


# -- time --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "e",
    [
        1 + sin(t) / 2, sin(t) * cos(2 * t), sin(t) ** 2 - 3, exp(-(t**2)), 1 / (2 + sin(t)), Abs(sin(t) - 2),
        -1 / (1 + t**2), (1 + sin(t)) ** 3, sqrt(3 + cos(t)), sin(sqrt(2) * t) + sin(t), exp(sin(t)),
    ],
)  # fmt: skip
def test_12_11_bounds_hold_at_all_times(e: sympy.Expr) -> None:
    low, high = bounds(e)
    values = sympy.lambdify(t, e)(np.linspace(-50, 50, 4001))
    assert float(low) <= np.min(values) + 1e-12
    assert np.max(values) <= float(high) + 1e-12
    assert float(high) - float(low) < 20


def test_12_11_unknown_functions_have_no_bounds() -> None:
    assert bounds(sympy.tan(t)) is None
    assert bounds(1 / sin(t)) is None
    assert bounds(t * x) is None


# -- what the report says ----------------------------------------------------------------------------------


def test_12_11_a_certificate_names_theorem_source_and_hypotheses() -> None:
    # A plant 1/(s (s + 1)) with a relay is Popov's; a spring and a damper that are cubes are the energy's.
    for force, theorem, source in ((-sign(x) - v, "Popov", "Khalil"), (-(x**3) - v**3, "energy", "Shevitz")):
        (item,) = stability_report(System({x: v, v: force})).items
        first, *rest = item.statements
        assert theorem in first.text
        assert source in first.source
        assert any(s.text.startswith("checked: ") for s in rest)
