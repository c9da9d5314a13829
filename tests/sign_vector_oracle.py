"""Runs of one vector field a sign vector by scipy, with event decisions of its own: for published problems.

DOP853 from phase to phase; guards sampled on its dense output and refined by bisection. On one surface a
slide is Filippov's convex combination, on several the multi-affine one; the mode after an event is the only
one that does what it says. Formulas are read by sympy.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy
from scipy.integrate import DOP853
from scipy.optimize import brentq, fsolve

TIME = sympy.Symbol("t")
SAME, OFF = 1e-11, 1e-9


@dataclass(frozen=True)
class Fields:
    """The fields by sign vector, and for each surface h and (dh/dt, dh/dx), as functions of (t, x)."""

    fields: dict[str, Callable[..., Any]]
    h: list[Callable[..., Any]]
    slopes: list[Callable[..., Any]]

    def blend(self, mode: str, u: Sequence[float], t: float, x: np.ndarray) -> np.ndarray:
        """The field of a mode with multipliers u."""
        places, total = [i for i, c in enumerate(mode) if c == "0"], np.zeros(len(x))
        for signs in itertools.product("+-", repeat=len(places)):
            key, weight = list(mode), 1.0
            for i, sign, value in zip(places, signs, u, strict=True):
                key[i], weight = sign, weight * (1 + value if sign == "+" else 1 - value) / 2
            total = total + weight * np.array(self.fields["".join(key)](t, x), dtype=float)
        return total

    def rate(self, i: int, t: float, x: np.ndarray, f: np.ndarray) -> float:
        """dh_i/dt along f."""
        slope, *row = self.slopes[i](t, x)
        return float(slope) + float(np.dot(row, f))

    def multipliers(self, mode: str, t: float, x: np.ndarray) -> np.ndarray | None:
        """Those with which a mode slides, None for none."""
        places = [i for i, c in enumerate(mode) if c == "0"]

        def rates(u: Sequence[float]) -> list[float]:
            f = self.blend(mode, u, t, x)
            return [self.rate(i, t, x, f) for i in places]

        if len(places) == 1:
            up, down = rates([1.0])[0], rates([-1.0])[0]
            return np.array([-(up + down) / (up - down)]) if up != down else None
        for start in itertools.product([0.0, -0.6, 0.6], repeat=len(places)):
            u, *_ = fsolve(rates, start, xtol=1e-15, full_output=True)
            if max(map(abs, rates(u))) < OFF * (1 + max(map(abs, x))):
                return np.asarray(u)
        return None

    def field(self, mode: str, t: float, x: np.ndarray) -> np.ndarray:
        """The field of a mode."""
        u = self.multipliers(mode, t, x) if "0" in mode else []
        assert u is not None
        return self.blend(mode, u, t, x)

    def after(self, mode: str, on: Sequence[int], t: float, x: np.ndarray) -> str:
        """The only mode that does what it says at a point on some surfaces."""
        found = []
        for signs in itertools.product("+-0", repeat=len(on)):
            key = list(mode)
            for i, sign in zip(on, signs, strict=True):
                key[i] = sign
            new = "".join(key)
            u = self.multipliers(new, t, x) if "0" in new else np.array([])
            if u is None or np.any(np.abs(u) > 1 + OFF):
                continue
            f = self.blend(new, list(u), t, x)
            left = [(i, 1 if s == "+" else -1) for i, s in zip(on, signs, strict=True) if s != "0"]
            if all(way * self.rate(i, t, x, f) > OFF for i, way in left):
                found.append(new)
        assert len(found) == 1, (t, x, found)
        return found[0]

    def guards(self, mode: str) -> list[tuple[int, str, Callable[..., float]]]:
        """(surface, "" or the side to which a slide is left, guard that falls to 0)."""
        out: list[tuple[int, str, Callable[..., float]]] = []
        places = [i for i, c in enumerate(mode) if c == "0"]
        for i, c in enumerate(mode):
            if c != "0":
                out.append((i, "", lambda t, x, i=i, s=1 if c == "+" else -1: s * float(self.h[i](t, x))))
            for side in "+-" if c == "0" else "":
                s, k = 1 if side == "+" else -1, places.index(i)
                if len(places) == 1:
                    out.append((i, side, lambda t, x, i=i, s=s: self._held(mode, i, s, t, x)))
                else:
                    out.append((i, side, lambda t, x, s=s, k=k: self._room(mode, k, s, t, x)))
        return out

    def _held(self, mode: str, i: int, side: int, t: float, x: np.ndarray) -> float:
        """The rate back to the only surface slid on from one side: no division."""
        key = mode.replace("0", "+" if side > 0 else "-")
        return -side * self.rate(i, t, x, self.field(key, t, x))

    def _room(self, mode: str, k: int, side: int, t: float, x: np.ndarray) -> float:
        """The distance of a multiplier from the end of its set."""
        u = self.multipliers(mode, t, x)
        return -1.0 if u is None else 1.0 - side * float(u[k])


def fields_of(case: Mapping[str, Any]) -> Fields:
    """The formulas of a case of a bank."""
    names = [*case["states"], *case.get("params", {})]
    known = {name: sympy.Symbol(name) for name in names} | {"t": TIME}
    put: dict[Any, Any] = {}
    for name, text in case.get("params", {}).items():
        put[known[name]] = sympy.sympify(str(text), locals=known).subs(put)
    x = [known[name] for name in case["states"]]

    def read(text: str) -> Any:
        return sympy.sympify(text.replace("^", "**"), locals=known).subs(put)

    h = [read(text) for text in case["h"]]
    table = {}
    for signs in itertools.product("+-", repeat=len(h)):
        key = "".join(signs)
        fits = [k for k in case["fields"] if all(a in ("*", b) for a, b in zip(k, key, strict=True))]
        row = case["fields"][fits[0]]
        table[key] = sympy.lambdify([TIME, x], [read(text) for text in row], "numpy")
    slopes = [sympy.lambdify([TIME, x], [e.diff(q) for q in (TIME, *x)], "numpy") for e in h]
    return Fields(table, [sympy.lambdify([TIME, x], e, "numpy") for e in h], slopes)


def _first(step: Any, guards: Any, armed: list[bool], samples: int) -> tuple[float, list[int]] | None:
    """The first zero of the guards on a step, with the guards that vanish there."""
    dense, best = step.dense_output(), None
    times = np.linspace(step.t_old, step.t, samples + 1)
    for n, (_, _, guard) in enumerate(guards):
        last = times[0]
        for time in times[1:]:
            value = guard(time, dense(time))
            armed[n] = armed[n] or value > 1e-10
            if armed[n] and value <= 0:
                at = last
                if guard(last, dense(last)) > 0:
                    at = brentq(lambda s, guard=guard: guard(s, dense(s)), last, time, xtol=1e-15, rtol=1e-15)
                if best is None or at < best[0] - SAME:
                    best = at, [n]
                elif abs(at - best[0]) <= SAME:
                    best[1].append(n)
                break
            last = time
    return best


def follow(
    case: Mapping[str, Any], x0: Sequence[float], span: tuple[float, float]
) -> tuple[list[float], np.ndarray]:
    """Times of all events (an instant once), and the state at the end."""
    system, (t, end), x = fields_of(case), span, np.array(x0, dtype=float)
    values = [float(h(t, x)) for h in system.h]
    mode = "".join("+" if v > 0 else "-" for v in values)
    on = [i for i, v in enumerate(values) if abs(v) < 1e-13]
    mode = system.after(mode, on, t, x) if on else mode
    times: list[float] = []
    while True:
        guards = system.guards(mode)
        armed = [guard(t, x) > 1e-10 for _, _, guard in guards]
        step = DOP853(
            lambda s, z, mode=mode: system.field(mode, s, z), t, x, end, rtol=1e-12, atol=1e-14,
            max_step=(span[1] - span[0]) / 20,
        )  # fmt: skip
        found = None
        while step.status == "running" and found is None:
            step.step()
            found = _first(step, guards, armed, 12)
        if found is None:
            return times, np.asarray(step.y)
        t, x = found[0], step.dense_output()(found[0])
        times.append(t)
        reached = [guards[n][0] for n in found[1] if guards[n][1] == ""]
        if reached:
            mode = system.after(mode, sorted({*reached, *(i for i, c in enumerate(mode) if c == "0")}), t, x)
        else:
            i, side, _ = guards[found[1][0]]
            mode = mode[:i] + side + mode[i + 1 :]
