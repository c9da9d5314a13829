"""Elementary functions in lanes: free of branches for ordinary arguments, within 2 units in the last place.

An extraordinary argument in any lane (an overflow, a negative base, 1e6 for a sine) sends the whole vector to
the C library, lane by lane. The polynomials are Chebyshev fits on the reduced ranges.
"""

from filippov.kernel.language.primitives import (
    each,
    everywhere,
    fma,
    from_bits,
    inline,
    lanes,
    sqrt,
    to_bits,
    two_to,
)

# Adding and subtracting 1.5 * 2**52 rounds to an integer, which is in the low bits in between.
NEAREST, NEAREST_BITS = 6755399441055744.0, 4843621399236968448
PER_LN2_1 = 1.4426950408889634
# ln 2 in two parts, the first with trailing zeros so that its product with an integer is exact.
LN2_A, LN2_B = 0.6931471803691238, 1.9082149292705877e-10
E0, E1, E2, E3 = 0.5, 0.16666666666666669, 0.041666666666624115, 0.008333333333330062
E4, E5, E6 = 0.0013888888917219482, 0.00019841269863058052, 2.480152128699544e-05
E7, E8, E9 = 2.7557268453107527e-06, 2.7620092706650667e-07, 2.5100388772450645e-08
L0, L1, L2, L3 = 0.6666666666666666, 0.40000000000000885, 0.28571428570799784, 0.22222222392581045
L4, L5, L6, L7 = 0.18181795547521137, 0.15386244737621665, 0.13268638369266825, 0.13088034850927555
# The same series from its second term on, and the first term as two doubles.
Q0, Q1, Q2, Q3 = 0.4, 0.2857142857142937, 0.22222222221652765, 0.18181818336099848
Q4, Q5, Q6, Q7 = 0.1538459488700718, 0.1333480879881234, 0.11706126464563398, 0.11724327060846747
TWO_THIRDS, TWO_THIRDS_REST = 0.6666666666666666, 3.700743415417188e-17
S0, S1, S2, S3 = -0.16666666666666666, 0.008333333333333331, -0.0001984126984126506, 2.7557319219335453e-06
S4, S5, S6 = -2.5052106231157904e-08, 1.605853141458901e-10, -7.586685070091267e-13
C0, C1, C2, C3 = 0.041666666666666664, -0.0013888888888888887, 2.4801587301584645e-05, -2.755731922140076e-07
C4, C5, C6 = 2.0876755790363397e-09, -1.1470460773969325e-11, 4.7458652037874553e-14
PER_HALF_PI = 0.6366197723675814
HALF_PI_A, HALF_PI_B, HALF_PI_C = 1.5707963267948966, 6.123233995736766e-17, -1.4973849048591698e-33
ROOT_HALF_BITS, ONE = 4604544271217802189, 4607182418800017408


@inline
@lanes
def exponential_tail(r: float) -> float:
    """exp(r) - 1 for |r| <= ln 2 / 2."""
    r2 = r * r
    r4 = r2 * r2
    low = fma(r2, fma(E3, r, E2), fma(E1, r, E0))
    high = fma(r2, fma(E7, r, E6), fma(E5, r, E4))
    return fma(r2, fma(r4, fma(r4, fma(E9, r, E8), high), low), r)


@inline
@lanes
def exponential(x: float) -> float:
    """exp(x)."""
    if everywhere(abs(x) < 708.0):
        shifted = fma(x, PER_LN2_1, NEAREST)
        n = shifted - NEAREST
        tail = exponential_tail(fma(-n, LN2_B, fma(-n, LN2_A, x)))
        scale = from_bits((to_bits(shifted) << 52) + ONE)
        return fma(scale, tail, scale)
    return exponential_far(x)


@lanes
def exponential_far(x: float) -> float:
    """exp(x) with overflow, underflow and NaN: the scale in two factors."""
    inside = max(min(x, 720.0), -760.0)
    shifted = fma(inside, PER_LN2_1, NEAREST)
    n = shifted - NEAREST
    tail = exponential_tail(fma(-n, LN2_B, fma(-n, LN2_A, inside)))
    k = to_bits(shifted) - NEAREST_BITS
    half = k >> 1
    scale = two_to(half)
    return fma(scale, tail, scale) * two_to(k - half)


@lanes
def log(x: float) -> float:
    """The natural logarithm."""
    if not everywhere((x >= 2.2250738585072014e-308) and (x <= 1.7976931348623157e308)):
        return each("log", x)
    bits = to_bits(x)
    k = (bits - ROOT_HALF_BITS) >> 52
    f = from_bits(bits - (k << 52)) - 1.0
    n = float(k)
    s = f / (2.0 + f)
    z = s * s
    z2 = z * z
    z4 = z2 * z2
    low = fma(z2, fma(L3, z, L2), fma(L1, z, L0))
    high = fma(z2, fma(L7, z, L6), fma(L5, z, L4))
    r = z * fma(z4, high, low)
    half = 0.5 * f * f
    return fma(n, LN2_A, f - (half - fma(s, half + r, n * LN2_B)))



@lanes
def log_pair(x: float) -> tuple[float, float]:
    """The natural logarithm of a normal number > 0 in two parts, to about 2**-65."""
    bits = to_bits(x)
    k = (bits - ROOT_HALF_BITS) >> 52
    f = from_bits(bits - (k << 52)) - 1.0
    n = float(k)
    d = 2.0 + f
    s = f / d
    s_low = (fma(-s, d, f) - s * (f - (d - 2.0))) / d
    z = s * s
    z_low = fma(s, s, -z) + 2.0 * s * s_low
    z2 = z * z
    z4 = z2 * z2
    low = fma(z2, fma(Q3, z, Q2), fma(Q1, z, Q0))
    high = fma(z2, fma(Q7, z, Q6), fma(Q5, z, Q4))
    q = fma(z4, high, low)
    u = z * q
    series = TWO_THIRDS + u
    series_low = (u - (series - TWO_THIRDS)) + (TWO_THIRDS_REST + (fma(z, q, -u) + z_low * q))
    cube = s * z
    cube_low = fma(s, z, -cube) + (s * z_low + s_low * z)
    v = cube * series
    v_low = fma(cube, series, -v) + (cube * series_low + cube_low * series)
    a = 2.0 * s + v
    a_low = (v - (a - 2.0 * s)) + (2.0 * s_low + v_low)
    large = n * LN2_A
    total = large + a
    return total, (a - (total - large)) + fma(n, LN2_B, a_low)


@lanes
def power(base: float, exponent: float) -> float:
    """base**exponent, as C's pow."""
    if not everywhere((base >= 2.2250738585072014e-308) and (base <= 1.7976931348623157e308)):
        return each("pow", base, exponent)
    size, rest = log_pair(base)
    p = exponent * size
    if not everywhere(abs(p) < 708.0):
        return each("pow", base, exponent)
    shifted = fma(p, PER_LN2_1, NEAREST)
    n = shifted - NEAREST
    r = fma(-n, LN2_B, fma(-n, LN2_A, p)) + fma(exponent, rest, fma(exponent, size, -p))
    tail = exponential_tail(r)
    scale = from_bits((to_bits(shifted) << 52) + ONE)
    return fma(scale, tail, scale)


@inline
@lanes
def power_of(base: float, exponent: float) -> float:
    """base**exponent with the usual exponents treated separately."""
    if everywhere(exponent == 2.0):
        return base * base
    if everywhere(exponent == 1.0):
        return base
    if everywhere(exponent == 0.5):
        return sqrt(base)
    return power(base, exponent)


@inline
@lanes
def size_power(base: float, exponent: float) -> float:
    """A power of a size |h|, see `elementary.size_power`."""
    if everywhere(exponent == 2.0):
        return base * base
    if everywhere(exponent == 1.0):
        return base
    above = power_of(max(base, 0.0), exponent)
    return base * base if exponent == 2.0 else (base if exponent == 1.0 else above)


@inline
@lanes
def quarter_turns(x: float) -> tuple[float, float, float]:
    """x = n pi / 2 + r with |r| <= pi / 4: r, its rounding error, and n + NEAREST."""
    shifted = fma(x, PER_HALF_PI, NEAREST)
    n = shifted - NEAREST
    first = fma(-n, HALF_PI_A, x)
    # Where the second part cancels the first, only the rounding errors of both remain.
    second = -n * HALF_PI_B
    total = first + second
    moved = total - first
    lost = (first - (total - moved)) + (second - moved)
    low = fma(-n, HALF_PI_C, lost + fma(-n, HALF_PI_B, -second))
    r = total + low
    return r, low - (r - total), shifted


@inline
@lanes
def sine_part(r: float, low: float) -> float:
    """sin(r + low) for |r| <= pi / 4."""
    z = r * r
    z2 = z * z
    series = fma(z2 * z2, fma(z2, S6, fma(S5, z, S4)), fma(z2, fma(S3, z, S2), fma(S1, z, S0)))
    return r + fma(r * z, series, fma(-0.5 * z, low, low))


@inline
@lanes
def cosine_part(r: float, low: float) -> float:
    """cos(r + low) for |r| <= pi / 4."""
    z = r * r
    z2 = z * z
    series = fma(z2 * z2, fma(z2, C6, fma(C5, z, C4)), fma(z2, fma(C3, z, C2), fma(C1, z, C0)))
    half = 0.5 * z
    above = 1.0 - half
    return above + (((1.0 - above) - half) + fma(z2, series, -r * low))


@lanes
def sin(x: float) -> float:
    """The sine."""
    if not everywhere(abs(x) < 1e6):
        return each("sin", x)
    r, low, shifted = quarter_turns(x)
    n = to_bits(shifted)
    value = cosine_part(r, low) if (n & 1) != 0 else sine_part(r, low)
    return -value if (n & 2) != 0 else value


@lanes
def cos(x: float) -> float:
    """The cosine."""
    if not everywhere(abs(x) < 1e6):
        return each("cos", x)
    r, low, shifted = quarter_turns(x)
    n = to_bits(shifted)
    value = sine_part(r, low) if (n & 1) != 0 else cosine_part(r, low)
    return -value if ((n + 1) & 2) != 0 else value


@lanes
def tanh(x: float) -> float:
    """The hyperbolic tangent, from exp(2 |x|) - 1."""
    y = 2.0 * min(abs(x), 22.0)
    shifted = fma(y, PER_LN2_1, NEAREST)
    n = shifted - NEAREST
    tail = exponential_tail(fma(-n, LN2_B, fma(-n, LN2_A, y)))
    scale = from_bits((to_bits(shifted) << 52) + ONE)
    excess = fma(scale, tail, scale - 1.0)
    value = excess / (excess + 2.0)
    return value if x >= 0.0 else -value
