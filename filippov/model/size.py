"""The size of expressions: how many nodes they have, how deep they go, how many terms multiplied out.

Formulas of strangers, and those of one's own, may be short and yet stand for more than any computer holds:
(x + y + t + 1)**64 has 47,905 terms, and forty names that each stand twice in the next have a tree of 2**40
nodes. Work is counted before it is begun; what would be too much is refused by name, or decided otherwise.
"""

from __future__ import annotations

import math

import sympy
from sympy import Expr

# Terms to which an expression may be multiplied out (about a second).
MOST_TERMS = 2_000
# Nodes of the tree of one formula.
MOST_NODES = 10_000


def terms(e: Expr) -> int:
    """At most how many terms multiplying out meets, in the expression and in its arguments."""
    return _terms(e, {})[1]


def _terms(e: Expr, known: dict[Expr, tuple[int, int]]) -> tuple[int, int]:
    """Terms of the expression multiplied out, and the largest number of terms on the way."""
    if not e.args:
        return 1, 1
    found = known.get(e)
    if found is None:
        parts = [_terms(arg, known) for arg in e.args]
        most = max(largest for _, largest in parts)
        own = 1
        if e.is_Add:
            own = sum(count for count, _ in parts)
        elif e.is_Mul:
            own = math.prod(count for count, _ in parts)
        elif e.is_Pow and e.exp.is_Integer and parts[0][0] > 1:
            count, power = parts[0][0], min(abs(int(e.exp)), 10_000)
            own = math.comb(min(count, 10_000) + power - 1, power)
        # Numbers of a thousand digits say no more than a large one.
        found = known[e] = min(own, 10**18), min(max(most, own), 10**18)
    return found


def expanded(e: Expr) -> Expr:
    """The expression multiplied out, or as it is where that has too many terms."""
    return sympy.expand(e) if terms(e) <= MOST_TERMS else e


def cancelled(e: Expr) -> Expr:
    """The expression with common factors of numerator and denominator cancelled, or as it is where large."""
    return sympy.cancel(e) if terms(e) <= MOST_TERMS else e


class Scale:
    """Weighs expressions, remembering what it has weighed: shared parts are looked at once."""

    def __init__(self) -> None:
        self.known: dict[Expr, tuple[int, int]] = {}

    def weigh(self, e: Expr) -> tuple[int, int]:
        """The number of nodes of the tree, and its depth."""
        if not e.args:
            return 1, 0
        found = self.known.get(e)
        if found is None:
            parts = [self.weigh(arg) for arg in e.args]
            found = self.known[e] = 1 + sum(nodes for nodes, _ in parts), 1 + max(depth for _, depth in parts)
        return found
