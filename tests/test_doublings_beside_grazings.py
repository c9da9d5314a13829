"""Doublings beside a grazing, where steps of a continuation bend, against sines and exponentials."""

import numpy as np
from scipy.linalg import expm
from scipy.optimize import fsolve

from filippov import Surface, System, cos, parameters, states, t
from filippov.analysis import continuation, find_orbit


def test_a_period_doubling_before_a_grazing_is_located_from_wherever_the_branch_begins() -> None:
    # An oscillator with a stop at 1: one impact a period, whose multiplier goes to -inf where the impact
    # begins to graze. The step that ends there bends so much that its end is not found along its tangent.
    x, v = states("x v")
    p = parameters(F=1.0)
    c, w, e = 0.1, 0.7, 0.6
    stop = Surface("stop", 1 - x, reset={v: -e * v})
    system = System({x: v, v: -x - c * v + p.F * cos(w * t)}, surfaces=[stop], parameters=p)
    period, flow = 2 * np.pi / w, np.array([[0.0, 1.0], [-1.0, -c]])
    forced = 1 / (1 - w**2 + 1j * c * w)

    def closed(unknown: np.ndarray) -> np.ndarray:
        """The impact at phase phi with speed s comes back, with a multiplier -1."""
        F, phi, s = unknown
        steady = F * forced * np.exp(1j * phi)
        here = np.array([steady.real, (1j * w * steady).real])
        free = expm(flow * period)
        back = here + free @ (np.array([1.0, -e * s]) - here)
        rate = -1 + F * np.cos(phi)
        jump = np.array([[-e, 0.0], [(rate + c * e * s + e * (rate - c * s)) / s, -e]])
        return np.array([back[0] - 1, back[1] - s, np.linalg.det(np.eye(2) + jump @ free)])

    exact = fsolve(closed, (0.5266, 0.1, 0.1), xtol=1e-13)
    assert abs(closed(exact)).max() < 1e-11
    assert exact[2] > 0
    for start in (1.0, 0.59):
        orbit = find_orbit(system, (0, 0), parameters={"F": start}, transient=200)
        run = continuation(system, orbit, parameter="F", bounds=(0.5165, 1.0), direction=-1)
        (doubled,) = run.run().special
        assert doubled.special == "period doubling"
        assert abs(doubled.value - exact[0]) < 1e-8
