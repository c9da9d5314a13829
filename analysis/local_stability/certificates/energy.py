"""One mass on a line: its energy, and the sign of the power in each quadrant of position and speed.

q' = v, v' = F0(q) + G(q, v), F0 the mean of F over the signs of v at v = 0. With V = v^2/2 - integral of
F0, V' = v G. Where F0 leads back, V is positive definite and solutions pass through all quadrants, so that
power of one sign decides (LaSalle's invariance principle, for inclusions Shevitz & Paden 1994). Power
that vanishes keeps V. Where at v = 0 beside the point the force leads back with all signs but is balanced by
some, as by friction that outdoes it, solutions come to rest there, and the point is stable only.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace

import sympy
from sympy import Expr, Symbol

from filippov.analysis.local_stability.certificates.certificate import Certificate
from filippov.analysis.local_stability.certificates.homogeneous import EPSILON, lowest
from filippov.analysis.local_stability.certificates.local import Local, Signs

LASALLE = "Shevitz & Paden 1994, IEEE Trans. Automat. Contr. 39, 1910"
KRASOVSKII = "Krasovskii 1963; Shevitz & Paden 1994"
ENERGY = "Filippov 1988 (Lyapunov functions)"
_A, _B = sympy.symbols("a b", positive=True)


def energy(found: Local) -> Certificate | None:
    """The verdict by the energy of one mass; None where the field has not this form or power changes sign."""
    if len(found.x) != 2:
        return None
    for q, v in (found.x, found.x[::-1]):
        i, j = found.x.index(q), found.x.index(v)
        rates = {sympy.expand(f[i]) for f in found.fields.values()}
        c = sympy.expand(rates.pop() / v)
        if not rates and c.is_number and c.is_real and c != 0:
            return _one(found if c == 1 else _in_speed(found, j, c), q, v, j)
    return None


def _in_speed(found: Local, j: int, c: Expr) -> Local:
    """The same with the speed q' = c v in the place of v, whatever its sense and unit."""
    put = {found.x[j]: found.x[j] / c}

    def row(given: Sequence[Expr]) -> tuple[Expr, ...]:
        moved = [sympy.S(e).subs(put) for e in given]
        return tuple(c * e if k == j else e for k, e in enumerate(moved))

    return replace(
        found,
        fields={signs: row(f) for signs, f in found.fields.items()},
        h=tuple(h.subs(put) for h in found.h),
        resets={k: row(after) for k, after in found.resets.items()},
    )


def _one(found: Local, q: Symbol, v: Symbol, j: int) -> Certificate | None:
    moving = []
    for k, h in enumerate(found.h):
        if h.free_symbols <= {q}:
            moving.append(False)
        elif h.free_symbols <= {v} and k not in found.resets:
            moving.append(True)
        else:
            return None
    kept = _impacts(found, q, v)
    if kept is None:
        return None
    walls = [k for k, (_, turns) in kept.items() if turns and found.sides[k] != "both"]
    impact = [growth for growth, _ in kept.values()]
    powers, checked, held = list(impact), [], False
    for side in (1, -1):
        if any(_sign(found.h[k], {q: side * EPSILON}) != _of(found.sides[k]) for k in walls):
            continue
        at = [0 if m else _sign(h, {q: side * EPSILON}) for h, m in zip(found.h, moving, strict=True)]
        if any(s == 0 and not m for s, m in zip(at, moving, strict=True)):
            return None
        rest = _rest(found, at, v, j)
        part = lowest(rest.xreplace({q: side * EPSILON}))
        if part is None or not part[1].is_number or not side * part[1] < 0:
            return None
        held = held or _held(found, at, q, v, j, side)
        checked.append(f"for {q.name} {'>' if side > 0 else '<'} 0 beside it the force leads back")
        for way in (1, -1):
            signs = tuple(s or _sign(h, {v: way * EPSILON}) for s, h in zip(at, found.h, strict=True))
            if 0 in signs:
                return None
            put = {q: side * _A, v: way * _B}
            power = _power((found.fields[signs][j] - rest).subs(put, simultaneous=True) * way * _B)
            if power is None:
                return None
            powers.append(power)
    if not checked:
        return None
    impacts = ["impacts do not raise v^2" if max(impact) <= 0 else "impacts raise v^2"] if impact else []
    if all(p == 0 for p in powers):
        checked += [*impacts, "no power is lost or gained"]
        return Certificate("stable", "the energy is positive definite and kept", ENERGY, tuple(checked))
    if max(powers) <= 0 and held:
        checked += [
            *impacts,
            "the power v G is nowhere positive, and vanishes where v = 0 is held beside the rest",
        ]
        return Certificate("stable", "the energy does not rise along solutions", LASALLE, tuple(checked))
    if max(powers) <= 0:
        checked += [*impacts, "the power v G is nowhere positive and vanishes on no solution but the rest"]
        text = "the energy falls along solutions"
        return Certificate("asymptotically stable", text, LASALLE, tuple(checked))
    if min(powers) >= 0:
        checked += [*impacts, "the power v G is nowhere negative and vanishes on no solution but the rest"]
        return Certificate("unstable", "the energy grows along solutions", KRASOVSKII, tuple(checked))
    return None


def _of(side: str) -> int:
    return 1 if side == "+" else -1


def _rest(found: Local, at: list[int], v: Symbol, j: int) -> Expr:
    """F0: the mean over the signs of the surfaces of v (marked 0) at v = 0."""
    free = [k for k, s in enumerate(at) if s == 0]
    rows = []
    for choice in itertools.product((1, -1), repeat=len(free)):
        beside = dict(zip(free, choice, strict=True))
        signs: Signs = tuple(beside.get(k, s) for k, s in enumerate(at))
        rows.append(found.fields[signs][j].subs(v, 0))
    return sympy.Add(*rows) / len(rows)


def _held(found: Local, at: list[int], q: Symbol, v: Symbol, j: int, side: int) -> bool:
    """Whether v = 0 may be held on this side: a force there, by the signs of v, does not lead back."""
    for way in itertools.product((1, -1), repeat=at.count(0)):
        free = iter(way)
        signs: Signs = tuple(s or next(free) for s in at)
        part = lowest(found.fields[signs][j].subs(v, 0).xreplace({q: side * EPSILON}))
        if part is None or not part[1].is_number or not side * part[1] < 0:
            return True
    return False


def _sign(h: Expr, put: dict[Symbol, Expr]) -> int:
    """The sign of h just beside 0; 0 where it is not found."""
    part = lowest(h.xreplace(put))
    if part is None or not part[1].is_number or part[1] == 0:
        return 0
    return 1 if part[1] > 0 else -1


def _power(power: Expr) -> int | None:
    """The sign of a polynomial of two small positive numbers; None where it changes or is not seen."""
    e = sympy.expand(power)
    if e == 0:
        return 0
    if not e.is_polynomial(_A, _B):
        return None
    terms = sympy.Poly(e, _A, _B).terms()
    if any(not c.is_number for _, c in terms):
        return None
    signs = {bool(c > 0) for _, c in terms}
    if len(signs) == 1:
        return 1 if signs.pop() else -1
    least = tuple(min(m[k] for m, _ in terms) for k in (0, 1))
    for monomial, c in terms:
        if monomial == least:
            return 1 if c > 0 else -1
    return None


def _impacts(found: Local, q: Symbol, v: Symbol) -> dict[int, tuple[int, bool]] | None:
    """Of each reset q+ = q, v+ = r v on a surface of q: the sign of r^2 - 1, and whether r <= 0, so that the
    surface is not passed; None where one is no such."""
    i, j = found.x.index(q), found.x.index(v)
    out = {}
    for k, after in found.resets.items():
        if found.h[k].free_symbols - {q}:
            return None
        rate = sympy.expand(after[j]).coeff(v)
        if sympy.expand(after[i] - q).subs(q, 0) != 0 or sympy.expand(after[j] - rate * v) != 0:
            return None
        if not rate.is_number:
            return None
        out[k] = int(sympy.sign(rate**2 - 1)), bool(rate <= 0)
    return out
