"""Sums in the recurrences of Taylor coefficients: those of order k from the ones before (see `jet_graph`)."""

from filippov.kernel.language.primitives import Vector, apart, contract


@apart
@contract
def folded(k: int, first: int, a: Vector, b: Vector) -> float:
    """sum_j a_j b_(k-j) over j = first ... k, in two sums that do not wait for each other."""
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
