"""A switching surface: one scalar function h(t, x; p) with a name, and the set of its sign at h = 0."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, get_args

from filippov.base.errors import ModelError
from filippov.base.given import several
from filippov.base.keywords import constructor
from filippov.base.symbolic_value import is_condition, is_expression, single
from filippov.model.parameter import as_number

if TYPE_CHECKING:
    from sympy import Expr

Kind = Literal["switching", "kink", "observer", "reset"]
Side = Literal["+", "-", "both"]
# A number, an expression, or a function (t, x, p) -> float.
Bound = Any


class Role(NamedTuple):
    """What a run asks of a surface besides its functions; side: from which the state is reset, or None."""

    kind: str
    width: float
    side: str | None
    contact: bool


def surfaces_of(given: Any) -> tuple[Any, ...]:
    """What is given as surfaces=, in order; ModelError for the name of one."""
    if isinstance(given, str):
        raise ModelError(
            f"surfaces is {given!r}, expected a list of Surface. Write surfaces=[Surface({given!r}, h)], "
            "with the argument of the sign as h; without surfaces= they are found in the equations."
        )
    return tuple(several("surfaces", given, ModelError))


@constructor(error=ModelError, own=("name",), answers={
    "direction": "direction is of a UserEvent. The side from which a surface is reached for its reset is "
    "side: '+' (h > 0 before), '-' or 'both'; a surface that only switches has none.",
})  # fmt: skip
@dataclass(frozen=True)
class Surface:
    """The surface h = 0 with sign s = sgn(h), and s in [lo, hi] at h = 0 (`radius` r means [-r, r]).

    name      non-empty text
    h         sympy expression in t, states and parameters, or a function h(t, x, p) -> float
    radius    number, expression or function (t, x, p) -> float, or a pair (lo, hi); lo <= -1 and hi >= 1.
              Kept as the pair.
    kind      "switching": the field jumps; "kink": it is continuous, its derivative jumps (nothing can slide
              there); "observer": located only; "reset": the state jumps there. Default: "reset" with a
              reset, else "switching"
    gradient  for a function h: gradient(t, x, p) -> dh/dx, shape (n,). Default: by dual numbers where h takes
              them, else by differences
    linear    for a function h: it is affine in x and does not depend on t. Both are compared with differences
              of h where a run starts and at events: ModelError where they contradict
    width     half-width of the hysteresis: the sign s is left at h = -s width; 0 for none. A number, or an
              expression of parameters that is positive: the system then has the surface h/width of width 1
    reset     x+ = r(t, x-, p) where the surface is reached: a mapping from states (symbols or names) to
              expressions, states left out keep their values; for a function h a function r(t, x, p) -> (n,)
    side      the side from which it is reached for the reset: "+" (h > 0 before), "-" or "both"
    contact   whether the state may come to rest on the surface, in the limit of ever smaller impacts or after
              a plastic one (see `filippov.model.contact`). Default: where the equations allow it; for
              functions only where it is True, and then the reset must be an impact, else ModelError

    Raises ModelError. Static friction Fs above the limit Fc of the slip curve is radius=Fs/Fc.
    """

    name: str
    h: Any
    radius: Any = 1.0
    kind: Kind = None  # type: ignore[assignment]  # becomes "reset" or "switching"
    gradient: Callable[..., Any] | None = None
    linear: bool = False
    width: Any = 0.0
    reset: Any = None
    side: Side = "+"
    contact: bool | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "h", single(self.h))
        if not _is_text(self.name):
            raise ModelError(
                f"a surface has the name {self.name!r}, expected non-empty text. The name goes first: "
                "Surface('v', v)."
            )
        where = f"surface {self.name!r}"
        if is_condition(self.h):
            raise ModelError(
                f"{where}: h = {self.h} is a condition, expected a continuous function that changes its "
                "sign. "
                "Give the difference of its two sides."
            )
        if not is_expression(self.h) and not callable(self.h):
            bare = " Write it without quotes." if isinstance(self.h, str) else ""
            if isinstance(self.h, bool):
                bare = " Python's == compares at once: write h itself, v - vb for the surface v = vb."
            raise ModelError(
                f"{where}: h is {self.h!r} ({type(self.h).__name__}), expected a sympy expression or a "
                f"function h(t, x, p).{bare}"
            )
        given: str | None = self.kind
        if given is None:
            object.__setattr__(self, "kind", "switching" if self.reset is None else "reset")
        if self.kind not in get_args(Kind):
            raise ModelError(
                f"{where}: kind is {self.kind!r}, expected one of {', '.join(map(repr, get_args(Kind)))}."
            )
        object.__setattr__(self, "radius", _bounds(self.radius, where))
        if self.gradient is not None and not callable(self.gradient):
            raise ModelError(
                f"{where}: gradient is {self.gradient!r}, expected a function (t, x, p) -> dh/dx."
            )
        if self.symbolic and (self.gradient is not None or self.linear):
            raise ModelError(f"{where}: gradient and linear are for functions; an expression has its own.")
        if isinstance(self.width, tuple | list):
            raise ModelError(
                f"{where}: width is {self.width!r}, expected half the width of the hysteresis: the sign "
                "changes at h = -width and +width; what lies elsewhere is another h."
            )
        if not is_expression(self.width) or self.width.is_number:
            width = as_number(self.width, f"{where}: width")
            if width < 0:
                raise ModelError(f"{where}: width is {width}, expected a number >= 0.")
            object.__setattr__(self, "width", width)
        self._check_reset(where)

    def _check_reset(self, where: str) -> None:
        if self.side not in get_args(Side):
            raise ModelError(f"{where}: side is {self.side!r}, expected '+', '-' or 'both'.")
        if self.reset is None:
            if self.kind == "reset" or self.contact:
                what = "kind 'reset'" if self.kind == "reset" else "contact=True"
                raise ModelError(f"{where}: {what} needs a reset: Surface(name, h, reset={{v: -p.e*v}}).")
            return
        if self.kind in ("kink", "observer") or self.width != 0:
            what = f"a {self.kind}" if self.width == 0 else "a surface with hysteresis"
            raise ModelError(f"{where}: {what} cannot have a reset. Declare a surface of its own for it.")
        if self.contact and self.side == "both":
            raise ModelError(f"{where}: contact needs one side to rest on, side is 'both'. Give '+' or '-'.")
        if self.symbolic:
            object.__setattr__(self, "reset", reset_pairs(self.reset, f"{where}: reset"))
        elif not callable(self.reset):
            raise ModelError(
                f"{where}: reset is {self.reset!r}, expected a function r(t, x, p) -> x+, because h is one."
            )

    @property
    def symbolic(self) -> bool:
        """Whether h is a sympy expression."""
        return is_expression(self.h)

    @property
    def role(self) -> Role:
        """What a run asks of it besides its functions."""
        return Role(self.kind, self.width, None if self.reset is None else self.side, bool(self.contact))

    @property
    def wide(self) -> bool:
        """Whether the set at h = 0 is, or may be, larger than [-1, 1]."""
        return any(not isinstance(b, float) or not math.isclose(abs(b), 1.0) for b in self.radius)




def no_surface(given: object) -> str:
    """What to say of something among the surfaces that is none."""
    cure = " A TimeEvent goes into time_events=." if type(given).__name__ == "TimeEvent" else ""
    return f"surfaces holds {given!r}, expected Surface('name', h).{cure}"


def reset_pairs(value: Any, where: str) -> tuple[tuple[str, Expr], ...]:
    """A reset as pairs of a state's name and its value after; ModelError for anything but a mapping."""
    if isinstance(value, tuple) and all(isinstance(q, tuple) and len(q) == 2 for q in value):
        value = dict(value)
    if not isinstance(value, Mapping) or not value:
        raise ModelError(
            f"{where} is {value!r}, expected a mapping from states to their values after it: {{v: -p.e*v}}."
        )
    from filippov.model.check import as_expression

    out: dict[str, Expr] = {}
    for key, after in value.items():
        name = getattr(single(key), "name", key)
        if not isinstance(name, str):
            raise ModelError(f"{where} holds the key {key!r}, expected a state or its name.")
        if name in out:
            raise ModelError(f"{where} names the state {name!r} twice, by name and by symbol. Leave one out.")
        out[name] = as_expression(after, f"{where} of {name!r}")
    return tuple(out.items())


def _is_text(value: object) -> bool:
    return isinstance(value, str) and bool(value.strip())


def _bounds(radius: object, where: str) -> tuple[Bound, Bound]:
    """Return the set [lo, hi] at h = 0 from a radius or a pair."""
    if isinstance(radius, (tuple, list)):
        if len(radius) != 2:
            raise ModelError(f"{where}: radius has {len(radius)} entries, expected a number or (lo, hi).")
        low, high = (_bound(b, where) for b in radius)
    else:
        high = _bound(radius, where)
        low = _Negative(high) if callable(high) and not is_expression(high) else -high
    if (isinstance(low, float) and low > -1 + 1e-12) or (isinstance(high, float) and high < 1 - 1e-12):
        raise ModelError(
            f"{where}: the set at h = 0 is [{low}, {high}], which does not contain [-1, 1]. "
            "It must hold both one-sided signs; scale the field instead."
        )
    return low, high


def _bound(value: object, where: str) -> Bound:
    if is_expression(value) and not value.is_number:
        return value
    if callable(value) and not is_expression(value):
        return value
    return as_number(value, f"{where}: radius")


@dataclass(frozen=True)
class _Negative:
    """The function (t, x, p) -> -f(t, x, p), picklable where f is."""

    f: Callable[..., float]

    def __call__(self, t: float, x: Any, p: Any) -> float:
        return -self.f(t, x, p)
