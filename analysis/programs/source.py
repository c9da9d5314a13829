"""The source of a live function: its syntax tree, its file, and what its free names stand for."""

from __future__ import annotations

import ast
import functools
import inspect
import types
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from filippov.base.errors import ModelError

Node = ast.FunctionDef | ast.Lambda


@dataclass(frozen=True)
class Source:
    """A function as it stands in its file.

    node       its syntax tree
    file       the path of its file; lines: the text of that file
    function   the live function, whose globals and closure its names are looked up in
    bound      arguments that come before those of a call: the object of a method, those of functools.partial
    named      arguments that functools.partial gives by name
    """

    node: Node
    file: str
    lines: tuple[str, ...]
    function: types.FunctionType
    bound: tuple[Any, ...] = ()
    named: dict[str, Any] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """The name by which messages call it."""
        return self.function.__qualname__.rpartition("<locals>.")[2]

    def text(self, node: ast.AST) -> str:
        """What stands in the file for a node, on one line."""
        found = ast.get_source_segment("\n".join(self.lines), node) or ast.unparse(node)
        return " ".join(found.split())

    def writes(self) -> str:
        """Where items of the state, its second argument, are assigned to: "line 3 `y[0] = 0`", or ""."""
        names = [a.arg for a in (*self.node.args.posonlyargs, *self.node.args.args)][len(self.bound) :]
        for node in ast.walk(self.node):
            if not isinstance(node, ast.Assign | ast.AugAssign):
                continue
            for target in node.targets if isinstance(node, ast.Assign) else [node.target]:
                whole = target if isinstance(node, ast.AugAssign) else None  # y += ... writes into y as well
                held = target.value if isinstance(target, ast.Subscript) else whole
                if isinstance(held, ast.Name) and held.id in names[1:2]:
                    return f"line {node.lineno} `{self.text(node)}`"
        return ""

    def outside(self, name: str) -> Any:
        """What a free name stands for: a variable around the function, a global, a builtin, or KeyError."""
        code = self.function.__code__
        if name in code.co_freevars and self.function.__closure__ is not None:
            return self.function.__closure__[code.co_freevars.index(name)].cell_contents
        if name in self.function.__globals__:
            return self.function.__globals__[name]
        builtins = self.function.__globals__.get("__builtins__", {})
        return (builtins if isinstance(builtins, dict) else vars(builtins))[name]


def source_of(function: Callable[..., Any]) -> Source:
    """The source of a function, lambda, method, functools.partial or object with __call__.

    Raises ModelError where there is none (built-in functions, text that was run without a file).
    """
    bound: tuple[Any, ...] = ()
    named: dict[str, Any] = {}
    live: Any = function
    while True:
        if isinstance(live, functools._lru_cache_wrapper):  # what it keeps changes no value
            live = live.__wrapped__
        elif isinstance(live, functools.partial):
            bound, named = (*live.args, *bound), {**live.keywords, **named}
            live = live.func
        elif inspect.ismethod(live):
            bound, live = (live.__self__, *bound), live.__func__
        elif hasattr(live, "py_func"):  # compiled by numba: what it was made from
            live = live.py_func
        elif callable(live) and inspect.ismethod(live.__call__):
            live = live.__call__
        else:
            break
    if not isinstance(live, types.FunctionType):
        raise ModelError(f"{function!r} has no source in Python; give a function f(t, y) written in a file.")
    if hasattr(live, "__wrapped__"):
        raise ModelError(
            f"{live.__qualname__} is wrapped by a decorator, whose doing its source does not show. Give the "
            "function inside."
        )
    try:
        lines, _ = inspect.findsource(live)
    except (OSError, TypeError):
        raise ModelError(
            f"the source of {live.__qualname__} cannot be found: it was not read from a file. Put it into "
            "one."
        ) from None
    text = tuple(line.rstrip("\n") for line in lines)
    node = _node(live, ast.parse("".join(lines)))
    return Source(node, inspect.getsourcefile(live) or "", text, live, bound, named)


def _node(live: types.FunctionType, tree: ast.Module) -> Node:
    code = live.__code__
    arguments = code.co_varnames[: code.co_argcount + code.co_kwonlyargcount]
    fitting: list[Node] = []
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef) and node.name == code.co_name:
            first = min([node.lineno, *(d.lineno for d in node.decorator_list)])
        elif isinstance(node, ast.Lambda) and code.co_name == "<lambda>":
            first = node.lineno
        else:
            continue
        names = tuple(a.arg for a in (*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs))
        if first == code.co_firstlineno and names == arguments:
            fitting.append(node)
    if len(fitting) > 1:
        fitting = [node for node in fitting if _holds(node, code)]
    if len(fitting) != 1:
        raise ModelError(
            f"the source of {live.__qualname__} (line {code.co_firstlineno} of "
            f"{Path(code.co_filename).name}) is not what runs: the file was changed since, or several "
            "functions stand on that line. Import it anew, one function per line."
        )
    return fitting[0]


def _holds(node: Node, code: types.CodeType) -> bool:
    """Whether the code of a lambda lies within this node: there may be several on a line."""
    body = node.body if isinstance(node, ast.Lambda) else node
    end = (body.end_lineno, body.end_col_offset)
    places = [(p[0], p[2], p[1], p[3]) for p in code.co_positions() if None not in p and p[1] and p[3]]
    own = [p for p in places if p[0] is not None and p[3] > 0]
    return bool(own) and all(
        (body.lineno, body.col_offset) <= (p[0], p[1]) and (p[2], p[3]) <= end for p in own
    )
