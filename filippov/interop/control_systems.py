"""Systems from python-control: linear ones, nonlinear ones, and interconnections.

Needs the extra `filippov[control]`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import Any

import numpy as np
import sympy
from sympy import Expr, Symbol

from filippov.base.errors import ModelError
from filippov.base.keywords import keywords
from filippov.base.names import check_known
from filippov.interop.asked import Asked, Params
from filippov.interop.control_blocks import control_module
from filippov.interop.wiring import Block, identifier, wired
from filippov.model.check import as_expression
from filippov.model.system import System


@keywords("keyword", error=ModelError)
def from_control(system: Any, inputs: Mapping[str, Any] | None = None) -> System:
    """The system that an object of python-control describes, its outputs as outputs.

    system   StateSpace or TransferFunction in continuous time, nlsys, or what control.interconnect made of
             such and of the blocks of `filippov.interop`
    inputs   by label, for all of its inputs: numbers or expressions (an Input, a parameter, sin(t))

    Functions of nlsys are called with symbols: arithmetic and functions of numpy are understood, `if` is
    refused. Numbers in params of nlsys and interconnect are parameters under their names, block_name where a
    state or an output has it; those that the functions ask for with if or ==, and what is no
    number, keep their values. States are named by their labels, plant_x0 for "x[0]" of "plant" where another
    has the same. Raises ModelError.
    """
    control = control_module()
    if not isinstance(system, control.InputOutputSystem):
        raise ModelError(
            f"from_control was given {type(system).__name__}, expected a system of python-control."
        )
    if not isinstance(system, control.InterconnectedSystem):
        system = _linear(system, control)
        given = _given(system, inputs)
        (block,) = _blocks([system], control, given, {})
        sources = dict(zip(block.inputs, given, strict=True))
        named = zip(map(identifier, system.output_labels), block.outputs, strict=True)
        return wired([block], sources, {}, dict(named))
    given = _given(system, inputs)
    blocks = _blocks(system.syslist, control, given, system.params)
    wires = [q for block in blocks for q in block.inputs]
    ends = [
        Symbol(f"{block.name}.y{k}", real=True) for block in blocks for k in range(len(block.outputs))
    ]
    carried = [e for block in blocks for e in block.outputs]
    between, outside = np.asarray(system.connect_map), np.asarray(system.input_map)
    sources = {
        wire: _combined(between[j], ends) + _combined(outside[j], given) for j, wire in enumerate(wires)
    }
    shown = np.asarray(system.output_map)
    outputs = {
        identifier(label): _combined(shown[i], [*ends, *wires])
        for i, label in enumerate(system.output_labels)
    }
    return wired(blocks, sources, dict(zip(ends, carried, strict=True)), outputs)


def _combined(row: Any, items: Any) -> Expr:
    """The sum of items with the weights of a row."""
    return sympy.Add(*(_weight(w) * q for w, q in zip(row, items, strict=False) if w != 0))


def _weight(value: Any) -> Expr:
    number = float(value)
    return sympy.Integer(int(number)) if number.is_integer() else sympy.Float(number)


def _given(system: Any, inputs: Mapping[str, Any] | None) -> list[Expr]:
    named = dict(inputs or {})
    check_known("input", named, list(system.input_labels), ModelError)
    if missing := [label for label in system.input_labels if label not in named]:
        raise ModelError(
            f"nothing is given for the input {missing[0]!r}: from_control(system, inputs="
            f"{{{missing[0]!r}: 0}}), a number or an expression."
        )
    return [as_expression(named[label], f"input {label!r}") for label in system.input_labels]


def _linear(system: Any, control: Any) -> Any:
    """A transfer function as states."""
    if isinstance(system, control.TransferFunction):
        if system.ninputs != 1 or system.noutputs != 1:
            raise ModelError("a transfer matrix: give it as a StateSpace, control.ss(A, B, C, D).")
        return control.ss(system, name=system.name, inputs=system.input_labels, outputs=system.output_labels)
    return system


def _blocks(systems: Any, control: Any, given: list[Expr], params: Mapping[str, Any]) -> list[Block]:
    """The blocks of systems; params: of the diagram, which go before those of its systems."""
    labels = Counter(label for system in systems for label in system.state_labels)
    named = [_states(system, labels, len(systems) > 1) for system in systems]
    used = {q.name for e in given for q in e.free_symbols if isinstance(q, Symbol)} | {"t"}
    shown = {identifier(label) for system in systems for label in system.output_labels}
    found = Params(used.union(shown, *named))
    out = []
    for names, system in zip(named, systems, strict=True):
        if system.dt not in (None, 0):
            raise ModelError(
                f"{system.name!r} is sampled (dt = {system.dt}). In a loop in continuous time it is the "
                "block filippov.interop.sampled(system, ...)."
            )
        x = tuple(Symbol(name, real=True) for name in names)
        u = tuple(Symbol(f"{system.name}.{label}", real=True) for label in system.input_labels)
        name = identifier(system.name)
        if hasattr(system, "filippov"):
            out.append(system.filippov(name, u[0], x))
        elif isinstance(system, control.StateSpace):
            a, b, c, d = (_exact(matrix) for matrix in (system.A, system.B, system.C, system.D))
            state, inputs = sympy.Matrix(len(x), 1, x), sympy.Matrix(len(u), 1, u)
            out.append(Block(name, u, tuple(c * state + d * inputs), x, tuple(a * state + b * inputs)))
        elif isinstance(system, control.InterconnectedSystem):
            raise ModelError(
                f"{system.name!r} is an interconnection inside another one: interconnect all blocks at once."
            )
        elif isinstance(system, control.NonlinearIOSystem):
            out.append(Asked(system, u, x, {**system.params, **params}).block(name, found))
        else:
            raise ModelError(f"{system.name!r} is {type(system).__name__}, which is not understood.")
    return out


def _states(system: Any, labels: Mapping[str, int], several: bool) -> list[str]:
    """The names of the states of a system; labels: how often each label is there."""
    return [
        identifier(label) if labels[label] == 1 and label.isidentifier() else
        identifier(f"{system.name}_{label}" if several else label)
        for label in system.state_labels
    ]  # fmt: skip


def _exact(matrix: Any) -> sympy.Matrix:
    rows = np.asarray(matrix, dtype=float)
    return sympy.Matrix(*rows.shape, [_weight(q) for q in rows.ravel()])

