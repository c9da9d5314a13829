"""The multiplier of a sliding surface in the scratch, with its range over a step."""

from filippov.kernel.language.primitives import Vector, kernel, shift
from filippov.kernel.loop.model import W_MULT
from filippov.kernel.tables.layout import COLUMNS, LEAST, MOST, MULTIPLIER, RATE_MINUS, RATE_PLUS, SLOPE


@kernel
def track(w: Vector, i: int, value: float, plus: float, minus: float) -> None:
    """Note a multiplier with the rates it comes from."""
    mult = shift(w, W_MULT + i * COLUMNS)
    mult[MULTIPLIER] = value
    mult[RATE_PLUS], mult[RATE_MINUS] = plus, minus
    mult[LEAST] = min(mult[LEAST], value)
    mult[MOST] = max(mult[MOST], value)
    mult[SLOPE] = max(mult[SLOPE], plus - minus)
