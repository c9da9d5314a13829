"""Results that tell themselves: in a notebook, and as plain data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any, ClassVar

from filippov.base.escape import markup


class Shown:
    """`_repr_html_`: the text of str(), escaped, in the lines that it has."""

    __slots__ = ()

    def _repr_html_(self) -> str:
        return f"<pre>{markup(self)}</pre>"


class Told(Shown):
    """A dataclass whose fields `to_dict` tells, and `_also`; not `_untold`, nor the labels of its figures."""

    __slots__ = ()
    _also: ClassVar[tuple[str, ...]] = ()
    _untold: ClassVar[tuple[str, ...]] = ()

    def to_dict(self) -> dict[str, Any]:
        """Plain data: numbers, text, lists and dicts; complex numbers as [re, im]."""
        names = [name for name in _names(self) if name not in ("labels", *self._untold)]
        return {name: plain_data(getattr(self, name)) for name in (*names, *self._also)}


def plain_data(value: Any) -> Any:
    """A value, with what is in it, as plain data."""
    if hasattr(value, "to_dict"):
        return value.to_dict()
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, complex):
        return [value.real, value.imag]
    if isinstance(value, Mapping):
        return {name: plain_data(item) for name, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain_data(item) for item in value]
    if is_dataclass(value):
        return {name: plain_data(getattr(value, name)) for name in _names(value)}
    return value


def _names(one: Any) -> list[str]:
    return [field.name for field in fields(one)]
