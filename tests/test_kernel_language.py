"""The kernel language: what it takes means the same in machine code as in Python; the rest is refused."""

import ctypes
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from filippov.kernel.codegen import build
from filippov.kernel.codegen.interpreted import interpret
from filippov.kernel.language.compiler import compile_unit, load_objects
from filippov.kernel.language.primitives import KernelError
from filippov.kernel.language.unit import Unit, add_kernels
from filippov.kernel.loop import elementary

ELEMENTARY = Path(elementary.__file__)  # the exponential function
SIGNATURE = "(a: int, b: int, u: float, v: float, out: Vector) -> int"
CONSTANTS: dict[str, Any] = {
    "DOUBLES_OF": [2.5, -1.0], "WHOLES_OF": [3, -4], "TWICE_ONE": 2, "ONE_HALF": 0.5,
    "SURE": True, "NEVER": False,
}  # fmt: skip
# One line or block a construct; integers into the result, doubles into `out`.
CONSTRUCTS = {
    "whole_sum": "return a + b - 3 * a",
    "floor_division": "return a // b if b != 0 else 0",
    "remainder": "return a % b if b != 0 else 0",
    "floor_division_by_a_number": "return a // 7 + a // -7 + a % 7 - a % -7",
    "shifts": "return (a << 3) + (a >> 2) + (b & 12) + (b | 5)",
    "sign": "out[0] = -u\nreturn -a + +b",
    "doubles": "out[0] = u + v * 2.0 - u / 3.0\nreturn 0",
    "true_division": "out[0] = a / b if b != 0 else 0.5\nreturn 0",
    "division_by_zero": "out[0] = u / (v - v)\nreturn 0",
    "chain": "return 1 if -2.0 < u <= v < 5.0 else 0",
    "whole_chain": "return 1 if a < b != 3 else 0",
    "of_nan": (
        "w = (u - u) / (v - v)\nreturn (1 if w != w else 0) + (2 if w < u else 0) + (4 if w == w else 0)"
    ),
    "and_or": "return 1 if (u < v and a > 0) or not (b < 2) else 0",
    "a_condition": "flag = u < v or a == b\nreturn 5 if flag else 6",
    "numbers_as_conditions": "if a and (u or b):\n    return 1\nreturn 2 if not b else 3",
    "short_circuit": "return 1 if a > 0 and a <= 2 and DOUBLES_OF[a - 1] > 0.0 else 0",
    "choice_of_kinds": "out[0] = a if u < 0.0 else v\nreturn 0",
    "branches": "if a < 0:\n    r = 1\nelif a == 0:\n    r = 2\nelse:\n    r = 3\nreturn r",
    "early_return": "if u > 0.0:\n    return 1\nelse:\n    return 2",
    "constant_branch": "r = 0\nif SURE:\n    r += 1\nif NEVER:\n    r += 10\nelse:\n    r += 100\nreturn r",
    "settled_conditions": (
        "r = 0\nif TWICE_ONE == 1 or a > b:\n    r += 1\nif SURE and not NEVER or a > 0:\n    r += 10\n"
        "if NEVER and a > 0:\n    r += 100\nif a > 0 and ONE_HALF >= 0.5:\n    r += 1000\n"
        "if TWICE_ONE > 1 and (u < v or SURE):\n    r += 10000\nreturn r"
    ),
    "settled_before_and_after_a_call": (
        "r = 0\nif twice(a) > 3 and NEVER:\n    r += 1\nflag = u < v or SURE\nif flag:\n    r += 10\n"
        "other = SURE and u < v and not NEVER\nreturn r + (100 if other else 0)"
    ),
    "range_one": "r = 0\nfor i in range(min(abs(a), 9)):\n    r = 2 * r + i\nreturn r",
    "range_two": "r = 0\nfor i in range(a, min(b, a + 9)):\n    r = 2 * r + i\nreturn r",
    "range_down": "r = 0\nfor i in range(a, max(b, a - 9), -1):\n    r = 2 * r + i\nreturn r",
    "range_step": (
        "r = 0\nfor i in range(a, a + 9, 4):\n    r = 3 * r + i\n"
        "for i in range(5, a, -3):\n    r += i\nreturn r"
    ),
    "nested": (
        "r = 0\nfor i in range(4):\n    for j in range(i):\n        if j == b:\n            break\n"
        "        if i == a:\n            continue\n        r += 10 * i + j\nreturn r"
    ),
    "while_loop": (
        "r, i = 0, abs(a) % 17\nwhile i > 0:\n    i -= 2\n"
        "    if i == 4:\n        continue\n    r += i\nreturn r"
    ),
    "while_true": (
        "i = 0\nwhile True:\n    i += 1\n"
        "    found = i * i\n    if found >= abs(b):\n        break\nreturn found"
    ),
    "loop_variable_is_bound_anew": (
        "r = 0\nfor i in range(3):\n    k = i\n    i = 7\n    r += i + k\nreturn r"
    ),
    "swap": "a, b = b, a\nout[0], out[1] = v, u\nreturn 3 * a + b",
    "several_targets": "r = s = a\nr += 1\nreturn 10 * r + s",
    "augmented": (
        "out[0] = 1.5\nout[0] += u\nout[0] *= 2.0\nout[0] -= v\n"
        "out[0] /= 4.0\nr = 3\nr *= a\nr -= b\nreturn r"
    ),
    "extremes": "out[0] = min(u, v, 0.25)\nout[1] = max(u, v)\nreturn min(a, b) + max(a, 3) + abs(b)",
    "extremes_of_nan": "w = (u - u) / (v - v)\nout[0] = max(u, w)\nreturn 0",
    "mixed_extremes": "out[0] = min(u, a)\nout[1] = max(b, v)\nreturn 0",
    "functions": (
        "out[0] = sqrt(abs(u)) + rint(v)\nout[1] = two_to(a % 30)\nreturn truncate(u) + truncate(-v)"
    ),
    "root_of_negative": "out[0] = sqrt(-1.0 - abs(u))\nreturn 0",
    "bits": "out[0] = from_bits(to_bits(u))\nreturn to_bits(v) >> 40",
    "tables": "i = 1 if u < 0.0 else 0\nout[0] = DOUBLES_OF[i] * ONE_HALF\nreturn WHOLES_OF[i] * TWICE_ONE",
    "views": "w = shift(out, 2)\nw[0], w[1] = u, v\nout[0] = out[2] + out[3]\nreturn 0",
    "calls": "s, d = both(u, v)\nout[0], out[1] = s, d\nchange(out, v)\nreturn twice(a) + twice(TWICE_ONE)",
    "float_of": "out[0] = float(a) / 2.0\nreturn 0",
}
HELPERS = """
@kernel
def both(u: float, v: float) -> tuple[float, float]:
    return u + v, u - v

@kernel
def twice(a: int) -> int:
    return 2 * a

@kernel
def change(out: Vector, v: float) -> None:
    if v < 0.0:
        return
    out[2] = v
"""


def indented(body: str) -> str:
    return "".join(f"    {line}\n" for line in body.split("\n"))


SOURCE = HELPERS + "".join(
    f"\n@kernel\ndef {name}{SIGNATURE}:\n" + indented(body) for name, body in CONSTRUCTS.items()
)


def machine_code(text: str, names: tuple[str, ...]) -> tuple[object, dict[str, Any]]:
    unit = Unit(constants=CONSTANTS | build._shared()[0])
    add_kernels(unit, text, "case.py")
    add_kernels(unit, ELEMENTARY.read_text(encoding="utf-8"), "elementary.py")
    engine = load_objects(compile_unit(unit, {}, names))
    kind = ctypes.CFUNCTYPE(
        ctypes.c_int64, ctypes.c_int64, ctypes.c_int64, ctypes.c_double, ctypes.c_double, ctypes.c_void_p
    )
    return engine, {name: kind(engine.get_function_address(name)) for name in names}


ENGINE, COMPILED = machine_code(SOURCE, tuple(CONSTRUCTS))
PYTHON = interpret({"case": SOURCE}, (), CONSTANTS, tuple(CONSTRUCTS))
wholes, numbers = st.integers(-50, 50), st.floats(-1e3, 1e3) | st.sampled_from([0.0, -0.0, 0.5, 1.0])


@pytest.mark.parametrize("name", CONSTRUCTS)
@given(a=wholes, b=wholes, u=numbers, v=numbers)
def test_13_2_means_the_same_compiled_as_in_python(name: str, a: int, b: int, u: float, v: float) -> None:
    one, two = np.zeros(8), np.zeros(8)
    assert COMPILED[name](a, b, u, v, one.ctypes.data) == PYTHON[name](a, b, u, v, two)
    np.testing.assert_array_equal(one, two)


LIBRARY = (
    "sin", "cos", "tan", "exp", "log", "tanh", "sinh", "cosh", "asin", "acos", "atan", "asinh", "acosh",
    "atanh", "floor", "ceil", "erf", "expm1", "log1p",
)  # fmt: skip
OF_ONE = "".join(f"\n@kernel\ndef of_{f}{SIGNATURE}:\n    out[0] = {f}(u)\n    return 0\n" for f in LIBRARY)
OF_TWO = (
    f"\n@kernel\ndef of_atan2{SIGNATURE}:\n    out[0] = atan2(u, v)\n    return 0\n"
    f"\n@kernel\ndef of_power{SIGNATURE}:\n    out[0] = power(u, v) + u**v\n    return 0\n"
    f"\n@kernel\ndef of_square{SIGNATURE}:\n    out[0] = u**2\n    return 0\n"  # a product in machine code
    f"\n@kernel\ndef of_fma{SIGNATURE}:\n    out[0] = fma(u, v, 1.0)\n    return 0\n"
)
FUNCTIONS = tuple(f"of_{f}" for f in (*LIBRARY, "atan2", "power", "square", "fma"))
ENGINE_OF, COMPILED_OF = machine_code(OF_ONE + OF_TWO, FUNCTIONS)
PYTHON_OF = interpret(
    {"functions": OF_ONE + OF_TWO}, (ELEMENTARY,), CONSTANTS | build._shared()[0], FUNCTIONS
)


@pytest.mark.parametrize("name", FUNCTIONS)
@given(u=st.floats(-3, 3), v=st.floats(-3, 3))
def test_13_2_functions_are_those_of_the_c_library(name: str, u: float, v: float) -> None:
    one, two = np.zeros(8), np.zeros(8)
    COMPILED_OF[name](0, 0, u, v, one.ctypes.data)
    PYTHON_OF[name](0, 0, u, v, two)
    size = 1 + abs(u * v) if name == "of_fma" else 0.0  # rounded once in machine code
    assert one[0] == pytest.approx(two[0], rel=1e-15, abs=3e-16 * size, nan_ok=True) or (
        math.isinf(one[0]) and one[0] == two[0]
    )


REFUSED = {
    "invert": ("return ~a", "~"),
    "xor": ("return a ^ b", "BitXor"),
    "augmented_xor": ("a ^= b\nreturn a", "BitXor"),
    "matrix_product": ("return a @ b", "MatMult"),
    "is": ("return 1 if a is b else 0", "`is`"),
    "in": ("return 1 if a in b else 0", "`in`"),
    "or_as_value": ("return a or b", "`or` of numbers"),
    "and_as_value": ("r = a and b\nreturn r", "`and`"),
    "sign_of_a_condition": ("return -(u < v)", "a condition has no sign"),
    "float_remainder": ("out[0] = u % v\nreturn 0", "not defined for doubles"),
    "float_floor_division": ("out[0] = u // v\nreturn 0", "not defined for doubles"),
    "for_else": ("for i in range(3):\n    a += i\nelse:\n    a = 0\nreturn a", "no else"),
    "while_else": ("while a > 0:\n    a -= 1\nelse:\n    a = 5\nreturn a", "no else"),
    "no_range": ("for i in reversed(a):\n    b += i\nreturn b", r"range\(\.\.\.\)"),
    "step_of_a_range": ("for i in range(0, 9, a):\n    b += i\nreturn b", "step of a range"),
    "step_of_zero": ("for i in range(0, 9, 0):\n    b += i\nreturn b", "step of a range"),
    "two_loop_variables": ("for i, j in range(3):\n    b += i\nreturn b", "one variable"),
    "unset": ("if a > 0:\n    r = 1\nreturn r", "r may be unset"),
    "unset_in_a_loop": ("for i in range(a):\n    r = i\nreturn r", "r may be unset"),
    "unset_augmented": ("r += 1\nreturn r", "r may be unset"),
    "loop_variable": ("for i in range(a):\n    b += 1\nreturn i", "loop that has ended"),
    "missing_return": ("if a > 0:\n    return 1", "without a return"),
    "missing_return_in_a_loop": ("for i in range(a):\n    return i", "without a return"),
    "empty_return": ("return", "return without a value"),
    "tuple_too_long": ("s, d, e = both(u, v)\nreturn 0", "3 names or values stand beside 2"),
    "tuple_too_short": ("s, d = u, v, u\nreturn 0", "2 names or values stand beside 3"),
    "tuple_for_a_number": ("return a, b", "a tuple where"),
    "named_argument": ("return twice(a=a)", "by position"),
    "star": ("return twice(*out)", "by position"),
    "too_many_arguments": ("return twice(a, b)", "takes 1 arguments"),
    "unknown_name": ("return c", "unknown name c"),
    "unknown_function": ("return cube(a)", "unknown function cube"),
    "call_of_a_number": ("twice = 3\nreturn twice(a)", "a number here"),
    "double_for_an_integer": ("r = 1\nr = 0.5\nreturn r", "is needed"),
    "text": ("return 'a'", "only numbers"),
    "list": ("r = [a, b]\nreturn 0", "List is not part"),
    "lambda": ("r = lambda: 1\nreturn 0", "Lambda is not part"),
    "function_inside": ("def g() -> int:\n    return 1\nreturn 0", "FunctionDef is not part"),
    "assertion": ("assert a > 0\nreturn 0", "Assert is not part"),
    "exception": ("try:\n    a += 1\nexcept ValueError:\n    a = 0\nreturn a", "Try is not part"),
    "walrus": ("return (r := a)", "NamedExpr is not part"),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_13_2_is_refused_with_file_and_line(name: str) -> None:
    body, why = REFUSED[name]
    text = (
        HELPERS + f"\n@kernel\ndef case{SIGNATURE}:\n" + "".join(f"    {line}\n" for line in body.split("\n"))
    )
    with pytest.raises(KernelError, match=why) as caught:
        machine_code(text, ("case",))
    assert str(caught.value).startswith("case.py:")
    line = int(str(caught.value).split(":")[1])
    assert text.count("\n", 0, text.index("def case")) < line <= text.count("\n")
    assert "kernel case" in str(caught.value)


@pytest.mark.parametrize(
    "signature", ["(a: int = 3) -> int", "(*a: int) -> int", "(a: int, *, b: int) -> int", "(a) -> int"]
)
def test_13_2_a_signature_outside_the_language(signature: str) -> None:
    with pytest.raises(KernelError):
        machine_code(f"@kernel\ndef case{signature}:\n    return a\n", ("case",))


def test_13_2_two_kernels_of_one_name() -> None:
    unit = Unit()
    add_kernels(unit, "@kernel\ndef case(a: int) -> int:\n    return a\n", "one.py")
    with pytest.raises(KernelError, match=r"two\.py:2: kernel case: there is another"):
        add_kernels(unit, "@kernel\ndef case(a: int) -> int:\n    return -a\n", "two.py")
