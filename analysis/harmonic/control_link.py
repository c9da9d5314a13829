"""Conversion to and from linear plants of python-control: a relay loop from a plant, a plant from a loop.

Needs the extra `filippov[control]`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import sympy

from filippov import ModelError, Surface, System, UsageError, sign, states
from filippov import t as time
from filippov.analysis.harmonic.quasi_linear import lure
from filippov.analysis.sensitivity.variation import mode_field
from filippov.base.keywords import keywords
from filippov.base.names import unknown
from filippov.interop.control_blocks import control_module
from filippov.model.symbolic import convex
from filippov.solving.reading import expression_of
from filippov.solving.state.options import check_state


@keywords()
def relay_loop(plant: Any) -> System:
    """x' = A x - B sgn(y), y = C x: the plant of python-control under relay feedback; surface "output".

    plant   a TransferFunction or StateSpace with one input and one output, strictly proper, continuous time

    Raises ModelError for any other plant: with feed-through the relay would act on its own input at once.
    """
    control = control_module()
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


@keywords()
def linear_mode(
    system: System, mode: Any, x: Any, *, t: float = 0.0, parameters: Mapping[str, float] | None = None,
    inputs: Sequence[str] | None = None, outputs: Sequence[str] | None = None,
) -> Any:  # fmt: skip
    """The field of one mode, linearised at a state, as a StateSpace.

    mode     signs such as "+0": while sliding the multipliers follow the state
    x        one number per state, in order or by name; t: the time
    inputs   parameters by which the field is moved; default: all
    outputs  states or outputs of the system; default: all
             states

    x' - f = A (x - x0) + B (p - p0), y - y0 = C (x - x0) + D (p - p0). Raises ModelError, UsageError.
    """
    control, form = control_module(), system.symbolic
    if form is None:
        raise ModelError("linear_mode is for systems in expressions; this has functions.")
    signs, names = form.signs(mode), tuple(system.parameters.names if inputs is None else inputs)
    if not names:
        raise ModelError("the system has no parameter that could be the input of a StateSpace. Add one.")
    field = mode_field(system, signs, names)
    n, wanted = system.dimension, list(system.states if outputs is None else outputs)
    values, times = system.parameters.resolve(parameters), np.array([float(t)])
    state = check_state(x, system)[None, :]
    s = field.multipliers(times, state, values)
    whole = field.matrix(times, state, s, values)[0, :n]
    slopes = np.zeros((0, field.size))
    if field.sliding:
        slopes = field.multiplier_slope(times, state, s, values)[0]
    at = dict(zip((time, *form.x, *form.p, *form.s), (t, *state[0], *values, *s[0]), strict=True))
    numbers = {q: sympy.Float(float(v), 17) for q, v in at.items()}
    by = [*form.x, *(q for name in names for q in form.p if q.name == name)]
    rows = []
    for name in wanted:
        e = _in_mode(system, name, signs)
        row = np.array([float(e.diff(q).xreplace(numbers)) for q in by])
        through = [float(e.diff(form.s[i]).xreplace(numbers)) for i in field.sliding]
        rows.append(row + np.array(through) @ slopes[:, : len(by)])
    c = np.array(rows).reshape(len(wanted), len(by))
    return control.ss(
        whole[:, :n], whole[:, n : n + len(names)], c[:, :n], c[:, n:],
        inputs=list(names), outputs=wanted, states=list(system.states),
    )  # fmt: skip


def _in_mode(system: System, name: str, signs: tuple[int, ...]) -> sympy.Expr:
    """A state or output in a mode, with multipliers as symbols where it slides."""
    form = system.symbolic
    assert form is not None
    if name not in system.states and name not in system.outputs:
        raise UsageError(unknown("output", name, (*system.states, *system.outputs)))
    if name in system.states:
        return form.x[system.states.index(name)]
    fixed = {s: sympy.Integer(m) for s, m in zip(form.s, signs, strict=True) if m}
    free = {s for s, m in zip(form.s, signs, strict=True) if not m}
    sizes = {sympy.Abs(h): m * h for h, m in zip(form.plain_h(), signs, strict=True)}
    return convex(expression_of(system, name).xreplace(fixed), free).xreplace(sizes)


def linear_plant(system: System, surface: str, parameters: Mapping[str, float] | None = None) -> Any:
    """The linear part of a loop as a StateSpace: from the input at the sign of one surface to its h.

    x' = A x + b sgn(h), h = c x: returns -c (sI - A)^-1 b, so that the loop is closed by a relay with
    negative feedback. Raises ModelError where the field is not of this form.
    """
    control = control_module()
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
