"""Blocks with switches, as nonlinear systems of python-control: they go into control.interconnect.

Each is an ordinary `control.nlsys` with its function for python-control itself, and carries what
`from_control` makes exact surfaces of. Needs the extra `filippov[control]`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import sympy
from sympy import Expr, Symbol

from filippov.base.errors import ModelError
from filippov.base.given import shown
from filippov.base.keywords import keywords
from filippov.interop.wiring import Block
from filippov.model.check import as_expression
from filippov.model.surface import Surface
from filippov.model.symbols import Max, Min, sign
from filippov.model.time_event import TimeEvent

# From the name, the input and the symbols of states to a block.
Build = Callable[[str, Symbol, tuple[Symbol, ...]], Block]
MOST_LEVELS = 32


def control_module() -> Any:
    """python-control; ImportError that says how to install it."""
    try:
        import control
    except ImportError:
        raise ImportError(
            "this needs python-control, which is not installed: pip install filippov[control]"
        ) from None
    return control


@keywords("keyword", error=ModelError)
def relay(inputs: Any, outputs: Any, amplitude: Any = 1.0, *, width: Any = 0.0, name: str = "relay") -> Any:
    """y = amplitude sgn(u); width: half-width of its hysteresis."""
    a = _positive(amplitude, name, "amplitude")

    def build(name: str, u: Symbol, x: tuple[Symbol, ...]) -> Block:
        return Block(name, (u,), (a * sign(u),), surfaces=(Surface(name, u, width=width),))

    return _static(build, inputs, outputs, name)


@keywords("keyword", error=ModelError)
def saturation(
    inputs: Any, outputs: Any, low: Any = -1.0, high: Any = 1.0, *, name: str = "saturation"
) -> Any:
    """y = u between low and high, else the nearer of them."""
    lower, upper = as_expression(low, f"{name}: low"), as_expression(high, f"{name}: high")
    if (upper - lower).is_positive is False:
        raise ModelError(f"{name}: low is {low} and high is {high}, expected low < high.")
    return _static(
        lambda name, u, x: Block(name, (u,), (Max(lower, Min(upper, u)),)), inputs, outputs, name
    )


@keywords("keyword", error=ModelError)
def dead_zone(inputs: Any, outputs: Any, width: Any = 1.0, *, name: str = "dead_zone") -> Any:
    """y = 0 for |u| <= width, beyond it u - width or u + width."""
    w = _positive(width, name, "width")
    return _static(
        lambda name, u, x: Block(name, (u,), (Max(u - w, 0) + Min(u + w, 0),)), inputs, outputs, name
    )


@keywords("keyword", error=ModelError)
def quantiser(inputs: Any, outputs: Any, step: Any = 1.0, levels: Any = 8, *, name: str = "quantiser") -> Any:
    """y = the nearest multiple of step, up to `levels` steps to either side; switches at odd half steps."""
    q = _positive(step, name, "step")
    if isinstance(levels, bool) or not isinstance(levels, int) or not 1 <= levels <= MOST_LEVELS:
        raise ModelError(f"{name}: levels is {levels!r}, expected a whole number from 1 to {MOST_LEVELS}.")
    edges = [sympy.Rational(2 * k - 1, 2) for k in range(1, levels + 1)]

    def build(name: str, u: Symbol, x: tuple[Symbol, ...]) -> Block:
        return Block(name, (u,), (sum(sign(u - e * q) + sign(u + e * q) for e in edges) * q / 2,))

    return _static(build, inputs, outputs, name)


@keywords("keyword", error=ModelError)
def friction(
    inputs: Any, outputs: Any, coulomb: Any = 1.0, *, static: Any = None, viscous: Any = 0.0,
    name: str = "friction",
) -> Any:  # fmt: skip
    """F = coulomb sgn(v) + viscous v, and at v = 0 any force up to `static` (default: coulomb)."""
    slip, drag = _positive(coulomb, name, "coulomb"), as_expression(viscous, f"{name}: viscous")
    radius = 1.0 if static is None else as_expression(static, f"{name}: static") / slip

    def build(name: str, v: Symbol, x: tuple[Symbol, ...]) -> Block:
        return Block(name, (v,), (slip * sign(v) + drag * v,), surfaces=(Surface(name, v, radius=radius),))

    return _static(build, inputs, outputs, name)


@keywords("keyword", error=ModelError)
def backlash(
    inputs: Any, outputs: Any, width: Any = 1.0, *, fastest: Any = 1e3, name: str = "backlash"
) -> Any:
    """Play: the output z stays while |u - z| < width, and is carried along at the edges.

    fastest   more than |u'| ever is: z' = fastest (sgn(u - z - width) + sgn(u - z + width))/2, whose sliding
              on an edge is the play exactly as long as |u'| < fastest; a faster input leaves the edge behind
    """
    w, rate = _positive(width, name, "width"), _positive(fastest, name, "fastest")

    def build(name: str, u: Symbol, x: tuple[Symbol, ...]) -> Block:
        z = x[0]
        move = rate * (sign(u - z - w) + sign(u - z + w)) / 2
        edges = Surface(f"{name}_up", u - z - w), Surface(f"{name}_down", u - z + w)
        return Block(name, (u,), (z,), x, (move,), edges)

    return _with_state(build, inputs, outputs, name, 1)


@keywords("keyword", error=ModelError)
def sample_and_hold(
    inputs: Any, outputs: Any, period: Any, *, start: Any = 0.0, name: str = "hold"
) -> Any:
    """y = u at the last of the times start + k period; before the first after the start its initial state."""

    def build(name: str, u: Symbol, x: tuple[Symbol, ...]) -> Block:
        clock = TimeEvent(name, period=period, start=start, reset={x[0]: u})
        return Block(name, (u,), (x[0],), x, (sympy.S.Zero,), time_events=(clock,))

    return _with_state(build, inputs, outputs, name, 1)


@keywords("keyword", error=ModelError)
def sampled(system: Any, inputs: Any, outputs: Any, *, start: Any = 0.0, name: str = "sampled") -> Any:
    """A sampled linear system of python-control with one input and one output, its output held.

    x+ = A x + B u and y = C x + D u at the times start + k dt; the last state is the output that is held.
    """
    control = control_module()
    if not isinstance(system, control.StateSpace | control.TransferFunction):
        raise ModelError(
            f"{name}: system is {shown(system)}, expected a sampled StateSpace or TransferFunction of "
            "python-control: control.tf([0.5], [1, -0.5], dt=0.1)."
        )
    plant = control.ss(system)
    period = plant.dt
    if period in (None, 0, True) or plant.ninputs != 1 or plant.noutputs != 1:
        raise ModelError(
            f"{name}: expected a sampled system (dt > 0) with one input and one output, got dt = {period}, "
            f"{plant.ninputs} inputs and {plant.noutputs} outputs."
        )

    def build(name: str, u: Symbol, x: tuple[Symbol, ...]) -> Block:
        inner = sympy.Matrix(x[:-1]) if plant.nstates else sympy.zeros(0, 1)
        after = _numbers(plant.A) * inner + _numbers(plant.B) * u
        held = (_numbers(plant.C) * inner)[0] if plant.nstates else sympy.S.Zero
        reset = {**dict(zip(x[:-1], after, strict=True)), x[-1]: held + float(plant.D[0, 0]) * u}
        clock = TimeEvent(name, period=float(period), start=start, reset=reset)
        return Block(name, (u,), (x[-1],), x, (sympy.S.Zero,) * len(x), time_events=(clock,))

    return _with_state(build, inputs, outputs, name, plant.nstates + 1)


def _numbers(matrix: Any) -> sympy.Matrix:
    return sympy.Matrix([[float(q) for q in row] for row in np.asarray(matrix)])


def _positive(value: Any, name: str, what: str) -> Expr:
    e = as_expression(value, f"{name}: {what}")
    if e.is_number and not e.is_positive:
        raise ModelError(f"{name}: {what} is {value}, expected a number > 0.")
    return e


def _signals(inputs: Any, outputs: Any, name: str) -> None:
    """Refuse what are not the names of one signal that goes in and one that comes out."""
    for what, value in (("inputs", inputs), ("outputs", outputs)):
        held = value if isinstance(value, list | tuple) else [value]
        if len(held) != 1 or not isinstance(held[0], str):
            raise ModelError(
                f"{name}: {what} is {shown(value)}, expected the name of one signal, as in "
                "relay('error', 'command', 1.0). Values in a diagram come from its blocks and inputs."
            )


def _static(build: Build, inputs: Any, outputs: Any, name: str) -> Any:
    _signals(inputs, outputs, name)
    u = Symbol("u", real=True)
    block = build(name, u, ())

    def output(t: Any, x: Any, given: Any, params: Any) -> Any:
        return np.array([float(block.outputs[0].subs(u, float(np.atleast_1d(given)[0])))])

    made = control_module().nlsys(None, output, inputs=inputs, outputs=outputs, name=name)
    made.filippov = build
    return made


def _with_state(build: Build, inputs: Any, outputs: Any, name: str, count: int) -> Any:
    _signals(inputs, outputs, name)

    def refused(t: Any, x: Any, given: Any, params: Any) -> Any:
        raise ModelError(f"block {name!r} has events: simulate it with filippov, from_control(...).")

    made = control_module().nlsys(
        refused, lambda t, x, given, params: np.atleast_1d(x)[-1:], inputs=inputs, outputs=outputs, name=name,
        states=[f"{name}_{k + 1}" for k in range(count)] if count > 1 else [name],
    )  # fmt: skip
    made.filippov = build
    return made
