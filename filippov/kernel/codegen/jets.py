"""Kernel source of Taylor coefficients: recurrences over a graph of operations, written out or as loops.

Small graphs are written out order by order, without coefficients that are 0: the compiler then sees
independent sums. Larger ones become loops over the coefficients (see `jet_groups`), which keeps the length of
the code linear in the graph.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from filippov.kernel.codegen.jet_graph import JetGraph, Node, first_value
from filippov.kernel.codegen.jet_groups import GroupedLoops

# Products of coefficients in a kernel that is written out.
WRITTEN_OUT = 8000


def heavy(graph: JetGraph, order: int) -> bool:
    """Whether a graph is too large to be written out."""
    costly = sum(node.kind in ("product", "quotient", "power", "root", "integral") for node in graph.nodes)
    return costly * order * order > 2 * WRITTEN_OUT or len(graph.nodes) * order > WRITTEN_OUT


def jet_lines(graph: JetGraph, results: Sequence[int], order: int) -> tuple[list[str], int]:
    """Statements that store coefficients 0 ... order - 1 of the results in `out`, one order after the other.

    Result i below the number of states is the rate of state i. Then how many numbers of `work` they use.
    """
    used = _used(graph, results)
    if not heavy(graph, order):
        return _WrittenOut(graph, results, order, used).lines(), 0
    loops = GroupedLoops(graph, results, order, used)
    return loops.lines(), loops.room


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
            return first_value(node, [known[n] for n in node.operands], [known[n] for n in node.asked])
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
        # Where parameters make the exponent an integer there must be no division by a base that may be 0.
        square, itself = self._product(u, u, k) or "0.0", self.value[u, k] or "0.0"
        return f"(({square}) if {exponent} == 2.0 else ({itself} if {exponent} == 1.0 else {said or '0.0'}))"


def _in_two(terms: Sequence[str]) -> str | None:
    """The sum as two independent ones, the terms with the newest coefficients last."""
    if len(terms) < 4:
        return " + ".join(terms) or None
    return f"({' + '.join(terms[::2])}) + ({' + '.join(terms[1::2])})"
