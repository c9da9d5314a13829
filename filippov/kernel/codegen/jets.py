"""Kernel source of Taylor coefficients: recurrences over a graph of operations, written out or as loops.

Small graphs are written out order by order, without coefficients that are 0: the compiler then sees
independent sums. Every recurrence ends with the coefficients of its own order, which come last, each in one
product with a factor known before; constant factors of an operand are part of that factor. A processor waits
for what follows from the order before, not for the sums. Larger graphs become loops over the coefficients
(see `jet_groups`), which keeps the length of the code linear in the graph.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from filippov.kernel.codegen.jet_graph import JetGraph, Node, first_value
from filippov.kernel.codegen.jet_groups import GroupedLoops

# Products of coefficients in a kernel that is written out.
WRITTEN_OUT = 8000
# The most coefficients at the end of a series that are compared with as many before them.
LAST = 4
_Coefficient = Callable[[int], str | None]
_SINGULAR = ("quotient", "power", "root", "integral")


def heavy(graph: JetGraph, order: int) -> bool:
    """Whether a graph is too large to be written out."""
    costly = sum(node.kind in ("product", "quotient", "power", "root", "integral") for node in graph.nodes)
    return costly * order * order > 2 * WRITTEN_OUT or len(graph.nodes) * order > WRITTEN_OUT


def jet_lines(
    graph: JetGraph, results: Sequence[int], order: int, tails: Sequence[int] = (), decaying: int = 0,
    squares: bool = False,
) -> tuple[list[str], int]:
    """Statements that store coefficients 0 ... order - 1 of the results in `out`, one order after the other.

    Result i below the number of states is the rate of state i. Then how many numbers of `work` they use.
    tails: nodes of a graph that is not heavy, of which the last coefficients are stored in `work`; behind
    them all coefficients of the exponents of the first `decaying`.
    squares: of such a graph, for parameters that make the exponents of `chosen_exponents` 2.
    """
    used = _used(graph, results)
    if not heavy(graph, order):
        written = _WrittenOut(graph, results, order, used, squares)
        text = written.lines()
        stored = [*written.tails(tails), *written.exponents(tails[:decaying])]
        return [*text, *(f"    work[{q}] = {said}" for q, said in enumerate(stored))], len(stored)
    loops = GroupedLoops(graph, results, order, used)
    return loops.lines(), loops.room


def last_terms(order: int) -> int:
    """How many coefficients at the end of a series are compared with as many before them."""
    return min(LAST, (order - 1) // 3)


def chosen_exponents(graph: JetGraph, results: Sequence[int]) -> list[str]:
    """The exponents behind some results that parameters may make an integer."""
    nodes = [graph.nodes[number] for number in _used(graph, results)]
    return sorted({node.texts[0] for node in nodes if node.kind == "power" and node.texts[1] != "power"})


def endless(graph: JetGraph, results: Sequence[int]) -> list[int]:
    """The nodes behind some results whose series do not end, exponentials first; also jumps and kinks."""
    nodes, found = graph.nodes, []
    for number in _used(graph, results):
        node = nodes[number]
        asks = any(nodes[n].kind != "constant" for n in node.asked)
        if node.kind in _SINGULAR or (node.kind in ("choice", "step") and asks):
            found.append(number)
    return sorted(found, key=lambda number: not _is_exponential(nodes[number]))


def exponentials(graph: JetGraph, numbers: Sequence[int]) -> int:
    """How many of some nodes are exponentials."""
    return sum(_is_exponential(graph.nodes[number]) for number in numbers)


def _is_exponential(node: Node) -> bool:
    return node.kind == "integral" and node.texts == ("exp({0})",)


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
    squares: bool = False
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
                    square = self.squares and node.kind == "power" and node.texts[1] != "power"
                    said = f"{own[0]} * {own[0]}" if square else first_value(node, own, asked)
                    self._store(number, 0, said)
                    self._relate(number, node)
                elif self.base[number] == number:
                    self._store(number, k, self._coefficient(number, node, k))
            results = enumerate(self.results)
            self.text += [f"    out[{k * count + i}] = {self._whole(r, k)}" for i, r in results]
        return self.text

    def tails(self, numbers: Sequence[int]) -> list[str]:
        """The last 2 `last_terms` coefficients of each node, a row of `work`.

        Zeros for a node that jumps or has a kink; those of a series that has ended where the number is -1.
        """
        terms, stored = last_terms(self.order), list[str]()
        for number in numbers:
            for q, k in enumerate(range(self.order - 2 * terms, self.order)):
                said = "1.0" if q < terms and number < 0 else "0.0"
                if number >= 0 and self.graph.nodes[number].kind in _SINGULAR:
                    said = self.value[number, k] or "0.0"
                stored.append(said)
        return stored

    def exponents(self, numbers: Sequence[int]) -> list[str]:
        """All coefficients of the exponent of each exponential; 0 for other nodes."""
        stored = []
        for number in numbers:
            own = number >= 0 and _is_exponential(self.graph.nodes[number])
            inside = self.graph.nodes[number].operands[0] if own else -1
            stored += [self._whole(inside, k) if own else "0.0" for k in range(self.order)]
        return stored

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

    def _rate(self, number: int, k: int) -> str | None:
        """k times a coefficient without its factor."""
        name = self._name(number, k)
        return None if name is None else self._product_of(repr(float(k)), name)

    def _folded(self, k: int, left: _Coefficient, right: _Coefficient) -> str | None:
        """sum_j left_j right_(k-j) over 0 < j < k; None where all are 0."""
        pairs = [(left(j), right(k - j)) for j in sorted(range(1, k), key=lambda j: max(j, k - j))]
        return _in_two([f"{a} * {b}" for a, b in pairs if a is not None and b is not None])

    def _folded_with_itself(self, u: int, k: int, *factors: str | None) -> tuple[str | None, str | None]:
        """sum_j u_j u_(k-j) over 0 < j < k times factors: pairs of coefficients, and the square of one."""
        names = [self._name(u, j) for j in range(k)]
        pairs = zip(names[(k - 1) // 2 : 0 : -1], names[k // 2 + 1 :], strict=True)
        twice = _in_two([f"{a} * {b}" for a, b in pairs if a is not None and b is not None])
        middle = names[k // 2] if k % 2 == 0 else None
        square = _times(self._product_of(*factors), middle and f"{middle} * {middle}")
        return square, _times(self._product_of("2.0", *factors), twice)

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
        inside = self._folded(k, lambda j: self._name(u, j), lambda j: self._name(v, j))
        late = sorted(((u, v), (v, u)), key=lambda pair: self.depth[pair[0]])
        ends = [self._newest(n, k, self.value[other, 0]) for n, other in late]
        return _sum(_times(self._product_of(self.factor[u], self.factor[v]), inside), *ends)

    def _square(self, u: int, k: int) -> str | None:
        inside = self._folded_with_itself(u, k, self.factor[u], self.factor[u])
        return _sum(*inside, self._newest(u, k, "2.0", self.value[u, 0]))

    def _quotient(self, number: int, node: Node, k: int) -> str | None:
        """y = u / v: y_k = (u_k - sum_{j > 0} v_j y_{k-j}) / v_0."""
        u, v = node.operands
        below = self._inverse(v)
        inside = self._folded(k, lambda j: self._name(v, j), lambda j: self._name(number, j))
        late = sorted(
            ((u, ()), (v, ("-1.0", self.value[number, 0]))), key=lambda part: self.depth[part[0]]
        )
        ends = [self._newest(n, k, *factors, below) for n, factors in late]
        return _sum(_times(self._product_of("-1.0", below, self.factor[v]), inside), *ends)

    def _root(self, number: int, node: Node, k: int) -> str | None:
        """y**2 = u: y_k = (u_k - sum_{0 < j < k} y_j y_{k-j}) / (2 y_0)."""
        below = self._inverse(number)
        inside = self._folded_with_itself(number, k, "-0.5", below)
        return _sum(*inside, self._newest(node.operands[0], k, "0.5", below))

    def _power(self, number: int, node: Node, k: int) -> str | None:
        """y = u**e: y_k = (e sum_{j > 0} j u_j y_{k-j} - sum_{j > 0} u_j (k - j) y_{k-j}) / (k u_0)."""
        (u,), (exponent, name) = node.operands, node.texts
        if name != "power" and self.squares:
            return self._square(u, k)
        below = self._inverse(u)
        up = self._folded(k, lambda j: self._rate(u, j), lambda j: self._name(number, j))
        down = self._folded(k, lambda j: self._name(u, j), lambda j: self._rate(number, j))
        inside = up and down and f"({exponent}) * ({up}) - ({down})"
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
        inside = self._folded(k, lambda j: self._rate(u, j), lambda j: self._name(g, j))
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
