"""Orbits that a sliding mode holds at a point, continued until the disturbance exceeds the control."""

import numpy as np
import pytest

from filippov import System, UsageError, parameters, sign, sin, states, t
from filippov.analysis import continuation, find_orbit


@pytest.mark.parametrize("seed", range(8))
def test_disturbance_breaks_through(seed):
    rng = np.random.default_rng(seed)
    c, K, w = rng.uniform((0.5, 1, 1), (3, 5, 4))
    x, v, z = states("x v z")
    p = parameters(d=0.4 * K)
    push = -K * sign(v + c * x) + p.d * sin(w * t)
    kinds = [{x: v, v: push}, {x: v, v: push, z: x - z}, {x: -K * sign(x) + p.d * sin(w * t)}]
    system = System(kinds[seed % 3])
    start = rng.uniform(-1, 1, system.dimension)
    branch = continuation(system, find_orbit(system, start), parameter="d", bounds=(0.2 * K, 1.1 * K)).run()
    assert branch.special[0].special == "adding-sliding"
    assert abs(branch.special[0].value - K) < 1e-6 * K


def test_parameter_in_no_formula_is_refused():
    x, v = states("x v")
    p = parameters(k=1, unused=3, c=0.3)
    system = System({x: v, v: -p.k * x - p.c * sign(v) + sin(1.3 * t)}, parameters=p)
    orbit = find_orbit(system, (1, 0))
    with pytest.raises(UsageError, match=r"'unused' stands in no equation.*Vary one that does: k, c"):
        continuation(system, orbit, parameter="unused", bounds=(1, 5))
    assert len(continuation(system, orbit, parameter="c", bounds=(0.29, 0.31)).run().points) > 2
