"""Kernel source of Taylor coefficients: recurrences over a graph of operations, written out or as loops.

Small graphs are written out order by order, coefficients that are 0 left away: the compiler then sees
independent sums. Larger ones become loops over the coefficients, which keeps the code linear in the graph.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from filippov.kernel.codegen.generate import joined
from filippov.kernel.codegen.jet_graph import JetGraph, Node

# Products of coefficients in a kernel that is written out.
WRITTEN_OUT = 8000


def heavy(graph: JetGraph, order: int) -> bool:
    """Whether a graph is too large to be written out."""
    costly = sum(node.kind in ("product", "quotient", "power", "root", "integral") for node in graph.nodes)
    return costly * order * order > 2 * WRITTEN_OUT or len(graph.nodes) * order > WRITTEN_OUT


def jet_lines(graph: JetGraph, results: Sequence[int], order: int) -> list[str]:
    """Statements that store coefficients 0 ... order - 1 of the results in `out`, one order after the other.

    Result i below the number of states is the rate of state i. Loops use `work`, `order` numbers a node.
    """
    used = _used(graph, results)
    writer = (_Loops if heavy(graph, order) else _WrittenOut)(graph, results, order, used)
    return writer.lines()


def _used(graph: JetGraph, results: Sequence[int]) -> list[int]:
    waiting, found = list(results), set(results)
    while waiting:
        node = graph.nodes[waiting.pop()]
        for other in {*node.operands, *node.asked} - found:
            found.add(other)
            waiting.append(other)
    return sorted(found)


@dataclass
class _WrittenOut:
    graph: JetGraph
    results: Sequence[int]
    order: int
    used: list[int]

    def lines(self) -> list[str]:
        self.text: list[str] = []
        self.value: dict[tuple[int, int], str | None] = {}
        self.inverse: dict[int, str] = {}
        count = len(self.results)
        for k in range(self.order):
            for number in self.used:
                self._name(number, k, self._coefficient(number, self.graph.nodes[number], k))
            for i, result in enumerate(self.results):
                self.text.append(f"    out[{k * count + i}] = {self.value[result, k] or '0.0'}")
        return self.text

    def _name(self, number: int, k: int, said: str | None) -> None:
        if said is not None and (not said.isidentifier() or k == 0):
            name = f"v{number}_{k}"
            self.text.append(f"    {name} = {said}")
            said = name
        self.value[number, k] = said

    def _inverse(self, number: int) -> str:
        """1 / the value of order 0."""
        if number not in self.inverse:
            self.inverse[number] = f"r{number}"
            self.text.append(f"    r{number} = 1.0 / {self.value[number, 0]}")
        return self.inverse[number]

    def _paired(self, a: int, b: int, pairs: Sequence[tuple[int, int, float]]) -> str | None:
        """Sum of products of coefficients of a and b, each with a factor; None where all are 0."""
        terms = []
        for i, j, factor in sorted(pairs, key=lambda pair: max(pair[:2])):
            left, right = self.value[a, i], self.value[b, j]
            if left is None or right is None or factor == 0.0:
                continue
            terms.append(f"{left} * {right}" if factor == 1.0 else f"{factor!r} * {left} * {right}")
        return _in_two(terms)

    def _coefficient(self, number: int, node: Node, k: int) -> str | None:
        if k == 0:
            known = {n: self.value.get((n, 0)) or "0.0" for n in (*node.operands, *node.asked)}
            return _first(node, [known[n] for n in node.operands], [known[n] for n in node.asked])
        u, v = (*node.operands, -1, -1)[:2]
        if node.kind in ("constant", "step"):
            return None
        if node.kind == "time":
            return "1.0" if k == 1 else None
        if node.kind == "leaf":
            rate = self.value[self.results[node.place], k - 1]
            return rate if rate is None or k == 1 else f"{rate} * {1.0 / k!r}"
        if node.kind == "sum":
            terms = [
                said if factor == "1.0" else f"{factor} * {said}"
                for factor, said in zip(node.texts, (self.value[n, k] for n in node.operands), strict=True)
                if said is not None
            ]
            return " + ".join(terms) if terms else None
        if node.kind == "product":
            return self._product(u, v, k)
        if node.kind == "choice":
            return self._choice(node, k)
        if node.kind == "quotient":
            rest = self._paired(v, number, [(j, k - j, 1.0) for j in range(1, k + 1)])
            first = self.value[u, k]
            if rest is None:
                return first and f"{first} * {self._inverse(v)}"
            return f"({first or '0.0'} - ({rest})) * {self._inverse(v)}"
        if node.kind == "root":
            half = [(j, k - j, 2.0 if 2 * j < k else 1.0) for j in range(1, k // 2 + 1)]
            rest, first = self._paired(number, number, half), self.value[u, k]
            if rest is None:
                return first and f"0.5 * {first} * {self._inverse(number)}"
            return f"0.5 * ({first or '0.0'} - ({rest})) * {self._inverse(number)}"
        if node.kind == "power":
            return self._power(number, u, node, k)
        sign = node.texts[1] if len(node.texts) > 1 else "1.0"
        rest = self._paired(u, v, [(j, k - j, float(j)) for j in range(1, k + 1)])
        return rest and f"{float(sign) / k!r} * ({rest})"

    def _product(self, u: int, v: int, k: int) -> str | None:
        if u != v:
            return self._paired(u, v, [(j, k - j, 1.0) for j in range(k + 1)])
        return self._paired(u, u, [(j, k - j, 2.0 if 2 * j < k else 1.0) for j in range(k // 2 + 1)])

    def _choice(self, node: Node, k: int) -> str | None:
        first, second = (self.value[n, k] or "0.0" for n in node.operands)
        if first == second:
            return None if first == "0.0" else first
        asked = [self.value[n, 0] or "0.0" for n in node.asked]
        return f"({first} if {node.texts[0].format(*asked)} else {second})"

    def _power(self, number: int, u: int, node: Node, k: int) -> str | None:
        exponent, name = node.texts
        terms = []
        for j in sorted(range(1, k + 1), key=lambda j: max(j, k - j)):
            left, right = self.value[u, j], self.value[number, k - j]
            if left is not None and right is not None:
                terms.append(f"({exponent} * {float(j)!r} - {float(k - j)!r}) * {left} * {right}")
        total = _in_two(terms)
        said = total and f"{1.0 / k!r} * ({total}) * {self._inverse(u)}"
        if name == "power":
            return said
        # Exponents that the parameters make whole leave no division by a base that may be 0.
        square, itself = self._product(u, u, k) or "0.0", self.value[u, k] or "0.0"
        return f"(({square}) if {exponent} == 2.0 else ({itself} if {exponent} == 1.0 else {said or '0.0'}))"


@dataclass
class _Loops:
    graph: JetGraph
    results: Sequence[int]
    order: int
    used: list[int]

    def lines(self) -> list[str]:
        self.place = {number: i * self.order for i, number in enumerate(self.used)}
        count = len(self.results)
        out = [f"    work[{self.place[n]}] = {self._start(self.graph.nodes[n])}" for n in self.used]
        out += [f"    out[{i}] = {self._at(result, '0')}" for i, result in enumerate(self.results)]
        out.append(f"    for k in range(1, {self.order}):")
        for number in self.used:
            out.append(f"        {self._at(number, 'k')} = {self._later(number, self.graph.nodes[number])}")
        for i, result in enumerate(self.results):
            out.append(f"        out[k * {count} + {i}] = {self._at(result, 'k')}")
        return out

    def _at(self, number: int, k: str) -> str:
        return f"work[{self.place[number]} + {k}]"

    def _row(self, number: int) -> str:
        return f"shift(work, {self.place[number]})"

    def _start(self, node: Node) -> str:
        values = [self._at(n, "0") if n in self.place else "" for n in node.operands]
        return _first(node, values, [self._at(n, "0") for n in node.asked])

    def _asked(self, node: Node) -> str:
        return node.texts[0].format(*(self._at(n, "0") for n in node.asked))

    def _later(self, number: int, node: Node) -> str:
        u, v = (*node.operands, -1, -1)[:2]
        if node.kind in ("constant", "step"):
            return "0.0"
        if node.kind == "time":
            return "1.0 if k == 1 else 0.0"
        if node.kind == "leaf":
            return f"work[{self.place[self.results[node.place]]} + k - 1] / k"
        if node.kind == "sum":
            terms = [
                f"{f} * {self._at(n, 'k')}"
                for f, n in zip(node.texts, node.operands, strict=True)
                if self.graph.nodes[n].kind != "constant"
            ]
            return joined(" + ", terms) if terms else "0.0"
        if node.kind == "choice":
            return f"({self._at(u, 'k')} if {self._asked(node)} else {self._at(v, 'k')})"
        if node.kind == "product":
            return f"folded(k, 0, {self._row(u)}, {self._row(v)})"
        own = self._row(number)
        if node.kind == "quotient":
            return f"({self._at(u, 'k')} - folded(k, 1, {self._row(v)}, {own})) / {self._at(v, '0')}"
        if node.kind == "root":
            return f"0.5 * ({self._at(u, 'k')} - folded_inside(k, {own})) / {self._at(number, '0')}"
        if node.kind == "power":
            exponent, name = node.texts
            said = f"power_term(k, {exponent}, {self._row(u)}, {own})"
            if name == "power":
                return said
            square = f"folded(k, 0, {self._row(u)}, {self._row(u)})"
            whole = f"{self._at(u, 'k')} if {exponent} == 1.0 else {said}"
            return f"({square} if {exponent} == 2.0 else ({whole}))"
        sign = "-" if len(node.texts) > 1 and node.texts[1] == "-1.0" else ""
        return f"{sign}integral_term(k, {self._row(u)}, {self._row(v)})"


def _first(node: Node, values: Sequence[str], asked: Sequence[str]) -> str:
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


def _in_two(terms: Sequence[str]) -> str | None:
    """The sum as two that do not wait for each other, the terms with the newest coefficients last."""
    if len(terms) < 4:
        return " + ".join(terms) or None
    return f"({' + '.join(terms[::2])}) + ({' + '.join(terms[1::2])})"
