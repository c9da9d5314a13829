"""Where a run is cut into calls goes by the clock; nothing that is found does."""

import numpy as np

from filippov import Status, System, solve
from filippov.solving import loop


class Clock:
    """A clock that goes forward by random amounts, from microseconds to a second, between two looks."""

    def __init__(self, seed: int) -> None:
        self.random, self.now = np.random.default_rng(seed), 0.0

    def monotonic(self) -> float:
        self.now += 10.0 ** self.random.uniform(-6, 0)
        return self.now


def test_an_undeclared_jump_in_time_ends_the_run_wherever_it_is_cut(monkeypatch):
    """A pulse of 1000 on [50, 50.001] from rest: at its edge no step is short enough, whatever was tried."""

    def pulse(t, x, p, s):
        return [-x[0] + 1000.0 * (50 <= t < 50.001)]

    system = System(field=pulse, states="y")
    for seed in range(400):
        monkeypatch.setattr(loop, "time", Clock(seed))
        found = solve(system, [0.0], (49.9, 50.1), max_step=1e-3)
        assert found.status is Status.MIN_STEP, seed
        assert abs(found.t_end - 50) < 1e-9, seed
        if seed == 0:
            first = found
        assert found.t_end == first.t_end, seed
        assert np.array_equal(found.x_end, first.x_end), seed
