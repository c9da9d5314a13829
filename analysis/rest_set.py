"""Which states of rest belong to one connected set of equilibria.

Two rests belong together where the states between them come to rest beside themselves: the ends of motions from
points of the straight line are a chain without a gap, and the widest gap closes when it is looked at again. On a
straight set they do not move at all; on a bent one they are drawn to it; between two separate equilibria the chain
breaks.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from filippov.analysis.state_map import StateMap

Array = npt.NDArray[np.float64]
BETWEEN = 12
# The widest gap of a chain, in parts of an even spacing; how often P is applied to come to rest.
GAP, ITERATES = 2.5, 60
# How often the widest gap is looked at: sets apart by (GAP/13)^4 = 0.0014 of two rests' distance are told apart.
LOOKS = 4


def joined(
    flow: StateMap, a: Array, b: Array, size: Array, near: float, looks: int = LOOKS
) -> npt.NDArray[np.bool_]:
    """Whether the rests a and b (k, n) lie in one set, row by row; `near`: displacement that counts as none."""
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


def groups(flow: StateMap, rests: Array, size: Array, near: float) -> npt.NDArray[np.int64]:
    """Number of the connected set of each rest (k, n): (k,), by the shortest links between them."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    count = len(rests)
    if count < 2:
        return np.zeros(count, dtype=np.int64)
    scaled = rests / size
    neighbours = cKDTree(scaled).query(scaled, k=min(4, count))[1][:, 1:]
    pairs = {(int(min(i, j)), int(max(i, j))) for i, row in enumerate(neighbours) for j in row if i != j}
    table = np.array(sorted(pairs), dtype=np.int64)
    held = joined(flow, rests[table[:, 0]], rests[table[:, 1]], size, near)
    links = table[held]
    while True:
        graph = coo_array((np.ones(len(links)), (links[:, 0], links[:, 1])), shape=(count, count))
        total, label = connected_components(graph, directed=False)
        # What is still apart is tried once more, by the closest pair of every two groups.
        more = _closest(scaled, label, total) if total <= 40 else np.zeros((0, 2), dtype=np.int64)
        more = np.array([q for q in more.tolist() if tuple(q) not in pairs], dtype=np.int64).reshape(-1, 2)
        if not len(more):
            return np.asarray(label, dtype=np.int64)
        pairs |= {tuple(q) for q in more.tolist()}
        links = np.vstack([links, more[joined(flow, rests[more[:, 0]], rests[more[:, 1]], size, near)]])


def _closest(scaled: Array, label: npt.NDArray[np.int32], total: int) -> npt.NDArray[np.int64]:
    """The closest pair of members of every two groups."""
    from scipy.spatial import cKDTree

    members = [np.flatnonzero(label == g) for g in range(total)]
    trees = [cKDTree(scaled[m]) for m in members]
    out = []
    for g in range(total):
        for h in range(g + 1, total):
            gap, at = trees[g].query(scaled[members[h]])
            k = int(np.argmin(gap))
            i, j = int(members[g][at[k]]), int(members[h][k])
            out.append((min(i, j), max(i, j)))
    return np.array(out, dtype=np.int64).reshape(-1, 2)
