"""Bands of any number of Switch or Karnopp models that share a rate: each friction sticks to what moves by e.

    h_i in place of which the sign takes h_i - e_i;   e_i' = -alpha_i e_i
    e_i = +-eta_i where |h_i| = eta_i is passed inwards, 0 where it is passed outwards

so that dh_i/dt = -alpha_i h_i while friction i sticks, from the edge of its band on. Who sticks, and with
which force, the inclusion itself decides: three surfaces a friction for any number of them, where the levels
of `filippov.model.comparators.coupled_bands` grow like 3^n. Friction that slips within its band sticks again
at h_i = e_i, not where its force would hold it.

Where h_i is a sum of others, sum_j c_ij(x) h_j, it has no e: it sticks at the same sum of theirs, so that all
stick at once. Its band is that of this sum, |h_i| <= sum_j |c_ij| eta_j. While it is within it none of these
e_j is set: it would tear off, and could drive h_j out of the band again, at once and forever.

Switch     places move with the velocities
Karnopp    velocities count in every equation as those at h_i - e_i, brought there along what the signs do
           (where some depend on the others, each along what its own sign does), so nothing drifts in stick
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np
import sympy
from scipy.linalg import qr
from sympy import Expr, Symbol

from filippov.base.arrays import Array
from filippov.base.errors import ModelError
from filippov.model.comparator import Karnopp
from filippov.model.comparators.stick_band import OTHERS, UNIT, StickBand, kink, moved_onto
from filippov.model.surface import Surface
from filippov.model.symbolic import SymbolicForm, convex
from filippov.model.symbols import states

Row = tuple[Expr, ...] | None


def with_moving_stick(
    form: SymbolicForm, surfaces: Sequence[Surface], bands: Sequence[StickBand]
) -> tuple[SymbolicForm, tuple[Surface, ...]]:
    """The form with one state e more for each band, last, and the surfaces with the edges of bands, last.

    A band whose h is a sum of others has no e. Raises ModelError where what Karnopp takes for the velocity
    at h = e depends on the velocities.
    """
    shares = _shares(form, bands)
    own = [k for k in range(len(bands)) if k in shares[k]]
    e = _memories(form, [bands[k] for k in own])
    at = dict(zip(own, e, strict=True))
    sticks = [sympy.Add(*(c * at[j] for j, c in row.items())) for row in shares]
    n, m = len(form.x), len(form.h)
    h, sets, out = list(form.h), list(form.radius), list(surfaces)
    widths = list(form.widths) or [None] * m
    for band, q in zip(bands, sticks, strict=True):
        h[band.i], widths[band.i] = band.h - q, None
        out[band.i] = replace(band.surface, h=band.surface.h - q, width=0.0)
    reach = [sympy.Add(*(_at_least(c) * bands[j].width for j, c in row.items())) for row in shares]
    # The signs of both edges of every band.
    signs = [[Symbol(f"_s{m + 2 * k + side}", real=True) for side in (0, 1)] for k in range(len(bands))]
    edges: list[Row] = []
    for k, band in enumerate(bands):
        q = at.get(k)
        after: Expr | None = None
        if q is not None:
            # One rule for both edges: an impact may pass them at once.
            free = sympy.Mul(*(
                1 - (1 - signs[j][0]) * (1 + signs[j][1]) / 4
                for j, row in enumerate(shares) if j != k and k in row
            ))  # fmt: skip
            after = q + free * (band.width * sympy.Add(*signs[k]) / 2 - q)
        for name, side in (("upper", 1), ("lower", -1)):
            h.append(band.h - side * reach[k])
            own = band.surface.h - side * reach[k]
            label = f"{band.surface.name}:{name}"
            if after is None:
                edges.append(None)
                out.append(kink(band.surface, label, own))
            else:
                edges.append(tuple(after if other is q else other for other in (*form.x, *e)))
                out.append(Surface(label, own, reset={q: after}, side="both"))
    more = len(edges)
    still = [k for k, band in enumerate(bands) if isinstance(band.own, Karnopp)]
    still = [k for k in still if k in shares[k] or not shares[k].keys() <= set(still)]
    seen = _seen(form, [bands[k] for k in still], [sticks[k] for k in still], bands)
    field = [f.xreplace(seen) for f in form.field]
    field[n:n] = [-bands[k].alpha * q for k, q in at.items()]

    def longer(row: Row) -> Row:
        return None if row is None else (*row, *e)

    made = replace(
        form, x=(*form.x, *e), field=tuple(field), h=tuple(h), radius=(*sets, *[UNIT] * more),
        s=(*form.s, *(Symbol(f"_s{k}", real=True) for k in range(m, m + more))),
        a=(*form.a, *(Symbol(f"_a{k}", nonnegative=True) for k in range(m, m + more))),
        reset=(*(longer(row) for row in form.reset or (None,) * m), *edges),
        time_reset=tuple(longer(row) for row in form.time_reset),
        contact=tuple(
            None if q is None else replace(q, direction=(*q.direction, *[sympy.S.Zero] * len(e)))
            for q in (*form.contact, *[None] * more)
        ) if form.contact else (),
        widths=(*widths, *[None] * more) if any(w is not None for w in widths) else (),
        held=(*form.held, *[False] * more) if form.held else (),
    )  # fmt: skip
    return made, tuple(out)


def _shares(form: SymbolicForm, bands: Sequence[StickBand]) -> list[dict[int, Expr]]:
    """Of which bands each h is a sum, with which factors, functions of places: of itself, or of ones before.

    All of a sum stick at once, at the same sum of their e: with an e of its own one would tear off.
    """
    signs = {band.s for band in bands}
    moved = [x for x, f in zip(form.x, form.field, strict=True) if f.free_symbols & signs]
    rows = [_row(band.h, moved) for band in bands]
    free = sorted({q for row in rows for e in row for q in e.free_symbols}, key=lambda q: str(q.name))
    rng = np.random.default_rng(0)
    drawn = []
    for _ in range(2):
        at = dict(zip(free, map(sympy.Float, rng.uniform(0.5, 1.5, len(free))), strict=True))
        drawn.append(np.array([[float(sympy.N(e.xreplace(at))) for e in row] for row in rows]))
    own: list[int] = []
    out: list[dict[int, Expr]] = []
    for k, row in enumerate(rows):
        few = (q for size in range(1, min(len(own), len(moved)) + 1) for q in combinations(own, size))
        among = next((q for q in few if all(_sum_of(part[list(q)], part[k]) for part in drawn)), None)
        if among is None:
            own.append(k)
            out.append({k: sympy.S.One})
            continue
        pivots = qr(drawn[0][list(among), :-1], pivoting=True, mode="r")[1][: len(among)].tolist()
        base = sympy.Matrix([[rows[j][c] for c in pivots] for j in among])
        found = base.T.LUsolve(sympy.Matrix([row[c] for c in pivots]))
        out.append({j: _tidy(e) for j, e in zip(among, found, strict=True)})
    return out


def _sum_of(base: Array, row: Array) -> bool:
    """Whether a row is a sum of others that can all be 0 at once: of independent slopes."""
    slopes = base[:, :-1]
    if np.linalg.matrix_rank(slopes, tol=1e-9) < len(base):
        return False
    share = np.linalg.lstsq(slopes.T, row[:-1], rcond=None)[0]
    return bool(np.any(row[:-1]) and np.max(np.abs(share @ base - row)) < 1e-9)


def _at_least(c: Expr) -> Expr:
    """|c|, or what is no less and has no kink."""
    return sympy.Abs(c) if c.is_number else (1 + c**2) / 2


def _row(h: Expr, moved: Sequence[Symbol]) -> list[Expr]:
    """h as what velocities are multiplied by, and the rest."""
    slopes = [h.diff(x) for x in moved]
    if any(e.has(*moved) for e in slopes):
        return [sympy.S.Zero] * len(moved) + [h]
    return [*slopes, h.xreplace(dict.fromkeys(moved, sympy.S.Zero))]


def _tidy(e: Expr) -> Expr:
    if not e.is_number:
        return sympy.simplify(e)
    value = round(float(e), 12)
    return sympy.Integer(int(value)) if value.is_integer() else sympy.Float(float(e))


def _memories(form: SymbolicForm, bands: Sequence[StickBand]) -> tuple[Symbol, ...]:
    """One new state for each band, named after its surface."""
    taken = [q.name for q in (*form.x, *form.p)]
    for band in bands:
        name = "e_" + "".join(c if c.isalnum() else "_" for c in band.surface.name)
        while name in taken:
            name += "_"
        taken.append(name)
    return tuple(states(" ".join(taken[-len(bands) :])))


def _seen(
    form: SymbolicForm, bands: Sequence[StickBand], sticks: Sequence[Expr], every: Sequence[StickBand]
) -> dict[Symbol, Expr]:
    """The states as those under Karnopp, which are `bands`, count them."""
    signs = {band.s for band in every}
    at = {band.a: sympy.S.Zero for band in every}
    fields = [convex(f, signs).xreplace(at) for f in form.field[: len(form.x)]]
    parts = [
        ([q], [[band.h.diff(x) for x in form.x]], [[f.diff(band.s) for f in fields]])
        for band, q in zip(bands, sticks, strict=True)
    ]
    if not parts:
        return {}
    h, slopes, effects = ([row for part in parts for row in part[k]] for k in range(3))
    lost = moved_onto(h, slopes, effects, form.x, form.p)
    alone = [] if lost else [moved_onto(*part, form.x, form.p) for part in parts]
    if not lost and not all(alone):
        names = ", ".join(repr(band.surface.name) for band in bands)
        raise ModelError(
            f"{bands[0].name}: the ratio in which the signs of {names} act on the velocities changes with "
            f"these, expected one of the places alone, as a mass matrix has it. {OTHERS}"
        )
    lost = lost or [sympy.Add(*less) for less in zip(*alone, strict=True)]
    return {x: x - less for x, less in zip(form.x, lost, strict=True) if less != 0}
