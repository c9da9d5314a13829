"""One setting of a view: how it is read from a control or a link, and the range of its slider."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from filippov import ModelError, Parameter, UsageError
from filippov.base.names import unknown

LONGEST = 64  # characters of a value in a link


@dataclass(frozen=True)
class Field:
    """A setting by its key.

    key      as in the link: p.NAME, x0.NAME, or a name of its own
    default  a float, an int or a text; its type is that of the value
    choices  the allowed texts
    check    value -> value within its bounds; raises ModelError or UsageError
    slider   low, high and step of its slider, or None
    group    its group on the page
    """

    key: str
    default: float | int | str
    label: str
    unit: str = ""
    choices: tuple[str, ...] = ()
    check: Callable[[Any], Any] | None = None
    slider: tuple[float, float, float] | None = None
    group: str = ""

    @property
    def id(self) -> str:
        """The id of its control on the page, where a dot has another meaning."""
        return self.key.replace(".", "-")

    def read(self, given: Any) -> float | int | str:
        """The value of a number or of a text. Raises UsageError, which names the setting."""
        try:
            return self._checked(given)
        except (ModelError, UsageError) as error:
            raise UsageError(f"{self.key}: {error}") from None

    def _checked(self, given: Any) -> float | int | str:
        if isinstance(self.default, str):
            if given not in self.choices:
                raise UsageError(unknown("choice", str(given)[:LONGEST], self.choices))
            return str(given)
        number = self._number(given)
        return number if self.check is None else self.check(number)

    def _number(self, given: Any) -> float | int:
        try:
            if isinstance(given, bool) or len(str(given)) > LONGEST or "_" in str(given):
                raise ValueError
            value = float(given)
        except (TypeError, ValueError, OverflowError):
            what = "nothing" if given in (None, "") else repr(given)[:LONGEST]
            raise UsageError(f"{what} was given, expected a number such as 0.5 or 1e-3.") from None
        if not math.isfinite(value):
            raise UsageError(f"it is {value}, expected a finite number.")
        if isinstance(self.default, int):
            if value != int(value):
                raise UsageError(f"it is {value:g}, expected a whole number.")
            return int(value)
        return value


def slider_range(parameter: Parameter, value: float) -> tuple[float, float, float] | None:
    """Low, high and step around a value: from 0 to three times it, within the bounds, in round steps.

    None where the bounds leave no room. The box beside a slider accepts every value within the bounds.
    """
    # Subnormal values do not allow 200 steps: they count as 0.
    value = value if abs(value) > 1e-300 else 0.0
    reach = abs(value) or 1.0
    low = 0.0 if value > 0 else value - 2 * reach if value < 0 else -reach
    high = 0.0 if value < 0 else value + 2 * reach
    if parameter.lower is not None:
        low = max(low, parameter.lower)
        high = high if high > low else low + 2 * reach
    if parameter.upper is not None:
        high = min(high, parameter.upper)
        low = low if low < high else high - 2 * reach
        low = low if parameter.lower is None else max(low, parameter.lower)
    # Narrower ranges have no round steps in the digits that are shown.
    if not high - low > max(1e-300, 1e-6 * max(abs(low), abs(high))):
        return None
    step = step_of(low, high)
    # The ends lie on the grid of steps, within the bounds, so that a slider shows round numbers.
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    if parameter.lower is not None and _round(first * step) < parameter.lower:
        first += 1
    if parameter.upper is not None and _round(last * step) > parameter.upper:
        last -= 1
    return (_round(first * step), _round(last * step), step) if first < last else None


def step_of(low: float, high: float) -> float:
    """A round step, with first digit 1, 2 or 5: 80 to 200 of them between low and high."""
    raw = (high - low) / 200
    power = 10.0 ** math.floor(math.log10(raw))
    return _round(next(power * k for k in (1, 2, 5, 10) if power * k >= raw * (1 - 1e-12)))


def _round(value: float) -> float:
    return float(f"{value:.12g}")
