"""Resting contact on surfaces given by functions, as `filippov.model.contact` does for expressions.

    L = dh/dt = h_t + grad h . f,   x' = f + side (1 - side s)/2 D,   L' = 0

D is the direction in which the reset moves a state that runs onto the surface, just off rest. Its length does
not act on the solution, as s follows from L' = 0. Derivatives are exact where the functions take dual
numbers, else differences, those of L of differences.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from filippov.base.arrays import Array
from filippov.base.errors import ModelError
from filippov.kernel.derivative.difference import slope
from filippov.model.surface import Surface

Function = Callable[[float, Array], Array]
OPEN_END = 1e300
# Relative to the states: the distance off rest at which the reset is evaluated; a change that counts as none.
OFF_REST, NONE = 1e-4, 1e-4


class PlainContacts:
    """The contacts of a system of functions.

    field(t, x, signs) -> x'; row(i, t, x) -> h_i, dh_i/dx and dh_i/dt, shape (n + 2,); reset(i, t, x) -> x+;
    exact(i, t, x, signs, rate) -> dL/dx and dL/dt, shape (n + 1,), or None
    """

    def __init__(
        self,
        surfaces: Sequence[Surface],
        field: Callable[[float, Array, Array], Array],
        row: Callable[[int, float, Array], Array],
        reset: Callable[[int, float, Array], Array],
        exact: Callable[[int, float, Array, Array, Callable[[float, Array], float]], Array | None],
    ) -> None:
        self.surfaces, self.field, self.row, self.reset, self.exact = surfaces, field, row, reset, exact
        self.side = np.array([(1.0 if q.side == "+" else -1.0) if q.contact else 0.0 for q in surfaces])
        self.checked: set[int] = set()
        self.across: dict[int, Array] = {}
        self.last: dict[int, tuple[float, bytes, Array]] = {}

    def held(self, mode: Array) -> list[int]:
        """The surfaces that the state rests on in a mode."""
        return [i for i, side in enumerate(self.side) if side != 0.0 and mode[i] == 0.0]

    def signs(self, mode: Array) -> Array:
        """The signs at which rates of contacts are evaluated; they do not depend on them."""
        return np.where(mode != 0.0, mode, np.where(self.side != 0.0, self.side, 1.0))

    def rate(self, i: int, t: float, x: Array, signs: Array) -> float:
        """L of surface i."""
        x.flags.writeable = False
        row = self.row(i, t, x)
        return float(row[1:-1] @ self.field(t, x, signs) + row[-1])

    def slopes(self, i: int, t: float, x: Array, signs: Array) -> Array:
        """dL/dx and dL/dt of surface i, shape (n + 1,)."""
        found = self.exact(i, t, x, signs, lambda at, y: self.rate(i, at, y, signs))
        if found is not None:
            return found
        out = np.empty(x.size + 1)
        largest = float(np.max(np.abs(x), initial=0.0))
        for j in range(x.size + 1):
            at = t if j == x.size else float(x[j])

            def along(moved: float, j: int = j) -> float:
                if j == x.size:
                    return self.rate(i, moved, x, signs)
                y = x.copy()
                y[j] = moved
                y.flags.writeable = False
                return self.rate(i, t, y, signs)

            out[j] = slope(along, at, max(abs(at), 1e-3 * largest, 1e-3))
        return out

    def pushed(self, field: Array, t: float, x: Array, s: Array, mode: Array) -> Array:
        """The field with the reactions of the surfaces that the state rests on; s: signs and multipliers."""
        for i in self.held(mode):
            side = self.side[i]
            field = field + 0.5 * side * (1.0 - side * s[i]) * self.direction(i, t, x, self.signs(mode))
        return field

    def direction(self, i: int, t: float, x: Array, signs: Array) -> Array:
        """D of surface i at a state, scaled to grad L . D = 1; ModelError where there is none."""
        key = t, x.tobytes() + signs.tobytes()
        if i in self.last and self.last[i][:2] == key:
            return self.last[i][2]
        if i not in self.checked:
            self._check(i, t, self._at_rest(i, t, x, signs), signs)
            self.checked.add(i)
        found = self._direction(i, t, x, signs)
        self.last[i] = (*key, found)
        return found

    def _direction(self, i: int, t: float, x: Array, signs: Array) -> Array:
        step, into = self._probe(i, t, x, signs)
        jumps = []
        for place in (x + step, x):
            place.flags.writeable = False
            jumps.append(self.reset(i, t, place) - place)
        push = jumps[0] - jumps[1]
        high, low = x + 0.5 * push, x - 0.5 * push
        along = self.rate(i, t, high, signs) - self.rate(i, t, low, signs)
        if not np.isfinite(along) or abs(along) <= NONE * abs(into):
            self._refuse(i, "the reset does not act on dh/dt")
        return np.asarray(push / along)

    def _probe(self, i: int, t: float, x: Array, signs: Array) -> tuple[Array, float]:
        """A small displacement that keeps h and runs onto the surface, and the change of L along it.

        grad L is evaluated again only where the displacement from the last one has become less steep.
        """
        slope, now = self.row(i, t, x)[1:-1], self.rate(i, t, x, signs)
        for known in (True, False):
            across = self.across.get(i)
            if across is None or not known:
                across = self.across[i] = self.slopes(i, t, x, signs)[:-1]
            size = float(slope @ slope)
            way = across - slope * (float(across @ slope) / size) if size > 0.0 else across
            along = float(across @ way)
            if not along > 0.0:
                if known:
                    continue
                self._refuse(i, "dh/dt does not depend on the state")
            length = OFF_REST * max(float(np.max(np.abs(x), initial=0.0)), 1.0) / float(np.sqrt(way @ way))
            step = -self.side[i] * length * way
            into = self.rate(i, t, x + step, signs) - now
            if known and not -self.side[i] * into > 0.5 * along * length:
                continue
            return step, into
        raise AssertionError

    def _at_rest(self, i: int, t: float, x: Array, signs: Array) -> Array:
        """The state moved to h = L = 0 along the gradients."""
        for _ in range(4):
            row = self.row(i, t, x)
            values = np.array([row[0], self.rate(i, t, x, signs)])
            rows = np.vstack([row[1:-1], self.slopes(i, t, x, signs)[:-1]])
            step, *_ = np.linalg.lstsq(rows, values, rcond=None)
            x = np.ascontiguousarray(x - step)
            x.flags.writeable = False
        return x

    def _check(self, i: int, t: float, x: Array, signs: Array) -> None:
        """Refuse a surface whose reset, or whose signs, act on h or dh/dt at rest (once for every run)."""
        step, into = self._probe(i, t, x, signs)
        level = NONE * abs(into)
        for j in range(len(signs)):
            other = signs.copy()
            other[j] = -other[j]
            if abs(self.rate(i, t, x, other) - self.rate(i, t, x, signs)) > level:
                self._refuse(i, f"the sign of {self.surfaces[j].name!r} acts on dh/dt")
        after = self.reset(i, t, x)
        after.flags.writeable = False
        slope = self.row(i, t, x)[1:-1]
        shift = abs(self.row(i, t, after)[0] - self.row(i, t, x)[0])
        if shift > NONE * float(np.abs(slope) @ np.abs(step) + np.abs(slope) @ np.abs(x)) or not (
            abs(self.rate(i, t, after, signs)) <= max(level, 2.0 * abs(self.rate(i, t, x, signs)))
        ):
            self._refuse(i, "the reset changes h or dh/dt where both are 0")

    def _refuse(self, i: int, why: str) -> None:
        raise ModelError(
            f"surface {self.surfaces[i].name!r}: there is no resting contact, for {why}. contact=True fits a "
            "reset that keeps h and turns dh/dt round, as an impact does; leave it out to end the run where "
            "the impacts accumulate."
        )
