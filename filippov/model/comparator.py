"""What stands in the place of the set-valued sign Sgn(h).

Exact()            the inclusion: s in [-1, 1], or the surface's own set, at h = 0
Band(width)        s = clip(h/width, -1, 1)
Smooth(width)      s = tanh(h/width)
Hysteresis(width)  a two-valued relay: s is kept until h = -s width
"""

from __future__ import annotations

from dataclasses import dataclass

from filippov.base.errors import ModelError
from filippov.base.symbolic_value import is_expression
from filippov.model.parameter import as_number


@dataclass(frozen=True)
class Exact:
    """The differential inclusion itself."""


@dataclass(frozen=True)
class _Wide:
    """A comparator with a half-width, in the units of h."""

    width: float

    def __post_init__(self) -> None:
        name = type(self).__name__
        if is_expression(self.width) and not self.width.is_number:
            raise ModelError(
                f"the width of {name} is {self.width}, expected a number: a comparator has one width for "
                "all runs. A width that is a parameter is that of a relay: Surface(name, h, width=p.w)."
            )
        width = as_number(self.width, f"the width of {name}")
        if width <= 0:
            raise ModelError(
                f"the width of {name} is {width}, expected a number > 0 in the units of h. Use Exact() for "
                "none."
            )
        object.__setattr__(self, "width", width)


@dataclass(frozen=True)
class Band(_Wide):
    """s = clip(h/width, -1, 1): a saturated line, continuous, with kinks at h = +-width."""


@dataclass(frozen=True)
class Smooth(_Wide):
    """s = tanh(h/width): no surface is left."""


@dataclass(frozen=True)
class Hysteresis(_Wide):
    """s keeps its value +1 or -1 until h = -s width."""


Comparator = Exact | Band | Smooth | Hysteresis


def check_comparator(comparator: object) -> Comparator:
    """Return an instance of a comparator, or raise ModelError."""
    if isinstance(comparator, (Exact, Band, Smooth, Hysteresis)):
        return comparator
    hint = " Give its width." if comparator in (Band, Smooth, Hysteresis) else " Write Exact()."
    raise ModelError(
        f"comparator is {comparator!r}, expected Exact(), Band(width), Smooth(width) or Hysteresis(width)."
        + (hint if isinstance(comparator, type) else "")
    )
