"""Friction models of the literature for curves that rise, fall, or hold the velocity of the body."""

from typing import Any

import numpy as np
import pytest

from filippov import EventKind, ModelError, Surface, System, cos, exp, sign, solve, states, t
from filippov.analysis import compare
from filippov.model.friction_model import with_friction_model

x, v, w = states("x v w")
SPEED = abs(v)
BODY: dict[str, tuple[Any, Any]] = {  # level of friction, velocity of the belt
    "rises": (0.3 + 0.5 * SPEED, 0),
    "rises as a square": (0.3 + 0.5 * v**2, 0),
    "falls, then rises": (0.3 + 0.3 * SPEED / (1 + SPEED) + 0.2 * exp(-SPEED / 0.1), 0),
    "falls at once": (0.3 + 0.3 * exp(-((SPEED / 0.1) ** 0.5)), 0),
    "of the body's own velocity": (0.35 + 0.3 * exp(-(v**2) / 0.05), 0.3),
}
ABOVE_A_FALLING_LEVEL = ["lugre", "elasto-plastic", "maxwell-slip"]


def body(case: str) -> System:
    level, belt = BODY[case]
    force = -x - level * sign(v - belt) + 0.3 * cos(2 * t)
    return System({x: v, v: force}, surfaces=[Surface("slip", v - belt)])


@pytest.mark.parametrize("model", ABOVE_A_FALLING_LEVEL)
@pytest.mark.parametrize("case", BODY)
def test_15_2_models_go_to_the_exact_solution_whatever_the_curve(case: str, model: str) -> None:
    """Of order 1/2 in the width; the exact run has no bristles."""
    system = body(case)
    exact = solve(system, (0.5, 0.7), (0, 7), rtol=1e-10, atol=1e-12)
    assert any(event.kind is EventKind.ENTRY for event in exact.events)
    table = compare(system, (0.5, 0.7), (0, 7), against=[model], widths=(1e-3, 1e-5))
    wide, narrow = (row["error_state"] for row in table.of(model))
    assert narrow < 0.01
    assert np.log10(wide / narrow) / 2 > 0.35, (wide, narrow)


def test_15_2_what_a_model_cannot_hold_is_refused() -> None:
    with pytest.raises(ModelError, match="memory lags the sliding speed"):
        with_friction_model(body("of the body's own velocity"), "memory", 1e-3)
    two_curves = System({v: -(1 + exp(-abs(v))) * sign(v) + cos(t), w: -w - (1 + v**2) * sign(v)})
    for model in ABOVE_A_FALLING_LEVEL:
        with pytest.raises(ModelError, match="another curve in one equation than in another"):
            with_friction_model(two_curves, model, 1e-3, tau=1.0)
    with_friction_model(two_curves, "dahl", 1e-3)


def test_15_2_a_surface_without_a_name_has_bristles_too() -> None:
    made = with_friction_model(System({x: v, v: -x - sign(0.52 * x - w), w: v}), "lugre", 1e-3, tau=1.0)
    assert [surface.kind for surface in made.surfaces] == ["kink"]
    assert made.states[-1].startswith("z_0_52")
