"""Elementary functions of the generated field, free of calls so that they are inlined where they are used.

Latency counts: a stage waits for the exponential of the previous stage.
"""

from filippov.kernel.language.primitives import (
    INF,
    contract,
    fma,
    inline,
    kernel,
    power,
    sqrt,
    truncate,
    two_to,
)
from filippov.kernel.tables.root_tables import EXP2

# 64 / ln 2, and ln 2 / 64 in two parts, the first with trailing zeros so that its product with n is exact.
PER_LN2 = 92.33248261689366
LN2_HIGH = 0.010830424695086549
LN2_LOW = 1.162596423439437e-12
# Adding and subtracting 1.5 * 2**52 rounds to an integer.
ROUNDER = 6755399441055744.0


@inline
@contract
def exponential(x: float) -> float:
    """exp(x) to about one rounding: x = n ln 2 / 64 + r, a table of 2**(j/64), r to degree 5."""
    n = (x * PER_LN2 + ROUNDER) - ROUNDER
    r = fma(-n, LN2_LOW, fma(-n, LN2_HIGH, x))
    r2 = r * r
    tail = fma(r2, fma(r2, fma(r, 1.0 / 120.0, 1.0 / 24.0), fma(r, 1.0 / 6.0, 0.5)), r)
    if -708.0 < x < 709.0:
        k = truncate(n)
        scale = EXP2[k & 63] * two_to(k >> 6)
        return fma(scale, tail, scale)
    if not (x < 709.782712893384):
        return INF if x > 0.0 else x
    if x < -745.2:
        return 0.0
    k = truncate(n)
    half = (k >> 6) // 2
    scale = EXP2[k & 63] * two_to(half)
    return fma(scale, tail, scale) * two_to((k >> 6) - half)


@inline
@kernel
def power_of(base: float, exponent: float) -> float:
    """base**exponent, the usual exponents apart: pow costs several times the rest of a field."""
    if exponent == 2.0:
        return base * base
    if exponent == 1.0:
        return base
    if exponent == 0.5:
        return sqrt(base)
    return power(base, exponent)


@inline
@kernel
def size_power(base: float, exponent: float) -> float:
    """A power of a size |h|. In a stage beyond the surface the size is negative: whole powers go on smoothly
    there, others, which are not defined, stop at 0 (clause E8).
    """
    if exponent == 2.0:
        return base * base
    if exponent == 1.0:
        return base
    return power_of(max(base, 0.0), exponent)


@kernel
def sign_of(value: float) -> float:
    """The sign of a number that no surface stands for (an expression of parameters)."""
    return 1.0 if value > 0.0 else (-1.0 if value < 0.0 else 0.0)
