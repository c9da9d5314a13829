"""The functions of a program that jump or have corners, as expressions with a note of where they stand."""

from __future__ import annotations

import ast
import itertools
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import sympy
from sympy import Abs, And, Expr, Heaviside, Max, Min, Not, Or, sign

from filippov.analysis.programs.choice import (
    Flags,
    as_number,
    elementwise,
    expression,
    is_condition,
    is_number,
    length_less,
    plain,
)
from filippov.analysis.programs.notes import Clock, ReadingError, at
from filippov.model.symbolic import Select

QUANTISED = (
    "steps without end of the state: the System that it means has one surface for every step. Give the "
    "rounded or "
    "wrapped quantity a state of its own, with a reset at the ends of its range"
)
# Levels of a staircase over one period of a clock that become surfaces.
MOST_LEVELS = 50
# Of a step: how near to a whole number of steps a limit counts as one.
NEARLY_WHOLE = 1e-9


class Switching:
    """Part of the reader: each method is a function of a program, called with its node and its arguments."""

    flags: Flags
    clocks: dict[Any, Clock]
    time: Any

    def site(self, node: ast.AST, kind: str, h: Any) -> None:
        """Note that the program switches here."""
        raise NotImplementedError

    def fixed(self, value: Any) -> Any:
        """The number of a value that depends on parameters alone, else None."""
        raise NotImplementedError

    def truth(self, node: ast.AST, value: Any) -> Any:
        """A value as a condition."""
        raise NotImplementedError

    def call(self, node: ast.AST, function: Any, args: list[Any], named: dict[str, Any]) -> Any:
        """The value of a call."""
        raise NotImplementedError

    def rests(self, difference: Any) -> bool:
        """Whether a difference is 0 in a whole part of the states."""
        raise NotImplementedError

    def split(self, value: Any, function: Callable[[float], Any]) -> Any:
        """A function of what takes finitely many values; None where it takes others."""
        raise NotImplementedError

    def fail(self, node: ast.AST, message: str) -> ReadingError:
        """The error that names the line."""
        raise NotImplementedError

    def compare(self, node: ast.AST, how: str, a: Any, b: Any) -> Any:
        """A comparison of two numbers."""
        raise NotImplementedError

    # -- signs and sizes -----------------------------------------------------------------------------------

    def sign(self, node: ast.AST, value: Any) -> Any:
        """np.sign."""

        def one(x: Any) -> Any:
            x = as_number(x)
            if is_number(x):
                return float(np.sign(x))
            self.site(node, "sign", x)
            if self.rests(x):
                below = self.flags.choose(self.compare(node, "<", x, 0), -1, 0)
                return self.flags.choose(self.compare(node, ">", x, 0), 1, below)
            half = self.half_step(x)
            return sign(x) if half is None else (sign(x - half) + sign(x + half)) / 2

        return elementwise(one, value)

    def magnitude(self, node: ast.AST, value: Any) -> Any:
        """Absolute values."""

        def one(x: Any) -> Any:
            x = as_number(x)
            if not is_number(x):
                self.site(node, "abs", x)
            return abs(x) if is_number(x) else Abs(x)

        return elementwise(one, value)

    def copysign(self, node: ast.AST, value: Any, other: Any) -> Any:
        """|value| with the sign of the other."""

        def one(a: Any, b: Any) -> Any:
            number = self.fixed(b)
            if number is not None:
                turn: Any = math.copysign(1.0, number)
            elif isinstance(b, Expr) and (b.has(Select) or self.rests(b)):  # where 0 counts as positive
                turn = self.flags.choose(self.compare(node, "<", b, 0), -1, 1)
            else:
                turn = self.sign(node, b)
            return self.magnitude(node, a) * turn

        return elementwise(one, value, other)

    def heaviside(self, node: ast.AST, value: Any, half: Any = 0.5) -> Any:
        """np.heaviside; its value at 0 is used where the argument counts, never off the surface otherwise."""

        def one(x: Any) -> Any:
            if is_number(x):
                return float(np.heaviside(x, 0.5))
            self.site(node, "heaviside", x)
            between = self.half_step(x)
            if between is None:
                return Heaviside(x)
            return half * Heaviside(x + between) + (1 - half) * Heaviside(x - between)

        return elementwise(one, value)

    def cbrt(self, node: ast.AST, value: Any) -> Any:
        """sign(x) |x|**(1/3)."""
        third = sympy.Rational(1, 3)
        return elementwise(lambda x: self.sign(node, x) * self.magnitude(node, x) ** third, value)

    def negative(self, node: ast.AST, value: Any) -> Any:
        """np.signbit."""
        return self.less(node, value, 0)

    # -- choices -------------------------------------------------------------------------------------------

    def where(self, node: ast.AST, condition: Any, yes: Any = None, no: Any = None) -> Any:
        """np.where with three arguments."""
        if yes is None or no is None:
            raise self.fail(node, "np.where with one argument gives places, which are no formula")

        def one(c: Any, a: Any, b: Any) -> Any:
            held = self.truth(node, c)
            return (a if held else b) if isinstance(held, bool) else self.flags.choose(held, a, b)

        return elementwise(one, condition, yes, no)

    def select(self, node: ast.AST, conditions: Any, choices: Any, default: Any = 0) -> Any:
        """np.select."""
        for condition, choice in reversed(list(zip(conditions, choices, strict=True))):
            default = self.where(node, condition, choice, default)
        return default

    def piecewise(
        self, node: ast.AST, x: Any, condlist: Any, funclist: Any, *args: Any, **named: Any
    ) -> Any:
        """np.piecewise: the last of the conditions that hold counts; else the function left over, or 0."""
        if is_number(x) and not isinstance(x, (float, np.floating)):
            raise self.fail(node, "np.piecewise of a whole number gives whole numbers; write it with a point")
        array = isinstance(x, (np.ndarray, list, tuple))
        if not isinstance(condlist, (list, tuple, np.ndarray)) or (
            array and not isinstance(condlist[0], (list, np.ndarray))
        ):
            condlist = [condlist]
        if len(funclist) not in {len(condlist), len(condlist) + 1}:
            held = f"{len(condlist)} condition{'s'[: len(condlist) - 1]}"
            raise self.fail(node, f"{len(funclist)} functions for {held}, expected as many or one more")

        def value(function: Any) -> Any:
            if is_number(function) or isinstance(function, Expr) or is_condition(function):
                return elementwise(lambda _: function, x)
            return elementwise(lambda u: self._of_one(self.call(node, function, [u, *args], dict(named))), x)

        out = value(funclist[-1]) if len(funclist) > len(condlist) else value(0)
        x = np.asarray(x, dtype=object) if array else x
        for condition, function in zip(condlist, funclist, strict=False):
            out = self.where(node, condition, value(function), out)
        return out

    @staticmethod
    def _of_one(value: Any) -> Any:
        return value.ravel()[0] if isinstance(value, np.ndarray) and value.size == 1 else value

    def clip(self, node: ast.AST, value: Any, a_min: Any = None, a_max: Any = None, **bounds: Any) -> Any:
        """np.clip: least(largest(value, a_min), a_max)."""
        low, high = bounds.get("min", a_min), bounds.get("max", a_max)
        if low is not None and high is not None:
            ends = [self.fixed(v) for v in (low, high) if not isinstance(v, np.ndarray)]
            known = [end for end in ends if end is not None]
            if len(known) == 2 and known[0] < known[1]:
                return elementwise(lambda v: self._between(node, v, low, high), value)
        value = value if low is None else self._extreme(node, Max, "clip", (value, low))
        return value if high is None else self._extreme(node, Min, "clip", (value, high))

    def _between(self, node: ast.AST, value: Any, low: Any, high: Any) -> Any:
        """A number between bounds of which the first is known to be the lower."""
        if self.fixed(value) is not None:
            return self._extreme(node, Min, "clip", (self._extreme(node, Max, "clip", (value, low)), high))
        above = self.flags.choose(self.compare(node, ">", value, high), high, value)
        return self.flags.choose(self.compare(node, "<", value, low), low, above)

    def largest(self, node: ast.AST, *values: Any, **given: Any) -> Any:
        """The largest of numbers."""
        return self._extreme(node, Max, "max", self._items(node, values, given))

    def least(self, node: ast.AST, *values: Any, **given: Any) -> Any:
        """The least of numbers."""
        return self._extreme(node, Min, "min", self._items(node, values, given))

    def _items(self, node: ast.AST, values: tuple[Any, ...], given: dict[str, Any]) -> tuple[Any, ...]:
        if given:
            raise self.fail(node, f"{', '.join(given)}= is not followed here")
        return tuple(np.ravel(values[0])) if len(values) == 1 else values

    def _extreme(self, node: ast.AST, kind: Any, name: str, values: tuple[Any, ...]) -> Any:
        def one(*items: Any) -> Any:
            items = tuple(as_number(item) for item in items)
            if all(is_number(item) for item in items):
                return max(items) if kind is Max else min(items)
            length = length_less(*items, self.fixed) if len(items) == 2 else None
            if length is not None:
                self.site(node, name, length)
                first, second = items if isinstance(items[0], sympy.Pow) else items[::-1]
                return Select(length, *((first, second) if kind is Max else (second, first)))
            for a, b in itertools.combinations(items, 2):
                self.site(node, name, a - b)
            if not any(isinstance(item, Expr) and item.has(Select) for item in items):
                return kind(*items)
            out = items[0]
            for item in items[1:]:  # sympy compares what it is given, without end where it chooses
                h = out - item
                out = Select(h, out, item) if kind is Max else Select(h, item, out)
            return out

        return elementwise(one, *values)

    def interpolate(self, node: ast.AST, x: Any, xp: Any, fp: Any, **given: Any) -> Any:
        """np.interp: a polygon, with a corner at each of its points."""
        numbers = [[self.fixed(v) for v in np.ravel(np.asarray(row, dtype=object))] for row in (xp, fp)]
        if any(None in row for row in numbers):
            raise self.fail(node, "np.interp is followed for tables of numbers, not of the state")
        places, values = (np.array(row, dtype=float) for row in numbers)
        if given or len(places) > 50:
            raise self.fail(node, "np.interp is followed with three arguments and at most 50 points")

        def one(u: Any) -> Any:
            if is_number(u):
                return float(np.interp(u, places, values))
            out: Any = values[-1]
            for k in range(len(places) - 1, 0, -1):
                slope = (values[k] - values[k - 1]) / (places[k] - places[k - 1])
                out = self.flags.choose(
                    self.less(node, u, places[k]), values[k - 1] + slope * (u - places[k - 1]), out
                )
            return self.flags.choose(self.less(node, u, places[0]), values[0], out)

        return elementwise(one, x)

    # -- conditions ----------------------------------------------------------------------------------------

    def greater(self, node: ast.AST, a: Any, b: Any) -> Any:
        """a > b."""
        return elementwise(lambda u, v: self.compare(node, ">", u, v), a, b)

    def less(self, node: ast.AST, a: Any, b: Any) -> Any:
        """a < b."""
        return elementwise(lambda u, v: self.compare(node, "<", u, v), a, b)

    def close(self, node: ast.AST, a: Any, b: Any = 0.0, **given: Any) -> Any:
        """A test whether two numbers agree but for a tolerance: a dead band."""
        width = self.fixed(given.get("abs_tol", given.get("atol", 1e-8)))
        return elementwise(lambda u, v: self.compare(node, "<", self.magnitude(node, u - v), width), a, b)

    def all_of(self, node: ast.AST, *values: Any) -> Any:
        """Whether all of them hold."""
        return self._joined(node, And, values)

    def any_of(self, node: ast.AST, *values: Any) -> Any:
        """Whether one of them holds."""
        return self._joined(node, Or, values)

    def _joined(self, node: ast.AST, kind: Any, values: tuple[Any, ...]) -> Any:
        items = np.ravel(np.asarray(values[0], dtype=object)) if len(values) == 1 else values
        if len(values) > 1 and any(isinstance(v, np.ndarray) for v in values):
            return elementwise(lambda *parts: self._joined(node, kind, parts), *values)
        return plain(kind(*(self.truth(node, item) for item in items)))

    def negated(self, node: ast.AST, value: Any) -> Any:
        """Not."""
        return elementwise(lambda v: plain(Not(self.truth(node, v))), value)

    def as_bool(self, node: ast.AST, value: Any = False) -> Any:
        """bool(...)."""
        return self.truth(node, value)

    def as_float(self, node: ast.AST, value: Any = 0.0) -> Any:
        """float(...): a condition as 1 or 0."""
        if isinstance(value, np.ndarray) and value.size == 1:
            value = value.ravel()[0]
        if isinstance(value, str):
            raise self.fail(node, "float of a text is not followed")
        return as_number(value)

    def never(self, node: ast.AST, value: Any) -> bool:
        """Whether a number is NaN: the field has none where it is defined."""
        del node, value
        return False

    def always(self, node: ast.AST, value: Any) -> bool:
        """Whether a number is finite."""
        del node, value
        return True

    def finite(self, node: ast.AST, value: Any, **given: Any) -> Any:
        """np.nan_to_num: the same number, for the field has no other where it is defined."""
        del node, given
        several = isinstance(value, (list, tuple))
        return elementwise(as_number, np.asarray(value, dtype=object) if several else value)

    def instance(self, node: ast.AST, value: Any, kind: Any) -> bool:
        """isinstance: a number of the state counts as a float."""
        del node
        return isinstance(value, kind) or (isinstance(value, Expr) and issubclass(float, kind))

    # -- sums ----------------------------------------------------------------------------------------------

    def total(self, node: ast.AST, values: Any, *start: Any, **given: Any) -> Any:
        """The sum of an array or list."""
        if given or isinstance(values, dict):
            raise self.fail(node, f"a sum with {', '.join(given) or 'a dict'} is not followed")
        return sum((as_number(v) for v in np.ravel(np.asarray(values, dtype=object))), *start)

    def inner(self, node: ast.AST, a: Any, b: Any) -> Any:
        """np.vdot: the sum of the products of all entries."""
        first, second = (np.ravel(np.asarray(v, dtype=object)).tolist() for v in (a, b))
        if len(first) != len(second):
            raise self.fail(node, f"np.vdot of {len(first)} and {len(second)} entries")
        return sum(as_number(u) * as_number(v) for u, v in zip(first, second, strict=True))

    def norm(self, node: ast.AST, values: Any, ord: Any = None) -> Any:  # noqa: A002  (numpy's word)
        """The Euclidean norm of all entries, or of a vector the sum or the largest of the sizes."""
        items = [as_number(v) for v in np.ravel(np.asarray(values, dtype=object)).tolist()]
        kind = None if ord is None else self.fixed(ord)
        if ord is not None and (kind not in {1.0, 2.0, math.inf} or np.ndim(values) != 1):
            raise self.fail(node, "a norm is followed for vectors, of order 1, 2 or inf")
        if kind in {1.0, math.inf}:
            sizes = [self.magnitude(node, v) for v in items]
            return sum(sizes) if kind == 1.0 else self.largest(node, *sizes)
        if len(items) == 1:
            return self.magnitude(node, items[0])
        return sympy.sqrt(sum(v**2 for v in items))

    def distance(self, node: ast.AST, a: Any, b: Any) -> Any:
        """math.dist."""
        return self.norm(node, [u - v for u, v in zip(a, b, strict=True)])

    # -- steps ---------------------------------------------------------------------------------------------

    def half_step(self, value: Any) -> Any:
        """Half the distance between the values of what counts alone decide and which may be 0; else None.

        What counts stays at 0 for a while, so its switching lies halfway between 0 and the next value.
        """
        if not isinstance(value, Expr):
            return None
        counts = [clock.symbol for clock in self.clocks.values() if clock.kind == "floor"]
        slopes = [value.diff(n) for n in counts if value.has(n)]
        numbers = [self.fixed(slope) for slope in slopes]
        rest = self.fixed(value.xreplace(dict.fromkeys(counts, sympy.S.Zero)))
        sizes = [abs(number) for number in numbers if number]
        if not sizes or rest is None or None in numbers:
            return None
        if len(sizes) > 1 and not all(size == round(size) for size in sizes):
            return None
        step = sizes[0] if len(sizes) == 1 else float(math.gcd(*(round(size) for size in sizes)))
        return None if abs(rest / step - round(rest / step)) > NEARLY_WHOLE else sympy.nsimplify(step / 2)

    def mod(self, node: ast.AST, a: Any, b: Any) -> Any:
        """A % b, with the sign of b."""
        return elementwise(lambda u, v: self._step(node, "mod", u, v), a, b)

    def divided(self, node: ast.AST, a: Any, b: Any) -> Any:
        """A // b."""
        return elementwise(lambda u, v: self._step(node, "floor", u, v), a, b)

    def divided_and_rest(self, node: ast.AST, a: Any, b: Any) -> tuple[Any, Any]:
        """divmod."""
        return self.divided(node, a, b), self.mod(node, a, b)

    def floor(self, node: ast.AST, value: Any) -> Any:
        """The largest whole number that is not larger."""
        return self.divided(node, value, 1)

    def ceiling(self, node: ast.AST, value: Any) -> Any:
        """-floor(-value)."""
        return -self.divided(node, -value, 1)

    def whole(self, node: ast.AST, value: Any) -> Any:
        """int(...): of a condition 1 or 0, of time (which does not fall below 0) its floor."""
        if is_number(value):
            return int(value)
        if is_condition(value) or value in self.flags.symbols:
            return as_number(value)
        steps = self.split(value, math.trunc)
        return self.divided(node, value, 1) if steps is None else steps

    def nearest(self, node: ast.AST, value: Any, *digits: Any) -> Any:
        """The nearest whole number."""
        if digits:
            raise self.fail(node, f"rounding to digits gives {QUANTISED}")
        steps = self.split(value, round)
        return self.divided(node, value + sympy.Rational(1, 2), 1) if steps is None else steps

    def fmod(self, node: ast.AST, a: Any, b: Any) -> Any:
        """The rest with the sign of a: for time, that of %."""
        modulus = self.fixed(b)
        steps = self.split(as_number(a), lambda q: math.fmod(q, modulus)) if modulus else None
        return self.mod(node, a, b) if steps is None else steps

    def _step(self, node: ast.AST, kind: str, a: Any, b: Any) -> Any:
        a, b = as_number(a), as_number(b)
        if is_number(a) and is_number(b):
            return a % b if kind == "mod" else a // b
        first, modulus = self.fixed(a), self.fixed(b)
        if first is not None and modulus is not None:
            return first % modulus if kind == "mod" else first // modulus
        of_clock = self._step_of_clock(node, kind, expression(a), modulus)
        if of_clock is not None:
            return of_clock
        if modulus:
            steps = self.split(a, lambda q: q % modulus if kind == "mod" else q // modulus)
            if steps is not None:
                return steps
        rate = expression(a).diff(self.time)
        speed = self.fixed(rate)
        offset = expression(a).subs(self.time, 0)
        if modulus is None or speed is None or self.fixed(offset) is None:
            raise self.fail(node, QUANTISED)
        if modulus * speed <= 0 or not math.isfinite(modulus * speed):
            raise self.fail(node, "a clock that runs backwards (a negative rate or period) is not followed")
        self.site(node, "time", None)
        return self._clock(node, kind, rate, offset, b).symbol

    def _clock(self, node: ast.AST, kind: str, rate: Any, offset: Any, modulus: Any) -> Clock:
        key = (kind, rate, offset, modulus)
        if key not in self.clocks:
            name = "phase" if kind == "mod" else "count"
            number = sum(clock.kind == kind for clock in self.clocks.values())
            symbol = sympy.Dummy(name if not number else f"{name}_{number + 1}", real=True)
            self.clocks[key] = Clock(kind, symbol, rate, offset, modulus, at(node))
        return self.clocks[key]

    def _step_of_clock(self, node: ast.AST, kind: str, a: Any, modulus: float | None) -> Any:
        """Steps of what a clock shows: (t // T) % 2 and (t % T) // d; None for anything else."""
        clock = next((c for c in self.clocks.values() if c.symbol == a), None)
        size = None if clock is None else self.fixed(clock.modulus)
        if clock is None or size is None or modulus is None or modulus <= 0:
            return None
        if clock.kind == "floor":
            whole = round(modulus)
            if kind != "mod" or modulus != whole or whole > MOST_LEVELS:
                return None
            # The clock that counts is a longer one that comes back to 0, in parts of its period.
            longer = self._clock(node, "mod", clock.rate, clock.offset, clock.modulus * whole)
            return self._levels(node, longer.symbol, clock.modulus, whole)
        number = math.ceil(size / modulus - 1e-9)
        if number > MOST_LEVELS:
            return None
        step = sympy.Float(modulus, 17)
        levels = self._levels(node, a, step, number)
        return levels if kind == "floor" else a - step * levels

    def _levels(self, node: ast.AST, phase: Any, step: Any, number: int) -> Any:
        """floor(phase/step) for 0 <= phase < number step."""
        at_least = (self.compare(node, ">=", phase, j * step) for j in range(1, number))
        return sum((as_number(held) for held in at_least), sympy.S.Zero)


HANDLERS: dict[str, Callable[..., Any]] = {
    name: value for name, value in vars(Switching).items() if callable(value) and not name.startswith("_")
}
