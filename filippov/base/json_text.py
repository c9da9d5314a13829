"""Data as JSON text: strict JSON, in which every character can be seen."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

from filippov.base.escape import printable


def json_text(data: Any, indent: int = 1) -> str:
    """The document, ended by a line end; characters that cannot be seen are written as \\u001b.

    So no terminal acts on them. Raises ValueError for NaN and infinities, which JSON does not have.
    """
    text = json.dumps(data, ensure_ascii=False, indent=indent, allow_nan=False)
    if not text.replace("\n", "").isprintable():
        # Outside of its strings JSON has no such character but the line end.
        text = "".join(c if c == "\n" or printable(c) == c else _escaped(c) for c in text)
    return text + "\n"


def finite(data: Any) -> Any:
    """The same with null for what is not finite, at any depth; numbers of numpy as those of Python."""
    if isinstance(data, Mapping):
        return {key: finite(value) for key, value in data.items()}
    if isinstance(data, list | tuple):
        return [finite(value) for value in data]
    value = data.item() if hasattr(data, "item") else data
    return value if not isinstance(value, float) or math.isfinite(value) else None


def _escaped(character: str) -> str:
    units = character.encode("utf-16-be", "surrogatepass")
    return "".join(f"\\u{units[k : k + 2].hex()}" for k in range(0, len(units), 2))
