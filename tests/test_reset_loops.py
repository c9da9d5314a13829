"""Reset control loops (Clegg's integrator, first-order elements) against matrix exponentials, to rest."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq

from filippov import UsageError, models
from filippov.analysis import Section, brute_force, find_section, returns

Array = npt.NDArray[np.float64]
MODEL = models.get("reset_control")
SYSTEM = MODEL.build()
ERROR = Section("error", "reset", "z", t_max=100.0)


def loops(seed: int, count: int) -> list[dict[str, float]]:
    """Loops from Clegg's integrator, b = 0, to fast elements, of either sign of the set point."""
    draw = np.random.default_rng(seed)
    return [
        {
            "r": float(draw.choice([-1, 1]) * 10 ** draw.uniform(-3, 3)), "k": draw.uniform(0.5, 4),
            "b": float(draw.choice([0.0, draw.uniform(0, 2)])), "pole": draw.uniform(0.1, 0.9),
        }
        for _ in range(count)
    ]  # fmt: skip


def resets(p: dict[str, float], count: int) -> list[tuple[float, float]]:
    """(time, z) of the first resets: the flow between them is one matrix, on (z, w, u, 1)."""
    r, b, k = p["r"], p["b"], p["k"]
    rate = np.array([[0, 1, 0, 0], [0, -p["pole"], 1, 0], [-k, -k, -b, k * r], [0, 0, 0, 0]])
    step, x, time, found = expm(0.01 * rate), np.array([0.0, 0, 0, 1]), 0.0, []
    for _ in range(count):
        at, ahead = x, 0
        # The error is 0 at the begin of all but the first: its sign is that of the first step.
        sign = np.sign(r - sum((step @ x)[:2]))
        while sign * (r - sum(at[:2])) >= 0 or ahead < 2:
            at, ahead = step @ at, ahead + 1
            if ahead > 10_000:
                return found
        gap = brentq(
            lambda s, x=x: r - sum((expm(s * rate) @ x)[:2]), 0.01 * (ahead - 1), 0.01 * ahead, xtol=1e-15
        )
        time, x = time + gap, expm(gap * rate) @ x
        x[2] = 0.0
        found.append((time, float(x[0])))
    return found


@pytest.mark.parametrize("seed", range(4))
def test_16_5_reset_loops_reset_where_the_exponentials_say(seed: int) -> None:
    for p in loops(seed, 5):
        expected = resets(p, 5)
        found = returns(SYSTEM, ERROR, MODEL.x0, len(expected), parameters=p, rtol=1e-11)
        assert found.message == "", p
        for at, (time, z) in zip(found.t, expected, strict=True):
            # The states hold 1e-11 of the set point, however little is left of the swing.
            assert at == pytest.approx(time, abs=1e-9 * max(1, abs(p["r"] / (z - p["r"])))), p
        assert found.d == pytest.approx([z for _, z in expected], rel=1e-7, abs=1e-8 * abs(p["r"]))


@pytest.mark.parametrize("seed", range(4))
def test_16_5_what_rests_is_not_followed_to_rounding(seed: int) -> None:
    """Each reset leaves |e| a constant part of what it was: a loop rests on (r, 0, 0), which says so."""
    for p in loops(seed, 5):
        (_, one), (_, two) = resets(p, 2)
        shrinks = abs(two - p["r"]) < 0.6 * abs(one - p["r"])
        found = returns(SYSTEM, ERROR, MODEL.x0, 264, parameters=p, rtol=1e-8)
        if shrinks:
            assert found.rests, p
            assert len(found.t) <= 64
            assert found.x_end == pytest.approx([p["r"], 0, 0], rel=1e-6, abs=1e-6 * abs(p["r"]))


def test_16_5_a_diagram_of_a_loop_that_rests_shows_the_set_point() -> None:
    with pytest.raises(UsageError, match="comes to rest at"):
        find_section(SYSTEM, MODEL.x0)
    shown = brute_force(SYSTEM, ERROR, "r", [0.5, 1.0, 2.0], MODEL.x0)
    assert shown.d == pytest.approx(np.outer([0.5, 1, 2], np.ones(64)), rel=1e-7)
    assert all(note.endswith("the solution rests") for note in shown.notes)
