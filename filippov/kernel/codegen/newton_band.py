"""The order of states in which Newton's matrices of a large sparse system are bands."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from filippov.kernel.language.unit import Constant

if TYPE_CHECKING:
    from filippov.model.symbolic import SymbolicForm

# Fewer states are not worth a band, nor is a band of more than this part of a row.
FEW, WORTH = 16, 0.5


def newton_band(form: SymbolicForm, constants: Mapping[str, Any]) -> dict[str, Constant]:
    """BAND and IN_BAND of `filippov.kernel.loop.model`, from the equations and the constants of their unit.

    By the reverse Cuthill-McKee order of the symmetric pattern (George & Liu 1981).
    """
    n = len(form.x)
    dense: dict[str, Constant] = {"BAND": 0, "IN_BAND": [0]}
    # The acceleration of a contact is in its guard: nothing is known of what that depends on.
    rows = [] if n < FEW or any(form.contact) else jacobian_rows(form, constants)
    if not rows or sum(map(len, rows)) > WORTH * n * n:
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


def jacobian_rows(form: SymbolicForm, constants: Mapping[str, Any]) -> list[set[int]]:
    """For every state those on which its component of the field depends, whatever slides; [] for too many.

    The multiplier of a surface depends on all that the rates of its component of surfaces depend on, and
    moves what its sign acts on and the states in its guard.
    """
    first, column, component = (constants[name] for name in ("G_FIRST", "G_COLUMN", "COMPONENT"))
    columns = [column[first[i] : first[i + 1]] for i in range(len(form.h))]
    place = {x: j for j, x in enumerate(form.x)}
    sign, size = {s: i for i, s in enumerate(form.s)}, {a: i for i, a in enumerate(form.a)}
    rows, moved, felt = list[set[int]](), dict[int, set[int]](), dict[int, set[int]]()
    signs = list[set[int]]()
    for k, f in enumerate(form.field):
        inside = f.free_symbols
        rows.append({k, *(place[x] for x in inside & place.keys())})
        rows[k].update(*(columns[size[a]] for a in inside & size.keys()))
        signs.append({sign[s] for s in inside & sign.keys()})
        for i in signs[k]:
            moved.setdefault(component[i], set()).add(k)
    for i in set[int]().union(*signs):
        moved[component[i]].update(columns[i])
        felt.setdefault(component[i], set()).update(columns[i], *(rows[r] for r in columns[i]))
    for number, states in moved.items():
        if len(states) * len(felt[number]) > len(rows) ** 2 // 4:
            return []
        for r in states:
            rows[r] |= felt[number]
    return rows
