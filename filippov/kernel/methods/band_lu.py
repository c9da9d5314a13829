"""LU factors of matrices in a band with row pivoting, real and complex, kept for many right-hand sides.

Row i holds columns i - band to i + 2 band, the last ones for what pivoting fills (Golub & Van Loan 2013,
section 4.3.5). Rows are exchanged from the pivot on: the factors left of it stay where they were made. A
complex matrix is two arrays, its real and its imaginary part.
"""

from filippov.kernel.language.primitives import Indices, Vector, kernel, shift


@kernel
def factor_band(a: Vector, pivots: Indices, n: int, band: int) -> bool:
    """LU factors of a, in place; False where it is singular."""
    below = 3 * band  # from an entry to the one below it
    for k in range(n):
        last, end, pivot = min(k + band, n - 1), min(k + 2 * band, n - 1), k
        column = shift(a, band + k)
        for i in range(k + 1, last + 1):
            if abs(column[i * below]) > abs(column[pivot * below]):
                pivot = i
        pivots[k] = pivot
        if not (abs(column[pivot * below]) > 0.0):
            return False
        top = shift(column, k * below)
        if pivot != k:
            other = shift(column, pivot * below)
            for j in range(end - k + 1):
                held = top[j]
                top[j] = other[j]
                other[j] = held
        for i in range(k + 1, last + 1):
            row = shift(column, i * below)
            if row[0] != 0.0:
                ratio = row[0] / top[0]
                row[0] = ratio
                for j in range(1, end - k + 1):
                    row[j] -= ratio * top[j]
    return True


@kernel
def substitute_band(a: Vector, pivots: Indices, b: Vector, n: int, band: int) -> None:
    """Solve with the factors of `factor_band`, b in place."""
    below = 3 * band
    for k in range(n):
        column, pivot = shift(a, band + k), pivots[k]
        if pivot != k:
            held = b[k]
            b[k] = b[pivot]
            b[pivot] = held
        for i in range(k + 1, min(k + band, n - 1) + 1):
            b[i] -= column[i * below] * b[k]
    for k in range(n):
        i = n - 1 - k
        row, total = shift(a, band + i + i * below), b[i]
        for j in range(1, min(2 * band, k) + 1):
            total -= row[j] * b[i + j]
        b[i] = total / row[0]


@kernel
def factor_band_complex(re: Vector, im: Vector, pivots: Indices, n: int, band: int) -> bool:
    """LU factors of re + i im, in place; False where it is singular."""
    below = 3 * band
    for k in range(n):
        last, end, pivot, best = min(k + band, n - 1), min(k + 2 * band, n - 1), k, -1.0
        x, y = shift(re, band + k), shift(im, band + k)
        for i in range(k, last + 1):
            size = abs(x[i * below]) + abs(y[i * below])
            if size > best:
                pivot, best = i, size
        pivots[k] = pivot
        if not (best > 0.0):
            return False
        top, turned = shift(x, k * below), shift(y, k * below)
        if pivot != k:
            other, twin = shift(x, pivot * below), shift(y, pivot * below)
            for j in range(end - k + 1):
                u, v = top[j], turned[j]
                top[j], turned[j] = other[j], twin[j]
                other[j], twin[j] = u, v
        d = top[0] ** 2 + turned[0] ** 2
        c, s = top[0] / d, -turned[0] / d
        for i in range(k + 1, last + 1):
            row, twin = shift(x, i * below), shift(y, i * below)
            u, v = row[0], twin[0]
            if u != 0.0 or v != 0.0:
                p, q = u * c - v * s, u * s + v * c
                row[0], twin[0] = p, q
                for j in range(1, end - k + 1):
                    row[j] -= p * top[j] - q * turned[j]
                    twin[j] -= p * turned[j] + q * top[j]
    return True


@kernel
def substitute_band_complex(
    re: Vector, im: Vector, pivots: Indices, b: Vector, c: Vector, n: int, band: int
) -> None:  # fmt: skip
    """Solve with the factors of `factor_band_complex`, b + i c in place."""
    below = 3 * band
    for k in range(n):
        x, y, pivot = shift(re, band + k), shift(im, band + k), pivots[k]
        if pivot != k:
            held, turned = b[k], c[k]
            b[k], c[k] = b[pivot], c[pivot]
            b[pivot], c[pivot] = held, turned
        for i in range(k + 1, min(k + band, n - 1) + 1):
            p, q = x[i * below], y[i * below]
            b[i] -= p * b[k] - q * c[k]
            c[i] -= p * c[k] + q * b[k]
    for k in range(n):
        i = n - 1 - k
        row, twin = shift(re, band + i + i * below), shift(im, band + i + i * below)
        u, v = b[i], c[i]
        for j in range(1, min(2 * band, k) + 1):
            u -= row[j] * b[i + j] - twin[j] * c[i + j]
            v -= row[j] * c[i + j] + twin[j] * b[i + j]
        p, q = row[0], twin[0]
        d = p * p + q * q
        b[i], c[i] = (u * p + v * q) / d, (v * p - u * q) / d
