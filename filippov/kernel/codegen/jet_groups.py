"""Taylor coefficients of large graphs: loops over the orders, operations of one kind side by side in lanes.

Each order goes through the graph level by level. Operations of one kind in a level are a group: coefficients
of their operands are copied beside each other, order by order, so that a vector holds as many sums as it has
lanes (`recurrences`). A coefficient is copied once and enters the sums of all orders behind it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from filippov.kernel.codegen.generate import joined
from filippov.kernel.codegen.jet_graph import JetGraph, Node, first_value
from filippov.kernel.tables.layout import LANES

# Fewer operations of a kind than this are taken one by one.
FEW = 3
_COSTLY = ("product", "quotient", "root", "power", "integral")


@dataclass
class Group:
    """Operations of one kind in a level, and where in `work` their operands and results have their rows.

    width: from one order to the next; rows: of the operands and, last, of the results
    """

    kind: str
    numbers: list[int]
    width: int = 1
    rows: list[int] = field(default_factory=list)


class GroupedLoops:
    """Statements for the `used` nodes of a graph; `room` numbers of `work` are needed."""

    def __init__(self, graph: JetGraph, results: Sequence[int], order: int, used: Sequence[int]) -> None:
        self.graph, self.results, self.order, self.used = graph, results, order, used
        self.levels = self._levels()
        self.room = 0
        single = [n for n in used if graph.nodes[n].kind not in _COSTLY]
        self.place: dict[int, tuple[int, int]] = {n: (i, len(single)) for i, n in enumerate(single)}
        self.room = len(single) * order
        self.groups = [self._grouped(level) for level in self.levels]

    def _levels(self) -> list[list[int]]:
        """Nodes by depth within an order; an integral does not depend on its slope of the same order."""
        level: dict[int, int] = {}
        for number in self.used:
            node = self.graph.nodes[number]
            asked = node.operands[:1] if node.kind == "integral" else node.operands
            level[number] = 1 + max((level[n] for n in asked), default=-1)
        found: list[list[int]] = [[] for _ in range(1 + max(level.values(), default=-1))]
        for number, at in level.items():
            found[at].append(number)
        return found

    def _kind(self, number: int) -> str:
        node = self.graph.nodes[number]
        if node.kind == "product" and node.operands[0] == node.operands[1]:
            return "square"
        return node.texts[1] if node.kind == "power" else node.kind

    def _grouped(self, level: Sequence[int]) -> list[Group]:
        by_kind: dict[str, list[int]] = {}
        for number in level:
            if self.graph.nodes[number].kind in _COSTLY:
                by_kind.setdefault(self._kind(number), []).append(number)
        groups = []
        for kind, numbers in by_kind.items():
            # An operation that tests its exponent is not grouped.
            alone = len(numbers) < FEW or kind in ("power_of", "size_power")
            for part in [[n] for n in numbers] if alone else [numbers]:
                group = Group(kind, part, 1 if alone else -(-len(part) // LANES) * LANES)
                for _ in range(2 if kind in ("square", "root", "power", "power_of", "size_power") else 3):
                    group.rows.append(self.room)
                    self.room += group.width * self.order
                if kind in ("power", "integral") and not alone:
                    # Exponents and signs, one per lane.
                    group.rows.insert(0, self.room)
                    self.room += group.width
                self.place |= {n: (group.rows[-1] + i, group.width) for i, n in enumerate(part)}
                groups.append(group)
        return groups

    def lines(self) -> list[str]:
        """The statements of `jets.jet_lines`."""
        count = len(self.results)
        out = [f"    {self._at(number, 0)} = {self._start(self.graph.nodes[number])}" for number in self.used]
        for group in (g for level in self.groups for g in level):
            out += self._copied(group, 0, range(2))
            if group.width > 1 and group.kind in ("power", "integral"):
                out += [
                    f"    work[{group.rows[0] + i}] = {_of_lane(self.graph.nodes[n])}"
                    for i, n in enumerate(group.numbers)
                ]
        out += [f"    out[{i}] = {self._at(result, 0)}" for i, result in enumerate(self.results)]
        out += [f"    for k in range(1, {self.order}):", "        part = 1.0 / float(k)"]
        for level, groups in zip(self.levels, self.groups, strict=True):
            for number in level:
                if number in self.place and self.graph.nodes[number].kind not in _COSTLY:
                    out.append(f"        {self._at(number)} = {self._later(number)}")
            for group in groups:
                ready = range(1 if group.kind == "integral" else 2)
                out += [f"    {line}" for line in self._copied(group, None, ready)]
                out += [f"        {line}" for line in self._taken(group)]
        for group in (g for level in self.groups for g in level if g.kind == "integral"):
            out += [f"    {line}" for line in self._copied(group, None, range(1, 2))]
        stored = enumerate(self.results)
        out += [f"        out[k * {count} + {i}] = {self._at(result)}" for i, result in stored]
        return out

    def _at(self, number: int, order: int | None = None, back: int = 0) -> str:
        """A coefficient: of an order, or of order k - back."""
        place, width = self.place[number]
        if order is not None:
            return f"work[{place + order * width}]"
        return f"work[{place - back * width} + k * {width}]"

    def _copied(self, group: Group, order: int | None, which: range) -> list[str]:
        """An order of the operands into the rows of their group."""
        rows = group.rows[-3:-1] if len(group.rows) > 2 and group.kind != "power" else group.rows[-2:-1]
        out = []
        for q in which:
            if q >= len(rows):
                continue
            for i, number in enumerate(group.numbers):
                at = f"{rows[q] + i}" if order == 0 else f"{rows[q] + i} + k * {group.width}"
                out.append(f"    work[{at}] = {self._at(self.graph.nodes[number].operands[q], order)}")
        return out

    def _start(self, node: Node) -> str:
        values = [self._at(n, 0) if n in self.place else "" for n in node.operands]
        return first_value(node, values, [self._at(n, 0) for n in node.asked])

    def _later(self, number: int) -> str:
        """Coefficient k of an operation without recurrence."""
        node = self.graph.nodes[number]
        if node.kind in ("constant", "step"):
            return "0.0"
        if node.kind == "time":
            return "1.0 if k == 1 else 0.0"
        if node.kind == "leaf":
            return f"{self._at(self.results[node.place], back=1)} * part"
        if node.kind == "choice":
            asked = node.texts[0].format(*(self._at(n, 0) for n in node.asked))
            return f"({self._at(node.operands[0])} if {asked} else {self._at(node.operands[1])})"
        terms = [
            self._at(n) if f == "1.0" else f"{f} * {self._at(n)}"
            for f, n in zip(node.texts, node.operands, strict=True)
            if self.graph.nodes[n].kind != "constant"
        ]
        return joined(" + ", terms) if terms else "0.0"

    def _taken(self, group: Group) -> list[str]:
        """Coefficient k of a group."""
        rows = ", ".join(f"shift(work, {row})" for row in group.rows)
        if group.width > 1:
            return [f"{group.kind}s_beside(k, {group.width} // VECTORS, {rows})"]
        (number,) = group.numbers
        own, *given = (f"shift(work, {row})" for row in reversed(group.rows))
        node, u = self.graph.nodes[number], given[-1]
        said = {
            "product": lambda: f"folded(k, 0, {u}, {given[0]})",
            "square": lambda: f"folded(k, 0, {u}, {u})",
            "quotient": lambda: f"({u}[k] - folded(k, 1, {given[0]}, {own})) / {given[0]}[0]",
            "root": lambda: f"0.5 * ({u}[k] - folded_inside(k, {own})) / {own}[0]",
            "integral": lambda: f"{_of_lane(node)} * integral_term(k, {u}, {given[0]})",
        }.get(group.kind, lambda: self._power(node, u, own))()
        return [f"{self._at(number)} = {said}"]

    def _power(self, node: Node, u: str, own: str) -> str:
        exponent, name = node.texts
        said = f"power_term(k, {exponent}, {u}, {own})"
        if name == "power":
            return said
        whole = f"{self._at(node.operands[0])} if {exponent} == 1.0 else {said}"
        return f"(folded(k, 0, {u}, {u}) if {exponent} == 2.0 else ({whole}))"


def _of_lane(node: Node) -> str:
    """The exponent of a power, the sign of an integral."""
    if node.kind == "power":
        return node.texts[0]
    return "-1.0" if len(node.texts) > 1 and node.texts[1] == "-1.0" else "1.0"
