"""Rates and products from the gradients in the scratch, and the multipliers that follow from rates.

The nonzero columns of a gradient are known (see `structure`).
"""

from filippov.kernel.language.primitives import Vector, kernel
from filippov.kernel.loop.model import G_COLUMN, G_FIRST, N
from filippov.kernel.loop.state import Scratch


@kernel
def rate(i: int, f: Vector, w: Scratch) -> float:
    """d/dt h_i along the velocity f, from the gradient in the scratch."""
    total = w.gt[i]
    for a in range(G_FIRST[i], G_FIRST[i + 1]):
        total += w.g[i * N + G_COLUMN[a]] * f[G_COLUMN[a]]
    return float(total)


@kernel
def gradient_product(i: int, other: int, w: Scratch) -> float:
    """The inner product of two gradients."""
    total = 0.0
    for a in range(G_FIRST[i], G_FIRST[i + 1]):
        j = G_COLUMN[a]
        total += w.g[i * N + j] * w.g[other * N + j]
    return total


@kernel
def add_gradient(i: int, factor: float, out: Vector, w: Scratch) -> None:
    """Add a multiple of a gradient to a state or velocity."""
    for a in range(G_FIRST[i], G_FIRST[i + 1]):
        j = G_COLUMN[a]
        out[j] += factor * w.g[i * N + j]


@kernel
def track(w: Scratch, i: int, value: float, plus: float, minus: float) -> None:
    """Note a multiplier with the rates it comes from, and its range over a step."""
    mult = w.mult[i]
    mult.value = value
    mult.rate_plus, mult.rate_minus = plus, minus
    mult.least = min(mult.least, value)
    mult.most = max(mult.most, value)
    mult.slope = max(mult.slope, plus - minus)
