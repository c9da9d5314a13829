"""The right-hand side with its signs as an argument, as sympy expressions: x' = f(t, x, s, a; p).

s_i is the sign of the switching function h_i and a_i stands for |h_i|. In a mode (one of +1, -1, 0 = sliding
for each surface) a_i = mode_i h_i, which is 0 while sliding. Select(s, f_plus, f_minus) is f_plus for s > 0,
else f_minus.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import sympy
from sympy import Expr, Symbol

from filippov.base.errors import UsageError
from filippov.base.given import several
from filippov.model.parameter_symbol import ParameterSymbol
from filippov.model.partials import Partials
from filippov.model.signals.samples import Samples
from filippov.model.symbols import t


class Select(sympy.Function):
    """Select(c, plus, minus) = plus where c > 0, else minus; the other branch is never evaluated.

    It resolves as soon as c is a number, whatever the other branch holds, and its derivative is taken in the
    branches: c is a sign, constant wherever the derivative exists.
    """

    nargs = 3

    @classmethod
    def eval(cls, c: Expr, plus: Expr, minus: Expr) -> Expr | None:
        """Resolve where both branches are equal or the sign of c is known."""
        if plus == minus:
            return plus
        if c.is_positive:
            return plus
        if c.is_nonpositive:
            return minus
        if c.is_number and c.is_comparable:
            return plus if c > 0 else minus
        return None

    @classmethod
    def _should_evalf(cls, arg: Expr) -> int:
        return -1  # a float in a branch is no reason to look for a numerical Select

    def _eval_evalf(self, prec: int) -> Expr:
        c, plus, minus = self.args
        return self.func(c, plus._eval_evalf(prec), minus._eval_evalf(prec))

    def differentiated(self, inner: Sequence[Expr]) -> Expr:
        """Return the derivative, given those of the arguments."""
        return self.func(self.args[0], *inner[1:])

    def _eval_derivative(self, symbol: Symbol) -> Expr:
        return self.differentiated([arg.diff(symbol) for arg in self.args])

    def fdiff(self, argindex: int = 1) -> Expr:
        """Return the derivative by one argument; 0 by c."""
        c = self.args[0]
        if argindex == 1:
            return sympy.S.Zero
        return self.func(c, 1, 0) if argindex == 2 else self.func(c, 0, 1)

    def _eval_is_extended_real(self) -> bool | None:
        return self._both("is_extended_real")

    def _eval_is_finite(self) -> bool | None:
        return self._both("is_finite")

    def _eval_is_extended_positive(self) -> bool | None:
        return self._both("is_extended_positive")

    def _eval_is_extended_nonnegative(self) -> bool | None:
        return self._both("is_extended_nonnegative")

    def _eval_is_extended_negative(self) -> bool | None:
        return self._both("is_extended_negative")

    def _eval_is_extended_nonpositive(self) -> bool | None:
        return self._both("is_extended_nonpositive")

    def _both(self, fact: str) -> bool | None:
        first, second = (getattr(branch, fact) for branch in self.args[1:])
        return first if first == second else None

    def _eval_rewrite_as_Piecewise(self, c: Expr, plus: Expr, minus: Expr, **hints: Any) -> Expr:
        return sympy.Piecewise((plus, c > 0), (minus, True))

    def _python(self, printer: Any, *args: Any, **hints: Any) -> str:
        c, plus, minus = (printer._print(a) for a in self.args)
        return f"(({plus}) if ({c}) > 0 else ({minus}))"

    _pythoncode = _mpmathcode = _lambdacode = _python

    def _numpycode(self, printer: Any, *args: Any, **hints: Any) -> str:
        c, plus, minus = (printer._print(a) for a in self.args)
        return f"{printer._module_format('numpy.where')}(({c}) > 0, {plus}, {minus})"


@dataclass(frozen=True)
class Contact:
    """Resting contact on a surface: its side, the rate L = dh/dt, and the direction D of the push."""

    side: int
    rate: Expr
    direction: tuple[Expr, ...]

    def symbols(self) -> set[Symbol]:
        """What the direction holds; the signs among them are those of surfaces on which the contact slips."""
        return set().union(*(d.free_symbols for d in self.direction))

    def pushed(self, s: Expr) -> tuple[Expr, ...]:
        """What is added to the field in contact: side (1 - side s)/2 D."""
        push = self.side * (1 - self.side * s) / 2
        return tuple(push * d if d is not sympy.S.Zero else d for d in self.direction)


@dataclass(frozen=True)
class SymbolicForm:
    """x' = f(t, x, s, a; p): all fields are tuples.

    x, p      state and parameter symbols
    s, a      one symbol per surface: its sign, and |h|
    field     one expression per state in t, x, p, s, a
    h         one expression per surface in t, x, p and the a of earlier surfaces
    radius    one pair (lo, hi) a surface, in t, x, p: the set at h = 0
    reset     per surface the states after its reset, in t, x, p and the signs and sizes before; None for none
    contact   per surface the contact that its reset allows, or None

    time_reset  per time event the states after it, or None
    widths    per surface the expression of its hysteresis by which h is divided, or None
    held        per surface whether h stands for a derivative of the switching function (see
                `filippov.model.reduction`); empty where none does

    `reset`, `contact` and `widths` are empty where no surface has one.
    """

    x: tuple[Symbol, ...]
    p: tuple[ParameterSymbol, ...]
    s: tuple[Symbol, ...]
    a: tuple[Symbol, ...]
    field: tuple[Expr, ...]
    h: tuple[Expr, ...]
    radius: tuple[tuple[Expr, Expr], ...]
    reset: tuple[tuple[Expr, ...] | None, ...] = ()
    contact: tuple[Contact | None, ...] = ()
    time_reset: tuple[tuple[Expr, ...] | None, ...] = ()
    widths: tuple[Expr | None, ...] = ()
    held: tuple[bool, ...] = ()

    def signs(self, mode: Sequence[int] | str) -> tuple[int, ...]:
        """Return a mode, given as integers or as text such as "+0-", as a tuple of +1, 0, -1."""
        given: Sequence[Any] = () if isinstance(mode, str) else several("mode", mode)
        if isinstance(mode, str):
            table = {"+": 1, "-": -1, "0": 0}
            given = [table.get(c, c) for c in mode]
        if len(given) != len(self.s) or any(isinstance(m, bool) or m not in (-1, 0, 1) for m in given):
            raise UsageError(
                f"mode {mode!r} does not fit: expected {len(self.s)} entries, each one of +1, 0, -1 "
                "(in text: '+', '0', '-')."
            )
        return tuple(int(m) for m in given)

    def sizes_at_mode(self, mode: Sequence[int] | str) -> dict[Symbol, Expr]:
        """Return a_i -> mode_i h_i, with the a inside h_i replaced in turn."""
        sizes: dict[Symbol, Expr] = {}
        for a, h, m in zip(self.a, self.h, self.signs(mode), strict=True):
            sizes[a] = m * h.xreplace(sizes)
        return sizes

    def at_mode(self, mode: Sequence[int] | str) -> tuple[Expr, ...]:
        """Return the field in a mode: s_i = +-1, a_i = mode_i h_i, Selects resolved.

        Where mode_i = 0 the symbol s_i stays: a Select on it becomes the convex combination
        (1 + s)/2 f_plus + (1 - s)/2 f_minus.
        """
        signs = self.signs(mode)
        sizes = self.sizes_at_mode(signs)
        fixed = {s: sympy.Integer(m) for s, m in zip(self.s, signs, strict=True) if m}
        free = {s for s, m in zip(self.s, signs, strict=True) if not m}
        # Signs first: a branch that is not taken may be undefined where its a is 0.
        field = tuple(convex(f.xreplace(fixed), free).xreplace(sizes) for f in self.field)
        for contact, s, m in zip(self.contact, self.s, signs, strict=False):
            if contact is not None and m == 0:
                pushed = (convex(q.xreplace(fixed), free).xreplace(sizes) for q in contact.pushed(s))
                field = tuple(f + q for f, q in zip(field, pushed, strict=True))
        return field

    def h_at_mode(self, mode: Sequence[int] | str) -> tuple[Expr, ...]:
        """Return the switching functions in a mode, without a; dh/dt for a surface that is rested on."""
        sizes = self.sizes_at_mode(mode)
        out = [h.xreplace(sizes) for h in self.h]
        for i, (contact, m) in enumerate(zip(self.contact, self.signs(mode), strict=False)):
            if contact is not None and m == 0:
                out[i] = contact.rate
        return tuple(out)

    def jacobian(self, mode: Sequence[int] | str) -> sympy.Matrix:
        """df/dx in a mode, shape (n, n); the s of sliding surfaces are held."""
        return _derivative(self.at_mode(mode), self.x)

    def gradients(self, mode: Sequence[int] | str) -> sympy.Matrix:
        """dh/dx in a mode, shape (m, n)."""
        return _derivative(self.h_at_mode(mode), self.x)

    def rates(self, mode: Sequence[int] | str) -> tuple[Expr, ...]:
        """d/dt h = dh/dt + grad h . f in a mode, one expression per surface."""
        field = self.at_mode(mode)
        return tuple(rate_along(h, field, self.x) for h in self.h_at_mode(mode))

    def plain_h(self) -> tuple[Expr, ...]:
        """Return the switching functions with Abs(h_j) written out in place of a_j."""
        inside = set().union(*(h.free_symbols for h in self.h))
        sizes: dict[Symbol, Expr] = {}
        out = []
        for a, h in zip(self.a, self.h, strict=True):
            out.append(h.xreplace(sizes) if sizes else h)
            if a in inside:
                sizes[a] = sympy.Abs(out[-1])
        return tuple(out)

    def names(self) -> dict[str, Expr]:
        """What names in a formula mean: states, parameters and inputs."""
        from filippov.model.signals.input import input_of

        named: dict[str, Expr] = {q.name: q for q in (*self.x, *self.p)}
        return named | {samples.name: input_of(samples) for samples in self.inputs}

    @cached_property
    def inputs(self) -> tuple[Samples, ...]:
        """The samples of the inputs in it, by name."""
        from filippov.model.signals.input import inputs_in

        return inputs_in(self.expressions())

    def expressions(self) -> Iterator[Expr]:
        """Every expression of the form, in a fixed order."""
        yield from self.field
        yield from self.h
        for low, high in self.radius:
            yield low
            yield high
        for after in (*self.reset, *self.time_reset):
            yield from after or ()

    def put(self, values: Mapping[Any, Expr]) -> SymbolicForm:
        """The form with expressions in place of symbols in all that it states."""

        def row(given: Sequence[Expr] | None) -> Any:
            return None if given is None else tuple(e.xreplace(values) for e in given)

        return replace(
            self, field=row(self.field), h=row(self.h), radius=tuple(map(row, self.radius)),
            reset=tuple(map(row, self.reset)), time_reset=tuple(map(row, self.time_reset)),
        )  # fmt: skip

    def __getstate__(self) -> dict[str, Any]:
        return {k: v for k, v in self.__dict__.items() if k != "inputs"}


def lie_derivative(h: Expr, field: Iterable[Expr], x: Iterable[Symbol]) -> Expr:
    """grad h . f, the rate of h along a field that does not depend on time."""
    inside = h.free_symbols  # of twenty masses one: sympy takes as long to find the other slopes 0
    return sum((h.diff(q) * f for q, f in zip(x, field, strict=True) if q in inside), sympy.S.Zero)


def rate_along(h: Expr, field: Iterable[Expr], x: Iterable[Symbol]) -> Expr:
    """dh/dt + grad h . f, the rate of h along the solutions of a field."""
    return h.diff(t) + lie_derivative(h, field, x)


def convex(f: Expr, free: set[Symbol]) -> Expr:
    """Return f with each Select on a sign among `free` written as (1 + s)/2 plus + (1 - s)/2 minus."""
    if not f.args or not f.has(Select):
        return f
    args = [convex(arg, free) for arg in f.args]
    if isinstance(f, Select) and args[0] in free:
        return (1 + args[0]) / 2 * args[1] + (1 - args[0]) / 2 * args[2]
    return f.func(*args)


def _derivative(functions: Sequence[Expr], by: Sequence[Symbol]) -> sympy.Matrix:
    partials = Partials()
    return sympy.Matrix(len(functions), len(by), lambda i, j: partials.by(functions[i], by[j]))
