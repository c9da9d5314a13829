"""Elementary functions the generated field needs beyond those of the C library."""

from filippov._kernels.language import kernel, power, sqrt


@kernel
def power_of(base: float, exponent: float) -> float:
    """base**exponent with the exponents of practice told apart: pow costs several times the rest of a field."""
    if exponent == 2.0:
        return base * base
    if exponent == 1.0:
        return base
    if exponent == 0.5:
        return sqrt(base)
    return power(base, exponent)


@kernel
def sign_of(value: float) -> float:
    """The sign of a number that no surface stands for (an expression of parameters)."""
    return 1.0 if value > 0.0 else (-1.0 if value < 0.0 else 0.0)
