"""Expressions of a program, from syntax tree to values (see `choice`)."""

from __future__ import annotations

import ast
import enum
import operator
import types
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
import sympy
from sympy import And, Expr, Not, Or

from filippov.analysis.programs.arrays import Arrays, Chosen, Mask
from filippov.analysis.programs.choice import (
    Choice,
    Nothing,
    as_number,
    elementwise,
    is_condition,
    is_number,
    plain,
)
from filippov.analysis.programs.notes import Again, Memory, ReadingError, Site
from filippov.analysis.programs.outside import Outside, Parameters, opened
from filippov.analysis.programs.source import Source

_BINARY: dict[type, Callable[[Any, Any], Any]] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv,
    ast.Pow: operator.pow,
}  # fmt: skip
_BITWISE: dict[type, str] = {ast.BitAnd: "all_of", ast.BitOr: "any_of"}
_COMPARE: dict[type, str] = {
    ast.Lt: "<",
    ast.LtE: "<=",
    ast.Gt: ">",
    ast.GtE: ">=",
    ast.Eq: "==",
    ast.NotEq: "!=",
}


RECORD = "What the field needs of the past is a state, or a reset that keeps it"


class Closure:
    """A function or lambda defined within the program."""

    def __init__(self, node: ast.FunctionDef | ast.Lambda, source: Source, scopes: tuple[int, ...]) -> None:
        self.node, self.source, self.scopes = node, source, scopes


class Method:
    """An attribute of a value that is called."""

    def __init__(self, owner: Any, name: str) -> None:
        self.owner, self.name = owner, name


class Expressions(Arrays):
    """Part of the reader: values of expressions in the present state of the program."""

    parameters: Parameters
    sites: list[Site]
    memories: dict[tuple[Any, ...], Memory]
    logs: set[int]
    frames: dict[int, dict[str, Any]]
    remembered: dict[tuple[Any, ...], Any]
    source: Source
    scopes: tuple[int, ...]

    def call(self, node: ast.AST, function: Any, args: list[Any], named: dict[str, Any]) -> Any:
        """The value of a call."""
        raise NotImplementedError

    def memory(self, key: tuple[Any, ...]) -> Memory | None:
        """What is remembered under a key, if it is."""
        return self.memories.get(key)

    # -- names ---------------------------------------------------------------------------------------------

    def value(self, node: ast.expr) -> Any:
        """The value of an expression."""
        method = getattr(self, f"_{type(node).__name__}", None)
        if method is None:
            raise self.fail(node, f"{type(node).__name__} is not followed")
        try:
            return method(node)
        except (ReadingError, Again):
            raise
        except Exception as error:  # noqa: BLE001  (numbers of the program go through any function)
            raise self.fail(node, f"{type(error).__name__}: {str(error).rstrip('.')}") from None

    def _Constant(self, node: ast.Constant) -> Any:
        if isinstance(node.value, complex):
            raise self.fail(node, "complex numbers are not followed")
        return node.value

    def _JoinedStr(self, node: ast.JoinedStr) -> Any:
        del node
        return "text"

    def _Name(self, node: ast.Name) -> Any:
        for number in reversed(self.scopes):
            if node.id in self.frames[number]:
                found = self.frames[number][node.id]
                if isinstance(found, Nothing):
                    raise self.fail(node, f"{node.id!r} is not set on every path that leads here")
                return found
        return self.free(node, node.id)

    def free(self, node: ast.AST, name: str) -> Any:
        """The value of a name that is not the program's own."""
        holder, key = self.holder(name)
        if (kept := self.recalled(holder, key)) is not None:
            return kept
        try:
            value = self.source.outside(name)
        except (KeyError, ValueError):
            raise self.fail(node, f"there is no {name!r}") from None
        return self.parameters.inside(value, name)

    def holder(self, name: str) -> tuple[Any, Any]:
        """Where a free name is kept, and under which key: the globals, or the cell of a closure."""
        live = self.source.function
        if name in live.__code__.co_freevars and live.__closure__:
            return live.__closure__[live.__code__.co_freevars.index(name)], None
        return live.__globals__, name

    def recalled(self, holder: Any, key: Any) -> Any:
        """The symbol of a memory; None where it is none."""
        memory = self.memory((id(holder), key))
        return None if memory is None else memory.symbol

    # -- containers ----------------------------------------------------------------------------------------

    def _Attribute(self, node: ast.Attribute) -> Any:
        owner = self.value(node.value)
        return self.attribute(node, owner, node.attr, self.source.text(node))

    def attribute(self, node: ast.AST, owner: Any, name: str, label: str) -> Any:
        """owner.name."""
        held = owner.value if isinstance(owner, Outside) else owner
        if isinstance(held, types.ModuleType):
            found = getattr(held, name)
            if held.__name__ in {"math", "numpy"} and name in {"pi", "e", "tau"}:
                return {"pi": sympy.pi, "e": sympy.E, "tau": 2 * sympy.pi}[name]
            return found if held.__name__ in {"math", "numpy"} else self.parameters.inside(found, label)
        if isinstance(held, np.ndarray) and name in {"T", "size", "shape", "ndim"}:
            return getattr(opened(owner, self.parameters), name)
        if isinstance(held, (np.ndarray, list, tuple, dict, Expr, str)) and not hasattr(held, "_fields"):
            return Method(owner, name)
        if isinstance(held, (Closure, Nothing)) or not hasattr(held, name):
            raise self.fail(node, f"there is no {name!r}")
        if (kept := self.recalled(held, name)) is not None:
            return kept
        kind = getattr(type(held), name, None)
        if isinstance(kind, property) and kind.fget is not None:
            return self.call(node, kind.fget, [owner], {})
        found = getattr(held, name)
        return found if isinstance(found, types.MethodType) else self.parameters.inside(found, label)

    def _Subscript(self, node: ast.Subscript) -> Any:
        owner = self.value(node.value)
        if owner is np.r_:
            return self._row(node)
        key = self.key(node.slice)
        label = self.source.text(node)
        if isinstance(owner, Outside) and isinstance(key, (Chosen, Mask)):
            if id(owner.value) in self.logs or any(id(owner.value) == place[0] for place in self.memories):
                raise self.fail(node, f"it reads {owner.label}, which it changes, where the state says")
            owner = opened(owner, self.parameters)
        if isinstance(key, (Chosen, Mask)):
            return self.entry(node, owner, key)
        if isinstance(owner, Outside):
            if id(owner.value) in self.logs:
                raise self.fail(
                    node, f"it reads {owner.label}, in which it keeps a record: a memory. {RECORD}"
                )
            if not isinstance(key, slice) and (kept := self.recalled(owner.value, key)) is not None:
                return kept
            owner_value = owner.value
            if isinstance(owner_value, np.ndarray):
                owner_value = owner_value.astype(float)
            try:
                found = owner_value[key]
            except (KeyError, IndexError, TypeError) as error:
                raise self.fail(node, f"{type(error).__name__} {error}") from None
            inside = self.parameters.inside(found, label)
            return opened(inside, self.parameters) if isinstance(key, slice) else inside
        try:
            return owner[key]
        except (KeyError, IndexError, TypeError) as error:
            raise self.fail(node, f"{type(error).__name__}: {error}") from None

    def _row(self, node: ast.Subscript) -> Any:
        """np.r_[...] of numbers and arrays."""
        parts = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
        if any(isinstance(part, (ast.Slice, ast.Constant)) for part in parts):
            raise self.fail(node, "np.r_ is followed for arrays and names; write np.concatenate")
        values = [opened(self.value(part), self.parameters) for part in parts]
        return np.concatenate([np.asarray(value, dtype=object).reshape(-1) for value in values])

    def key(self, node: ast.expr) -> Any:
        """An index, a slice or a tuple of them, in whole numbers; the key of a dict."""
        if isinstance(node, ast.Slice):
            ends = [None if part is None else self.key(part) for part in (node.lower, node.upper, node.step)]
            return slice(*ends)
        if isinstance(node, ast.Tuple):
            parts = tuple(self.key(part) for part in node.elts)
            if any(isinstance(part, (Chosen, Mask)) for part in parts):
                raise self.fail(node, "an index that depends on the state chooses; write it with conditions")
            return parts
        found = opened(self.value(node), self.parameters)
        if isinstance(found, (str, enum.Enum, slice, bool, type(None), type(...))):
            return found
        if isinstance(found, (list, np.ndarray)):
            entries = [plain(part) for part in np.ravel(np.asarray(found, dtype=object)).tolist()]
            if all(isinstance(part, (bool, np.bool_)) for part in entries):
                return np.array(found, dtype=bool)
            wholes = [self.whole_number(node, part) for part in entries]
            if None not in wholes:
                return np.array(wholes, dtype=int).reshape(np.shape(found))
            return Mask(np.asarray(found, dtype=object))
        if isinstance(found, Nothing):
            raise self.fail(node, "an index that not every path sets")
        if isinstance(found, Choice):
            return Chosen(found)
        whole = self.whole_number(node, found)
        return Chosen(found) if whole is None else whole

    def whole_number(self, node: ast.AST, value: Any) -> int | None:
        """The value as a whole number, None where the state decides."""
        del node
        number = self.fixed(value)
        return None if number is None or number != round(number) else int(number)

    def items(self, node: ast.AST, value: Any) -> list[Any]:
        """What an iteration over a value gives."""
        value = opened(value, self.parameters)
        if isinstance(value, (list, tuple, range, dict, np.ndarray, zip, enumerate, reversed)):
            return list(value)
        if isinstance(value, Iterable) and not isinstance(value, sympy.Basic):
            return list(value)
        raise self.fail(node, "an iteration over what is no list, array or range")

    def _Tuple(self, node: ast.Tuple) -> Any:
        return tuple(self._elements(node.elts))

    def _Set(self, node: ast.Set) -> Any:
        return tuple(dict.fromkeys(self._elements(node.elts)))

    def _List(self, node: ast.List) -> Any:
        return self._elements(node.elts)

    def _elements(self, nodes: list[ast.expr]) -> list[Any]:
        out: list[Any] = []
        for part in nodes:
            if isinstance(part, ast.Starred):
                out += self.items(part, self.value(part.value))
            else:
                out.append(self.value(part))
        return out

    def _Dict(self, node: ast.Dict) -> Any:
        if any(key is None for key in node.keys):
            raise self.fail(node, "** in a dict is not followed")
        return {self.value(k): self.value(v) for k, v in zip(node.keys, node.values, strict=True) if k}

    def _ListComp(self, node: ast.ListComp | ast.GeneratorExp) -> Any:
        out: list[Any] = []

        def level(k: int) -> None:
            if k == len(node.generators):
                out.append(self.value(node.elt))
                return
            part = node.generators[k]
            for item in self.items(part.iter, self.value(part.iter)):
                self.assign(part.target, item)
                kept = [self.truth(test, self.value(test)) for test in part.ifs]
                if not all(isinstance(k, bool) for k in kept):
                    raise self.fail(node, "a list whose length depends on the state is not followed")
                if all(kept):
                    level(k + 1)

        level(0)
        return out

    _GeneratorExp = _ListComp

    def assign(self, target: ast.expr, value: Any) -> None:
        """Give a value to names, attributes and items."""
        raise NotImplementedError

    # -- operations ----------------------------------------------------------------------------------------

    def _BinOp(self, node: ast.BinOp) -> Any:
        return self.binary(node, node.op, self.value(node.left), self.value(node.right))

    def binary(self, node: ast.AST, op: ast.operator, a: Any, b: Any) -> Any:
        """An operation with two operands."""
        a, b = opened(a, self.parameters), opened(b, self.parameters)
        if isinstance(op, ast.Mod):
            return "text" if isinstance(a, str) else self.mod(node, a, b)
        if isinstance(op, ast.FloorDiv):
            return self.divided(node, a, b)
        if isinstance(op, ast.MatMult):
            return np.asarray(np.dot(a, b), dtype=object)[()]
        if type(op) in _BITWISE:
            return elementwise(lambda u, v: getattr(self, _BITWISE[type(op)])(node, u, v), a, b)
        if type(op) not in _BINARY:
            raise self.fail(node, f"the operator {type(op).__name__} is not followed")
        if isinstance(a, (list, tuple)) or isinstance(b, (list, tuple)):
            return self._sequences(node, op, a, b)
        if isinstance(a, str) or isinstance(b, str):
            return "text"
        for operand in (a, b):
            if (
                not isinstance(operand, (np.ndarray, Expr))
                and not is_number(operand)
                and not is_condition(operand)
            ):
                raise self.fail(node, f"arithmetic with {type(operand).__name__} is not followed")

        def one(u: Any, v: Any) -> Any:
            if is_condition(u) and is_condition(v) and not isinstance(op, ast.Mult):
                raise self.fail(
                    node, "arithmetic with two conditions means one thing for Python's bool and another for "
                    "numpy's, whose sum is an or; write int(...) of each"
                )  # fmt: skip
            u, v = as_number(u), as_number(v)
            if isinstance(op, ast.Pow):
                return self.power(node, u, v)
            if isinstance(op, ast.Div) and is_number(v) and v == 0:
                raise self.fail(node, "a division by zero")
            return _BINARY[type(op)](u, v)

        return elementwise(one, a, b)

    def _sequences(self, node: ast.AST, op: ast.operator, a: Any, b: Any) -> Any:
        if isinstance(a, np.ndarray) or isinstance(b, np.ndarray):
            first, second = (np.asarray(v, dtype=object) for v in (a, b))
            return self.binary(node, op, first, second)
        if isinstance(op, ast.Add) and type(a) is type(b):
            return a + b
        count = self.whole_number(node, b if isinstance(a, (list, tuple)) else a)
        if isinstance(op, ast.Mult) and count is not None:
            return (a if isinstance(a, (list, tuple)) else b) * count
        raise self.fail(node, "arithmetic with a list; make it an array first")

    def power(self, node: ast.AST, base: Any, exponent: Any) -> Any:
        """base**exponent; a whole exponent is put in as a number."""
        if is_number(base) and is_number(exponent):
            return base**exponent
        whole = self.whole_number(node, exponent)
        out = base ** (exponent if whole is None else whole)
        if isinstance(out, Expr) and out.has(sympy.Abs) and not base.has(sympy.Abs):
            self.site(node, "abs", next(iter(out.atoms(sympy.Abs))).args[0])
        return out

    def _UnaryOp(self, node: ast.UnaryOp) -> Any:
        value = opened(self.value(node.operand), self.parameters)
        if isinstance(node.op, (ast.Not, ast.Invert)):
            return self.negated(node, value)
        if isinstance(node.op, ast.USub):
            return elementwise(lambda v: -as_number(v), value)
        return value

    def _BoolOp(self, node: ast.BoolOp) -> Any:
        return self._in_order(node.values, isinstance(node.op, ast.And))

    def _in_order(self, items: Sequence[ast.expr], both: bool) -> Any:
        """What `and` (`both`) or `or` gives: the first value that decides, else the last."""
        value = self.value(items[0])
        held = self.truth(items[0], value)
        if len(items) == 1 or (isinstance(held, bool) and held != both):
            return value
        rest = self._in_order(items[1:], both)
        if isinstance(held, bool):
            return rest
        if isinstance(rest, (bool, np.bool_)) or is_condition(rest) or rest in self.flags.symbols:
            return plain((And if both else Or)(held, rest))
        decided = (not both) if is_condition(value) else value
        return self.flags.choose(held, *((rest, decided) if both else (decided, rest)))

    def _Compare(self, node: ast.Compare) -> Any:
        values = [self.value(node.left), *(self.value(part) for part in node.comparators)]
        held = [
            self._one_compare(node, op, a, b) for op, a, b in zip(node.ops, values, values[1:], strict=False)
        ]
        return held[0] if len(held) == 1 else self.all_of(node, *held)

    def _one_compare(self, node: ast.Compare, op: ast.cmpop, a: Any, b: Any) -> Any:
        if isinstance(op, (ast.Is, ast.IsNot)):
            if isinstance(b, bool) and a in self.flags.symbols:
                return a if b == isinstance(op, ast.Is) else Not(a)
            if isinstance(a, Choice) or isinstance(b, Choice):
                return self.compare(node, "==" if isinstance(op, ast.Is) else "!=", a, b)
            same = a is b or (isinstance(a, (bool, str)) and type(a) is type(b) and a == b)
            return same == isinstance(op, ast.Is)
        if isinstance(op, (ast.In, ast.NotIn)):
            found = self.any_of(node, *(self.compare(node, "==", a, v) for v in self.items(node, b)), False)
            return self.negated(node, found) if isinstance(op, ast.NotIn) else found
        a, b = opened(a, self.parameters), opened(b, self.parameters)
        return elementwise(lambda u, v: self.compare(node, _COMPARE[type(op)], u, v), a, b)

    def _IfExp(self, node: ast.IfExp) -> Any:
        held = self.truth(node.test, self.value(node.test))
        if isinstance(held, bool):
            return self.value(node.body if held else node.orelse)
        return self.flags.choose(held, self.value(node.body), self.value(node.orelse))

    def _Lambda(self, node: ast.Lambda) -> Any:
        return Closure(node, self.source, self.scopes)

    def _NamedExpr(self, node: ast.NamedExpr) -> Any:
        value = self.value(node.value)
        self.assign(node.target, value)
        return value
