"""Outputs: quantities of a system by name, as expressions in state, time and parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from filippov.base.errors import ModelError
from filippov.base.names import check_known, check_name
from filippov.base.signature import check_signature
from filippov.base.symbolic_value import is_expression
from filippov.model.check import as_expression, check_expression


def check_outputs(outputs: Any, states: Sequence[str], symbolic: bool) -> dict[str, Any]:
    """Outputs by name: expressions, or functions f(t, x, p, s) of a system of functions. Raises ModelError.
    """
    if outputs is None:
        return {}
    if not isinstance(outputs, Mapping):
        raise ModelError(f"outputs are {outputs!r}, expected a dict from names to expressions.")
    out: dict[str, Any] = {}
    for given, value in outputs.items():
        name = check_name(given, "output")
        if name in states:
            raise ModelError(f"the output {name!r} has the name of a state. Rename the output.")
        where = f"the output {name!r}"
        if symbolic:
            out[name] = as_expression(value, where)
            check_expression(out[name], where)
        elif callable(value) and not is_expression(value):
            check_signature(value, ("t", "x", "p", "s"), where, "a float")
            out[name] = value
        else:
            raise ModelError(
                f"{where} is {value!r}, expected a function f(t, x, p, s) -> float, because the field is a "
                "function."
            )
    return out


def check_labels(labels: Any, known: Sequence[str]) -> dict[str, str]:
    """Labels of axes by name of state, output or input, and "t". Raises ModelError."""
    if labels is None:
        return {}
    if not isinstance(labels, Mapping) or not all(isinstance(text, str) for text in labels.values()):
        raise ModelError(f"labels are {labels!r}, expected texts by name: {{'x': 'position [m]'}}.")
    check_known("label", labels, ("t", *known))
    return dict(labels)
