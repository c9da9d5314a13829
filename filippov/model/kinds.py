"""The kind of a surface: whether the field jumps across it, and which signs occur together on it."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence

import numpy as np
import numpy.typing as npt
import sympy
from sympy import Expr, Integer, Symbol

from filippov.base.errors import ModelError
from filippov.base.pattern import pattern
from filippov.model.parameter_symbol import ParameterSymbol
from filippov.model.surface import Kind, Surface
from filippov.model.symbolic import SymbolicForm
from filippov.model.symbols import t
from filippov.model.table import as_decimals, decimal, number, samples

MAX_COMBINATIONS = 1024
ROUNDING = 1e-12
MARGIN = 1e-9
# Scales at which a jump is asked for where a continuous function may hide it near the origin.
SCALES = tuple(Integer(10) ** k for k in (0, 1, 2, 3, 4, 6, 8, -2, -4))


class Kinds:
    """What the equations say of every surface; what holds its sign is looked up once for all of them.

    `unexpanded` is the field with signs where it jumps, and with its continuous functions left as they are.
    """

    def __init__(self, form: SymbolicForm, unexpanded: Sequence[Expr]) -> None:
        self.form = form
        self.h = form.plain_h()
        self._used = set().union(*(e.free_symbols for e in (*form.field, *form.h)))
        self._number = {s: i for i, s in enumerate(form.s)}
        self._across: list[list[Expr]] = [[] for _ in form.s]
        self._expanded: list[list[Expr]] = [[] for _ in form.s]
        for f, expanded in zip(unexpanded, form.field, strict=True):
            for s in f.free_symbols & self._number.keys():
                self._across[self._number[s]].append(f)
                if f.has(sympy.Abs, sympy.Max, sympy.Min):
                    self._expanded[self._number[s]].append(expanded)
        self._roles = dict.fromkeys(form.x, "x") | dict.fromkeys(form.s, "s")
        # Whether the field jumps across surfaces on which nothing else acts, by what stands there.
        self._alone: dict[Hashable, bool] = {}

    def kind(self, i: int, surface: Surface) -> Kind:
        """The kind of surface i; ModelError if the declared one contradicts the equations."""
        used = self.form.s[i] in self._used or self.form.a[i] in self._used
        if surface.kind == "observer" and not used:
            return "observer"
        jumps = self._known(i)
        if jumps and surface.kind not in ("switching", "reset"):
            raise ModelError(
                f"surface {surface.name!r} is declared as {surface.kind!r}, but the equations jump across "
                "it. Leave the kind out."
            )
        if surface.reset is not None and not jumps:
            return "reset"
        return "switching" if jumps else "kink"

    def _known(self, i: int) -> bool:
        """The same as `_jumps`, asked once of surfaces that are alike, as those of a hundred equal blocks."""
        found = self._across[i]
        if any(len(f.free_symbols & self._number.keys()) > 1 for f in found):
            return self._jumps(i)
        key = pattern((self.h[i], *found), self._roles)
        if key not in self._alone:
            self._alone[key] = self._jumps(i)
        return self._alone[key]

    def _jumps(self, i: int) -> bool:
        """Whether f differs on the two sides of surface i; where no point of it is found, it is taken to."""
        s, h = self.form.s[i], self.h[i]
        own = {sympy.Abs(h): sympy.S.Zero, sympy.Abs(-h): sympy.S.Zero}
        jumps = []
        for f in map(decimal, self._across[i]):
            plus, minus = (f.xreplace({s: Integer(m)}).xreplace(own) for m in (1, -1))
            if plus != minus:
                jumps.append(plus - minus)
        if not jumps:
            return False
        seen = False
        for point in _points_on(decimal(h), set().union(*(j.free_symbols for j in jumps)) - {*self._number}):
            if any(self._jumps_at(jump, point) for jump in jumps):
                return True
            search = _Search(self.form, self._number, i, point)
            if any(search.found(jump, {}) for jump in jumps):
                return True
            seen = seen or search.evaluated
        return not seen or self._jumps_elsewhere(i, jumps)

    def _jumps_elsewhere(self, i: int, jumps: Sequence[Expr]) -> bool:
        """Whether f jumps where the continuous functions in it have other branches than at the points tried,
        as sign(x) Max(y - 10, 0) does: in each branch that linear conditions allow, and on larger scales."""
        if not self._expanded[i]:
            return False
        s, a, m = self.form.s[i], self.form.a[i], len(self.form.s)
        branches = []
        for f in map(decimal, self._expanded[i]):
            plus, minus = (f.xreplace({s: Integer(side), a: sympy.S.Zero}) for side in (1, -1))
            jump = plus - minus
            for j in reversed(range(m)):
                size = sympy.S.Zero if j == i else self.form.s[j] * decimal(self.form.h[j])
                jump = jump.xreplace({self.form.a[j]: size})
            branches.append(jump)
        symbols = set().union(*(e.free_symbols for e in (*jumps, *branches))) - {*self._number}
        h = decimal(self.h[i])
        for point in _points_on(h, symbols):
            search = _Search(self.form, self._number, i, point, certain=True)
            if any(search.found(jump, {}) for jump in branches):
                return True
        return any(
            self._jumps_at(jump, point)
            for k, scale in enumerate(SCALES, start=2)
            for point in _points_on(h, symbols, scale, k) for jump in jumps
        )  # fmt: skip

    def _jumps_at(self, jump: Expr, point: dict[Symbol, Expr]) -> bool:
        """Whether a jump is not 0 with the signs that the other surfaces have at the point itself."""
        signs: dict[Symbol, Expr] = {}
        for s in jump.free_symbols & self._number.keys():
            value = number(decimal(self.h[self._number[s]]), point)
            if value is None or not value.is_real or not abs(value) > ROUNDING:
                return False
            signs[s] = Integer(1 if value > 0 else -1)
        size = _size(jump.xreplace(signs), point)
        return size is not None and bool(size > ROUNDING)


class _Search:
    """Walks through the signs of the other surfaces that a jump across surface i depends on.

    certain: whether signs must be known to occur together; else what is left open counts
    """

    def __init__(
        self, form: SymbolicForm, number: Mapping[Symbol, int], i: int, point: dict[Symbol, Expr],
        certain: bool = False,
    ) -> None:  # fmt: skip
        self.form, self.number, self.certain = form, number, certain
        self.i = i
        self.point = point
        self.evaluated = False
        self.budget = MAX_COMBINATIONS

    def found(self, jump: Expr, mode: dict[Symbol, int]) -> bool:
        """Whether the jump is not 0 for a combination of signs that can occur; True if there are too many."""
        if jump.is_zero:
            self.evaluated = True
            return False
        signs = jump.free_symbols & self.number.keys()
        if signs:
            s = min(signs, key=self.number.__getitem__)
            return any(self.found(jump.xreplace({s: Integer(m)}), {**mode, s: m}) for m in (1, -1))
        self.budget -= 1
        if self.budget < 0:
            return not self.certain
        size = _size(jump, self.point)
        self.evaluated = self.evaluated or size is not None
        return size is not None and bool(size > ROUNDING) and (
            _possible(self.form, self.i, mode, self.point, not self.certain)
        )


def _size(jump: Expr, point: dict[Symbol, Expr]) -> Expr | None:
    """Return |jump| at a point, relative to the sizes of its terms; None where it is not finite."""
    terms = [number(term, point) for term in sympy.Add.make_args(jump)]
    if any(term is None for term in terms):
        return None
    scale = sum(abs(term) for term in terms if term is not None)
    return abs(sum(term for term in terms if term is not None)) / scale if scale else sympy.S.Zero


def _points_on(
    h: Expr, symbols: set[Symbol], scale: Expr = sympy.S.One, seed: int = 1
) -> list[dict[Symbol, Expr]]:
    """Return a few points with h = 0, their states and time of a scale."""
    variables = sorted(h.free_symbols, key=lambda q: (isinstance(q, ParameterSymbol), q == t, q.name))
    points = []
    for at in samples(h.free_symbols | symbols, 6, seed):
        moved = {q: v if isinstance(q, ParameterSymbol) else scale * v for q, v in at.items()}
        point = as_decimals(moved, h)
        for variable in variables:
            rest = {q: v for q, v in point.items() if q != variable}
            line = h.xreplace(rest)
            root = _root(line, variable, point[variable])
            if root is not None:
                points.append({**rest, variable: root})
                break
    return points[:4]


def _root(line: Expr, variable: Symbol, start: Expr) -> Expr | None:
    slope = line.diff(variable)
    if not slope.free_symbols and slope.is_finite and not slope.is_zero:
        return -line.xreplace({variable: sympy.S.Zero}) / slope
    for guess in (start, -start, 3 * start):
        try:
            root = sympy.nsolve(line, variable, guess, prec=30)
        except (ValueError, ZeroDivisionError, TypeError, KeyError, AttributeError, NotImplementedError):
            continue
        if root.is_real:
            return root
    return None


def _possible(
    form: SymbolicForm, i: int, mode: Mapping[Symbol, int], point: Mapping[Symbol, Expr], left_open: bool
) -> bool:
    """Whether the signs in `mode` can occur together on surface i, at the parameters of `point`.

    `left_open` where a switching function involved is not affine in state and time, or has no value at 0.
    """
    if not mode:
        return True
    fixed = {q: value for q, value in point.items() if isinstance(q, ParameterSymbol)}
    sizes: dict[Symbol, Expr] = {}
    rows: list[tuple[Expr, int]] = []
    for j, (s, a, h) in enumerate(zip(form.s, form.a, form.h, strict=True)):
        inner = h.xreplace(sizes)
        sign = 0 if j == i else mode.get(s)
        # A size whose sign is open stays a symbol, which leaves what it occurs in undecided.
        if sign is not None:
            sizes[a] = Integer(sign) * inner
            rows.append((inner.xreplace(fixed), sign))
    free = set().union(*(h.free_symbols for h, _ in rows))
    if free & set(form.a):
        return left_open
    variables = sorted(free, key=lambda q: q.name)
    equal: list[list[float]] = []
    above: list[list[float]] = []
    for h, sign in rows:
        slopes = [h.diff(q) for q in variables]
        if any(slope.free_symbols for slope in slopes):
            return left_open
        line = [float(slope) for slope in slopes] + [float(h.xreplace(dict.fromkeys(variables, Integer(0))))]
        if not np.all(np.isfinite(line)):
            return left_open
        scale = max(abs(c) for c in line) or 1.0
        (above if sign else equal).append([(sign or 1) * c / scale for c in line])
    return _feasible(np.array(equal), np.array(above))


def _feasible(equal: npt.NDArray[np.float64], above: npt.NDArray[np.float64]) -> bool:
    """Whether A y + b = 0 and C y + d > 0 have a solution; rows are (A | b) and (C | d).

    Homogenised: A y + b w = 0, C y + d w >= e, w >= e, all bounded; feasible if the largest e is positive.
    """
    from scipy.optimize import linprog

    n = equal.shape[1] - 1
    a_eq = np.hstack([equal, np.zeros((len(equal), 1))])
    a_ub = np.hstack([-above, np.ones((len(above), 1))])
    positive = np.zeros((1, n + 2))
    positive[0, n], positive[0, n + 1] = -1.0, 1.0
    result = linprog(
        np.r_[np.zeros(n + 1), -1.0],
        A_ub=np.vstack([a_ub, positive]),
        b_ub=np.zeros(len(above) + 1),
        A_eq=a_eq,
        b_eq=np.zeros(len(equal)),
        bounds=[(-1.0, 1.0)] * n + [(0.0, 1.0), (0.0, 1.0)],
    )
    return bool(result.status != 0 or -result.fun > MARGIN)
