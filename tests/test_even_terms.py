"""Polynomial fields f = J(x) W x + s (x_1^3, ...) with J antisymmetric: d(x.W x)/dt = 2 s sum w_i x_i^4.

J W x does no work in x . W x, whatever J is, so s decides: none of the linear parts does (roots on the axis).
"""

import numpy as np
import pytest
import sympy

from filippov import System, solve, states
from filippov.analysis import stability_report

x = states("x v y")


def drawn(seed: int, rate: int) -> tuple[System, int]:
    """A system of 2 or 3 states."""
    rng = np.random.default_rng([31, seed])
    n = int(rng.integers(2, 4))
    weights = [sympy.Integer(int(k)) for k in rng.integers(1, 4, n)]
    J = sympy.zeros(n, n)
    for i in range(n):
        for k in range(i):
            linear = int(rng.integers(-3, 4))
            J[i, k] = linear + int(rng.integers(-2, 3)) * x[int(rng.integers(n))]
            J[k, i] = -J[i, k]
    field = J * sympy.Matrix([w * q for w, q in zip(weights, x, strict=False)])
    field = [sympy.expand(f + rate * q**3) for f, q in zip(field, x, strict=False)]
    return System(dict(zip(x[:n], field, strict=True))), n


def answer_at_zero(system: System) -> str:
    report = stability_report(system, budget=4.0)
    return next(
        item.answer for item in report.items
        if item.equilibrium.dimension == 0 and not any(item.equilibrium.value)
    )  # fmt: skip


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("rate", "answer"), [(-1, "asymptotically stable"), (1, "unstable"), (0, "stable")])
def test_the_sign_of_the_power_decides(seed: int, rate: int, answer: str) -> None:
    system, _ = drawn(seed, rate)
    assert answer_at_zero(system) == answer


def test_power_that_is_lost_in_one_state_alone() -> None:
    """What stays where c = 0 has c' = a^2 + b^2 = 0 too; without that coupling the others turn for ever."""
    a, b, c = x[:3]
    coupled = System({a: b - a * c, b: -a - b * c, c: a**2 + b**2 - c**3})
    assert answer_at_zero(coupled) == "asymptotically stable"
    assert answer_at_zero(System({a: b, b: -a, c: -(c**3)})) == "stable"


def test_a_weak_focus_of_fifth_order() -> None:
    a, b = x[:2]
    r = (a**2 + b**2) ** 2
    for s, answer in ((-1, "asymptotically stable"), (1, "unstable")):
        assert answer_at_zero(System({a: b + s * a * r, b: -a + s * b * r})) == answer


@pytest.mark.parametrize("seed", range(3))
def test_solutions_of_such_fields_fall(seed: int) -> None:
    system, n = drawn(seed, -1)
    run = solve(system, [0.4] * n, (0, 60), rtol=1e-9)
    assert run.success
    assert np.linalg.norm(run.x_end) < 0.5 * np.linalg.norm(run.y[:, 0])
