"""Elementary functions in lanes against mpmath over their whole range, and the rules of lane kernels."""

import ctypes
import math
from collections.abc import Callable

import mpmath
import numpy as np
import pytest

from filippov.kernel.codegen import build
from filippov.kernel.files import kernel_file
from filippov.kernel.language.compiler import compile_unit, load_objects
from filippov.kernel.language.primitives import KernelError
from filippov.kernel.language.unit import LANES, Unit, add_kernels

NAMES = ("exp", "log", "sin", "cos", "tanh", "sqrt", "tan", "atan", "expm1")
WRAPPER = """
@lanes
def do_{0}(a: Vector, b: Vector, out: Vector) -> int:
    out[0] = {1}
    return 0

@kernel
def run_{0}(a: Vector, b: Vector, out: Vector, n: int) -> int:
    for q in range(n):
        do_{0}(shift(a, q * LANES), shift(b, q * LANES), shift(out, q * LANES))
    return 0
"""
TINY, HUGE = 5e-324, 1.7976931348623157e308
SPECIAL = [0.0, -0.0, TINY, -TINY, 2.2250738585072014e-308, 1e-300, -1e-300, 1.0, -1.0, HUGE, -HUGE]
SPECIAL += [math.inf, -math.inf, math.nan]


def compiled() -> tuple[object, dict[str, Callable[..., int]]]:
    unit = Unit()
    constants, _ = build._shared()
    unit.constants.update(constants)
    unit.constants["LANES"] = LANES
    for name in ("elementary", "lane_functions"):
        add_kernels(unit, kernel_file(name).read_text(encoding="utf-8"))
    texts = {name: f"{name}(a[0])" for name in NAMES}
    texts |= {name: f"{name}(a[0], b[0])" for name in ("power", "power_of", "size_power", "atan2")}
    texts |= {"least": "min(a[0], b[0])", "size": "abs(a[0])", "sign": "sign_of(a[0])"}
    for name, text in texts.items():
        add_kernels(unit, WRAPPER.format(name, text))
    engine = load_objects(compile_unit(unit, {}, tuple(f"run_{name}" for name in texts)))
    kind = ctypes.CFUNCTYPE(ctypes.c_int64, *[ctypes.c_void_p] * 3, ctypes.c_int64)
    return engine, {name: kind(engine.get_function_address(f"run_{name}")) for name in texts}


ENGINE, RUN = compiled()


def call(name: str, a: np.ndarray, b: np.ndarray | None = None) -> np.ndarray:
    count = -(-a.size // LANES)
    padded = np.full(count * LANES, a[0])
    padded[: a.size] = a
    second = np.full(count * LANES, 1.0 if b is None else b[0])
    if b is not None:
        second[: b.size] = b
    out = np.empty_like(padded)
    RUN[name](padded.ctypes.data, second.ctypes.data, out.ctypes.data, count)
    return out[: a.size]


def roundings(found: np.ndarray, exact: list[mpmath.mpf]) -> float:
    """Largest error in units in the last place."""
    worst = 0.0
    for value, truth in zip(found.tolist(), exact, strict=True):
        nearest = float(truth)
        if math.isinf(nearest) or nearest == 0.0:
            assert value == nearest or abs(value) >= HUGE or abs(value) <= TINY
            continue
        unit = math.ulp(nearest)
        worst = max(worst, float(abs(mpmath.mpf(value) - truth) / unit))
    return worst


def spread(lo: float, hi: float, count: int, seed: int) -> np.ndarray:
    return np.random.default_rng(seed).uniform(lo, hi, count)


def magnitudes(lo: float, hi: float, count: int, seed: int) -> np.ndarray:
    """Numbers of all sizes between 10**lo and 10**hi."""
    return 10.0 ** spread(lo, hi, count, seed)


RANGES = {
    "exp": [spread(-745.5, 709.78, 800, 1), spread(-2, 2, 800, 2), -magnitudes(-320, 0, 200, 3)],
    "log": [magnitudes(-323, 308, 800, 4), spread(0.6, 1.6, 800, 5), 1 + magnitudes(-16, -3, 400, 6)],
    "sin": [spread(-10, 10, 800, 7), spread(-1e6, 1e6, 400, 8), magnitudes(-300, 300, 400, 9)],
    "cos": [spread(-10, 10, 800, 7), spread(-1e6, 1e6, 400, 8), magnitudes(-300, 300, 400, 9)],
    "tanh": [spread(-25, 25, 800, 10), magnitudes(-300, 2, 800, 11), -magnitudes(-8, 0, 400, 12)],
}


@pytest.mark.parametrize("name", list(RANGES))
def test_function_is_within_two_roundings_over_its_range(name: str) -> None:
    mpmath.mp.dps = 60
    for x in RANGES[name]:
        exact = [getattr(mpmath, name)(mpmath.mpf(v)) for v in x.tolist()]
        assert roundings(call(name, x), exact) <= 2.0


def test_multiples_of_a_quarter_turn_keep_their_digits() -> None:
    mpmath.mp.dps = 60
    x = np.arange(-4000, 4001, 7) * (np.pi / 2)
    for name in ("sin", "cos"):
        exact = [getattr(mpmath, name)(mpmath.mpf(v)) for v in x.tolist()]
        assert roundings(call(name, x), exact) <= 2.0


@pytest.mark.parametrize("name", [*RANGES, "sqrt", "tan", "atan", "expm1"])
def test_special_values_are_those_of_the_c_library(name: str) -> None:
    expected = []
    for v in SPECIAL:
        try:
            expected.append(getattr(math, name)(v))
        except OverflowError:
            expected.append(math.inf)
        except ValueError:
            expected.append(-math.inf if name == "log" and v == 0 else math.nan)
    found = call(name, np.array(SPECIAL))
    np.testing.assert_allclose(found, expected, rtol=5e-16, atol=TINY)


def test_power_is_within_two_roundings_over_its_range() -> None:
    mpmath.mp.dps = 60
    base = np.concatenate([magnitudes(-307, 308, 1500, 20), spread(0.5, 2.0, 1500, 21)])
    exponent = np.concatenate([spread(-1, 1, 1500, 22), spread(-700, 700, 1500, 23)])
    exact = [mpmath.mpf(b) ** mpmath.mpf(e) for b, e in zip(base.tolist(), exponent.tolist(), strict=True)]
    assert roundings(call("power", base, exponent), exact) <= 2.0


def test_power_of_special_values_is_that_of_the_c_library() -> None:
    base = np.array([b for b in SPECIAL for _ in range(7)])
    exponent = np.array([0.0, 1.0, -1.0, 3.0, 0.5, math.inf, math.nan] * len(SPECIAL))
    with np.errstate(all="ignore"):
        expected = np.power(base, exponent)
    np.testing.assert_allclose(call("power", base, exponent), expected, rtol=5e-16)


@pytest.mark.parametrize("exponent", [2.0, 1.0, 0.5, 0.3])
def test_a_common_exponent_gives_what_mixed_ones_give(exponent: float) -> None:
    base = spread(0.0, 3.0, 64, 24)
    mixed = np.where(np.arange(64) % 2 == 0, exponent, 1.7)
    alike = call("power_of", base, np.full(64, exponent))
    np.testing.assert_allclose(call("power_of", base, mixed)[::2], alike[::2], rtol=4e-16)
    np.testing.assert_allclose(call("size_power", base, mixed)[::2], alike[::2], rtol=4e-16)


def test_sizes_beyond_their_surface_go_on_smoothly_or_stop_at_zero() -> None:
    base = np.full(8, -0.3)
    np.testing.assert_array_equal(
        call("size_power", base, np.array([2.0, 1.0, 0.5, 0.7] * 2)), [0.3 * 0.3, -0.3, 0.0, 0.0] * 2
    )


def test_smallest_size_and_sign_of_lanes() -> None:
    a, b = spread(-1, 1, 16, 25), spread(-1, 1, 16, 26)
    np.testing.assert_array_equal(call("least", a, b), np.minimum(a, b))
    np.testing.assert_array_equal(call("size", a), np.abs(a))
    np.testing.assert_array_equal(call("sign", np.append(a, 0.0)), np.append(np.sign(a), 0.0))


def test_lanes_cannot_branch() -> None:
    unit = Unit()
    text = "@lanes\ndef f(x: float) -> float:\n    if x > 0.0:\n        return x\n    return 0.0\n"
    add_kernels(unit, text)
    with pytest.raises(KernelError, match="lanes cannot branch"):
        compile_unit(unit, {}, ())
