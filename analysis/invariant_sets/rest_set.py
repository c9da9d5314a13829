"""Which states of rest belong to one connected set of equilibria.

Two rests belong together where the states between them come to rest beside themselves: the ends of solutions
from points of the straight line are a chain without a gap, and the widest gap closes when it is looked at
again. On a straight set they do not move at all; on a bent one they are drawn to it; between two separate
equilibria the chain breaks.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from filippov.analysis.invariant_sets.state_map import StateMap
from filippov.base.arrays import Array, Whole

BETWEEN = 12
# The widest gap of a chain, in parts of an even spacing; how often R is applied to come to rest.
GAP, ITERATES = 2.5, 60
# How often the widest gap is looked at: sets apart by (GAP/13)^4 = 0.0014 of two rests' distance are
# separated.
LOOKS = 4
# Rests through which a tree is laid.
MOST = 2000


def joined(
    flow: StateMap, a: Array, b: Array, size: Array, near: float, looks: int = LOOKS
) -> npt.NDArray[np.bool_]:
    """Whether rests a and b (k, n) lie in one set, row by row; `near`: displacement that is none."""
    if not len(a):
        return np.zeros(0, dtype=bool)
    share = np.linspace(0.0, 1.0, BETWEEN + 2)[1:-1]
    start = a[:, None, :] + share[None, :, None] * (b - a)[:, None, :]
    shape = start.shape
    x = start.reshape(-1, shape[2])
    moving = np.ones(len(x), dtype=bool)
    failed = np.zeros(len(x), dtype=bool)
    for _ in range(ITERATES):
        rows = np.flatnonzero(moving)
        if not rows.size:
            break
        image, ends = flow(x[rows])
        good = flow.done(ends)
        failed[rows[~good]] = True
        moving[rows] = good & (np.max(np.abs(image - x[rows]) / size, axis=1) > near)
        x[rows] = image
    rests = ~(moving | failed)
    rests[rests] = flow.resting(x[rests], near * size)
    settled = np.all(rests.reshape(shape[:2]), axis=1)
    chain = np.concatenate([a[:, None, :], x.reshape(shape), b[:, None, :]], axis=1) / size
    steps = np.linalg.norm(np.diff(chain, axis=1), axis=2)
    width = np.linalg.norm((b - a) / size, axis=1)
    # Rests within what counts as no displacement are one.
    one = width <= 10 * near
    held = settled & (np.max(steps, axis=1) <= GAP * width / (BETWEEN + 1) + near) & ~one
    if looks > 1 and held.any():
        rows = np.flatnonzero(held)
        widest = np.argmax(steps[rows], axis=1)
        held[rows] = joined(
            flow, chain[rows, widest] * size, chain[rows, widest + 1] * size, size, near, looks - 1
        )
    return np.asarray(held | one)


def groups(flow: StateMap, rests: Array, size: Array, near: float, reach: float) -> Whole:
    """Number of the connected set of each rest (k, n): (k,), by the links of the shortest tree through them.

    Rests closer than `reach`, in parts of the sizes, are taken for one.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components, minimum_spanning_tree
    from scipy.spatial.distance import cdist

    while True:
        cells = np.round(rests / size / reach)
        _, place, member = np.unique(cells, axis=0, return_index=True, return_inverse=True)
        if len(place) <= MOST:
            break
        reach *= 2
    x = rests[place]
    if len(x) == 1:
        return np.zeros(len(rests), dtype=np.int64)
    tree = minimum_spanning_tree(cdist(x / size, x / size)).tocoo()
    held = joined(flow, x[tree.row], x[tree.col], size, near)
    links = coo_array((np.ones(int(held.sum())), (tree.row[held], tree.col[held])), shape=(len(x), len(x)))
    return np.asarray(connected_components(links, directed=False)[1], dtype=np.int64)[member.ravel()]
