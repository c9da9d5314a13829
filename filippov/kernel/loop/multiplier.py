"""The multiplier of a sliding surface in the scratch, with its range over a step."""

from filippov.kernel.language.primitives import kernel
from filippov.kernel.loop.state import Scratch


@kernel
def track(w: Scratch, i: int, value: float, plus: float, minus: float) -> None:
    """Note a multiplier with the rates it comes from."""
    mult = w.mult[i]
    mult.value = value
    mult.rate_plus, mult.rate_minus = plus, minus
    mult.least = min(mult.least, value)
    mult.most = max(mult.most, value)
    mult.slope = max(mult.slope, plus - minus)
