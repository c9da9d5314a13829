"""What a program finds outside itself: numbers become parameters, what changes between calls is a memory."""

from __future__ import annotations

import enum
import keyword
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy
from sympy import Symbol

from filippov.analysis.programs.choice import is_number


@dataclass(frozen=True)
class Outside:
    """A container or object of the live program, with the text by which the source calls it."""

    value: Any
    label: str

    def __len__(self) -> int:
        return len(self.value)


class Parameters:
    """Numbers that a program reads, as symbols with names and values."""

    def __init__(self) -> None:
        self.values: dict[Symbol, float] = {}
        self.names: dict[Symbol, str] = {}
        self.unnamed: set[Symbol] = set()
        self._known: dict[tuple[str, float], Symbol] = {}

    def symbol(self, label: str, value: Any) -> Any:
        """The symbol of a number that the source calls by a label such as "k", "self.k" or 'p["k"]'."""
        number = float(value)
        if not math.isfinite(number):
            return number
        key = (label, number)
        if key not in self._known:
            words = "".join(c if c.isalnum() or c == "_" else " " for c in label).split() or ["value"]
            last = words[-1]
            if last.isdigit() and len(words) > 1:
                last = f"{words[-2]}_{last}"
            symbol = sympy.Dummy(last, real=True)
            self._known[key] = symbol
            self.values[symbol], self.names[symbol] = number, last
            if label.endswith("]") and "'" not in label:
                self.unnamed.add(symbol)
        return self._known[key]

    def name(self, symbol: Any, name: str) -> None:
        """Call a parameter by the name to which it is assigned, where it has none of its own."""
        if symbol in self.unnamed:
            self.names[symbol] = name
            self.unnamed.discard(symbol)

    def fixed(self, value: Any) -> float | None:
        """The number of a value that depends on parameters alone, else None."""
        if is_number(value):
            return float(value)
        if not isinstance(value, sympy.Basic) or not value.free_symbols <= self.values.keys():
            return None
        try:
            return float(value.xreplace({q: sympy.Float(v, 17) for q, v in self.values.items()}))
        except TypeError:
            return None

    def inside(self, value: Any, label: str) -> Any:
        """A live value as one of the reader: numbers as symbols, containers and objects as they are."""
        if isinstance(value, (bool, np.bool_)):
            return bool(value)
        if isinstance(value, enum.Enum):
            return value
        if is_number(value):
            return self.symbol(label, value)
        if value is None or isinstance(value, (str, sympy.Basic)) or callable(value):
            return value
        if isinstance(value, np.ndarray) and value.ndim == 0:
            return self.symbol(label, value)
        if isinstance(value, type(math)):
            return value
        return Outside(value, label)


def opened(value: Any, parameters: Parameters) -> Any:
    """A container of the live program as one of the reader: arrays keep their numbers."""
    if not isinstance(value, Outside):
        return value
    held, label = value.value, value.label
    if isinstance(held, np.ndarray):
        return np.array(held.astype(float).tolist(), dtype=object).reshape(held.shape)
    if isinstance(held, Mapping):
        return {k: opened(parameters.inside(v, f"{label}[{k!r}]"), parameters) for k, v in held.items()}
    if isinstance(held, (list, tuple, range)):
        items = [opened(parameters.inside(v, f"{label}[{i}]"), parameters) for i, v in enumerate(held)]
        return items if isinstance(held, list) else tuple(items)
    return value


def unique(wanted: Mapping[Symbol, str], taken: set[str]) -> dict[Symbol, str]:
    """Names that are different, are identifiers, and are not taken."""
    out: dict[Symbol, str] = {}
    used = set(taken)
    for symbol, name in wanted.items():
        base = name if name.isidentifier() and not keyword.iskeyword(name) else f"q_{name}".replace("-", "_")
        base = base.lstrip("_") or "q"
        chosen, number = base, 2
        while chosen in used:
            chosen, number = f"{base}_{number}", number + 1
        out[symbol] = chosen
        used.add(chosen)
    return out
