"""Which gradients, field components and signs depend on each other: it keeps the cost of a step linear.

A gradient has nonzero entries in few columns, and a sign acts on few components of the field. Surfaces are
coupled where the sign of one acts on the rate of the other, where their gradients share a column, or where
one stands in the other as a size; multipliers are solved component by component of that relation. Signs that
act on no component of the field in common have one colour: one field call takes the derivatives by all signs
of a colour (Curtis, Powell & Reid 1974, J. Inst. Maths Applics 13).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from filippov.kernel.language.unit import Constant

if TYPE_CHECKING:
    from sympy import Expr

    from filippov.model.surface import Surface


@dataclass(frozen=True)
class Structure:
    """The dependencies in the expressions of a system.

    columns  for every surface the states on which h_i depends
    signs    for every state the surfaces whose sign occurs in its component of the field
    sizes    for every surface those whose size |h| occurs in h_i
    """

    columns: tuple[tuple[int, ...], ...]
    signs: tuple[frozenset[int], ...]
    sizes: tuple[frozenset[int], ...]

    @classmethod
    def full(cls, n: int, m: int) -> Structure:
        """Everything acts on everything: plain functions, of which nothing is known."""
        every = frozenset(range(m))
        return cls((tuple(range(n)),) * m, (every,) * n, (frozenset(),) * m)

    def components(self) -> list[int]:
        """The component number of every surface, counted in the order of their first surfaces.

        A surface whose sign and size act on nothing (an observer) stands alone: it never slides.
        """
        m = len(self.columns)
        root = list(range(m))

        def find(i: int) -> int:
            while root[i] != i:
                root[i] = root[root[i]]
                i = root[i]
            return i

        def join(i: int, j: int) -> None:
            a, b = find(i), find(j)
            root[max(a, b)] = min(a, b)

        first: dict[int, int] = {}
        acting = frozenset().union(*self.signs, *self.sizes)
        for i, columns in enumerate(self.columns):
            if i not in acting:
                continue
            for r in columns:
                join(i, first.setdefault(r, i))
                for j in self.signs[r]:
                    join(i, j)
            for j in self.sizes[i]:
                join(i, j)
        numbers = {i: k for k, i in enumerate(sorted({find(i) for i in range(m)}))}
        return [numbers[find(i)] for i in range(m)]

    def colours(self) -> list[int]:
        """A colour for every sign, chosen greedily: signs of one colour share no component of the field."""
        m = len(self.columns)
        rows: list[list[int]] = [[] for _ in range(m)]
        for r, signs in enumerate(self.signs):
            for i in signs:
                rows[i].append(r)
        colours = [-1] * m
        for i in range(m):
            taken = {colours[j] for r in rows[i] for j in self.signs[r]}
            colours[i] = next(c for c in range(m + 1) if c not in taken)
        return colours

    def constants(self, n: int) -> dict[str, Constant]:
        """The same as tables of `filippov.kernel.loop.model`, which the kernels read."""
        m = len(self.columns)
        component, colour = self.components(), self.colours()
        count = max(colour, default=0) + 1
        owner = [-1] * (count * n)
        for r, signs in enumerate(self.signs):
            for i in signs:
                owner[colour[i] * n + r] = i
        first = [0]
        for columns in self.columns:
            first.append(first[-1] + len(columns))
        sizes = [component.count(k) for k in range(max(component, default=0) + 1)]
        return {
            "G_FIRST": first,
            "G_COLUMN": [j for columns in self.columns for j in columns] or [0],
            "COMPONENT": component or [0],
            "BY_COMPONENT": sorted(range(m), key=lambda i: (component[i], i)) or [0],
            "COLOUR": colour or [0],
            "COLOURS": count,
            "OWNER": owner or [-1],
            "LARGEST": max(sizes, default=1) or 1,
        }


def same_as(h: Sequence[Expr], surfaces: Sequence[Surface]) -> list[int]:
    """Of every observer k + 1 where it has the function of surface k, -k - 1 with the other sign, else 0.

    Functions are the same but for a factor that is a number; of several surfaces it is the first.
    """
    if all(surface.kind != "observer" for surface in surfaces):
        return [0] * len(surfaces)
    primitive = [function.as_content_primitive()[1] for function in h]
    found: dict[Expr, int] = {}
    for k, surface in enumerate(surfaces):
        if surface.kind != "observer" and h[k].free_symbols:
            found.setdefault(primitive[k], k + 1)
    return [
        found.get(primitive[i], -found.get(-primitive[i], 0)) if surface.kind == "observer" else 0
        for i, surface in enumerate(surfaces)
    ]
