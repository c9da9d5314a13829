"""Between systems here and linear plants of python-control: a relay loop from a plant, a plant from a loop.

Needs the extra `filippov[control]`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from filippov.analysis.harmonic.quasi_linear import lure
from filippov.base.errors import ModelError
from filippov.model.surface import Surface
from filippov.model.symbols import sign, states
from filippov.model.system import System


def _control() -> Any:
    try:
        import control
    except ImportError:
        raise ImportError(
            "this needs python-control, which is not installed: pip install filippov[control]"
        ) from None
    return control


def relay_loop(plant: Any) -> System:
    """x' = A x - B sgn(y), y = C x: the plant of python-control under relay feedback; surface "output".

    plant   a TransferFunction or StateSpace with one input and one output, strictly proper, continuous time

    Raises ModelError for another one: with feed-through the relay would act on its own input at once.
    """
    control = _control()
    if not isinstance(plant, control.TransferFunction | control.StateSpace):
        raise ModelError(
            f"plant is {type(plant).__name__}, expected a TransferFunction or StateSpace of python-control."
        )
    if plant.ninputs != 1 or plant.noutputs != 1:
        raise ModelError(
            f"the plant has {plant.ninputs} inputs and {plant.noutputs} outputs, expected one of each."
        )
    if plant.dt not in (None, 0):
        raise ModelError(f"the plant is sampled (dt = {plant.dt}), expected one in continuous time.")
    if isinstance(plant, control.TransferFunction):
        above, below = plant.num[0][0], plant.den[0][0]
        if len(np.trim_zeros(above, "f")) >= len(np.trim_zeros(below, "f")):
            raise ModelError(
                f"the plant ({plant}) is not strictly proper: its output follows the relay at once. Add the "
                "actuator's lag."
            )
        plant = control.tf2ss(plant)
    if np.any(plant.D != 0):
        raise ModelError(f"the plant has feed-through D = {plant.D}, expected 0. Add the actuator's lag.")
    x = states([f"x{k + 1}" for k in range(plant.nstates)])
    output = sum(float(c) * state for c, state in zip(plant.C[0], x, strict=True))
    relay = sign(output)
    return System(
        {
            state: sum(float(a) * other for a, other in zip(row, x, strict=True)) - float(gain) * relay
            for state, row, gain in zip(x, plant.A, plant.B[:, 0], strict=True)
        },
        surfaces=[Surface("output", output)],
    )


def linear_plant(system: System, surface: str, parameters: Mapping[str, float] | None = None) -> Any:
    """The linear part of a loop as a StateSpace: from what the sign of one surface multiplies to its h.

    x' = A x + b sgn(h), h = c x: returns -c (sI - A)^-1 b, so that the loop is closed by a relay with
    negative feedback. Raises ModelError where the field is not of this form.
    """
    control = _control()
    split = lure(system, surface, parameters)
    if split.widths.size != 1 or split.widths[0] != 0.0 or split.offset != 0.0:
        raise ModelError(f"expected one surface without hysteresis, h = c x; {surface!r} has more.")
    y = np.array([-2.0, -1.0, 1.0, 2.0])
    values = split.phi(y, np.sign(y)[None, :])
    jump = values[:, 3]
    if not np.allclose(values, np.outer(jump, np.sign(y)), rtol=1e-12, atol=1e-12):
        raise ModelError(
            f"the terms in {surface!r} are more than a relay and a line, so the rest is no linear plant."
        )
    return control.ss(split.matrix, -jump[:, None], split.row[None, :], 0)
