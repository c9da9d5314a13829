"""Sums in the recurrences of Taylor coefficients: order k from the lower ones (see `jet_graph`)."""

from filippov.kernel.language.primitives import Vector, apart, contract, lanes


@apart
@contract
def folded(k: int, first: int, a: Vector, b: Vector) -> float:
    """sum_j a_j b_(k-j) over j = first ... k, as two independent sums."""
    one, two = 0.0, 0.0
    for half in range((k - first + 1) // 2):
        j = first + 2 * half
        one += a[j] * b[k - j]
        two += a[j + 1] * b[k - j - 1]
    if (k - first + 1) % 2 == 1:
        one += a[k] * b[0]
    return one + two


@apart
@contract
def folded_inside(k: int, a: Vector) -> float:
    """sum_j a_j a_(k-j) over j = 1 ... k - 1."""
    total = 0.0
    for j in range(1, k):
        total += a[j] * a[k - j]
    return total


@apart
@contract
def integral_term(k: int, u: Vector, g: Vector) -> float:
    """Coefficient k of the y with y' = g u'."""
    total = 0.0
    for j in range(1, k + 1):
        total += float(j) * u[j] * g[k - j]
    return total / float(k)


@apart
@contract
def power_term(k: int, exponent: float, u: Vector, y: Vector) -> float:
    """Coefficient k of y = u**exponent, from u y' = exponent y u'."""
    total = 0.0
    for j in range(1, k + 1):
        total += (exponent * float(j) - float(k - j)) * u[j] * y[k - j]
    return float(total / (float(k) * u[0]))


@apart
@contract
@lanes
def products_beside(k: int, blocks: int, a: Vector, b: Vector, out: Vector) -> None:
    """Coefficient k of the products in all lanes of the blocks."""
    for block in range(blocks):
        one, two = 0.0, 0.0
        for half in range((k + 1) // 2):
            j = 2 * half
            one += a[j * blocks + block] * b[(k - j) * blocks + block]
            two += a[(j + 1) * blocks + block] * b[(k - j - 1) * blocks + block]
        if k % 2 == 0:
            one += a[k * blocks + block] * b[block]
        out[k * blocks + block] = one + two


@apart
@contract
@lanes
def squares_beside(k: int, blocks: int, a: Vector, out: Vector) -> None:
    """Coefficient k of the squares, each pair of coefficients once."""
    for block in range(blocks):
        total, middle = 0.0, 0.0
        for j in range((k + 1) // 2):
            total += a[j * blocks + block] * a[(k - j) * blocks + block]
        if k % 2 == 0:
            middle = a[k // 2 * blocks + block] * a[k // 2 * blocks + block]
        out[k * blocks + block] = 2.0 * total + middle


@apart
@contract
@lanes
def quotients_beside(k: int, blocks: int, u: Vector, v: Vector, out: Vector) -> None:
    """Coefficient k of u / v."""
    for block in range(blocks):
        total = u[k * blocks + block]
        for j in range(1, k + 1):
            total -= v[j * blocks + block] * out[(k - j) * blocks + block]
        out[k * blocks + block] = total / v[block]


@apart
@contract
@lanes
def roots_beside(k: int, blocks: int, u: Vector, out: Vector) -> None:
    """Coefficient k of the square roots."""
    for block in range(blocks):
        total = u[k * blocks + block]
        for j in range(1, k):
            total -= out[j * blocks + block] * out[(k - j) * blocks + block]
        out[k * blocks + block] = 0.5 * total / out[block]


@apart
@contract
@lanes
def powers_beside(k: int, blocks: int, exponent: Vector, u: Vector, out: Vector) -> None:
    """As `power_term`."""
    for block in range(blocks):
        total, slope = 0.0, exponent[block] + 1.0
        for j in range(1, k + 1):
            weight = slope * float(j) - float(k)
            total += weight * u[j * blocks + block] * out[(k - j) * blocks + block]
        out[k * blocks + block] = total / (float(k) * u[block])


@apart
@contract
@lanes
def integrals_beside(k: int, blocks: int, factor: Vector, u: Vector, g: Vector, out: Vector) -> None:
    """As `integral_term`, times a factor."""
    for block in range(blocks):
        total = 0.0
        for j in range(1, k + 1):
            total += float(j) * u[j * blocks + block] * g[(k - j) * blocks + block]
        out[k * blocks + block] = factor[block] * total / float(k)
