"""Two invisible folds that meet in the plane: the verdict against turns of the solution itself."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from filippov import System, states
from filippov.analysis import stability_report

DRAWS = {"nightly": 200}.get(os.environ.get("FILIPPOV_PROFILE", ""), 6)
x, y = states("x y")


class Back:
    """The event y = 0, of a solution that has left to the side `sense`."""

    terminal = True

    def __init__(self, sense: float) -> None:
        self.direction = -sense

    def __call__(self, _: float, z: Any) -> float:
        return float(z[1])


def half(field: Any, start: float, sense: float) -> float:
    """Where a solution from (start, 0) comes back to y = 0 after it has left to the side `sense`."""
    found = solve_ivp(
        field, (0, 1), (start, 0.0), events=Back(sense), rtol=1e-12, atol=1e-16, max_step=0.01
    )
    return float(found.y_events[0][-1][0])


def fields(rng: np.random.Generator) -> list[tuple[list[float], list[float]]]:
    """Coefficients of x' and y' by 1, x, y, x^2 on either side; both folds at 0, both invisible."""
    sides = []
    for sense in (1, -1):
        f, g = np.round(rng.uniform(-1, 1, 4), 2), np.round(rng.uniform(-1, 1, 4), 2)
        f[0], f[3], g[0] = sense * round(rng.uniform(0.5, 2), 2), 0.0, 0.0
        g[1] = -round(rng.uniform(0.5, 2), 2)
        sides.append((f.tolist(), g.tolist()))
    return sides


def test_turns_are_as_the_second_order_says() -> None:
    rng = np.random.default_rng(211)
    judged = 0
    for _ in range(DRAWS):
        sides = fields(rng)
        terms = (1, x, y, x**2)
        rows = {
            sign: [sum(c * e for c, e in zip(row, terms, strict=True)) for row in side]
            for sign, side in zip("+-", sides, strict=True)
        }
        report = stability_report(System.from_modes(h=[y], states=[x, y], fields=rows))
        (item,) = [i for i in report.items if i.equilibrium.mode == "0" and not any(i.equilibrium.value)]

        def rate(_: float, z: Any, side: Any) -> list[float]:
            at = np.array([1.0, z[0], z[1], z[0] ** 2])
            return [float(np.dot(row, at)) for row in side]

        start = -0.01
        over = half(lambda u, z, side=sides[0]: rate(u, z, side), start, 1.0)
        turn = half(lambda u, z, side=sides[1]: rate(u, z, side), over, -1.0)
        growth = (abs(turn) - abs(start)) / start**2
        if abs(growth) < 0.05:
            continue
        judged += 1
        assert item.answer == ("unstable" if growth > 0 else "asymptotically stable"), (sides, growth)
    assert judged > DRAWS // 2


@pytest.mark.parametrize("flip", [1, -1])
def test_curved_surfaces_and_mirrored_states(flip: int) -> None:
    """The same two fields beside w = y + x^2 and with x mirrored: z = (x, y + x^2) is a change of states."""
    u, w = flip * x, y + x**2
    above, below = (1 + u / 2, -u + u**2 / 5), (-1 + w, -u - w / 3)
    rows = {k: [flip * f, g - 2 * x * flip * f] for k, (f, g) in {"+": above, "-": below}.items()}
    report = stability_report(System.from_modes(h=[w], states=[x, y], fields=rows))
    (item,) = [i for i in report.items if not any(i.equilibrium.value)]
    # k+ = 2/3 (1/2 + 1/5), k- = 2/3 (1/3): a turn from u < 0 leads to u - 0.24 u^2.
    assert item.answer == "unstable"


def test_a_centre_is_left_undecided_by_this_order() -> None:
    rows = {"+": [1, -x], "-": [-1, -2 * x]}
    report = stability_report(System.from_modes(h=[y], states=[x, y], fields=rows))
    assert [i.answer for i in report.items] != ["asymptotically stable"]
    assert "half a turn" not in report.to_text()
