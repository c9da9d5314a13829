"""The graph of elementary operations behind a set of expressions, for their Taylor coefficients.

Every operation has a recurrence for the coefficient of order k of its result from those of its operands up to
order k (Moore 1966; Jorba & Zou 2005, Experimental Mathematics 14, section 2). Functions whose derivative is
made of themselves become an `integral`, y' = g u', with g another node of the graph.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import sympy
from sympy import Expr, Symbol

from filippov.kernel.codegen.generate import joined
from filippov.model.symbolic import Select

Printer = Callable[[Expr], str]


@dataclass
class Node:
    """One operation: `kind`, operands by number, and text that does not change along the solution.

    kinds   constant (text), leaf (place of the state), time, sum (one factor an operand in `texts`), product,
            quotient, power (exponent in texts), integral (operands u and g; value of order 0 in texts),
            choice (operands a and b; texts the test, in terms of {0}, {1} ...: values of order 0 of `asked`),
            step (value of order 0 in texts, nothing else)
    """

    kind: str
    operands: tuple[int, ...] = ()
    texts: tuple[str, ...] = ()
    asked: tuple[int, ...] = ()
    place: int = 0


@dataclass
class JetGraph:
    """Nodes in an order in which each comes after its operands, but for the g of an integral.

    constant  prints an expression that does not change along the solution
    states, time, given: the symbols that change; `given` are expressions in place of symbols
    """

    constant: Printer
    states: Mapping[Symbol, int]
    time: Symbol
    given: Mapping[Symbol, Expr]
    scaled: Mapping[Symbol, tuple[str, Expr]] = field(default_factory=dict)
    nodes: list[Node] = field(default_factory=list)
    known: dict[Any, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.moving = {*self.states, self.time, *self.given, *self.scaled}

    def add(self, node: Node) -> int:
        """The number of a node, the one there is if it has been made before."""
        key = (node.kind, node.operands, node.texts, node.asked, node.place)
        if key not in self.known:
            self.known[key] = len(self.nodes)
            self.nodes.append(node)
        return self.known[key]

    def number(self, value: float) -> int:
        """A node for a number."""
        return self.add(Node("constant", texts=(repr(float(value)),)))

    def __call__(self, e: Expr) -> int:
        """The node of an expression."""
        if e not in self.known:
            self.known[e] = self._made(e)
        return self.known[e]

    def _made(self, e: Expr) -> int:
        if not e.free_symbols & self.moving:
            return self.add(Node("constant", texts=(self.constant(e),)))
        if e.is_Symbol:
            return self._symbol(e)
        if e.is_Add:
            return self._sum(e)
        if e.is_Mul:
            return self._product(e)
        if e.is_Pow:
            return self._power(e.base, e.exp)
        return self._function(e)

    def _symbol(self, e: Symbol) -> int:
        if e in self.states:
            return self.add(Node("leaf", place=self.states[e]))
        if e == self.time:
            return self.add(Node("time"))
        if e in self.given:
            return self(self.given[e])
        factor, whole = self.scaled[e]
        return self.total([(factor, self(whole))])

    def total(self, terms: Iterable[tuple[str, int]]) -> int:
        """Sum of operands with constant factors."""
        pairs = list(terms)
        return self.add(Node("sum", tuple(n for _, n in pairs), tuple(f for f, _ in pairs)))

    def _sum(self, e: Expr) -> int:
        fixed, terms = [], []
        for term in e.as_ordered_terms():
            if not term.free_symbols & self.moving:
                fixed.append(term)
                continue
            factor, rest = term.as_independent(*self.moving, as_Add=False)
            terms.append(("1.0" if factor == 1 else self.constant(factor), self(rest)))
        if fixed:
            terms.append(("1.0", self(sympy.Add(*fixed))))
        return self.total(terms)

    def _product(self, e: Expr) -> int:
        factor, rest = e.as_independent(*self.moving, as_Add=False)
        if factor != 1:
            return self.total([(self.constant(factor), self(rest))])
        above: list[Expr] = []
        below: list[Expr] = []
        for q in e.as_ordered_factors():
            (below if q.is_Pow and q.exp == -1 else above).append(q)
        # Constant powers of one quantity are one recurrence each, whatever their sign.
        node = self.times([self(q) for q in above]) if above else self.number(1.0)
        if below:
            return self.add(Node("quotient", (node, self.times([self(q.base) for q in below]))))
        return node

    def times(self, numbers: list[int]) -> int:
        """The product of operands."""
        node = numbers[0]
        for other in numbers[1:]:
            node = self.add(Node("product", (min(node, other), max(node, other))))
        return node

    def _power(self, base: Expr, exponent: Expr) -> int:
        if exponent.free_symbols & self.moving or not base.free_symbols & self.moving:
            log = self(sympy.log(base)) if base != sympy.E else self.number(1.0)
            inner = self.times([self(exponent), log])
            return self._integral(inner, "exp({0})", None)
        node = self(base)
        if exponent.is_Integer and int(exponent) > 0:
            half, rest = divmod(int(exponent), 2)
            if half == 0:
                return node
            square = self._power(base, sympy.Integer(half))
            square = self.times([square, square])
            return self.times([square, node]) if rest else square
        if exponent == -1:
            return self.add(Node("quotient", (self.number(1.0), node)))
        if exponent == -sympy.S.Half:
            return self.add(Node("quotient", (self.number(1.0), self._power(base, sympy.S.Half))))
        if exponent == sympy.S.Half:
            return self.add(Node("root", (node,)))
        name = "power" if exponent.is_number else "power_of"
        if base.free_symbols & set(self.scaled) and not exponent.is_Integer:
            name = "size_power"
        return self.add(Node("power", (node,), (self.constant(exponent), name)))

    def _integral(self, u: int, start: str, slope: Callable[[int], int] | None, *asked: int) -> int:
        """y' = g u' with y(0) = start; slope makes g from the number of y, None where g is y itself."""
        asked = asked or (u,)
        key = ("integral", u, start, asked)
        if key in self.known:
            return self.known[key]
        place = len(self.nodes)
        self.nodes.append(Node("integral", (u, place), (start,), asked))
        self.known[key] = place
        if slope is not None:
            self.nodes[place].operands = (u, slope(place))
        return place

    def _function(self, e: Expr) -> int:
        name, args = type(e).__name__, [self(a) for a in e.args]
        if name in ("Min", "Max"):
            node, sign = args[0], "<" if name == "Min" else ">"
            for other in args[1:]:
                node = self.add(Node("choice", (node, other), (f"{{0}} {sign} {{1}}",), (node, other)))
            return node
        if isinstance(e, Select):
            return self.add(Node("choice", (args[1], args[2]), ("{0} > 0.0",), (args[0],)))
        (u, *others) = args
        if name == "Abs":
            return self.add(Node("choice", (u, self.total([("-1.0", u)])), ("{0} > 0.0",), (u,)))
        if name in ("sign", "Heaviside", "floor", "ceiling"):
            text = {
                "sign": "sign_of({0})", "Heaviside": "(0.5 + 0.5 * sign_of({0}))", "floor": "floor({0})",
                "ceiling": "ceil({0})",
            }[name]  # fmt: skip
            return self.add(Node("step", (), (text,), (u,)))
        if name == "atan2":
            return self._angle(u, others[0])
        return self._elementary(name, u)

    def _square(self, u: int) -> int:
        return self.add(Node("product", (u, u)))

    def _one_and(self, factor: str, u: int) -> int:
        """1 + factor u**2."""
        return self.total([(factor, self._square(u)), ("1.0", self.number(1.0))])

    def _over(self, above: int, below: int) -> int:
        return self.add(Node("quotient", (above, below)))

    def _elementary(self, name: str, u: int) -> int:
        one = self.number(1.0)
        if name == "exp":
            return self._integral(u, "exp({0})", None)
        if name in ("sin", "cos", "sinh", "cosh"):
            wave = ("sin", "cos") if name in ("sin", "cos") else ("sinh", "cosh")
            first = self._pair(u, *wave)
            return first if name == wave[0] else first + 1
        if name == "tan":
            return self._integral(u, "tan({0})", lambda y: self._one_and("1.0", y))
        if name == "tanh":
            return self._integral(u, "tanh({0})", lambda y: self._one_and("-1.0", y))
        if name == "erf":
            bell = self._elementary("exp", self.total([("-1.0", self._square(u))]))
            slope = self.total([("1.1283791670955126", bell)])
        elif name == "log":
            slope = self._over(one, u)
        elif name == "atan":
            slope = self._over(one, self._one_and("1.0", u))
        elif name == "atanh":
            slope = self._over(one, self._one_and("-1.0", u))
        elif name in ("asin", "acos"):
            slope = self._over(one, self.add(Node("root", (self._one_and("-1.0", u),))))
            slope = self.total([("-1.0", slope)]) if name == "acos" else slope
        elif name == "asinh":
            slope = self._over(one, self.add(Node("root", (self._one_and("1.0", u),))))
        elif name == "acosh":
            # (u - 1)(u + 1) under two roots: exact also near u = 1.
            ends = [self.total([("1.0", u), ("1.0", self.number(c))]) for c in (-1.0, 1.0)]
            slope = self._over(one, self.times([self.add(Node("root", (end,))) for end in ends]))
        else:
            raise NotImplementedError(name)
        return self._integral(u, f"{name}({{0}})", lambda _: slope)

    def _pair(self, u: int, odd: str, even: str) -> int:
        """sin and cos, or sinh and cosh, together: each is the other's slope, but for a sign."""
        if ("pair", u, odd) not in self.known:
            first = self.known["pair", u, odd] = len(self.nodes)
            back = "-1.0" if odd == "sin" else "1.0"
            self.nodes.append(Node("integral", (u, first + 1), (f"{odd}({{0}})",), (u,)))
            self.nodes.append(Node("integral", (u, first), (f"{even}({{0}})", back), (u,)))
        return self.known["pair", u, odd]

    def _angle(self, y: int, x: int) -> int:
        """atan2(y, x): its derivative is (x y' - y x') / (x**2 + y**2), a sum of two integrals."""
        size = self.total([("1.0", self._square(x)), ("1.0", self._square(y))])
        first, second = self._over(x, size), self._over(y, size)
        one = self._integral(y, "atan2({1}, {0})", lambda _: first, x, y)
        other = self._integral(x, "0.0", lambda _: second, x, y)
        return self.total([("1.0", one), ("-1.0", other)])


def first_value(node: Node, values: Sequence[str], asked: Sequence[str]) -> str:
    """The value of a node, by those of its operands and of what it asks for."""
    u, v = (*values, "", "")[:2]
    if node.kind == "leaf":
        return f"x[{node.place}]"
    if node.kind == "time":
        return "t"
    if node.kind == "sum":
        return joined(" + ", [f"{f} * {a}" for f, a in zip(node.texts, values, strict=True)])
    if node.kind in ("product", "quotient"):
        return f"{u} {'*' if node.kind == 'product' else '/'} {v}"
    if node.kind == "root":
        return f"sqrt({u})"
    if node.kind == "power":
        return f"{node.texts[1]}({u}, {node.texts[0]})"
    said = node.texts[0].format(*asked)
    if node.kind == "choice":
        return u if u == v else f"({u} if {said} else {v})"
    return said
