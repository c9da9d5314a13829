"""Replacements of the set-valued sign Sgn(h), for all switching surfaces or chosen for each.

Exact()               the inclusion: s in [-1, 1], or the surface's own set, at h = 0
Band(width)           s = clip(h/width, -1, 1)
Smooth(width, shape)  s = tanh(h/width), (2/pi) atan(pi h/(2 width)) or h/sqrt(h^2 + width^2)
Hysteresis(width)     a two-valued relay: s is kept until h = -s width
Switch(eta, alpha)    |h| <= eta: dh/dt = -alpha h while the inclusion attracts, else slip (Leine 2000)
Karnopp(DV, alpha)    |h| <= DV: h counts as 0, and friction balances the force up to its static level

Widths are half-widths in the units of h: numbers, or expressions of parameters, which the system then has.
Sources: Karnopp 1985; Leine 2000; Acary & Brogliato 2008, chapter 2.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields
from typing import Any

from filippov.base.errors import ModelError
from filippov.base.keywords import constructor
from filippov.base.names import unknown
from filippov.base.symbolic_value import is_expression
from filippov.model.parameter import as_number

SHAPES = ("tanh", "arctan", "sqrt")
BALANCES = ("at rest", "in motion")


@dataclass(frozen=True)
class Exact:
    """The differential inclusion itself."""


class _Checked:
    """Reads the numbers of a comparator: each a number, or an expression of parameters."""

    def __post_init__(self) -> None:
        for item in fields(self):  # type: ignore[arg-type]  # of dataclasses only
            if item.type == "str":
                continue
            object.__setattr__(self, item.name, self._read(item.name, getattr(self, item.name)))

    def _read(self, name: str, given: Any) -> Any:
        where = f"the {name} of {type(self).__name__}"
        if is_expression(given) and not given.is_number:
            return given
        value = as_number(given, where)
        if name == "alpha":
            if value < 0:
                raise ModelError(f"{where} is {value}, expected a rate >= 0 in 1/time.")
        elif value <= 0:
            raise ModelError(
                f"{where} is {value}, expected a number > 0 in the units of h. Use Exact() for none."
            )
        return value


@constructor(error=ModelError)
@dataclass(frozen=True)
class Band(_Checked):
    """s = clip(h/width, -1, 1): a saturated line, continuous, with kinks at h = +-width."""

    width: Any


@constructor(error=ModelError)
@dataclass(frozen=True)
class Smooth(_Checked):
    """s = tanh(h/width), or another shape with the slope 1/width at 0: no surface is left.

    shape   "tanh"; "arctan", (2/pi) atan(pi h/(2 width)); "sqrt", h/sqrt(h^2 + width^2)
    """

    width: Any
    shape: str = "tanh"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.shape not in SHAPES:
            raise ModelError(unknown("shape of Smooth", self.shape, SHAPES))


@constructor(error=ModelError)
@dataclass(frozen=True)
class Hysteresis(_Checked):
    """s keeps its value +1 or -1 until h = -s width."""

    width: Any


@constructor(error=ModelError)
@dataclass(frozen=True)
class Switch(_Checked):
    """The Switch model of any sliding surface: ordinary differential equations, chosen by h and its rates.

        |h| > eta                        the field of that side
        |h| <= eta, L(lo) >= 0 >= L(hi)  sliding and relaxed onto the surface: dh/dt = -alpha h
        |h| <= eta, L(lo), L(hi) < 0     s = lo, and s = hi where both are > 0: it slips off or through
        |h| <= eta, L(lo) < 0 < L(hi)    the surface repels: s = h/eta

    L(s) is dh/dt at the sign s and |h| = 0; [lo, hi] is the set of the surface, its static levels. The
    surfaces are NAME:upper (h - eta), NAME:lower (h + eta), NAME:down (-L(lo)) and NAME:up (-L(hi)).
    eta, the half-width; alpha >= 0 [1/time]. Source: Leine 2000, after Karnopp 1985. Two or three surfaces
    may act on each other's rate (`filippov.model.comparators.coupled_bands`): within their bands the signs
    are those of the stick of all, and the levels are NAME:down with OTHER and so on. Four or more have a
    state e_NAME each, last and 0 at the start, at whose value of h they stick; who sticks is then decided by
    the inclusion, with no levels (`filippov.model.comparators.moving_stick`).

    balance   "at rest": the tests take L at h = 0, if h holds one state, linearly; "in motion": at the actual
              h, as damping in the balance requires: its level may then be slid on, in short successive sticks
    """

    eta: Any
    alpha: Any = 100.0
    balance: str = "at rest"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.balance not in BALANCES:
            raise ModelError(unknown("balance of Switch", self.balance, BALANCES))


@constructor(error=ModelError)
@dataclass(frozen=True)
class Karnopp(_Checked):
    """Karnopp's model: within |h| <= DV the velocity counts as that of h = 0 everywhere.

    Like `Switch`, with every other equation, and the balance L(lo) >= 0 >= L(hi) of the stick, taken at that
    velocity: nothing drifts in stick. Its own state goes there with dh/dt = -alpha h, or stays with alpha =
    0, Karnopp's own form. h must be a velocity, a state that another state's equation holds, linearly, or one
    body's velocity against another's, v - w; its sign must act on the equations of velocities alone, in a
    ratio that none of them changes. Velocities go to h = 0 along what the sign does, so that those of two
    bodies keep their momentum, and those that a mass matrix couples move as by the impulse. Source: Karnopp
    1985.
    """

    DV: Any
    alpha: Any = 100.0


Comparator = Exact | Band | Smooth | Hysteresis | Switch | Karnopp
NAMES = {kind.__name__: kind for kind in (Exact, Band, Smooth, Hysteresis, Switch, Karnopp)}


@dataclass(frozen=True)
class PerSurface:
    """A comparator for each of some surfaces, by name; Exact() on the others."""

    chosen: tuple[tuple[str, Comparator], ...]

    def items(self) -> Iterator[tuple[str, Comparator]]:
        """Surface names and their comparators."""
        return iter(self.chosen)


def check_comparator(comparator: object) -> Comparator:
    """Return an instance of a comparator, or raise ModelError."""
    if isinstance(comparator, tuple(NAMES.values())):
        return comparator  # type: ignore[return-value]  # one of them
    is_class = isinstance(comparator, type)
    wide = is_class and comparator is not Exact and comparator in NAMES.values()
    hint = " Give its width." if wide else " Write Exact()."
    raise ModelError(
        f"comparator is {comparator!r}, expected Exact(), Band(width), Smooth(width), Hysteresis(width), "
        "Switch(eta, alpha), Karnopp(DV, alpha), or a mapping from names of surfaces to these."
        + (hint if is_class else "")
    )


def per_surface(chosen: Mapping[Any, Any], places: Mapping[str, bool]) -> PerSurface | Comparator:
    """The comparators of a mapping in the order of the surfaces; one alone where all have the same.

    places: every surface's name and whether it is a switching one. Raises ModelError.
    """
    if not chosen:
        raise ModelError("comparator is an empty mapping, expected {'name of a surface': Band(width), ...}.")
    for name, comparator in chosen.items():
        check_comparator(comparator)
        if name not in places:
            raise ModelError(unknown("surface", name, places))
        if not places[name]:
            raise ModelError(f"surface {name!r} does not switch the field: no comparator can stand for it.")
    mine = {name: chosen.get(name, Exact()) for name, switching in places.items() if switching}
    first = next(iter(mine.values()))
    if all(comparator == first for comparator in mine.values()):
        return first  # type: ignore[no-any-return]  # checked above
    return PerSurface(tuple((name, c) for name, c in mine.items() if not isinstance(c, Exact)))


def by_surface(comparator: Comparator | PerSurface, places: Mapping[str, bool]) -> dict[str, Comparator]:
    """The comparator of every surface that has one of its own; places as for `per_surface`."""
    if isinstance(comparator, PerSurface):
        return dict(comparator.items())
    return {name: comparator for name, switching in places.items() if switching}


def numbers_of(comparator: Comparator) -> dict[str, Any]:
    """The fields of a comparator by name."""
    return {item.name: getattr(comparator, item.name) for item in fields(comparator)}
