"""Kernel source of Taylor coefficients: recurrences over a graph of operations, written out or as loops.

Small graphs are written out order by order, without coefficients that are 0: the compiler then sees
independent sums. Every recurrence ends with the coefficients of its own order, which come last, each in one
product with a factor known before; constant factors of an operand are part of that factor. A processor waits
for what follows from the order before, not for the sums. Larger graphs become loops over the coefficients
(see `jet_groups`), which keeps the length of the code linear in the graph.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from filippov.kernel.codegen.jet_graph import JetGraph, Node, first_value
from filippov.kernel.codegen.jet_groups import GroupedLoops

# Products of coefficients in a kernel that is written out.
WRITTEN_OUT = 8000
# The most coefficients at the end of a series that are compared with as many before them.
LAST = 4
_SINGULAR = ("quotient", "power", "root", "integral")


def heavy(graph: JetGraph, order: int) -> bool:
    """Whether a graph is too large to be written out."""
    costly = sum(node.kind in ("product", "quotient", "power", "root", "integral") for node in graph.nodes)
    return costly * order * order > 2 * WRITTEN_OUT or len(graph.nodes) * order > WRITTEN_OUT


def jet_lines(
    graph: JetGraph, results: Sequence[int], order: int, tails: Sequence[int] = ()
) -> tuple[list[str], int]:
    """Statements that store coefficients 0 ... order - 1 of the results in `out`, one order after the other.

    Result i below the number of states is the rate of state i. Then how many numbers of `work` they use.
    tails: nodes of a graph that is not heavy, of which the last coefficients are stored in `work`.
    """
    used = _used(graph, results)
    if not heavy(graph, order):
        written = _WrittenOut(graph, results, order, used)
        return [*written.lines(), *written.tails(tails)], 2 * last_terms(order) * len(tails)
    loops = GroupedLoops(graph, results, order, used)
    return loops.lines(), loops.room


def last_terms(order: int) -> int:
    """How many coefficients at the end of a series are compared with as many before them."""
    return min(LAST, (order - 1) // 3)


def endless(graph: JetGraph, results: Sequence[int]) -> list[int]:
    """The nodes behind some results whose series do not end, and those that jump or have kinks."""
    nodes, found = graph.nodes, []
    for number in _used(graph, results):
        node = nodes[number]
        asks = any(nodes[n].kind != "constant" for n in node.asked)
        if node.kind in _SINGULAR or (node.kind in ("choice", "step") and asks):
            found.append(number)
    return found


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
    """Coefficient k > 0 of a node is `factor[node]` times `value[base[node], k]`; None: 1, or a sum of none.

    value[node, 0] is the whole value. depth: recurrences of one order that a node comes behind.
    """

    graph: JetGraph
    results: Sequence[int]
    order: int
    used: list[int]
    text: list[str] = field(default_factory=list)
    value: dict[tuple[int, int], str | None] = field(default_factory=dict)
    factor: dict[int, str | None] = field(default_factory=dict)
    base: dict[int, int] = field(default_factory=dict)
    depth: dict[int, int] = field(default_factory=dict)
    named: dict[str, str] = field(default_factory=dict)

    def lines(self) -> list[str]:
        """The statements of `jet_lines`."""
        nodes, count = self.graph.nodes, len(self.results)
        for k in range(self.order):
            for number in self.used:
                node = nodes[number]
                if k == 0:
                    known = {n: self.value.get((n, 0)) or "0.0" for n in (*node.operands, *node.asked)}
                    own, asked = ([known[n] for n in group] for group in (node.operands, node.asked))
                    self._store(number, 0, first_value(node, own, asked))
                    self._relate(number, node)
                elif self.base[number] == number:
                    self._store(number, k, self._coefficient(number, node, k))
            results = enumerate(self.results)
            self.text += [f"    out[{k * count + i}] = {self._whole(r, k)}" for i, r in results]
        return self.text

    def tails(self, numbers: Sequence[int]) -> list[str]:
        """Statements that store 2 `last_terms` coefficients of each node in a row of `work`.

        Zeros for a node that jumps or has a kink; those of a series that has ended where the number is -1.
        """
        terms, lines = last_terms(self.order), list[str]()
        for number in numbers:
            for q, k in enumerate(range(self.order - 2 * terms, self.order)):
                said = "1.0" if q < terms and number < 0 else "0.0"
                if number >= 0 and self.graph.nodes[number].kind in _SINGULAR:
                    said = self.value[number, k] or "0.0"
                lines.append(f"    work[{len(lines)}] = {said}")
        return lines

    def _store(self, number: int, k: int, said: str | None) -> None:
        if said is not None and (not said.isidentifier() or k == 0):
            name = f"v{number}_{k}"
            self.text.append(f"    {name} = {said}")
            said = name
        self.value[number, k] = said

    def _relate(self, number: int, node: Node) -> None:
        """A sum of one operand and constants is a multiple of that operand from order 1 on."""
        moving = [
            (text, n)
            for text, n in zip(node.texts, node.operands, strict=False)
            if node.kind == "sum" and self.graph.nodes[n].kind != "constant"
        ]
        self.base[number], self.factor[number] = number, None
        # What an integral is the integral of may come later.
        before = [n for n in node.operands[: 1 if node.kind == "integral" else None] if n in self.depth]
        self.depth[number] = 1 + max((self.depth[n] for n in before), default=-1)
        if len(moving) == 1:
            ((text, n),) = moving
            self.base[number], self.depth[number] = self.base[n], self.depth[n]
            self.factor[number] = self._product_of(text, self.factor[n])

    def _product_of(self, *factors: str | None) -> str | None:
        """The product of constants: a number, a name, or None for 1."""
        number, names = 1.0, []
        for said in factors:
            try:
                number *= 1.0 if said is None else float(said)
            except ValueError:
                names.append(str(said))
        if number != 1.0:
            names.insert(0, repr(number))
        if len(names) < 2 and (not names or number != 1.0 or names[0].isidentifier()):
            return names[0] if names else None
        said = " * ".join(names)
        if said not in self.named:
            self.named[said] = f"f{len(self.named)}"
            self.text.append(f"    {self.named[said]} = {said}")
        return self.named[said]

    def _newest(self, number: int, k: int, *factors: str | None) -> str | None:
        """Coefficient k of a node times constants."""
        base = self.value[self.base[number], k]
        if base is None:
            return None
        factor = self._product_of(*factors, self.factor[number])
        return base if factor is None else f"{factor} * {base}"

    def _whole(self, number: int, k: int) -> str:
        if k == 0:
            return self.value[number, 0] or "0.0"
        return self._newest(number, k) or "0.0"

    def _name(self, number: int, k: int) -> str | None:
        """The value of order 0, or a coefficient without its factor."""
        return self.value[number, 0] if k == 0 else self.value[self.base[number], k]

    def _inverse(self, number: int) -> str:
        """1 / the value of order 0."""
        return self._product_of(f"(1.0 / {self.value[number, 0]})") or "1.0"

    def _paired(self, a: int, b: int, pairs: Sequence[tuple[int, int, float | str]]) -> str | None:
        """Sum of products of coefficients of a and b, each with a weight; None where all are 0."""
        terms = []
        for i, j, weight in sorted(pairs, key=lambda pair: max(pair[:2])):
            left, right = self._name(a, i), self._name(b, j)
            if left is not None and right is not None and weight != 0.0:
                terms.append(f"{left} * {right}" if weight == 1.0 else f"{weight} * {left} * {right}")
        return _in_two(terms)

    def _coefficient(self, number: int, node: Node, k: int) -> str | None:
        if node.kind in ("constant", "step"):
            return None
        if node.kind == "time":
            return "1.0" if k == 1 else None
        if node.kind == "leaf":
            rate = self.results[node.place]
            return self.value[rate, 0] if k == 1 else self._newest(rate, k - 1, repr(1.0 / k))
        if node.kind == "choice":
            return self._choice(node, k)
        if node.kind == "sum":
            late = sorted(zip(node.operands, node.texts, strict=True), key=lambda q: self.depth[q[0]])
            return _sum(*(self._newest(n, k, text) for n, text in late))
        recurrence = {
            "product": self._product, "quotient": self._quotient, "root": self._root, "power": self._power,
        }.get(node.kind, self._integral)  # fmt: skip
        return recurrence(number, node, k)

    def _product(self, number: int, node: Node, k: int) -> str | None:
        u, v = node.operands
        if u == v:
            return self._square(u, k)
        inside = self._paired(u, v, [(j, k - j, 1.0) for j in range(1, k)])
        late = sorted(((u, v), (v, u)), key=lambda pair: self.depth[pair[0]])
        ends = [self._newest(n, k, self.value[other, 0]) for n, other in late]
        return _sum(_times(self._product_of(self.factor[u], self.factor[v]), inside), *ends)

    def _square(self, u: int, k: int) -> str | None:
        pairs = [(j, k - j, 2.0 if 2 * j < k else 1.0) for j in range(1, k // 2 + 1)]
        inside = _times(self._product_of(self.factor[u], self.factor[u]), self._paired(u, u, pairs))
        return _sum(inside, self._newest(u, k, "2.0", self.value[u, 0]))

    def _quotient(self, number: int, node: Node, k: int) -> str | None:
        """y = u / v: y_k = (u_k - sum_{j > 0} v_j y_{k-j}) / v_0."""
        u, v = node.operands
        below = self._inverse(v)
        inside = self._paired(v, number, [(j, k - j, 1.0) for j in range(1, k)])
        late = sorted(
            ((u, ()), (v, ("-1.0", self.value[number, 0]))), key=lambda part: self.depth[part[0]]
        )
        ends = [self._newest(n, k, *factors, below) for n, factors in late]
        return _sum(_times(self._product_of("-1.0", below, self.factor[v]), inside), *ends)

    def _root(self, number: int, node: Node, k: int) -> str | None:
        """y**2 = u: y_k = (u_k - sum_{0 < j < k} y_j y_{k-j}) / (2 y_0)."""
        below = self._inverse(number)
        pairs = [(j, k - j, 2.0 if 2 * j < k else 1.0) for j in range(1, k // 2 + 1)]
        inside = self._paired(number, number, pairs)
        return _sum(
            _times(self._product_of("-0.5", below), inside), self._newest(node.operands[0], k, "0.5", below)
        )

    def _power(self, number: int, node: Node, k: int) -> str | None:
        """y = u**e: y_k = sum_{j > 0} ((e + 1) j - k) u_j y_{k-j} / (k u_0)."""
        (u,), (exponent, name) = node.operands, node.texts
        below, more = self._inverse(u), self._product_of(f"({exponent} + 1.0)")
        pairs = [(j, k - j, f"({more or '1.0'} * {float(j)!r} - {float(k)!r})") for j in range(1, k)]
        inside = self._paired(u, number, pairs)
        inside = _times(self._product_of(repr(1.0 / k), below, self.factor[u]), inside)
        said = _sum(inside, self._newest(u, k, f"({exponent})", self.value[number, 0], below))
        if name == "power":
            return said
        # Where parameters make the exponent an integer there must be no division by a base that may be 0.
        square, itself = self._square(u, k) or "0.0", self._whole(u, k)
        return f"(({square}) if {exponent} == 2.0 else ({itself} if {exponent} == 1.0 else {said or '0.0'}))"

    def _integral(self, number: int, node: Node, k: int) -> str | None:
        """y' = g u': y_k = sum_{j > 0} j u_j g_{k-j} / k."""
        u, g = node.operands
        sign = node.texts[1] if len(node.texts) > 1 else None
        inside = self._paired(u, g, [(j, k - j, float(j)) for j in range(1, k)])
        share = self._product_of(sign, repr(1.0 / k), self.factor[u], self.factor[g])
        return _sum(_times(share, inside), self._newest(u, k, sign, self.value[g, 0]))

    def _choice(self, node: Node, k: int) -> str | None:
        first, second = (self._newest(n, k) or "0.0" for n in node.operands)
        if first == second:
            return None if first == "0.0" else first
        asked = [self.value[n, 0] or "0.0" for n in node.asked]
        return f"({first} if {node.texts[0].format(*asked)} else {second})"


def _times(factor: str | None, said: str | None) -> str | None:
    return said if said is None or factor is None else f"{factor} * ({said})"


def _sum(*terms: str | None) -> str | None:
    return " + ".join(term for term in terms if term is not None) or None


def _in_two(terms: Sequence[str]) -> str | None:
    """The sum as two independent ones, the terms with the newest coefficients last."""
    if len(terms) < 4:
        return " + ".join(terms) or None
    return f"({' + '.join(terms[::2])}) + ({' + '.join(terms[1::2])})"
