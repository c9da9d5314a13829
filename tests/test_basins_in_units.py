"""Basins of the hunting loop in other units of length: the same attractors, the same labels."""

from __future__ import annotations

import numpy as np
import pytest

from filippov.analysis.diagrams.basin import Basin, basin
from filippov.analysis.maps.section import Section
from filippov.models import get


def told(length: float, values: dict[str, float]) -> Basin:
    """The basins in the plane of position and velocity."""
    model = get("hunting")
    scaled = {"m": 1 / length, "vs": 0.1 * length, "b": 1 / length, **values, "P": values["P"] / length}
    return basin(
        model.build(), Section.from_model(model), ("x", np.linspace(-0.4, 0.4, 16) * length),
        ("v", np.linspace(-2, 2, 16) * length), (-0.6 * length, 0.6 * length), parameters=scaled,
    )  # fmt: skip


@pytest.mark.parametrize("seed", range(4))
def test_12_13_basins_of_rest_and_of_a_hunting_cycle_in_any_unit_of_length(seed: int) -> None:
    rng = np.random.default_rng([seed, 53])
    values = {"P": float(rng.uniform(12, 19)), "I": float(rng.uniform(9, 12))}
    metres = told(1.0, values)
    assert len(metres.attractors) == 2
    for length in (1e-9, 1e-6, 1e-3, 1e3):
        found = told(length, values)
        assert np.array(found.attractors) / length == pytest.approx(metres.attractors, rel=1e-7)
        assert np.array_equal(found.label, metres.label)
