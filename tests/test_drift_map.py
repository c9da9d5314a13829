"""The return map to a set of rest positions in dimension 3 and up, against closed roots and motions."""

import numpy as np
import pytest

from filippov import Surface, System, exp, parameters, sign, solve, states
from filippov.analysis.local_stability.stability import stability_report
from filippov.analysis.steady.drift_map import drift_map
from filippov.analysis.steady.rest_map import rest_map

x, v, z, f, u = states("x v z f u")
p = parameters(P=20, D=1, I=10, tau=0.1, lag=0.05, Fs=4, Fc=2, vs=0.1, b=1)
STRIBECK = (p.Fc + (p.Fs - p.Fc) * exp(-((abs(v) / p.vs) ** 2))) * sign(v)
COMMAND = p.P * (x + p.D * (x - f) / p.tau + p.I * z)
SURFACE = [Surface("velocity", v)]
FILTERED = System({x: v, v: -COMMAND - STRIBECK - p.b * v, z: x, f: (x - f) / p.tau}, surfaces=SURFACE)
LAGGING = System(
    {x: v, v: -u - STRIBECK - p.b * v, z: x, f: (x - f) / p.tau, u: (COMMAND - u) / p.lag}, surfaces=SURFACE
)


def filtered(P: float, tau: float, lag: float | None = None) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Slip and sliding of the mass under a PID controller with a filtered derivative (and an actuator)."""
    command = [P * (1 + 1 / tau), 0, P * 10, -P / tau]
    rows = [[0, 1, 0, 0], [0, -1, 0, 0], [1, 0, 0, 0], [1 / tau, 0, 0, -1 / tau]]
    if lag is None:
        slip = np.array(rows, dtype=float)
        slip[1] -= command
    else:
        slip = np.zeros((5, 5))
        slip[:4, :4], slip[1, 4] = rows, -1.0
        slip[4] = [*np.array(command) / lag, -1 / lag]
    slide = slip.copy()
    slide[1] = 0.0
    return slip, slide, np.eye(len(slip))[1]


def after_one_slip(P: float, tau: float, d: float, lag: float | None = None) -> float:
    """Where the mass rests next, by the nonlinear motion from a break-away at d that arrived slowly."""
    integral = (4 / P - d) / 10
    start = [d, 0, integral, d]
    if lag is not None:
        # Under a slow ramp the actuator is late by its lag, P I d a second.
        integral += lag * d
        start = [d, 0, integral, d, 4]
    # The filter's state is late as well, but x stands still.
    got = solve(
        FILTERED if lag is None else LAGGING, start, (0, 30),
        parameters={"P": P, "tau": tau} | ({} if lag is None else {"lag": lag}),
        rtol=1e-12, atol=1e-17,
    )  # fmt: skip
    assert got.success
    return float(got.x_end[0]) / d


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_in_dimension_3_it_is_the_map_of_the_slip_polynomial(side: float) -> None:
    slide = np.array([[0, 1, 0], [0, 0, 0], [1, 0, 0.0]])
    for a2, a1, a0 in np.random.default_rng(1).uniform(0.1, (3, 5, 9), (100, 3)):
        slip = np.array([[0, 1, 0], [-a1, -a2, -a0], [1, 0, 0]])
        found, expected = drift_map(slip, slide, np.array([0, side, 0])), rest_map([1, a2, a1, a0])
        assert found is not None
        assert found.outcome == expected.outcome
        assert found.kappa == pytest.approx(expected.kappa, rel=1e-9)
        assert found.duration == pytest.approx(expected.duration, rel=1e-9)


@pytest.mark.parametrize(
    ("P", "tau"), [(10, 0.05), (20, 0.1), (40, 0.3), (30, 0.3), (10, 0.3), (10, 1.0), (15, 0.7)]
)
def test_a_filtered_derivative_against_motions_ever_nearer_to_the_set(P: float, tau: float) -> None:
    """In some of them the slide after the slip is left again at once. The difference falls like d."""
    found = drift_map(*filtered(P, tau))
    assert found is not None
    assert found.outcome == "returns"
    far, near = (after_one_slip(P, tau, d) for d in (1e-6, 1e-7))
    assert (10 * near - far) / 9 == pytest.approx(found.kappa, abs=1e-6)


@pytest.mark.parametrize(("P", "tau", "lag"), [(20, 0.1, 0.02), (10, 0.2, 0.1)])
def test_dimension_5(P: float, tau: float, lag: float) -> None:
    found = drift_map(*filtered(P, tau, lag))
    assert found is not None
    far, near = (after_one_slip(P, tau, d, lag) for d in (1e-6, 1e-7))
    assert (10 * near - far) / 9 == pytest.approx(found.kappa, abs=1e-6)


@pytest.mark.parametrize(
    ("P", "tau", "answer"),
    [(20, 0.1, "asymptotically stable"), (10, 1.0, "unstable"), (40, 0.3, "asymptotically stable")],
)
def test_the_report_decides_by_it(P: float, tau: float, answer: str) -> None:
    (item,) = stability_report(FILTERED, {"P": P, "tau": tau}).items
    (case,) = item.cases
    expected = drift_map(*filtered(P, tau))
    assert item.answer == answer
    assert expected is not None
    assert [m.kappa for m in case.maps] == pytest.approx([expected.kappa] * 2, rel=1e-9)
    assert case.criterion == "none"
    assert any("drift_map" in statement.source for statement in case.statements)


def test_at_the_threshold_of_the_filter_drifts_keep_their_size() -> None:
    (item,) = stability_report(FILTERED, {"P": 10}, solve_for="tau", budget=200).items
    assert item.cases[0].solved is not None
    (tau,) = item.cases[0].solved.threshold
    far, near = (after_one_slip(10, tau, d) for d in (1e-6, 1e-7))
    assert (10 * near - far) / 9 == pytest.approx(-1, abs=1e-6)


def test_without_a_drift_nothing_is_said() -> None:
    """Without the integrator the mass rests at once: its slides do not drift."""
    slip, slide, normal = filtered(10, 0.3)
    keep = [0, 1, 3]
    assert drift_map(slip[np.ix_(keep, keep)], slide[np.ix_(keep, keep)], normal[keep]) is None
    free = -p.P * (x + p.D * (x - f) / p.tau)
    lagging = System(
        {x: v, v: -u - STRIBECK, f: (x - f) / p.tau, u: (-free - u) / p.lag}, surfaces=SURFACE
    )
    assert [item.answer for item in stability_report(lagging).items] == ["undecided"]
