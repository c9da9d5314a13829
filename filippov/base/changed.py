"""A copy of an object with other parts."""

from __future__ import annotations

import copy
from functools import cached_property
from typing import Any, TypeVar

T = TypeVar("T")


def changed(one: T, **parts: Any) -> T:
    """The same with these attributes in place of its own, and without the values of cached properties."""
    other, kind = copy.copy(one), type(one)
    cached = [name for name in vars(other) if isinstance(getattr(kind, name, None), cached_property)]
    for name in cached:
        del vars(other)[name]
    vars(other).update(parts)
    return other
