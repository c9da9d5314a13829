"""Records of the kernel language: one declaration, the same places compiled and in Python."""

import ctypes
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from filippov.kernel.codegen.interpreted import interpret
from filippov.kernel.language import records
from filippov.kernel.language.compiler import compile_unit, load_objects
from filippov.kernel.language.primitives import Indices, KernelError, Vector
from filippov.kernel.language.records import Rows, Struct, part
from filippov.kernel.language.unit import Unit, add_kernels


class Pair(Struct):
    left: float
    right: float


class Whole(Struct):
    steps: int
    listed: Indices = part(lambda of: of)
    last: int


class Doubles(Struct):
    t: float
    k: Vector = part(lambda of: 2 * of)
    pairs: Rows[Pair] = part(lambda of: of)
    one: Pair = part()
    end: float


class Mixed(Struct):
    t: float
    count: int
    inner: Pair = part()
    x: Vector
    whole: Whole
    reals: Doubles
    others: Rows[Pair]


N = 3
SIZED = {kind.__name__: kind.sized(N) for kind in (Pair, Whole, Doubles, Mixed)}
BODIES = {
    "numbers": "r.t = u\nr.t += v\nr.count = a\nr.count += b\nreturn r.count - b",
    "swapped": "r.t, r.count = v, a\nr.inner.left, r.inner.right = r.t, u\nreturn r.count",
    "parts": (
        "d = r.reals\nfor i in range(6):\n    d.k[i] = u + i\nd.end, d.one.right = v, d.k[2]\n"
        "w = r.whole\nw.listed[1], w.last = a, b\nw.steps = w.listed[1] + w.last\nreturn w.steps"
    ),
    "rows": (
        "d = r.reals\nfor i in range(3):\n    row = d.pairs[i]\n    row.left, row.right = u * i, v\n"
        "d.pairs[1].left += 2.0\nother = shift_rows(r.others, 1)\nother[0].left = d.pairs[2].left\nreturn 0"
    ),
    "elsewhere": "r.x[1] = u\nr.x = shift(r.x, 1)\nr.x[1] = v\nr.others[1].right = r.x[0]\nreturn 0",
    "passed_on": "fill(r.inner, u)\nfill(r.reals.pairs[1], v)\nreturn total(r.whole, a)",
    "all_numbers": "n = size_of(r.inner)\nout = all_of(r.reals.one)\nout[n - 1] = u\nreturn n",
}
HELPERS = """
@kernel
def fill(pair: Pair, u: float) -> None:
    pair.left, pair.right = u, 2.0 * u

@kernel
def total(whole: Whole, a: int) -> int:
    whole.steps += a
    return whole.steps
"""


def text_of(name: str, body: str) -> str:
    lines = "".join(f"    {line}\n" for line in body.split("\n"))
    return f"\n@kernel\ndef {name}(a: int, b: int, u: float, v: float, r: Mixed) -> int:\n{lines}"


SOURCE = HELPERS + "".join(text_of(name, body) for name, body in BODIES.items())


def machine_code(text: str, names: tuple[str, ...]) -> tuple[object, dict[str, Any]]:
    unit = Unit(records=SIZED)
    add_kernels(unit, text, "case.py")
    engine = load_objects(compile_unit(unit, {}, names))
    whole, double = ctypes.c_int64, ctypes.c_double
    kind = ctypes.CFUNCTYPE(whole, whole, whole, double, double, ctypes.c_void_p)
    return engine, {name: kind(engine.get_function_address(name)) for name in names}


ENGINE, COMPILED = machine_code(SOURCE, tuple(BODIES))
FUNCTIONS = {"all_of": records.all_of, "size_of": records.size_of, "shift_rows": records.shift_rows}
PYTHON = interpret({"case": SOURCE}, (), {}, tuple(BODIES), SIZED | FUNCTIONS)  # type: ignore[arg-type]


def fresh() -> Any:
    made: Any = SIZED["Mixed"].new()
    rows = Rows(SIZED["Pair"], np.zeros((2, 2)))
    made.refer(x=np.zeros(4), whole=SIZED["Whole"].new(), reals=SIZED["Doubles"].new(), others=rows)
    return made


def numbers(made: Any, x: np.ndarray) -> list[list[float]]:
    own = [float(made.t), float(made.count), float(made.inner.left), float(made.inner.right)]
    arrays = (x, made.whole.array, made.reals.array, made.others.array.reshape(-1))
    return [own, *(array.tolist() for array in arrays)]


wholes, doubles = st.integers(-50, 50), st.floats(-1e3, 1e3)


@pytest.mark.parametrize("name", BODIES)
@given(a=wholes, b=wholes, u=doubles, v=doubles)
def test_13_3_a_record_is_the_same_compiled_as_in_python(
    name: str, a: int, b: int, u: float, v: float
) -> None:
    one, two = fresh(), fresh()
    first, second = one.x, two.x
    assert COMPILED[name](a, b, u, v, one.array.ctypes.data) == PYTHON[name](a, b, u, v, two)
    assert numbers(one, first) == numbers(two, second)


def test_13_3_places_follow_the_declaration() -> None:
    places = SIZED["Doubles"].places
    assert {name: (p.offset, p.size) for name, p in places.items()} == {
        "t": (0, 1), "k": (1, 6), "pairs": (7, 6), "one": (13, 2), "end": (15, 1)
    }  # fmt: skip
    assert SIZED["Doubles"].size == 16
    assert SIZED["Doubles"].doubles
    assert not SIZED["Whole"].doubles
    assert SIZED["Mixed"].size == 8


REFUSED = {
    "unknown_name": ("r.speed = u\nreturn 0", "record Mixed has no speed; it has t, count"),
    "unknown_read": ("return r.whole.t", "record Whole has no t; it has steps, listed, last"),
    "part_assigned": ("r.reals.k = r.x\nreturn 0", "k is a part of record Doubles; assign to its entries"),
    "record_assigned": ("r.inner = r.reals.one\nreturn 0", "inner is a part of record Mixed"),
    "row_assigned": ("r.reals.pairs[0] = u\nreturn 0", "a record is no number"),
    "another_record": ("fill(r.whole, u)\nreturn 0", "a Whole where a Pair is needed"),
    "another_reference": ("r.whole = r.reals\nreturn 0", "a Doubles where a Whole is needed"),
    "rows_for_a_record": ("fill(r.reals.pairs, u)\nreturn 0", r"a Rows\[Pair\] where a Pair is needed"),
    "array_for_a_record": ("fill(r.x, u)\nreturn 0", "a Vector where a Pair is needed"),
    "record_for_an_array": ("r.x = r.inner\nreturn 0", "a Pair where a Vector is needed"),
    "integers_for_doubles": ("r.x = r.whole.listed\nreturn 0", "a Indices where a Vector is needed"),
    "double_for_an_integer": ("r.count = u\nreturn 0", "a float where a int is needed"),
    "record_as_an_array": ("return r.whole[0]", "arrays are indexed by one integer"),
    "record_shifted": ("w = shift(r.reals, 1)\nreturn 0", "a Doubles where an array is needed"),
    "record_as_a_number": ("return a + r.whole", "a Whole is no number"),
    "name_of_a_number": ("return u.t", "a float has no names"),
    "name_of_rows": ("return r.reals.pairs.left", r"a Rows\[Pair\] has no names"),
    "numbers_of_an_array": ("return size_of(r.x)", "a Vector where a record is needed"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_13_3_is_refused_with_file_and_line(name: str) -> None:
    body, why = REFUSED[name]
    with pytest.raises(KernelError, match=why) as caught:
        machine_code(HELPERS + text_of("case", body), ("case",))
    assert str(caught.value).startswith(f"case.py:{HELPERS.count(chr(10)) + 4}: kernel case")


def test_13_3_an_annotation_that_is_no_record_is_refused_with_file_and_line() -> None:
    with pytest.raises(KernelError, match=r"case\.py:2: kernel case\(r\): annotate with .*, Mixed; or Rows"):
        machine_code("@kernel\ndef case(r: Other) -> int:\n    return 0\n", ("case",))


def test_13_3_python_refuses_the_same() -> None:
    made = fresh()
    with pytest.raises(AttributeError):
        made.speed = 1.0
    with pytest.raises(AttributeError, match="k is a part of it"):
        made.reals.k = np.zeros(6)
    for name, wrong, why in (
        ("x", np.zeros(4, dtype=np.int64), "an array of int64, expected an array of float64"),
        ("x", np.zeros((4, 4))[:, 0], "in one piece"),
        ("whole", made.reals, "is given a Doubles"),
        ("others", np.zeros(4), "is given a ndarray"),
        ("count", 3, "no reference count"),
    ):
        with pytest.raises(KernelError, match=why):
            made.refer(**{name: wrong})
    with pytest.raises(KernelError, match="an array of 3 float64, expected 2 of float64"):
        Pair(np.zeros(3))
    with pytest.raises(KernelError, match="its lengths are not known"):
        Doubles(np.zeros(3))


def test_13_3_a_declaration_that_makes_no_sense_is_refused() -> None:
    with pytest.raises(KernelError, match="t is a number: it has no length"):
        type(Struct)("Bad", (Struct,), {"__annotations__": {"t": float}, "t": part(2)})
    with pytest.raises(KernelError, match=r"t is 3\.0, expected part"):
        type(Struct)("Bad", (Struct,), {"__annotations__": {"t": float}, "t": 3.0})
    with pytest.raises(KernelError, match="size is a name that every record has"):
        type(Struct)("Bad", (Struct,), {"__annotations__": {"size": float}})
    with pytest.raises(KernelError, match="expected float, int, Vector"):
        type(Struct)("Bad", (Struct,), {"__annotations__": {"t": complex}})
