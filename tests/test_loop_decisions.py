"""What the compiled loop decides: batches of which nothing is left to `solve`, against closed forms."""

import numpy as np
import pytest

from filippov import Surface, System, parameters, sign, solve_many, states

x, v = states("x v")


@pytest.fixture
def alone(monkeypatch):
    """Let no row of a batch be solved again."""

    def refuse(*_, **__):
        raise AssertionError("left the compiled loop")

    monkeypatch.setattr("filippov.solving.solver.solve", refuse)


def flown(x0: float, v0: float, g: float, f: float, r: float, end: float) -> tuple[float, float, int]:
    """x'' = f - g sgn(x), v+ = r v at x = 0, on parabolas: x, v and the number of resets at the end."""
    t, count, side = 0.0, 0, np.sign(x0)
    while True:
        a = f - g * side
        # x0 + v0 s + a s**2/2 = 0, x0 being 0 after a reset.
        roots = np.roots([a / 2, v0, x0]) if x0 != 0 else np.array([-2 * v0 / a])
        s = min((q.real for q in roots if abs(q.imag) < 1e-12 and q.real > 0), default=np.inf)
        if t + s > end:
            s = end - t
            return x0 + v0 * s + a * s**2 / 2, v0 + a * s, count
        t, v0, x0, count = t + s, r * (v0 + a * s), 0.0, count + 1
        side = np.sign(v0)


def test_14_1_resets_where_the_field_jumps_stay_in_the_loop(alone) -> None:
    p = parameters(g=1.0, f=0.0, r=0.9)
    system = System(
        {x: v, v: p.f - p.g * sign(x)},
        surfaces=[Surface("edge", x, reset={v: p.r * v}, side="both")],
        parameters=p,
    )
    rng, k = np.random.default_rng(14), 128
    rows = {"g": rng.uniform(0.5, 2, k), "f": rng.uniform(-0.4, 0.4, k)}
    # Led through the surface or back from it, losing speed or winning it.
    rows["r"] = rng.choice([-1, 1], k) * rng.uniform(0.8, 1.2, k)
    starts = np.column_stack([rng.choice([-1, 1], k) * rng.uniform(0.2, 2, k), rng.uniform(-1, 1, k)])
    for lanes in (1, 8):
        many = solve_many(system, starts, (0, 5), parameters=rows, lanes=lanes)
        assert many.success.all()
        for q in range(k):
            *end, count = flown(*starts[q], *(float(rows[name][q]) for name in "gfr"), 5.0)
            assert many.x[q] == pytest.approx(end, rel=1e-7, abs=1e-7)
            assert many.events("edge", "reset")[q] == count
