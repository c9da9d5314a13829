"""The present piece of every input in the context of a run, and how kernels read it.

A piece is c0 + c1 u + c2 u^2 + c3 u^3 with u = t - b. What drives the loop writes b and the coefficients, as
bits, behind the addresses that the context begins with; the source of a unit does not depend on the samples.
"""

from __future__ import annotations

import math
from typing import Any

from filippov.model.signals.samples import ORDERS, ROOM

# Behind the addresses and times of `callback.new_context`.
FIRST = 8
EACH = 1 + ROOM


def input_text(place: int, kind: str, order: int) -> str:
    """Source of the derivative of an order of the input in a place, by Horner's rule."""
    at = FIRST + EACH * place
    parts = []
    for power in range(order, ORDERS[kind]):
        name, factor = f"from_bits(ctx[{at + 1 + power}])", float(math.perm(power, order))
        parts.append(name if factor == 1.0 else f"({factor!r} * {name})")
    text = parts.pop()
    while parts:
        text = f"({parts.pop()} + (t - from_bits(ctx[{at}])) * {text})"
    return text


def places(inputs: Any) -> dict[str, int]:
    """The place of each input by name."""
    return {samples.name: k for k, samples in enumerate(inputs)}
