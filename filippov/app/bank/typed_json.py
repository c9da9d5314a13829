"""Dataclasses from JSON and back, checked by their annotations, and their JSON Schema (draft 2020-12).

Annotations that are understood: str, int, float, bool, Any, Literal, None, unions, tuple[X, ...],
tuple[X, Y], dict[str, X], dataclasses, and families: a class with FAMILY = (key, {tag: dataclass}), of which
the entry `key` of an object says which dataclass it is.
"""

from __future__ import annotations

import dataclasses
import inspect
import types
from collections.abc import Mapping
from contextlib import suppress
from functools import cache
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

from filippov.base.errors import ModelError
from filippov.base.names import check_known, unknown

DRAFT = "https://json-schema.org/draft/2020-12/schema"
_PLAIN = {str: "string", float: "number", int: "integer", bool: "boolean", type(None): "null"}


@cache
def hints(kind: type) -> dict[str, Any]:
    """The annotations of a dataclass's fields, resolved."""
    found = get_type_hints(kind)
    return {field.name: found[field.name] for field in dataclasses.fields(kind)}


def read(kind: Any, data: Any, where: str) -> Any:
    """The value of that type that JSON data stand for. Raises ModelError that names the place."""
    origin, inner = get_origin(kind), get_args(kind)
    if kind is Any:
        return data
    if not _fits(kind, data):
        raise ModelError(f"{where} is {data!r:.60}, expected {in_words(kind)}.")
    if origin in (Union, types.UnionType):
        fitting = [one for one in inner if _fits(one, data)]
        for one in fitting[:-1]:
            with suppress(ModelError):
                return read(one, data, where)
        return read(fitting[-1], data, where)
    if origin is Literal and data not in inner:
        raise ModelError(f"{where}: {unknown('word', data, inner)}")
    if origin is tuple:
        kinds = [inner[0]] * len(data) if inner[-1] is Ellipsis else inner
        if len(kinds) != len(data):
            raise ModelError(f"{where} has {len(data)} entries, expected {len(kinds)}.")
        pairs = enumerate(zip(kinds, data, strict=True))
        return tuple(read(one, item, f"{where}[{k}]") for k, (one, item) in pairs)
    if origin is dict:
        return {key: read(inner[1], value, f"{where}.{key}") for key, value in data.items()}
    if hasattr(kind, "FAMILY"):
        key, members = kind.FAMILY
        if data.get(key) not in members:
            raise ModelError(f"{where}: {unknown(key, data.get(key), members)}")
        return read_fields(members[data[key]], {k: v for k, v in data.items() if k != key}, where)
    return read_fields(kind, data, where) if dataclasses.is_dataclass(kind) else data


def read_fields(kind: Any, data: Mapping[str, Any], where: str) -> Any:
    """The dataclass with these fields. Raises ModelError for one that is unknown, missing or wrong."""
    known = hints(kind)
    check_known(f"key of {where}:", data, known)
    for field in dataclasses.fields(kind):
        if _needed(field) and field.name not in data:
            raise ModelError(f"{where} has no {field.name!r}, expected {in_words(known[field.name])}.")
    return kind(**{name: read(known[name], value, f"{where}.{name}") for name, value in data.items()})


def _needed(field: dataclasses.Field[Any]) -> bool:
    return field.default is field.default_factory is dataclasses.MISSING


def _fits(kind: Any, data: Any) -> bool:
    """Whether data are of the sort of JSON that a type is written as."""
    origin, inner = get_origin(kind), get_args(kind)
    if origin in (Union, types.UnionType):
        return any(_fits(one, data) for one in inner)
    if kind is Any:
        return True
    if origin is Literal:
        return isinstance(data, str)
    if origin is tuple:
        return isinstance(data, list | tuple)
    if origin is dict or hasattr(kind, "FAMILY") or dataclasses.is_dataclass(kind):
        return isinstance(data, Mapping) and all(isinstance(key, str) for key in data)
    if isinstance(data, bool):
        return kind is bool
    return isinstance(data, int | float) if kind is float else isinstance(data, kind)


def in_words(kind: Any) -> str:
    """A type in words."""
    origin, inner = get_origin(kind), get_args(kind)
    if origin in (Union, types.UnionType):
        return " or ".join(in_words(one) for one in inner if one is not type(None))
    if origin is Literal:
        return "one of " + ", ".join(map(repr, inner))
    if origin is tuple:
        return "a list"
    words = {str: "text", float: "a number", int: "a whole number", bool: "true or false", Any: "anything"}
    return words.get(kind, "an object")


def written(value: Any) -> Any:
    """The JSON data of a value; fields that have their defaults are left out."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        fields = [f for f in dataclasses.fields(value) if getattr(value, f.name) not in (f.default, {})]
        tag = {value.FAMILY[0]: getattr(value, "tag", "")} if hasattr(value, "FAMILY") else {}
        return tag | {f.name: written(getattr(value, f.name)) for f in fields}
    if isinstance(value, Mapping):
        return {key: written(item) for key, item in value.items()}
    return [written(item) for item in value] if isinstance(value, list | tuple) else value


def schema(kind: Any, title: str) -> dict[str, Any]:
    """The JSON Schema of a type, with a definition for each dataclass that it names."""
    definitions: dict[str, Any] = {}
    body = _schema(kind, definitions)
    return {"$schema": DRAFT, "title": title, **body, "$defs": dict(sorted(definitions.items()))}


def _schema(kind: Any, found: dict[str, Any]) -> dict[str, Any]:
    origin, inner = get_origin(kind), get_args(kind)
    if kind is Any:
        return {}
    if origin in (Union, types.UnionType):
        return {"anyOf": [_schema(one, found) for one in inner]}
    if origin is Literal:
        return {"enum": list(inner)}
    if origin is tuple and inner[-1] is Ellipsis:
        return {"type": "array", "items": _schema(inner[0], found)}
    if origin is tuple:
        parts = [_schema(one, found) for one in inner]
        return {"type": "array", "prefixItems": parts, "items": False, "minItems": len(parts)}
    if origin is dict:
        return {"type": "object", "additionalProperties": _schema(inner[1], found)}
    if kind in _PLAIN:
        return {"type": _PLAIN[kind]}
    if kind.__name__ not in found:
        found[kind.__name__] = {}
        members = kind.FAMILY[1].values() if "FAMILY" in vars(kind) else ()
        one_of = {"oneOf": [_schema(member, found) for member in members]}
        found[kind.__name__] = one_of if members else _object(kind, found)
    return {"$ref": f"#/$defs/{kind.__name__}"}


def _object(kind: Any, found: dict[str, Any]) -> dict[str, Any]:
    parts = {name: _schema(one, found) for name, one in hints(kind).items()}
    needed = [f.name for f in dataclasses.fields(kind) if _needed(f)]
    if hasattr(kind, "FAMILY"):
        key = kind.FAMILY[0]
        parts, needed = {key: {"const": kind.tag}, **parts}, [key, *needed]
    text = (inspect.getdoc(kind) or "").strip()
    return {
        "type": "object", "description": text, "properties": parts, "required": needed,
        "additionalProperties": False,
    }  # fmt: skip
