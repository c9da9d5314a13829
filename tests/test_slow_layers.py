"""A surface behind which the motion goes on slowly: layers in which it relaxes, and folds of the field."""

from math import exp, log

import pytest

from filippov import Heaviside, Surface, System, parameters, sign, solve, states, t
from filippov.models.switch import hunting_switch

p = parameters(b=0.0, c=1.0)
y, z = states("y z")
# y' = -1 above, b + c (t - 1) below: from 1 it is at 0 at t = 1. z counts the time on each side.
FOLD = System(
    {y: -Heaviside(y) + (p.b + p.c * (t - 1)) * (1 - Heaviside(y)), z: sign(y)}, surfaces=[Surface("y", y)],
    parameters=p,
)  # fmt: skip


def counted(b: float, c: float, end: float) -> float:
    """z at 1 + end: below with -1, sliding with s = (m - 1)/(m + 1), m = b + c (t - 1)."""
    def slid(a: float, to: float) -> float:
        return (to - a) - 2 / c * log((1 + b + c * to) / (1 + b + c * a))

    if b < 0 and c > 0:  # below until -2 b/c
        back = min(-2 * b / c, end)
        return 1 - back + slid(back, end)
    if b < 0:
        return 1 - end
    leaves = end if c > 0 else min(-b / c, end)
    return 1 + slid(0, leaves) - (end - leaves)


@pytest.mark.parametrize("c", [1.0, -1.0, 30.0, 1e-3])
def test_15_a_slow_crossing_beside_a_fold_is_the_one_of_the_closed_form(c: float) -> None:
    """Rates beyond from 1e-3 down to rounding, of both signs: it dives, slides at once, or leaves."""
    for k in range(20):
        for side in (1, -1):
            b = side * 10 ** (-3 - k / 2)
            run = solve(FOLD, (1, 0), (0, 1.5), parameters={"b": b, "c": c})
            assert run.success, (b, run.message)
            assert run.x_end[1] == pytest.approx(counted(b, c, 0.5), abs=2e-9), b
            assert run.x_end[0] <= 1e-15


x, v = states("x v")
q = parameters(eta=1e-8, alpha=100.0)
LAYER = System(
    {x: v, v: -Heaviside(v - q.eta) - q.alpha * v * Heaviside(q.eta - v)},
    surfaces=[Surface("edge", v - q.eta)], parameters=q,
)  # fmt: skip


@pytest.mark.parametrize("alpha", [1.0, 100.0, 1e4])
def test_15_a_layer_in_which_the_motion_relaxes_is_crossed_however_thin(alpha: float) -> None:
    """v' = -1 until eta, then v = eta exp(-alpha (t - t1)): x ends eta/alpha farther."""
    for k in range(16):
        eta = 10 ** (-3 - k / 2)
        run = solve(LAYER, (0, 1), (0, 2), parameters={"eta": eta, "alpha": alpha})
        assert run.success, (eta, run.message)
        if alpha * eta < 1:
            assert [(e.kind, e.surface) for e in run.events] == [("crossing", "edge")]
        met = 1 - eta
        way = met - met**2 / 2 + eta / alpha * -(exp(-alpha * (2 - met)) - 1)
        assert run.x_end[0] == pytest.approx(way, abs=1e-10)


def test_15_the_switch_model_of_a_billionth_takes_the_steps_of_a_wide_one() -> None:
    """Its four crossings a stick are decided in the loop: the work does not grow as the band gets thin."""
    runs = [solve(hunting_switch(eta, 100.0), (0.1, 0, 0), (0, 20)) for eta in (1e-4, 1e-9)]
    wide, thin = ((len(run.events), run.nfev) for run in runs)
    assert all(run.success for run in runs)
    assert thin[0] == wide[0]
    assert thin[1] <= wide[1]
