"""Circle, Popov and Zames-Falb criteria: against linear gains of the sector, motions and closed forms."""

from __future__ import annotations

import os

import numpy as np
import pytest
import sympy
from feedback_models import KINDS, Loop, ends, random_loop
from sympy import Poly, Rational

from filippov import Max, Min, System, sign, states
from filippov.analysis.local_stability.certificates.certificate import Certificate
from filippov.analysis.local_stability.certificates.characteristic import INPUT, Characteristic, Piece
from filippov.analysis.local_stability.certificates.positive_real import (
    S,
    popov,
    positive_real,
    real_part,
    zames_falb,
)
from filippov.analysis.local_stability.stability import certify

DRAWS = {"nightly": 60, "ci": 3}.get(os.environ.get("FILIPPOV_PROFILE", ""), 2)
x, v, z = states("x v z")


def for_all(system: System) -> list[tuple[int, Certificate]]:
    """(dimension, certificate) of what is certified for all motions."""
    found = certify(system)
    return [(e.dimension, c) for e, c in found if c is not None and c.reach == "global"]


def comes_to_rest(loop: Loop, start: np.ndarray, length: float, of_set: bool) -> bool:
    last, middle = ends(loop, start, length, 5e-3, of_set)
    # A relay with held steps chatters by a power of the step, at least by its root.
    return last < max(0.02, 0.9 * middle) or ends(loop, start, length, 5e-3 / 16, of_set)[0] < 0.5 * last


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(DRAWS))
def test_12_11_certified_loops_come_to_rest(kind: str, seed: int) -> None:
    """All linear gains between the bounds that psi attains are stable, and motions from afar come in."""
    rng = np.random.default_rng(seed)
    loop = random_loop(rng, kind)
    for dimension, certificate in for_all(loop.system):
        assert certificate.answer == "asymptotically stable"
        low, high = loop.gains
        inner = np.geomspace(1e-3, 1e3, 200) + low if high == np.inf else np.linspace(low, high, 202)[1:-1]
        if not dimension:
            worst = [np.max(np.linalg.eigvals(loop.A - k * np.outer(loop.b, loop.c)).real) for k in inner]
            assert max(worst) < 1e-9
        size = 1.0 if kind == "quadratic" else 10 ** rng.uniform(-1, 1.5)
        assert comes_to_rest(loop, size * rng.uniform(-1, 1, len(loop.A)), 40.0, bool(dimension))


def test_12_11_popov_holds_for_every_stable_plant_of_order_two() -> None:
    """Aizerman's conjecture is true there: G = 1/(s^2 + p s + q), gains in [0, K], all p, q, K > 0."""
    rng = np.random.default_rng(0)
    for _ in range(30):
        p, q, k = (Rational(int(e), 10) for e in rng.integers(1, 60, 3))
        above, below = Poly(1, S, domain="QQ"), Poly(S**2 + p * S + q, S, domain="QQ")
        assert popov(above, below, None if rng.random() < 0.5 else k) is not None


def test_12_11_positive_real_functions_are_those_with_a_real_part_and_stable_poles() -> None:
    """Random H = p/q of order 3: the grid of Re H(i w) and the roots of q, by floats."""
    rng = np.random.default_rng(1)
    told = []
    for _ in range(200):
        p, q = (np.append(rng.integers(1, 3), rng.integers(-1, 9, 3)) for _ in range(2))
        w = np.linspace(0.00123, 60, 6001)
        if q[-1] == 0:
            continue
        H = np.polyval(p, 1j * w) / np.polyval(q, 1j * w)
        poles = np.max(np.roots(q).real)
        if abs(poles) < 1e-6 or abs(np.min(H.real)) < 1e-4:
            continue
        said = positive_real(*(Poly([int(c) for c in e], S, domain="QQ") for e in (p, q)))
        assert said == (poles < 0 and np.min(H.real) > 0)
        told.append(said)
    assert 20 < sum(told) < len(told) - 20


def test_12_11_real_part_of_a_product() -> None:
    rng = np.random.default_rng(2)
    for _ in range(20):
        p, q = (rng.integers(-5, 6, 4) for _ in range(2))
        found = real_part(*(Poly([int(c) for c in e], S, domain="QQ") for e in (p, q)))
        for w in (0.3, 1.7):
            exact = (np.polyval(p, 1j * w) * np.polyval(q, -1j * w)).real
            assert abs(float(found.eval(w)) - exact) < 1e-9 * max(1, abs(exact))


def test_12_11_zames_falb_goes_beyond_popov() -> None:
    """G = s^2/(s^4 + 0.2 s^3 + 6 s^2 + 0.1 s + 1) (O'Shea 1967's kind): Popov ends before slopes of 5 do."""
    above = Poly(S**2, S, domain="QQ")
    below = Poly([1, Rational(1, 5), 6, Rational(1, 10), 1], S, domain="QQ")
    reach = {}
    for name, tests in (
        ("popov", (lambda k: popov(above, below, k), lambda k: popov(-above, below + k * above, k))),
        ("zames", (lambda k: zames_falb(above, below, k, odd=True),)),
    ):
        held = [
            k for k in map(Rational, ("1/4", "1/2", "1", "2", "4")) if any(f(k) is not None for f in tests)
        ]
        reach[name] = max(held, default=0)
    assert reach["zames"] > reach["popov"]


def test_12_11_sectors_of_pieces() -> None:
    one, two = Poly(INPUT, INPUT, domain="QQ"), Poly(2 * INPUT - 1, INPUT, domain="QQ")
    oo, zero = sympy.oo, sympy.S.Zero
    bent = Characteristic((Piece(-oo, sympy.S.One, one), Piece(sympy.S.One, oo, two)), {})
    low, high = bent.sector()
    assert 0 < 1 - low < 1e-5  # 1 is reached: the sector is wider
    assert high == 2  # only at infinity
    assert bent.slopes() == (1, 2)
    assert not bent.odd
    minus, plus = (Poly(q, INPUT, domain="QQ") for q in (-1, 1))
    relay = Characteristic((Piece(-oo, zero, minus), Piece(zero, oo, plus)), {zero: (-1, 1)})
    assert relay.sector() == (0, None)
    assert relay.odd
    off = relay.moved(Rational(1, 2), sympy.S.One)  # an equilibrium at y = 1/2: psi = -2 below -1/2, 0 above
    assert off.at_zero == (0, 0)
    assert off.sector() is not None
    away = Characteristic((Piece(-oo, zero, plus), Piece(zero, oo, minus)), {zero: (-1, 1)})
    assert away.sector() is None


def test_12_11_a_saturated_loop_with_an_integrator_is_stable_for_all_motions() -> None:
    """x'' = -x' - sat(x): V = x'^2/2 + integral of sat, the classical case of Popov's criterion."""
    ((_, certificate),) = for_all(System({x: v, v: -v - Max(-1, Min(1, x))}))
    assert certificate.theorem.startswith("Popov")


def test_12_11_a_limit_cycle_is_never_certified_away() -> None:
    """Saturation around 1/(s + 1)^3 with gain above 8 swings; below it all motions come in (Popov)."""
    for gain, expected in ((7, 1), (9, 0)):
        y = gain * Max(-1, Min(1, x))
        loop = System({x: v - x, v: z - v, z: -z - y})
        assert len(for_all(loop)) == expected


def test_12_11_a_relay_of_order_two() -> None:
    """G = (s + 1/2)/((s + 1)^3): Popov for all motions, where only the motions near were decided."""
    loop = System({x: -3 * x + v, v: -3 * x + z - sign(x), z: -x - sign(x) / 2})
    ((_, certificate),) = for_all(loop)
    assert certificate.theorem.startswith("Popov")
    assert "zeros" in certificate.checked[-1]
