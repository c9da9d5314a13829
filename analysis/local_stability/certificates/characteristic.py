"""A set-valued function psi of one input with 0 in psi(0): pieces that are polynomials, and its sectors.

    sector [k, K]:  (psi - k y)(K y - psi) > 0 for y != 0
    slopes [k, K]:  k (y - z) <= psi(y) - psi(z) <= K (y - z) for y > z

All numbers are rational and all inequalities are decided by Sturm's count of roots.
Source: Khalil 2002 (sectors).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import pairwise

import sympy
from sympy import Expr, Poly, Rational

from filippov.analysis.algebra import linalg

INPUT = sympy.Symbol("y", real=True)
# A bound that is reached is moved outwards by this share, so that the sector holds strictly.
ROOM = Rational(1, 2**20)
OO = sympy.oo


@dataclass(frozen=True)
class Piece:
    """psi = poly on low < y < high."""

    low: Expr
    high: Expr
    poly: Poly


@dataclass(frozen=True)
class Characteristic:
    """psi by its pieces in order, without gaps.

    jumps   {y: (least, greatest)} where psi(y) is an interval
    """

    pieces: tuple[Piece, ...]
    jumps: Mapping[Expr, tuple[Expr, Expr]]

    @property
    def at_zero(self) -> tuple[Expr, Expr]:
        """The interval psi(0)."""
        return self.jumps.get(sympy.S.Zero, (sympy.S.Zero, sympy.S.Zero))

    def moved(self, y: Expr, level: Expr) -> Characteristic:
        """psi(y + .) - level."""
        pieces = [
            Piece(p.low - y, p.high - y, p.poly.compose(Poly(INPUT + y, INPUT)) - level) for p in self.pieces
        ]
        jumps = {a - y: (low - level, high - level) for a, (low, high) in self.jumps.items()}
        return Characteristic(tuple(pieces), jumps)

    def beside(self) -> Characteristic | None:
        """The function with the affine pieces that meet at 0 alone, continued; None where 0 is inside one."""
        for before, after in pairwise(self.pieces):
            if before.high == 0 and max(before.poly.degree(), after.poly.degree()) <= 1:
                jumps = {k: v for k, v in self.jumps.items() if k == 0}
                return Characteristic((replace(before, low=-OO), replace(after, high=OO)), jumps)
        return None

    def sector(self) -> tuple[Rational, Rational | None] | None:
        """The least sector [k, K] that holds strictly, K None for oo; None where there is none."""
        ratios = self._ratios()
        least = self._strict(min(ratios), -1) if min(ratios) != -OO else None
        if least is None:
            return None
        if max(ratios) == OO or self.at_zero != (0, 0):
            return least, None
        greatest = self._strict(max(ratios), 1)
        return None if greatest is None else (least, greatest)

    def _strict(self, bound: Rational, way: int) -> Rational | None:
        for k in (bound, bound + way * ROOM * max(1, abs(bound))):
            if self.inside(k, way):
                return k
        return None

    def inside(self, k: Rational, way: int) -> bool:
        """Whether (k y - psi) y > 0 for all y != 0 (way 1), or (psi - k y) y > 0 (way -1)."""
        zero = sympy.S.Zero
        for piece in self.pieces:
            gap = way * (Poly(k * INPUT, INPUT, domain="QQ") - piece.poly)
            for low, high, sign in (
                (max(piece.low, zero), piece.high, 1),
                (piece.low, min(piece.high, zero), -1),
            ):
                if low < high and not _above(sign * gap, low, high):
                    return False
        for y, ends in self.jumps.items():
            if y != 0 and any(way * (k * y - e) * y <= 0 for e in ends):
                return False
        low, high = self.at_zero
        return bool(low <= 0 <= high)

    def _ratios(self) -> list[Expr]:
        """The limits of psi/y at the ends of pieces, at 0 and oo, and its extrema between."""
        out = []
        for piece in self.pieces:
            p, level = piece.poly, piece.poly.eval(0)
            for end, inner in ((piece.low, 1), (piece.high, -1)):
                if end in {OO, -OO}:
                    out.append(_at_infinity(p, end))
                elif end == 0:
                    out.append(p.diff().eval(0) if level == 0 else inner * level * OO)
                else:
                    out.append(p.eval(end) / end)
            if piece.low < 0 < piece.high:
                out.append(p.diff().eval(0))
            if p.degree() > 1:
                turning = p.diff() * Poly(INPUT, INPUT) - p
                for root in map(float, linalg.roots([float(c) for c in turning.all_coeffs()]).real):
                    if piece.low < root < piece.high and root != 0:
                        y = Rational(root)
                        out.append(p.eval(y) / y)
        out += [e / y for y, ends in self.jumps.items() if y != 0 for e in ends]
        return out

    def slopes(self) -> tuple[Rational, Rational] | None:
        """Bounds of the slope of a continuous psi; None where it jumps or a slope has none."""
        if self.jumps or any(p.poly.degree() > 1 for p in self.pieces):
            return None
        found = [p.poly.diff().eval(0) for p in self.pieces]
        return min(found), max(found)

    @property
    def odd(self) -> bool:
        """Whether psi(-y) = -psi(y)."""
        back = Poly(-INPUT, INPUT)
        turned = [Piece(-p.high, -p.low, -p.poly.compose(back)) for p in reversed(self.pieces)]
        jumps = {-y: (-high, -low) for y, (low, high) in self.jumps.items()}
        return tuple(turned) == self.pieces and jumps == dict(self.jumps)


def _at_infinity(p: Poly, end: Expr) -> Expr:
    """The limit of p/y at an end that is not finite."""
    if p.degree() <= 1:
        return p.diff().eval(0)
    return p.LC() * (end ** (p.degree() - 1))


def _above(p: Poly, low: Expr, high: Expr) -> bool:
    """Whether p > 0 on low <= y <= high but at y = 0."""
    if p.is_zero:
        return False
    while p.eval(0) == 0:
        p = p.quo(Poly(INPUT, INPUT))
        # y < 0 on the whole interval if it ends at 0 or before.
        if high <= 0:
            p = -p
    middle = (low + high) / 2 if low > -OO and high < OO else (low + 1 if low > -OO else high - 1)
    roots = p.count_roots(None if low == -OO else low, None if high == OO else high)
    return bool(roots == 0 and p.eval(middle) > 0)
