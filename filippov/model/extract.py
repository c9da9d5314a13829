"""From expressions with sign, Abs, Heaviside, Piecewise, Max and Min to a SymbolicForm.

Each of these functions is replaced by the sign s_i or the size a_i = |h_i| of a surface:

    sign(h) -> s,  Heaviside(h) -> (1 + s)/2,  Abs(h) -> a,  Piecewise, Max, Min -> Select(s, plus, minus)

The surface h is the argument as it is written: sign(u) and Heaviside(u) give h = u; of two that differ by a
factor the first. What sympy turns round takes the orientation that a sign of the model has: |u|, and u and w
in Max and Min. A condition gives h = u - w where u > w holds, a threshold without state and time is
subtracted.

Products are taken apart: sign(f g) = sign(f) sign(g), |f g| = |f| |g|. A sign inside the argument of
another one is expanded, sign(g(sign(k))) -> Select(s_k, sign(g(1)), sign(g(-1))); |k|, Max and Min there
stay, as a_k.
An argument without state and time is a constant of the run and makes no surface. In a reset |u|, Max and Min
make none either: the map is evaluated at one point and continuous there, Select(u - w, u, w).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any, Literal

import sympy
from sympy import Abs, Expr, Heaviside, Integer, Max, Min, Mul, Piecewise, Pow, S, Symbol, sign
from sympy.core.relational import Eq, Ge, Gt, Le, Lt, Ne
from sympy.logic.boolalg import ITE, And, Not, Or, Xor

from filippov.base.errors import ModelError
from filippov.model.check import check_expression
from filippov.model.directions import with_signs
from filippov.model.size import Scale
from filippov.model.surface import Surface
from filippov.model.symbolic import Select
from filippov.model.table import SurfaceTable, dynamic, refuse_flat, vanishes

Path = Mapping[Symbol, int]
Context = Literal["field", "h", "jump", "reset"]
Choice = Callable[[Path], Expr]

MAX_NESTED_SIGNS = 10
# Cases into which the branches of one system unfold, and nodes of what they are put together to.
MOST_CASES, MOST_NODES = 5_000, 100_000


class Extractor:
    """Replaces the nonsmooth functions of expressions, collecting surfaces in `table`."""

    def __init__(self) -> None:
        self.table = SurfaceTable()
        self._memo: dict[tuple[Expr, Context, frozenset[tuple[Symbol, int]]], Expr] = {}
        self._where = ""
        self._cases = 0
        self._scale = Scale()

    def note(self, expressions: Iterable[Expr]) -> None:
        """Remember the arguments of signs and conditions as the model has them written, in order."""
        for expr in expressions:
            self.table.write(_arguments(expr))

    def declare(self, surfaces: tuple[Surface, ...]) -> None:
        """Enter the surfaces given by the user: smooth ones first, so that nested ones may refer to them."""
        for surface in sorted(surfaces, key=lambda surface: bool(surface.h.has(*NONSMOOTH))):
            self._where = f"surface {surface.name!r}"
            check_expression(surface.h, self._where)
            h = self.convert(surface.h, "h") if surface.h.has(*NONSMOOTH) else surface.h
            if self.table.signs_in(h):
                raise ModelError(
                    f"{self._where}: h = {surface.h} jumps, expected a continuous function that changes "
                    "its sign. "
                    "Give the argument of its sign, Heaviside or Piecewise as the surface."
                )
            entry = self.table.declare(surface, h)
            refuse_flat(self._where, surface.h, _factors(entry.h))

    def field(self, expr: Expr, where: str) -> Expr:
        """Return a right-hand side with the signs and sizes as symbols; `where` names it in messages."""
        self._where = where
        check_expression(expr, where)
        return self.convert(expr, "field")

    def reset(self, expr: Expr, where: str) -> Expr:
        """Return a state after a reset, its jumps by the signs, its |u|, Max and Min by their arguments."""
        self._where = where
        check_expression(expr, where)
        return self.convert(expr, "reset")

    def unexpanded(self, expr: Expr) -> Expr:
        """Return a right-hand side already read with its jumps as signs; Abs, Max and Min stay in it."""
        return self.convert(expr, "jump")

    def continuous(self, expr: Expr, where: str) -> Expr:
        """Return an expression in t, x, p and sizes a; raise ModelError if it jumps."""
        self._where = where
        check_expression(expr, where)
        out = self.convert(expr, "h")
        if self.table.signs_in(out):
            raise ModelError(f"{where}: {expr} jumps across a surface, expected a continuous expression.")
        return out

    def convert(self, expr: Expr, context: Context, path: Path | None = None) -> Expr:
        """Return `expr` without nonsmooth functions; `path` holds the signs known on the way to it.

        In the context "h" (inside the argument of a sign) what is continuous is written with sizes a; in the
        context "jump" Abs, Max and Min are left as they are, in "reset" they look at their arguments.
        """
        path = path or {}
        if not expr.has(*NONSMOOTH):
            return expr
        key = (expr, context, frozenset(path.items()))
        if key not in self._memo:
            self._memo[key] = self._convert(expr, context, path)
        return self._memo[key]

    def _convert(self, expr: Expr, context: Context, path: Path) -> Expr:
        expr = with_signs(expr) if isinstance(expr, Mul) and context != "reset" else expr
        if isinstance(expr, sign):
            return self._split(self.convert(expr.args[0], "h", path), path, self._sign)
        if context == "jump" and isinstance(expr, (Abs, Max, Min)):
            return self._inside(expr, context, path)
        if context == "reset" and isinstance(expr, (Abs, Max, Min)):
            return self._by_value(expr, path)
        if isinstance(expr, Abs):
            return self._split(self.convert(expr.args[0], "h", path), path, self._size)
        if isinstance(expr, Heaviside):
            return self._heaviside(expr, path)
        if isinstance(expr, Piecewise):
            return self._piece(list(expr.args), context, path)
        if isinstance(expr, Select):
            condition, plus, minus = expr.args
            return self._positive(
                condition, path, self._branch(plus, context), self._branch(minus, context), True, context
            )
        if isinstance(expr, (Max, Min)):
            items = sorted(expr.args, key=sympy.default_sort_key)
            if context == "field":
                return self._largest(items, isinstance(expr, Min), path)
            return self._largest_as_size(items, isinstance(expr, Min), path)
        return self._inside(expr, context, path)

    def _inside(self, expr: Expr, context: Context, path: Path) -> Expr:
        """The expression with its arguments converted; itself, where these stay as they are."""
        args = [self.convert(arg, context, path) for arg in expr.args]
        return expr if all(a is b for a, b in zip(args, expr.args, strict=True)) else expr.func(*args)

    def _branch(self, expr: Expr, context: Context) -> Choice:
        return lambda path: self.convert(expr, context, path)

    # -- arguments that hold signs ---------------------------------------------------------------------

    def _split(self, arg: Expr, path: Path, finish: Callable[[Expr, Path], Expr]) -> Expr:
        """Apply `finish` to arg, expanded over each sign that arg holds."""
        found = self.table.signs_in(arg)
        if not found:
            return finish(arg, path)
        if len(found) > MAX_NESTED_SIGNS:
            raise ModelError(
                f"{self._where}: the argument of one function holds {len(found)} signs, at most "
                f"{MAX_NESTED_SIGNS} can be expanded. Introduce a state or rewrite the argument."
            )
        s = found[0]
        known = self._known(s, path)
        if known:
            return self._split(arg.xreplace({s: Integer(known)}), path, finish)
        plus, minus = (self._split(arg.xreplace({s: Integer(m)}), {**path, s: m}, finish) for m in (1, -1))
        return self._join(s, plus, minus, "field")

    def _join(self, s: Symbol, plus: Expr, minus: Expr, context: Context) -> Expr:
        """Return the expression that is `plus` for s = 1 and `minus` for s = -1."""
        self._cases += 1
        if self._cases > MOST_CASES:
            raise ModelError(
                f"{self._where}: its branches (Piecewise, Max, Min, conditions) unfold into more than "
                f"{MOST_CASES} cases. Write it with fewer of them, or with states for what they choose from."
            )
        plus = self._weighed(plus.xreplace({s: S.One}))
        minus = self._weighed(minus.xreplace({s: S.NegativeOne}))
        if plus == minus:
            return plus
        if plus.is_number and minus.is_number:
            return (plus + minus) / 2 + s * (plus - minus) / 2
        if context == "h" and not self.table.signs_in(plus) and not self.table.signs_in(minus):
            entry = self.table.entry(s)
            factor = self.table.ratio(plus - minus, entry.h)
            if factor is not None:  # continuous: the jump is a multiple of h
                return (plus + minus) / 2 + factor * entry.a / 2
        if context == "field":
            plus, minus = (self.table.on_side(branch, s, m) for branch, m in ((plus, 1), (minus, -1)))
        return Select(s, plus, minus)

    def _weighed(self, branch: Expr) -> Expr:
        """Return a branch; ModelError where it is too large to be put together with others."""
        if self._scale.weigh(branch)[0] > MOST_NODES:
            raise ModelError(
                f"{self._where}: its branches are put together to more than {MOST_NODES} nodes. Write it "
                "with fewer of them, or with states for what they choose from."
            )
        return branch

    def _known(self, s: Symbol, path: Path) -> int:
        """Return the sign of s that follows from the path, 0 if none does."""
        if s in path:
            return path[s]
        h = self.table.entry(s).h
        for other, m in path.items():
            k = self.table.entry(other).h
            ahead = m * (h - k)  # m h = m k + ahead, m k > 0
            if dynamic(ahead) is False and ahead.is_nonnegative:
                return m
            ahead = m * (-h - k)  # -m h = m k + ahead
            if dynamic(ahead) is False and ahead.is_nonnegative:
                return -m
        return 0

    # -- the elementary functions, arguments free of signs ---------------------------------------------

    def _sign(self, arg: Expr, path: Path, written: bool = True) -> Expr:
        if arg.is_zero or (self.table.outermost(arg) is not None and self.table.flat(arg)):
            raise ModelError(
                f"{self._where}: the argument of a sign, Heaviside or Piecewise is 0 everywhere on one side "
                "of a surface, so its sign is undefined. Change the expression so that the argument changes "
                "sign."
            )
        if not dynamic(arg):
            return sign(arg)
        if arg.is_nonnegative:
            return S.One
        if arg.is_nonpositive:
            return S.NegativeOne
        found = self.table.match(arg)
        if found is None:
            parts = _factors(arg)
            if len(parts) > 1 or parts[0] != arg or _odd_power(arg):
                return Mul(*(self._sign_of_power(part, path, written) for part in parts))
            found = self.table.register(arg, written)
        entry, factor = found
        known = self._known(entry.s, path)
        return sign(factor) * (known or entry.s)

    def _sign_of_power(self, part: Expr, path: Path, written: bool) -> Expr:
        base, exponent = part.as_base_exp()
        if exponent == 1 or not dynamic(part):
            return self._sign(part, path, written)
        if exponent.is_odd:
            return self._sign(base, path, written)
        # Even powers are not negative; other powers are real only where they are not negative.
        if exponent.is_even or exponent.is_rational:
            return S.One
        if part.is_nonnegative:
            return S.One
        entry, factor = self.table.match(part) or self.table.register(part, written)
        return sign(factor) * entry.s

    def _size(self, arg: Expr, path: Path) -> Expr:
        if not dynamic(arg):
            return Abs(arg)
        if arg.is_nonnegative:
            return arg
        if arg.is_nonpositive:
            return -arg
        found = self.table.match(arg)
        if found is None:
            parts = _factors(arg)
            if len(parts) > 1 or parts[0] != arg or _odd_power(arg):
                return Mul(*(self._size_of_power(part, path) for part in parts))
            found = self.table.register(arg, written=False)
        entry, factor = found
        return Abs(factor) * entry.a

    def _size_of_power(self, part: Expr, path: Path) -> Expr:
        base, exponent = part.as_base_exp()
        if exponent == 1 or not dynamic(part):
            return self._size(part, path)
        if exponent.is_even or part.is_nonnegative:
            return part
        if exponent.is_odd:
            return Pow(self._size(base, path), exponent)
        if exponent.is_rational:
            return part
        entry, factor = self.table.match(part) or self.table.register(part, written=False)
        return Abs(factor) * entry.a

    def _heaviside(self, expr: Expr, path: Path) -> Expr:
        arg = self.convert(expr.args[0], "h", path)
        at_zero = expr.args[1] if len(expr.args) > 1 else S.Half

        def finish(inner: Expr, path: Path) -> Expr:
            if not dynamic(inner):
                return (
                    Heaviside(inner, at_zero).rewrite(Piecewise)
                    if inner.is_number
                    else Select(inner, 1, Select(-inner, 0, at_zero))
                )
            return (1 + self._sign(inner, path)) / 2

        return self._split(arg, path, finish)

    # -- conditions ------------------------------------------------------------------------------------

    def _piece(self, pieces: list[Any], context: Context, path: Path) -> Expr:
        if not pieces:
            signs = ", ".join(f"{self.table.entry(s).h} {'>' if m > 0 else '<'} 0" for s, m in path.items())
            raise ModelError(
                f"{self._where}: no branch of a Piecewise holds{' where ' + signs if signs else ''}. "
                "Let its last branch be (expression, True)."
            )
        (expr, condition), *rest = pieces
        return self._decide(
            condition,
            path,
            lambda known: self.convert(expr, context, known),
            lambda known: self._piece(rest, context, known),
            context,
        )

    def _decide(self, condition: Any, path: Path, yes: Choice, no: Choice, context: Context) -> Expr:
        """Return yes where the condition holds, else no."""
        if condition == True:  # noqa: E712  (sympy's true is not the object True)
            return yes(path)
        if condition == False:  # noqa: E712
            return no(path)
        if isinstance(condition, (Gt, Ge, Lt, Le)):
            difference, holds_above = _difference(condition)
            strict = isinstance(condition, (Gt, Lt))
            if holds_above:
                return self._positive(difference, path, yes, no, strict, context)
            return self._positive(difference, path, no, yes, not strict, context)
        if isinstance(condition, (Eq, Ne)):
            raise ModelError(
                f"{self._where}: the condition {condition} compares for equality; values on a surface "
                "itself are "
                "set by the inclusion. Use > or <, and Surface(..., radius=...) for a wider set on it."
            )
        if isinstance(condition, Not):
            return self._decide(condition.args[0], path, no, yes, context)
        if isinstance(condition, ITE):
            test, first, second = condition.args
            return self._decide(
                test,
                path,
                lambda known: self._decide(first, known, yes, no, context),
                lambda known: self._decide(second, known, yes, no, context),
                context,
            )
        if isinstance(condition, (And, Or, Xor)):
            first, *others = sorted(condition.args, key=sympy.default_sort_key)
            rest = condition.func(*others)
            if isinstance(condition, And):
                return self._decide(
                    first, path, lambda known: self._decide(rest, known, yes, no, context), no, context
                )
            if isinstance(condition, Or):
                return self._decide(
                    first, path, yes, lambda known: self._decide(rest, known, yes, no, context), context
                )
            return self._decide(
                first,
                path,
                lambda known: self._decide(rest, known, no, yes, context),
                lambda known: self._decide(rest, known, yes, no, context),
                context,
            )
        raise ModelError(
            f"{self._where}: the condition {condition} ({type(condition).__name__}) is not understood. "
            "Use <, <=, >, >= between expressions, joined by &, | and ~."
        )

    def _positive(
        self, arg: Expr, path: Path, yes: Choice, no: Choice, strict: bool, context: Context = "field",
        written: bool = True,
    ) -> Expr:  # fmt: skip
        """Return yes where arg > 0 (arg >= 0 where not strict), else no."""

        def finish(inner: Expr, path: Path) -> Expr:
            outer = self.table.outermost(inner)
            if outer is not None and self.table.flat(inner):
                # Max(0, u) > 0 is u > 0: where the argument is 0 in a whole region, each side by itself.
                known = self._known(outer.s, path)
                sides = {m: inner.xreplace({outer.a: m * outer.h}) for m in ([known] if known else [1, -1])}
                made = {
                    m: finish(S.Zero if vanishes(side) else side, {**path, outer.s: m})
                    for m, side in sides.items()
                }
                return made[known] if known else self._join(outer.s, made[1], made[-1], context)
            if dynamic(inner):
                return self._by_sign(self._sign(inner, path, written), path, yes, no, context)
            if strict:
                return Select(inner, yes(path), no(path))
            return Select(-inner, no(path), yes(path))

        return self._split(self.convert(arg, "h", path), path, finish)

    def _by_sign(self, value: Expr, path: Path, yes: Choice, no: Choice, context: Context) -> Expr:
        """Return yes where a product of signs is positive, else no."""
        if value.is_number:
            return yes(path) if value > 0 else no(path)
        found = self.table.signs_in(value)
        if not found:
            return Select(value, yes(path), no(path))
        s = found[0]
        known = self._known(s, path)
        if known:
            return self._by_sign(value.xreplace({s: Integer(known)}), path, yes, no, context)
        plus, minus = (
            self._by_sign(value.xreplace({s: Integer(m)}), {**path, s: m}, yes, no, context) for m in (1, -1)
        )
        return self._join(s, plus, minus, context)

    # -- Max and Min -----------------------------------------------------------------------------------

    def _largest(self, items: list[Expr], least: bool, path: Path) -> Expr:
        """Max (Min where `least`) as a contest of pairs, so that every surface is a plain difference."""
        return self._contest(items, least, path, lambda won, known: self.convert(won, "field", known))

    def _contest(
        self, items: list[Expr], least: bool, path: Path, then: Callable[[Expr, Path], Expr]
    ) -> Expr:  # fmt: skip
        """Apply `then` to the largest (least) of the items, expanded over which one it is."""
        bounded = next((q for q in items if isinstance(q, (Max, Min)) and dynamic(q)), None)
        others = [q for q in items if q is not bounded]
        if bounded is not None and not any(map(dynamic, others)) and sum(map(dynamic, bounded.args)) == 1:
            # Max(a, Min(b, u)): which of b and u it is goes first, and u meets each bound by itself.
            inner = sorted(bounded.args, key=sympy.default_sort_key)
            return self._contest(
                inner, isinstance(bounded, Min), path,
                lambda won, known: self._contest([won, *others], least, known, then),
            )  # fmt: skip
        first, *rest = items
        if not rest:
            return then(first, path)
        second, *rest = rest
        difference = second - first if least else first - second
        if vanishes(difference):
            return self._contest([first, *rest], least, path, then)
        return self._positive(
            difference,
            path,
            lambda known: self._contest([first, *rest], least, known, then),
            lambda known: self._contest([second, *rest], least, known, then),
            strict=True,
            written=False,
        )

    def _by_value(self, expr: Expr, path: Path) -> Expr:
        """|u|, Max or Min by the sign that its argument or differences have where it is evaluated."""
        first, *rest = (self.convert(arg, "reset", path) for arg in expr.args)
        for other in [-first] if isinstance(expr, Abs) else rest:
            first = Select(other - first if isinstance(expr, Min) else first - other, first, other)
        return first

    def _largest_as_size(self, items: list[Expr], least: bool, path: Path) -> Expr:
        """Max(u, v) = (u + v + |u - v|)/2, Min(u, v) = (u + v - |u - v|)/2."""
        value = self.convert(items[0], "h", path)
        for item in items[1:]:
            other = self.convert(item, "h", path)
            size = self._split(value - other, path, self._size)
            value = (value + other + (-size if least else size)) / 2
        return value


def _arguments(expr: Expr) -> Iterator[Expr]:
    for part in sympy.preorder_traversal(expr):
        if isinstance(part, (sign, Heaviside)):
            yield part.args[0]
        elif isinstance(part, (Gt, Ge, Lt, Le)):
            yield _difference(part)[0]


def _difference(condition: Any) -> tuple[Expr, bool]:
    """Return h and whether the condition holds where h > 0.

    sympy turns conditions round, k < x into x > k: a side without state and time is always subtracted.
    """
    larger, smaller = condition.gts, condition.lts
    return (larger - smaller, True) if dynamic(larger) else (smaller - larger, False)


def _odd_power(arg: Expr) -> bool:
    """Whether a surface is an odd power of one with the same zeros, which are simple there."""
    return bool(arg.is_Pow and arg.exp.is_odd)


def _factors(arg: Expr) -> list[Expr]:
    """Return the factors of arg, a common factor of a sum taken out.

    A minus sign stays with the factor that moves, where it is one alone: -a - b is no -1 times a + b.
    """
    whole = sympy.factor_terms(arg) if arg.is_Add else arg
    if not whole.is_Mul:
        return [arg]
    parts = [inner for factor in whole.args for inner in (_factors(factor) if factor.is_Add else [factor])]
    moving = [k for k, part in enumerate(parts) if dynamic(part)]
    if parts[0].is_number and parts[0].is_negative and len(moving) == 1 and not parts[moving[0]].is_Pow:
        parts[moving[0]] *= -1
        parts[0] = -parts[0]
    return parts[1:] if parts[0] == 1 else parts


NONSMOOTH = (sign, Abs, Heaviside, Piecewise, Max, Min, Select)
