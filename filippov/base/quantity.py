"""Quantities with units, as pint has them, at the border: converted to the unit of the model, or refused."""

from __future__ import annotations

from typing import Any

from filippov.base.errors import ModelError


def is_quantity(value: object) -> bool:
    """Whether a value has a magnitude and units, as a Quantity of pint; pint is not loaded for it."""
    return hasattr(value, "magnitude") and hasattr(value, "units") and hasattr(value, "to")


def plain(value: Any, unit: str, what: str) -> Any:
    """The magnitude of a quantity in a unit; anything else as it is.

    Raises ModelError where the model gives no unit, and where the quantity has another dimension.
    """
    if not is_quantity(value):
        return value
    if not unit and getattr(value, "dimensionless", False):
        return value.to("dimensionless").magnitude
    if not unit:
        raise ModelError(
            f"{what} is the quantity {value}, but the model gives no unit for it. Give the unit, "
            f"Parameter(default, unit={str(value.units)!r}) or labels={{name: 'name [{value.units}]'}}, or "
            "the magnitude alone."
        )
    try:
        return value.to(unit).magnitude
    except Exception as error:  # noqa: BLE001  # what pint calls it: other dimensions, an unknown unit
        raise ModelError(f"{what} is {value}, expected a quantity in {unit!r}: {error}") from None


def unit_of_label(label: str) -> str:
    """The unit in the brackets at the end of a label such as "position [m]"; "" where it has none."""
    head, bracket, unit = label.rstrip().rpartition("[")
    return unit[:-1].strip() if bracket and unit.endswith("]") and head is not None else ""
