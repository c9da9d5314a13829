"""Dead bands by hand: |u| < width where u = 0 is meant, and what friction is held at rest there.

A program cannot name the force of a mass at rest, and gives it inside a band of velocities: none, what
balances the load, or that up to a limit. The System has the sign that the field takes beyond the band, with a
wider set at u = 0 where the limit at rest is larger.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import sympy
from sympy import Abs, Expr

from filippov.analysis.programs.conditions import CORNERS, NEAREST, STEPS, cases_of
from filippov.analysis.programs.reader import Reading, read_program
from filippov.base.errors import ModelError
from filippov.model.symbolic import Select

# The widest band that may be a dead band, the widest for a velocity that something holds inside it, the
# widest that stands for 0 whatever is inside (the others may be the dead zone of a relay), and how many
# conditions are looked through inside.
WIDEST, WIDE, HAIR, MOST_INSIDE = 0.1, 0.02, 1e-6, 6
SAME = 1e-9

Fixed = Callable[[Any], float | None]


def band_of(h: Any, fixed: Fixed) -> tuple[Expr, float] | None:
    """(u, width) of a condition that compares |u| with a small width; None for another one."""
    if not isinstance(h, sympy.Add) or len(h.args) != 2:
        return None
    sizes = [part for part in h.args if isinstance(part, Abs) or isinstance(-part, Abs)]
    width = fixed(h - sizes[0]) if len(sizes) == 1 else None
    if width is None or not 0 < abs(width) <= WIDEST:
        return None
    size: Any = sizes[0] if isinstance(sizes[0], Abs) else -sizes[0]
    return size.args[0], abs(width)


def without_bands(found: Reading) -> Reading:
    """The same with the sign alone for each dead band that friction by hand has made.

    Other bands stay: those inside which nothing holds u still, unless they are as narrow as rounding, and
    those of a field that does not jump at u = 0 but for them.
    """
    for u, width in dict.fromkeys(_bands(found)):
        place = _zero_of(u, found)
        upper, lower, inside = (
            tuple(_chosen(rate, u, width, region, found) for rate in found.field) for region in (1, -1, 0)
        )
        if place is None or (width > HAIR and not _holds(u, place, inside, found)):
            continue
        outside = tuple(Select(u, above, below) for above, below in zip(upper, lower, strict=True))
        level = _level(u, place, outside, inside, found)
        if level is not None:
            held = ((u, level),) if level != 1 else ()
            edges = tuple(
                (site.h, u, width) for site in found.sites
                if site.h is not None and _sign_in(site.h, u, width, 0, found) is not None
            )  # fmt: skip
            dropped = (*found.dropped, *edges)
            found = replace(found, field=outside, dropped=dropped, held=(*found.held, *held))
    return found


def without_equalities(found: Reading, function: Callable[..., Any], args: Sequence[Any]) -> Reading:
    """The same with what the program holds where it compares a float for equality, as v == 0, if it says so.

    An equality is a dead band of no width; what is inside is read here alone.
    """
    if found.memories or not any(site.kind == "equality" for site in found.sites):
        return found
    try:
        near = without_bands(read_program(function, len(found.states), args, equal_nearby=True))
    except ModelError:
        return found
    left = (q for rate in near.field for q in rate.atoms(sympy.Float))
    return near if near.held and all(abs(float(q)) != NEAREST for q in left) else found


def _bands(found: Reading) -> Iterator[tuple[Expr, float]]:
    """(u, width) of the conditions that together, or alone as |u| < width, tell |u| < width."""
    fixed = found.parameters.fixed
    given = [h for h in dict.fromkeys(site.h for site in found.sites) if h is not None]
    for h in given:
        band = band_of(h, fixed)
        if band is not None and band[1] <= WIDE:
            yield band
    yield from ((site.h, NEAREST) for site in found.sites if site.kind == "equality" and site.h is not None)
    for first, second in itertools.combinations([h for h in given if not h.has(*STEPS, *CORNERS)], 2):
        for side in (1, -1):
            gap = fixed(sympy.expand(first + side * second))
            if gap is not None and 0 < abs(gap) <= 2 * WIDE:
                u = sympy.expand((first - side * second) / 2)
                yield -u if u.could_extract_minus_sign() else u, abs(gap) / 2


def _sign_in(h: Expr, u: Expr, width: float, region: int, found: Reading) -> int | None:
    """The sign of a condition above (1), below (-1) and inside (0) a band; None of one that is no edge."""
    fixed = found.parameters.fixed
    band = band_of(h, fixed)
    if band is not None and band[0] in (u, -u) and abs(band[1] - width) <= SAME * width:
        beyond = 1 if any(isinstance(part, Abs) for part in h.args) else -1
        return beyond if region else -beyond
    if h.has(*STEPS, *CORNERS):
        return None
    for way in (1, -1):
        rest = fixed(sympy.expand(h - way * u))
        if rest is not None and abs(abs(rest) - width) <= SAME * width:
            return way * region or (1 if rest > 0 else -1)
    return None


def _chosen(rate: Expr, u: Expr, width: float, region: int, found: Reading) -> Expr:
    """A rate in one region of a band."""
    while True:
        for atom in sorted(rate.atoms(Select), key=sympy.default_sort_key):
            sign = _sign_in(atom.args[0], u, width, region, found)
            if sign is not None:
                rate = rate.xreplace({atom: atom.args[1] if sign > 0 else atom.args[2]})
                break
        else:
            return rate


def _zero_of(u: Expr, found: Reading) -> dict[Expr, Expr] | None:
    """The place of a state at which u = 0; None where u is not linear in one."""
    for x in found.states:
        slope = u.diff(x)
        if found.parameters.fixed(slope):
            return {x: sympy.expand(x - u / slope)}
    return None


def _on_side(expr: Expr, u: Expr, side: int, fixed: Fixed) -> Expr:
    """An expression where u has a sign: signs, sizes and choices by u are decided."""
    while True:
        for atom in sorted(expr.atoms(*STEPS, Abs), key=sympy.default_sort_key):
            h, plus, minus = cases_of(atom)
            ratio = None if h.has(*STEPS, *CORNERS) else fixed(sympy.cancel(h / u))
            if ratio:
                expr = expr.xreplace({atom: plus if ratio * side > 0 else minus})
                break
        else:
            return expr


def _leaves(expr: Expr, path: tuple[Expr, ...] = ()) -> Iterator[tuple[Expr, tuple[Expr, ...]]]:
    """What an expression is in each of its cases, with the conditions on the way."""
    found = sorted(expr.atoms(*STEPS, *CORNERS), key=lambda q: (-sympy.count_ops(q), str(q)))
    if not found or len(path) >= MOST_INSIDE:
        yield expr, path
        return
    h, *sides = cases_of(found[0])
    for side in sides:
        yield from _leaves(expr.xreplace({found[0]: side}), (*path, h))


def _holds(u: Expr, place: dict[Expr, Expr], inside: tuple[Expr, ...], found: Reading) -> bool:
    """Whether u is a velocity, and stays as it is in one of the cases inside the band."""
    own, fixed = u.free_symbols & set(found.states), found.parameters.fixed
    others = (rate for x, rate in zip(found.states, found.field, strict=True) if x not in own)
    if not any(rate.free_symbols & own for rate in others):
        return False
    change = sum((u.diff(x) * rate for x, rate in zip(found.states, inside, strict=True)), u.diff(found.time))
    return any(fixed(sympy.simplify(leaf)) == 0.0 for leaf, _ in _leaves(change.xreplace(place)))


def _level(
    u: Expr, place: dict[Expr, Expr], outside: tuple[Expr, ...], inside: tuple[Expr, ...], found: Reading
) -> Any:
    """What is held at u = 0, relative to what acts in motion beside it; None where that is no number."""
    fixed = found.parameters.fixed
    for beyond, within in zip(outside, inside, strict=True):
        plus, minus = (_on_side(beyond, u, side, fixed).xreplace(place) for side in (1, -1))
        if fixed(sympy.simplify(plus - minus)) == 0.0:
            continue
        slips: dict[float, Any] = {}
        limits: dict[float, Any] = {}
        # What the load is made of is decided for both: a force that is limited is in motion and at rest.
        for leaf, path in _leaves(sympy.Tuple(within.xreplace(place), plus, minus)):
            if leaf.atoms(*STEPS, *CORNERS):
                return None
            rest, above, below = leaf
            ratio = sympy.simplify((2 * rest - above - below) / (above - below))
            known = fixed(ratio) is not None
            for level in [ratio] if known else _ends(ratio, path, found):
                size = fixed(level) or 0.0
                # Of a load that is held nothing but where that ends is a limit.
                if abs(size) > SAME and abs(abs(size) - 1.0) > SAME and not (known and fixed(rest) == 0.0):
                    (slips if known else limits)[round(abs(size), 9)] = level if size > 0 else -level
        levels = slips or limits
        if not levels:
            return sympy.S.One
        (size, level), *more = levels.items()
        factor, rest = level.as_coeff_Mul()
        return (rest if factor == 1.0 else level) if size > 1.0 and not more else None
    return None


def _ends(ratio: Expr, path: tuple[Expr, ...], found: Reading) -> Iterator[Expr]:
    """The values of a force at the conditions that it is compared in."""
    fixed = found.parameters.fixed
    for h in path:
        flat = h.replace(Abs, lambda q: q)
        for x in found.states:
            slope = sympy.simplify(flat.diff(x) / ratio.diff(x)) if ratio.diff(x) != 0 else None
            if slope is not None and fixed(slope):
                end = sympy.simplify(ratio - flat / slope)
                if fixed(end) is not None:
                    yield end
                break
