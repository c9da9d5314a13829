"""Whether surfaces on which a state slides attract, by the rates beside it, affine in signs: dh/dt = c + G s.

A solution leaves where some of the surfaces, with signs sigma, are departed from with a speed while the
others are held by multipliers within their bounds: sigma_i dh_i/dt > 0. Nearby solutions then leave by a
distance that does not depend on how near they start. One surface with s in [-1, 1] repels where G > 0; where
the set is wider (static friction above sliding friction) it does so also with G < 0 for every multiplier
beyond [-1, 1].

All come back in a time in proportion to their distance where D G + G' D is negative definite for a diagonal
D > 0 and all multipliers m are inside (-1, 1): V = sum d_i (abs(h_i) - m_i h_i) falls with the rate
(s - m)' D G (s - m), which is below a negative number while any h is not 0.
Sources: Filippov 1988; Leine & Nijmeijer 2004; Kaszkurewicz & Bhaya 2000 (diagonal stability).
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np

from filippov.analysis.algebra import linalg
from filippov.analysis.algebra.growth import Growth
from filippov.base.arrays import Array

# Parts of the terms of a rate, of 1 and of a matrix: what is below is not told from 0.
CLEAR = 1e-9
# Surfaces whose ways to leave are all tried: 3**k of them.
MOST = 6


def attraction(c: Array, G: Array, m: Array, bounds: Array) -> Growth:
    """Whether a state at rest on k surfaces, c + G m = 0, attracts across them.

    m, bounds   multipliers (k,) and the ends of their sets (k, 2)
    """
    if leaving(c, G, bounds) is not None:
        return "unstable"
    return "stable" if np.all(np.abs(m) < 1.0 - CLEAR) and _diagonally_stable(-G) else "undecided"


def leaving(c: Array, G: Array, bounds: Array) -> tuple[int, ...] | None:
    """The signs with which solutions leave, 0 on surfaces that they slide on; None if none are known."""
    k = len(c)
    if k > MOST or not (np.all(np.isfinite(c)) and np.all(np.isfinite(G))):
        return None
    ways = sorted(itertools.product((0, 1, -1), repeat=k), key=lambda way: sum(map(abs, way)))
    return next((way for way in ways[1:] if _leaves(c, G, bounds, np.array(way))), None)


def _leaves(c: Array, G: Array, bounds: Array, way: Array) -> bool:
    s, on, off = way.astype(float), way == 0, way != 0
    if np.any(on):
        inner = G[np.ix_(on, on)]
        if not abs(np.linalg.det(inner)) > CLEAR * np.prod(np.linalg.norm(inner, axis=1)):
            return False
        s[on] = -linalg.solve(inner, (c + G @ s)[on])
        if not np.all((bounds[on, 0] + CLEAR < s[on]) & (s[on] < bounds[on, 1] - CLEAR)):
            return False
    rates, sizes = c + G @ s, np.abs(c) + np.abs(G) @ np.abs(s)
    return bool(np.all((s * rates)[off] > CLEAR * sizes[off]))


def _diagonally_stable(M: Array) -> bool:
    """Whether one of the usual diagonal D > 0 makes D M + M' D positive definite."""
    if not np.all(np.diag(M) > 0):
        return False
    M = M / np.sqrt(np.outer(np.diag(M), np.diag(M)))
    for d in _scalings(M):
        if np.all(np.isfinite(d)) and np.all(d > 0):
            W = d[:, None] * M
            values = linalg.eigvalsh(W + W.T)
            if values[0] > CLEAR * values[-1]:
                return True
    return False


def _scalings(M: Array) -> Iterator[Array]:
    """Diagonals: 1; of a matrix with a dominant diagonal; by the first row, which decides for two."""
    yield np.ones(len(M))
    compared = 2.0 * np.diag(np.diag(M)) - np.abs(M)
    if abs(np.linalg.det(compared)) > CLEAR:
        yield linalg.solve(compared.T, np.ones(len(M))) / linalg.solve(compared, np.ones(len(M)))
    # d_i m_ij = +-d_j m_ji; an entry that is 0 counts as small as it has to be for two rows.
    least = 1e-4
    column, row = np.maximum(np.abs(M[:, 0]), least), np.maximum(np.abs(M[0]), least)
    yield row / column
