"""One event loop for all systems: it is the same whichever system it is made with, and fits every other."""

import ctypes
from typing import Any

import numpy as np
import pytest
from llvmlite import binding

from filippov import Surface, System, TimeEvent, sign, solve, states
from filippov.kernel.codegen import build
from filippov.kernel.codegen.parts import CORE, PARTS, linked
from filippov.kernel.files import kernel_file
from filippov.kernel.language.compiler import WHOLE, compile_unit, load_objects, written
from filippov.kernel.language.primitives import Indices, Vector
from filippov.kernel.language.records import Rows, Struct, part
from filippov.kernel.language.unit import Unit, add_kernels
from filippov.solving.state.machine import Machine

x, v, y, u = states("x v y u")


def smooth() -> System:
    return System({x: -x})


def relay() -> System:
    return System({x: v, v: -x - 3 * sign(v)})


def coupled() -> System:
    both = 2 * sign(x + y) + 3 * sign(y - u)
    return System({x: v, v: both - x, y: u, u: both * sign(x + y) - y})


def ball() -> System:
    return System({x: v, v: -1 + 0 * x}, surfaces=[Surface("floor", x, reset={v: -v / 2})])


def clocked() -> System:
    return System({x: -x}, time_events=[TimeEvent("clock", period=0.5, reset={x: 1 + 0 * x})])


def called() -> System:
    surface = Surface("h", lambda t, x, p: x[1])
    return System(field=lambda t, x, p, s: [-x[0], s[0] - x[1]], states="x y", surfaces=[surface])


SYSTEMS = {
    "DOP853": (smooth(), relay(), coupled(), ball(), clocked(), called()),
    "Taylor": (relay(), ball(), coupled()),
    "Radau": (relay(), coupled()),
}


def texts_of(method: str, monkeypatch: pytest.MonkeyPatch) -> dict[tuple[str, ...], dict[str, set[str]]]:
    """Of every part of the loop, by its files, the units as they stand before they are optimised, by name."""
    made: dict[tuple[str, ...], dict[str, set[str]]] = {}

    def noted(what: Any, make: Any) -> bytes:
        text = make()
        if not isinstance(what[0], str):  # no unit of a system
            made.setdefault(what[-1], {}).setdefault(repr(what), set()).add(text)
        return b""

    def unlinked(*_: Any) -> Any:
        raise NotImplementedError

    monkeypatch.setattr(build, "kept_code", noted)
    monkeypatch.setattr(build, "compile_unit", written)
    monkeypatch.setattr(build, "load_objects", unlinked)
    monkeypatch.setattr(build, "linked", lambda _: PARTS)
    monkeypatch.setattr(build, "_units", {})
    for system in SYSTEMS[method]:
        with pytest.raises(NotImplementedError):
            solve(system, np.ones(system.dimension), (0, 1), method=method)
    return made


@pytest.mark.parametrize("method", SYSTEMS)
def test_14_4_the_loop_is_the_same_whichever_system_it_is_made_with(
    method: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Nothing of a system is in it, neither a number nor a kernel.
    made = texts_of(method, monkeypatch)
    assert made.keys() == {piece.files for piece in PARTS}
    for units in made.values():
        # One for small fields, which are sampled in lanes, and one for the others.
        assert len(units) <= 2
        assert [len(texts) for texts in units.values()] == [1] * len(units)


def test_14_4_parts_of_the_loop_have_what_they_offer_and_no_large_kernel_of_another(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    made = texts_of("DOP853", monkeypatch)
    called = set[str]()
    for piece in PARTS:
        own = "".join(kernel_file(name).read_text(encoding="utf-8") for name in piece.files)
        for (text,) in made[piece.files].values():
            module = binding.parse_assembly(text)
            defined = {f.name: f for f in module.functions if not f.is_declaration}
            called |= {f.name for f in module.functions if f.is_declaration}
            assert defined.keys() >= {*piece.offers, *piece.entries}
            if piece is not CORE:
                copies = [f for name, f in defined.items() if f"def {name}(" not in own]
                assert all(sum(len(list(b.instructions)) for b in f.blocks) <= WHOLE for f in copies)
    assert called >= {name for piece in PARTS for name in piece.offers}


def test_14_4_a_system_is_linked_with_the_parts_that_it_needs() -> None:
    def parts(system: System, sliding: str = "filippov") -> set[str]:
        machine = Machine(system, "DOP853", np.zeros(0), sliding=sliding)
        return {piece.files[0] for piece in linked(machine.constants)}

    core = CORE.files[0]
    assert parts(smooth()) == parts(relay()) == {core}
    assert parts(coupled()) == {core, "dense", "simultaneous"}
    assert parts(ball()) == {core, "reset"}
    assert parts(clocked()) == {core, "ticks"}
    assert parts(relay(), "utkin") == {core, "dense"}


class Inner(Struct):
    left: float
    parts: Vector = part(lambda of: of)
    last: float


class Outer(Struct):
    first: float
    listed: Vector = part(lambda of: 2 * of)
    rows: Rows[Inner] = part(lambda of: of)
    one: Inner = part()
    end: float
    place: Indices = part(lambda of: of + 1)


SOURCE = """
@kernel
def fill(u: float, r: Outer) -> int:
    r.first, r.end = u, 2.0 * u
    for i in range(N):
        r.listed[2 * i + 1] = u + i
        row = r.rows[i]
        row.left, row.last = 3.0 * u, 4.0 * u + i
        row.parts[N - 1] = 5.0 * u
        r.place[i + 1] = 7 * i
    r.one.parts[0], r.one.last = 6.0 * u, float(size_of(r.one))
    return 1 if FLAG and N > 2 else 0
"""
NAMES = ("FLAG", "Inner", "Inner.last", "N", "Outer.end", "Outer.one", "Outer.place", "Outer.rows")


def shaped(records: dict[str, type[Struct]], flag: bool, n: int) -> list[int]:
    """The numbers of a shape, in the order of NAMES."""
    inner, outer = records["Inner"], records["Outer"]
    places = [outer.places[name].offset for name in ("end", "one", "place", "rows")]
    return [int(flag), inner.size, inner.places["last"].offset, n, *places]


def sized(n: int) -> dict[str, type[Struct]]:
    return {kind.__name__: kind.sized(n) for kind in (Inner, Outer)}


def test_14_4_a_kernel_reads_lengths_and_places_from_the_unit_it_is_linked_with() -> None:
    places = sized(1)["Outer"].places
    assert [name for name, place in places.items() if place.varies] == ["rows", "one", "end", "place"]
    kernels = Unit(records=sized(1), outside=frozenset({"SHAPE"}), shape={k: i for i, k in enumerate(NAMES)})
    add_kernels(kernels, SOURCE)
    code = compile_unit(kernels, {"N": 1, "FLAG": False}, ("fill",))
    for n, flag in ((1, True), (2, True), (3, False), (5, True)):
        records = sized(n)
        table = compile_unit(Unit(), {}, (), given={"SHAPE": shaped(records, flag, n)})
        engine = load_objects(code, table)
        call = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_double, ctypes.c_void_p)
        made: Any = records["Outer"].new()
        assert call(engine.get_function_address("fill"))(0.5, made.array.ctypes.data) == int(flag and n > 2)
        expected: Any = records["Outer"].new()
        expected.first, expected.end = 0.5, 1.0
        for i in range(n):
            expected.listed[2 * i + 1] = 0.5 + i
            expected.rows[i].left, expected.rows[i].last = 1.5, 2.0 + i
            expected.rows[i].parts[n - 1] = 2.5
            expected.place[i + 1] = 7 * i
        expected.one.parts[0], expected.one.last = 3.0, records["Inner"].size
        np.testing.assert_array_equal(made.array.view(np.int64), expected.array.view(np.int64))
