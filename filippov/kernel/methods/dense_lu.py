"""LU factors of small dense matrices with row pivoting, real and complex, kept for many right-hand sides.

Matrices are flat, row by row. A complex matrix is two arrays, its real and its imaginary part.
"""

from filippov.kernel.language.primitives import Indices, Vector, kernel


@kernel
def factor(a: Vector, pivots: Indices, n: int) -> bool:
    """LU factors of a, in place; False where it is singular."""
    for k in range(n):
        pivot = k
        for i in range(k + 1, n):
            if abs(a[i * n + k]) > abs(a[pivot * n + k]):
                pivot = i
        pivots[k] = pivot
        if not (abs(a[pivot * n + k]) > 0.0):
            return False
        if pivot != k:
            for j in range(n):
                held = a[k * n + j]
                a[k * n + j] = a[pivot * n + j]
                a[pivot * n + j] = held
        for i in range(k + 1, n):
            if a[i * n + k] != 0.0:
                ratio = a[i * n + k] / a[k * n + k]
                a[i * n + k] = ratio
                for j in range(k + 1, n):
                    a[i * n + j] -= ratio * a[k * n + j]
    return True


@kernel
def substitute(a: Vector, pivots: Indices, b: Vector, n: int) -> None:
    """Solve with the factors of `factor`, b in place."""
    for k in range(n):
        pivot = pivots[k]
        if pivot != k:
            held = b[k]
            b[k] = b[pivot]
            b[pivot] = held
    for i in range(1, n):
        total = b[i]
        for j in range(i):
            total -= a[i * n + j] * b[j]
        b[i] = total
    for i in range(n - 1, -1, -1):
        total = b[i]
        for j in range(i + 1, n):
            total -= a[i * n + j] * b[j]
        b[i] = total / a[i * n + i]


@kernel
def factor_complex(re: Vector, im: Vector, pivots: Indices, n: int) -> bool:
    """LU factors of re + i im, in place; False where it is singular."""
    for k in range(n):
        pivot, best = k, abs(re[k * n + k]) + abs(im[k * n + k])
        for i in range(k + 1, n):
            size = abs(re[i * n + k]) + abs(im[i * n + k])
            if size > best:
                pivot, best = i, size
        pivots[k] = pivot
        if not (best > 0.0):
            return False
        if pivot != k:
            for j in range(n):
                held, turned = re[k * n + j], im[k * n + j]
                re[k * n + j], im[k * n + j] = re[pivot * n + j], im[pivot * n + j]
                re[pivot * n + j], im[pivot * n + j] = held, turned
        d = re[k * n + k] ** 2 + im[k * n + k] ** 2
        c, s = re[k * n + k] / d, -im[k * n + k] / d
        for i in range(k + 1, n):
            u, v = re[i * n + k], im[i * n + k]
            if u != 0.0 or v != 0.0:
                p, q = u * c - v * s, u * s + v * c
                re[i * n + k], im[i * n + k] = p, q
                for j in range(k + 1, n):
                    re[i * n + j] -= p * re[k * n + j] - q * im[k * n + j]
                    im[i * n + j] -= p * im[k * n + j] + q * re[k * n + j]
    return True


@kernel
def substitute_complex(re: Vector, im: Vector, pivots: Indices, b: Vector, c: Vector, n: int) -> None:
    """Solve with the factors of `factor_complex`, b + i c in place."""
    for k in range(n):
        pivot = pivots[k]
        if pivot != k:
            held, turned = b[k], c[k]
            b[k], c[k] = b[pivot], c[pivot]
            b[pivot], c[pivot] = held, turned
    for i in range(1, n):
        u, v = b[i], c[i]
        for j in range(i):
            u -= re[i * n + j] * b[j] - im[i * n + j] * c[j]
            v -= re[i * n + j] * c[j] + im[i * n + j] * b[j]
        b[i], c[i] = u, v
    for i in range(n - 1, -1, -1):
        u, v = b[i], c[i]
        for j in range(i + 1, n):
            u -= re[i * n + j] * b[j] - im[i * n + j] * c[j]
            v -= re[i * n + j] * c[j] + im[i * n + j] * b[j]
        p, q = re[i * n + i], im[i * n + i]
        d = p * p + q * q
        b[i], c[i] = (u * p + v * q) / d, (v * p - u * q) / d
