"""Constructs that machine code would execute differently from Python: refused by file and line.

The translator checks types (`translate`); here is what the syntax tree shows: names that may be unset, a path
without a return, loops over anything but a range, operators and arguments that the language lacks.
"""

from __future__ import annotations

import ast
from collections import Counter
from collections.abc import Iterable, Sequence

from filippov.kernel.language.primitives import KernelError

_OPERATORS = (
    ast.Add, ast.Sub, ast.Mult, ast.Div, ast.FloorDiv, ast.Mod, ast.Pow, ast.LShift, ast.RShift, ast.BitAnd,
    ast.BitOr,
)  # fmt: skip
_STATEMENTS = (
    ast.Assign, ast.AugAssign, ast.Expr, ast.Pass, ast.Return, ast.If, ast.While, ast.For, ast.Break,
    ast.Continue,
)  # fmt: skip
# Nodes that need no check.
_NOTHING = (ast.Constant, ast.Load, ast.Store, ast.arguments, ast.arg, *_OPERATORS)
# Nodes with nothing in them that is checked.
_LEAVES = frozenset((ast.Name, ast.Constant, ast.Load, ast.Store, *_OPERATORS))
_COMPARISONS = (ast.Lt, ast.LtE, ast.Gt, ast.GtE, ast.Eq, ast.NotEq)


def check_kernel(node: ast.FunctionDef, file: str) -> frozenset[str]:
    """The names bound by more than one statement of this function; loop variables are excluded.

    Raises KernelError where the function leaves the language.
    """
    parts = [part for part in _parts(node) if type(part) not in _NOTHING]
    checked = _Checked(node, file, parts)
    checked.signature()
    for part in parts:
        if type(part) is not ast.Name:
            checked.part(part)
    known = {argument.arg for argument in node.args.args}
    after = checked.block(node.body, known)
    returns = node.returns is not None and not (
        isinstance(node.returns, ast.Constant) and node.returns.value is None
    )
    if returns and after is not None:
        raise checked.fail(node, "a path through it ends without a return")
    return _changing(known, parts)


def _changing(arguments: Iterable[str], parts: Sequence[ast.AST]) -> frozenset[str]:
    bound = Counter(arguments)
    bound.update(part.id for part in parts if isinstance(part, ast.Name) and isinstance(part.ctx, ast.Store))
    runs = Counter(
        part.target.id for part in parts if isinstance(part, ast.For) and isinstance(part.target, ast.Name)
    )
    return frozenset(name for name, times in bound.items() if times > runs.get(name, 1))


def _parts(node: ast.AST) -> list[ast.AST]:
    """The nodes of a tree, as `ast.walk` gives them but for contexts of names, in a fifth of its time."""
    found = [node]
    for part in found:
        if type(part) in _LEAVES:
            continue
        for name in part._fields:
            value = getattr(part, name, None)
            if isinstance(value, ast.AST):
                found.append(value)
            elif isinstance(value, list):
                found += [item for item in value if isinstance(item, ast.AST)]
    return found


class _Checked:
    """One function; sets of names are those that are bound on every path, None where no path leads on."""

    def __init__(self, node: ast.FunctionDef, file: str, parts: Sequence[ast.AST]) -> None:
        self.node, self.file = node, file
        self.breaks: list[list[set[str]]] = []
        self.local = {
            name.id for name in parts if isinstance(name, ast.Name) and isinstance(name.ctx, ast.Store)
        } | {argument.arg for argument in node.args.args}

    def fail(self, node: ast.AST, why: str) -> KernelError:
        return KernelError(f"{self.file}:{getattr(node, 'lineno', '?')}: kernel {self.node.name}: {why}")

    # Single nodes

    def signature(self) -> None:
        a = self.node.args
        if a.posonlyargs or a.kwonlyargs or a.vararg or a.kwarg or a.defaults:
            raise self.fail(self.node, "parameters are plain: no defaults, no *, no keyword-only ones")
        if any(argument.annotation is None for argument in a.args):
            raise self.fail(self.node, "every parameter is annotated")

    def part(self, node: ast.AST) -> None:
        """Refuse an operator, a call or a loop that compiled code would interpret differently."""
        if isinstance(node, ast.stmt) and node is not self.node and not isinstance(node, _STATEMENTS):
            raise self.fail(node, f"{type(node).__name__} is not part of the kernel language")
        if isinstance(node, ast.BinOp | ast.AugAssign) and not isinstance(node.op, _OPERATORS):
            raise self.fail(node, f"the operator {type(node.op).__name__} is not part of the kernel language")
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Invert):
            raise self.fail(node, "~ is not part of the kernel language; write `not` of a condition")
        if isinstance(node, ast.Compare) and not all(isinstance(op, _COMPARISONS) for op in node.ops):
            raise self.fail(node, "`is` and `in` are not part of the kernel language; compare numbers")
        if isinstance(node, ast.Call):
            if node.keywords or any(isinstance(a, ast.Starred) for a in node.args):
                raise self.fail(node, "arguments are given by position, without names and stars")
            if isinstance(node.func, ast.Name) and node.func.id in self.local:
                raise self.fail(node, f"{node.func.id} is a number here, not a function")
        if isinstance(node, ast.For | ast.While) and node.orelse:
            raise self.fail(node, "loops have no else")
        if isinstance(node, ast.For):
            self._range(node)

    def _range(self, node: ast.For) -> None:
        call = node.iter
        if not (isinstance(call, ast.Call) and isinstance(call.func, ast.Name) and call.func.id == "range"):
            raise self.fail(node, "loops run over range(...)")
        if not isinstance(node.target, ast.Name):
            raise self.fail(node, "a loop has one variable")
        if not 1 <= len(call.args) <= 3:
            raise self.fail(node, "range takes one to three numbers")
        if len(call.args) == 3 and not step_of(call.args[2]):
            raise self.fail(node, "the step of a range is a whole number that stands there, not 0")

    # Names on the paths through it

    def block(self, statements: Sequence[ast.stmt], known: set[str]) -> set[str] | None:
        """The names bound after these statements, or None where their end is never reached."""
        now: set[str] | None = set(known)
        for statement in statements:
            if now is None:
                return None  # unreachable
            now = self._after(statement, now)
        return now

    def _after(self, node: ast.stmt, known: set[str]) -> set[str] | None:
        if isinstance(node, ast.If):
            self._read(node.test, known)
            branches = [self.block(node.body, known), self.block(node.orelse, known)]
            left = [names for names in branches if names is not None]
            return set.intersection(*left) if left else None
        if isinstance(node, ast.While):
            self._read(node.test, known)
            ends = self._loop(node.body, known)
            if isinstance(node.test, ast.Constant) and node.test.value is True:
                return set.intersection(*ends) if ends else None
            return known
        if isinstance(node, ast.For):
            self._read(node.iter, known)
            assert isinstance(node.target, ast.Name)
            self._loop(node.body, known | {node.target.id})
            # In Python it keeps its last value, in compiled code it is one further.
            return known - {node.target.id}
        if isinstance(node, ast.Return | ast.Break | ast.Continue):
            self._read(node, known)
            if isinstance(node, ast.Break):
                self.breaks[-1].append(known)
            return None
        self._read(node, known)
        return known | set(_bound(node))

    def _loop(self, body: Sequence[ast.stmt], known: set[str]) -> list[set[str]]:
        """The names bound at each break of a loop."""
        self.breaks.append([])
        self.block(body, known)
        return self.breaks.pop()

    def _read(self, node: ast.AST, known: set[str]) -> None:
        for name in _parts(node):
            if isinstance(name, ast.Name) and isinstance(name.ctx, ast.Load):
                self._bound_here(name, known)
        if isinstance(node, ast.AugAssign) and isinstance(node.target, ast.Name):
            self._bound_here(node.target, known)

    def _bound_here(self, name: ast.Name, known: set[str]) -> None:
        if name.id in self.local and name.id not in known:
            raise self.fail(name, f"{name.id} may be unset here, or is the variable of a loop that has ended")


def _bound(node: ast.AST) -> Iterable[str]:
    return (n.id for n in _parts(node) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store))


def step_of(node: ast.expr) -> int:
    """The step of a range written as an integer constant; 0 for any other."""
    sign = 1
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        sign, node = -1, node.operand
    if isinstance(node, ast.Constant) and type(node.value) is int:
        return sign * node.value
    return 0
