"""The order of states in which Newton's matrices of a large sparse system are bands."""

from __future__ import annotations

from collections.abc import Sequence

from filippov.kernel.language.unit import Constant

# Fewer states are not worth a band, nor is a band of more than this part of a row.
FEW, WORTH = 16, 0.5


def newton_band(rows: Sequence[set[int]]) -> dict[str, Constant]:
    """BAND and IN_BAND of `filippov.kernel.loop.model`: row i of the Jacobian has entries in columns rows[i].

    By the reverse Cuthill-McKee order of the symmetric pattern (George & Liu 1981).
    rows: empty where not known
    """
    n = len(rows)
    dense: dict[str, Constant] = {"BAND": 0, "IN_BAND": [0]}
    if n < FEW or sum(map(len, rows)) > WORTH * n * n:
        return dense
    import numpy as np
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import reverse_cuthill_mckee

    i = np.repeat(np.arange(n), [len(row) for row in rows])
    j = np.array([column for row in rows for column in sorted(row)], dtype=np.int64)
    pattern = csr_array((np.ones(len(i), dtype=np.int8), (i, j)), shape=(n, n))
    order = np.asarray(reverse_cuthill_mckee(csr_array(pattern + pattern.T), symmetric_mode=True))
    place = np.empty(n, dtype=np.int64)
    place[order] = np.arange(n)
    band = max(1, int(np.max(np.abs(place[i] - place[j]), initial=0)))
    if 3 * band + 1 > WORTH * n:
        return dense
    return {"BAND": band, "IN_BAND": order.tolist()}
