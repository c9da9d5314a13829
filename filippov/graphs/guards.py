"""When a mode of a symbolic system is left: the guards as formulas.

On surface i, with r(s) = d/dt h_i at s_i = s and the set [lo, hi] of the sign at h_i = 0:

    crossing upwards      h = 0,  r(-1) > 0,  r(+1) > 0  (and r(hi) > 0 where hi > 1: sticking goes first)
    entry from below      h = 0,  r(-1) > 0 > r(hi)
    exit upwards          h = 0,  r(hi) = 0,  d/dt r(hi) > 0 along the field at s = hi

and the same with all signs reversed for downwards. A kink or an observer is only crossed; a relay with
hysteresis switches at h = -s width. The multipliers of the other sliding surfaces are substituted. This is
for attracting sliding: repelling sliding can be left at any time.

Sources: Filippov 1988, section 10; di Bernardo, Budd, Champneys, Kowalczyk 2008, section 2.2.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import sympy
from sympy import Expr, Symbol

from filippov.base.errors import ModelError
from filippov.base.status import EventKind, mode_text
from filippov.model.parameter_symbol import ParameterSymbol
from filippov.model.size import expanded
from filippov.model.symbolic import SymbolicForm, rate_along
from filippov.model.system import System
from filippov.solving.state.events import Mode

LARGEST_SOLVE = 3
_SIDES = {1: "+", -1: "-"}


@dataclass(frozen=True)
class Transition:
    """One way out of a mode.

    guard       in words of the surface: "v = 0 and dv/dt(-) > 0 and dv/dt(+) > 0"
    conditions  the same as sympy relations in t, states and parameters; what always holds is left out
    """

    source: Mode
    target: Mode
    surface: str
    kind: EventKind
    guard: str
    conditions: tuple[Any, ...]

    @property
    def formula(self) -> str:
        """The conditions as text."""
        return " and ".join(relation_text(c) for c in self.conditions) or "always"


def relation_text(relation: Any) -> str:
    """A relation as text, "v = 0" for an equation."""
    if isinstance(relation, sympy.Eq):
        return f"{formula_text(relation.lhs)} = {formula_text(relation.rhs)}"
    return formula_text(relation)


@lru_cache(maxsize=20_000)  # neighbouring modes share most of their equations
def formula_text(f: Any) -> str:
    """An expression as text, without insignificant digits."""
    return str(sympy.sstr(f, full_prec=False))


class Guards:
    """The formulas of a symbolic system, mode by mode.

    values: numbers for parameters, by name; the others stay symbols. Raises ModelError for plain functions.
    """

    def __init__(self, system: System, values: Mapping[str, float] | None = None) -> None:
        if system.symbolic is None:
            raise ModelError(
                "the possible transitions need a system of expressions; this one has a plain function as "
                "field. Write "
                "it as System({x: ...}), or use the graph observed in a solution."
            )
        self.system = system
        self.form = _with_values(system.symbolic, _numbers(system, values))
        self.names = system.surface_names
        self.labels = {s: Symbol(f"s[{n}]", real=True) for s, n in zip(self.form.s, self.names, strict=True)}
        # Each mode is looked at from all its neighbours.
        self.vertex = lru_cache(None)(self.form.at_mode)
        self.rates = lru_cache(None)(self.form.rates)
        self.h = lru_cache(None)(self.form.h_at_mode)
        self._multipliers: dict[Mode, dict[Symbol, Expr] | None] = {}

    def multipliers(self, mode: Mode) -> dict[Symbol, Expr] | None:
        """The sign of each sliding surface, solved from d/dt h = 0; None where it does not act on h."""
        if mode not in self._multipliers:
            self._multipliers[mode] = self._solve(mode)
        return self._multipliers[mode]

    def _solve(self, mode: Mode) -> dict[Symbol, Expr] | None:
        sliding = [i for i, m in enumerate(mode) if m == 0]
        if not sliding:
            return {}
        rates = self.rates(mode)
        unknown = [self.form.s[i] for i in sliding]
        equations = sympy.Matrix([rates[i] for i in sliding])
        matrix = equations.jacobian(unknown)
        if any(matrix.row(k).is_zero_matrix for k in range(len(sliding))):
            return None
        if len(sliding) > LARGEST_SOLVE or matrix.has(*unknown):
            return dict(self.labels)
        if _vanishes(matrix.det()):
            return None
        at_zero = equations.xreplace(dict.fromkeys(unknown, sympy.S.Zero))
        solved = matrix.LUsolve(-at_zero)
        on = self.on([self.h(mode)[i] for i in sliding])
        return {s: sympy.factor_terms(_settled(v, on)) for s, v in zip(unknown, solved, strict=True)}

    def field(self, mode: Mode) -> tuple[Expr, ...]:
        """x' of a mode, with multipliers and surfaces substituted: on v = 0 the expressions contain no v."""
        solved = self.multipliers(mode) or self.labels
        on = self.on([h for h, m in zip(self.h(mode), mode, strict=True) if m == 0])
        return tuple(_settled(f.xreplace(solved), on) for f in self.vertex(mode))

    def transitions(self, mode: Mode) -> Iterator[Transition]:
        """The ways out of a mode, on one surface each; the ones whose guard cannot hold are left out."""
        for i, surface in enumerate(self.system.surfaces):
            if surface.kind == "reset" and (mode[i] == 0 or surface.side in ("both", _SIDES[mode[i]])):
                continue  # filippov.graphs.reset_guards
            if surface.width > 0 and surface.kind == "switching":
                found: list[Transition | None] = [self._switch(mode, i)]
            elif mode[i] == 0:
                found = [self._exit(mode, i, sign) for sign in (-1, 1)]
            else:
                found = [self._cross(mode, i)]
                if surface.kind == "switching":
                    found.append(self._enter(mode, i))
            yield from (item for item in found if item is not None)

    # -- one kind each ---------------------------------------------------------------------------------

    def _cross(self, mode: Mode, i: int) -> Transition | None:
        up, target = -mode[i], with_sign(mode, i, -mode[i])
        on = self.at_surface(mode, i)
        bound = self._bound(i, up)
        sides = [(self._text(i, mode), self.rate(mode, i)), (self._text(i, target), self.rate(target, i))]
        if self.system.surfaces[i].kind == "switching" and bound != up:
            sides.append((self._text(i, target, bound), self.rate(with_sign(mode, i, 0), i, bound)))
        if any(rate is None for _, rate in sides):
            return None
        rates = [(text, _settled(rate, on)) for text, rate in sides if rate is not None]
        if _same(rates[0][1], rates[1][1]):
            rates = [(f"d{self.bracket(i)}/dt", rates[0][1]), *rates[2:]]
        items = [(f"{text} {'>' if up > 0 else '<'} 0", _sign(rate, up)) for text, rate in rates]
        return self._made(mode, target, i, EventKind.CROSSING, items)

    def _enter(self, mode: Mode, i: int) -> Transition | None:
        up, target = -mode[i], with_sign(mode, i, 0)
        if self.multipliers(target) is None:
            return None
        on = self.at_surface(mode, i)
        bound = self._bound(i, up)
        far = with_sign(mode, i, up) if bound == up else target
        first, second = self.rate(mode, i), self.rate(far, i, None if bound == up else bound)
        if first is None or second is None:
            return None
        first, second = _settled(first, on), _settled(second, on)
        if expanded((first - second) * up).is_nonpositive:
            return None
        text = self._text(i, with_sign(mode, i, up), None if bound == up else bound)
        items = [
            (f"{self._text(i, mode)} {'>' if up > 0 else '<'} 0", _sign(first, up)),
            (f"{text} {'<' if up > 0 else '>'} 0", _sign(second, -up)),
        ]
        return self._made(mode, target, i, EventKind.ENTRY, items)

    def _exit(self, mode: Mode, i: int, up: int) -> Transition | None:
        target = with_sign(mode, i, up)
        on = self.at_surface(mode, i)
        bound = self._bound(i, up)
        rate = self.rate(mode, i, bound)
        others = self._others(mode, i, bound)
        if rate is None or others is None:
            return None
        field = [f.xreplace(others) for f in self.vertex(mode)]
        # The guard says d/dt h = 0; used here it leaves the shorter formula.
        h = self.h(mode)[i]
        inside = h.free_symbols
        for k, x in enumerate(self.form.x):
            slope = h.diff(x) if x in inside else sympy.S.Zero
            if slope.is_number and slope.is_nonzero:
                field[k] = field[k] - rate / slope
                break
        growth = rate_along(rate, field, self.form.x)
        text = self._text(i, target, bound)
        items = [
            (f"{text} = 0", sympy.Eq(_settled(rate, on), 0)),
            (f"{'increasing' if up > 0 else 'decreasing'}", _sign(_settled(growth, on), up)),
        ]
        return self._made(mode, target, i, EventKind.EXIT, items)

    def _switch(self, mode: Mode, i: int) -> Transition | None:
        up = -mode[i]
        level = sympy.Float(self.system.surfaces[i].width) * up
        h = self.h(mode)[i]
        rate = self.rate(mode, i)
        if rate is None:
            return None
        settled = _settled(rate, self.on([h - level]))
        items = [(f"d{self.bracket(i)}/dt {'>' if up > 0 else '<'} 0", _sign(settled, up))]
        return self._made(mode, with_sign(mode, i, up), i, EventKind.CROSSING, items, level)

    # -- pieces ----------------------------------------------------------------------------------------

    def _made(
        self, mode: Mode, target: Mode, i: int, kind: EventKind, items: list[tuple[str, Any]], level: Any = 0
    ) -> Transition | None:
        at = sympy.Eq(self.h(mode)[i], level)
        conditions = [at, *(c for _, c in items)]
        if any(c == sympy.false for c in conditions) or not self.reached(mode, i, level):
            return None
        guard = " and ".join([f"{self.label(i)} = {formula_text(level)}", *(text for text, _ in items)])
        kept = tuple(dict.fromkeys(c for c in conditions if c != sympy.true))
        return Transition(mode, target, self.names[i], kind, guard, kept)

    def reached(self, mode: Mode, i: int, level: Any, also: Sequence[Expr] = ()) -> bool:
        """Whether surface i is reached inside a mode: parallel surfaces fix each other's sign there.

        also   further expressions that are 0 there
        """
        if self.system.surfaces[i].width > 0:
            return True
        h = self.h(mode)
        on = self.on([h[i] - level, *also])
        values = [_settled(h[j], on) * m for j, m in enumerate(mode) if j != i and m != 0]
        return not any(v.is_number and v.is_negative for v in values)

    def bracket(self, i: int) -> str:
        """The switching function as it stands behind a d: a name, or something in brackets."""
        text = formula_text(self.form.plain_h()[i])
        return text if text.isidentifier() else f"({text})"

    def label(self, i: int) -> str:
        """The switching function as text."""
        text = self.bracket(i)
        return text.removeprefix("(").removesuffix(")") if text.startswith("(") else text

    def plain(self, mode: Mode) -> list[Expr]:
        """The switching functions of a mode, the places of contacts too."""
        sizes = self.form.sizes_at_mode(mode)
        return [h.xreplace(sizes) for h in self.form.h]

    def settled(self, f: Expr, on: Mapping[Symbol, Expr]) -> Expr:
        """f with the states that `at_surface` or `on` give; left as it is where that is not defined."""
        return _settled(f, on)

    def _text(self, i: int, mode: Mode, bound: Any = None) -> str:
        where = mode_text(mode) if bound is None or bound in (1, -1) else f"s = {formula_text(bound)}"
        return f"d{self.bracket(i)}/dt({where})"

    def _bound(self, i: int, up: int) -> Expr:
        return self.form.radius[i][(1 + up) // 2]

    def rate(self, mode: Mode, i: int, bound: Expr | None = None) -> Expr | None:
        """d/dt h_i in a mode, at s_i = bound where given; None where other sliding cannot be held."""
        solved = self._others(mode, i, bound) if bound is not None else self.multipliers(mode)
        return None if solved is None else self.rates(mode)[i].xreplace(solved)

    def _others(self, mode: Mode, i: int, bound: Expr) -> dict[Symbol, Expr] | None:
        """The signs of the sliding surfaces with s_i held at a bound."""
        rest = [j for j, m in enumerate(mode) if m == 0 and j != i]
        own = {self.form.s[i]: bound}
        if not rest:
            return own
        rates = self.rates(mode)
        unknown = [self.form.s[j] for j in rest]
        equations = sympy.Matrix([rates[j].xreplace(own) for j in rest])
        matrix = equations.jacobian(unknown)
        if len(rest) > LARGEST_SOLVE or matrix.has(*unknown):
            return self.labels | own
        if _vanishes(matrix.det()):
            return None
        solved = matrix.LUsolve(-equations.xreplace(dict.fromkeys(unknown, sympy.S.Zero)))
        return own | dict(zip(unknown, solved, strict=True))

    def at_surface(self, mode: Mode, i: int) -> dict[Symbol, Expr]:
        """States as surface i fixes them where a mode reaches it, with the surfaces that it slides on."""
        h = self.h(mode)
        return self.on([h[i], *(h[j] for j, m in enumerate(mode) if m == 0 and j != i)])

    def on(self, zero: list[Expr]) -> dict[Symbol, Expr]:
        """States as given by h = 0, where h is affine in one of them with a number as slope."""
        known: dict[Symbol, Expr] = {}
        for h in zero:
            left = h.xreplace(known)
            inside = left.free_symbols
            for x in self.form.x:
                if x not in inside or x in known:
                    continue
                slope = left.diff(x)
                if slope.is_number and slope.is_nonzero:
                    value = expanded(x - left / slope)
                    known = {k: v.xreplace({x: value}) for k, v in known.items()} | {x: value}
                    break
        return known


def with_sign(mode: Mode, i: int, sign: int) -> Mode:
    """The mode with another sign of surface i."""
    return (*mode[:i], sign, *mode[i + 1 :])


def _sign(rate: Expr, up: int) -> Any:
    return sympy.Gt(rate, 0) if up > 0 else sympy.Lt(rate, 0)


def _vanishes(f: Expr) -> bool:
    """Whether f is 0 for all values of its symbols; a product of symbols and numbers is not simplified."""
    if all(factor.is_Symbol or (factor.is_number and factor.is_nonzero) for factor in sympy.Mul.make_args(f)):
        return False
    return bool(f.equals(0))


def _same(first: Expr, second: Expr) -> bool:
    return bool(first == second or expanded(first - second) == 0)


def _settled(f: Expr, on: Mapping[Symbol, Expr]) -> Expr:
    """f on its surfaces; left as it is where that is not defined (log(v) at v = 0)."""
    put = _powers(f.xreplace(dict(on)))
    return _powers(f) if put.has(sympy.nan, sympy.zoo, sympy.oo, -sympy.oo) else put


def _powers(f: Expr) -> Expr:
    """0**beta as 0 for an exponent that is a parameter with a positive default: sympy leaves it open."""

    def vanishes(power: Expr) -> bool:
        at = {
            q: sympy.Float(q.parameter.default)
            for q in power.exp.free_symbols
            if isinstance(q, ParameterSymbol)
        }
        value = power.exp.xreplace(at)
        return bool(power.base.is_zero and value.is_number and value.is_positive)

    zeros = [power for power in f.atoms(sympy.Pow) if vanishes(power)]
    return f.xreplace(dict.fromkeys(zeros, sympy.S.Zero)) if zeros else f


def _numbers(system: System, values: Mapping[str, float] | None) -> dict[str, Expr]:
    if values is None:
        return {}
    resolved = dict(zip(system.parameters.names, system.parameters.resolve(values).tolist(), strict=True))
    wanted = {str(getattr(name, "name", name)) for name in values}
    return {k: sympy.nsimplify(v, rational=True) for k, v in resolved.items() if k in wanted}


def _with_values(form: SymbolicForm, values: Mapping[str, Expr]) -> SymbolicForm:
    put = {q: values[q.name] for q in form.p if q.name in values}
    if not put:
        return form
    return replace(
        form,
        field=tuple(_powers(f.xreplace(put)) for f in form.field),
        h=tuple(h.xreplace(put) for h in form.h),
        reset=tuple(None if row is None else tuple(e.xreplace(put) for e in row) for row in form.reset),
        time_reset=tuple(None if r is None else tuple(e.xreplace(put) for e in r) for r in form.time_reset),
        contact=tuple(
            c if c is None else replace(
                c, rate=c.rate.xreplace(put), direction=tuple(d.xreplace(put) for d in c.direction)
            )
            for c in form.contact
        ),
        radius=tuple((low.xreplace(put), high.xreplace(put)) for low, high in form.radius),
    )
