"""Small dense linear systems: elimination, and the shortest solution where the matrix is singular."""

from filippov.kernel.language.primitives import Vector, kernel, shift, sqrt

RANK, CONSISTENT, SWEEPS = 1e-12, 1e-9, 60
# A pivot below this part of its row and of its column is rounding of what was eliminated.
NO_PIVOT = 1e-13


@kernel
def solve_linear(a: Vector, b: Vector, n: int, stride: int) -> bool:
    """Solve a y = b in place by elimination with row pivoting; False where a is singular."""
    for k in range(n):
        pivot, best = k, abs(a[k * stride + k])
        for i in range(k + 1, n):
            if abs(a[i * stride + k]) > best:
                pivot, best = i, abs(a[i * stride + k])
        size = 0.0
        for j in range(k, n):
            size = max(size, abs(a[pivot * stride + j]))
        if not (best > 1e-14 * size):
            return False
        if pivot != k:
            for j in range(n):
                held = a[k * stride + j]
                a[k * stride + j] = a[pivot * stride + j]
                a[pivot * stride + j] = held
            held = b[k]
            b[k] = b[pivot]
            b[pivot] = held
        for i in range(k + 1, n):
            factor = a[i * stride + k] / a[k * stride + k]
            if factor != 0.0:
                for j in range(k + 1, n):
                    a[i * stride + j] -= factor * a[k * stride + j]
                b[i] -= factor * b[k]
    for k in range(n - 1, -1, -1):
        total = b[k]
        for j in range(k + 1, n):
            total -= a[k * stride + j] * b[j]
        b[k] = total / a[k * stride + k]
    return True


@kernel
def rotate_columns(a: Vector, v: Vector, n: int, stride: int) -> None:
    """Rotate the columns of a until they are orthogonal; v becomes the rotation.

    One-sided Jacobi (Hestenes 1958): a v = u s without squaring the condition number.
    """
    for i in range(n):
        for j in range(n):
            v[i * stride + j] = 1.0 if i == j else 0.0
    for _ in range(SWEEPS):
        turned = 0
        for j in range(n):
            for k in range(j + 1, n):
                alpha, beta, gamma = 0.0, 0.0, 0.0
                for i in range(n):
                    alpha += a[i * stride + j] ** 2
                    beta += a[i * stride + k] ** 2
                    gamma += a[i * stride + j] * a[i * stride + k]
                if abs(gamma) <= 1e-15 * sqrt(alpha * beta) or gamma == 0.0:
                    continue
                turned += 1
                zeta = (beta - alpha) / (2.0 * gamma)
                tangent = 1.0 / (abs(zeta) + sqrt(1.0 + zeta * zeta))
                if zeta < 0.0:
                    tangent = -tangent
                cosine = 1.0 / sqrt(1.0 + tangent * tangent)
                sine = cosine * tangent
                for i in range(n):
                    held = a[i * stride + j]
                    a[i * stride + j] = cosine * held - sine * a[i * stride + k]
                    a[i * stride + k] = sine * held + cosine * a[i * stride + k]
                    held = v[i * stride + j]
                    v[i * stride + j] = cosine * held - sine * v[i * stride + k]
                    v[i * stride + k] = sine * held + cosine * v[i * stride + k]
        if turned == 0:
            break


@kernel
def least_norm(a: Vector, b: Vector, n: int, stride: int) -> bool:
    """The shortest y with a y = b, in place of b; False where there is none. Behind a: as much scratch."""
    v = shift(a, stride * stride)
    rotate_columns(a, v, n, stride)
    largest, size = 0.0, 0.0
    for j in range(n):
        total = 0.0
        for i in range(n):
            total += a[i * stride + j] ** 2
        largest = max(largest, total)
        size = max(size, abs(b[j]))
    # Column j of a: first its share of b, then its weight in y.
    for j in range(n):
        total, share = 0.0, 0.0
        for i in range(n):
            total += a[i * stride + j] ** 2
            share += a[i * stride + j] * b[i]
        share = share / total if total > RANK * RANK * largest else 0.0
        for i in range(n):
            b[i] -= share * a[i * stride + j]
        a[j] = share
    for i in range(n):
        if not (abs(b[i]) <= CONSISTENT * (size + sqrt(largest))):
            return False
    for i in range(n):
        total = 0.0
        for j in range(n):
            total += v[i * stride + j] * a[j]
        b[i] = total
    return True


@kernel
def equilibrate_rows(a: Vector, b: Vector, n: int, stride: int) -> None:
    """Divide each equation by its largest coefficient: equations have units of their own."""
    for i in range(n):
        size = 0.0
        for j in range(n):
            size = max(size, abs(a[i * stride + j]))
        if size > 0.0:
            for j in range(n):
                a[i * stride + j] /= size
            b[i] /= size


@kernel
def singular_pivots(a: Vector, n: int, stride: int) -> bool:
    """Whether an eliminated matrix of equilibrated rows has a pivot that is rounding."""
    for k in range(n):
        size = 0.0
        for i in range(k + 1):
            size = max(size, abs(a[i * stride + k]))
        if not (abs(a[k * stride + k]) > NO_PIVOT * size):
            return True
    return False


@kernel
def solve_or_least(a: Vector, b: Vector, n: int, stride: int, singular: int) -> bool:
    """Elimination, or for a singular matrix (after elimination refused it) the shortest solution."""
    equilibrate_rows(a, b, n, stride)
    if singular != 0:
        return least_norm(a, b, n, stride)
    return solve_linear(a, b, n, stride) and not singular_pivots(a, n, stride)
