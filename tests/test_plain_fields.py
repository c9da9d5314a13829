"""Plain fields keep their meaning when they are compiled: what reads anything that can change never is."""

import math
import types
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from filippov import Surface, System, TimeEvent, solve, solve_many, states
from filippov.base.errors import ModelError, UsageError
from filippov.kernel.codegen import replacement
from filippov.kernel.codegen.purity import purity

Made = tuple[Callable[..., Any], Callable[[float], None]]

GLOBAL_ARRAY, GLOBAL_NUMBER, GLOBAL_PAIR = np.zeros(1), 0.0, (1.0, np.zeros(1))
SETTINGS = types.ModuleType("settings_of_a_user")
FACTOR = 1.0


def _set(place: Any, key: Any) -> Callable[[float], None]:
    def write(u: float) -> None:
        place[key] = u

    return write


def global_array() -> Made:
    return lambda t, x, p, s: [GLOBAL_ARRAY[0]], _set(GLOBAL_ARRAY, 0)


def global_number() -> Made:
    def write(u: float) -> None:
        global GLOBAL_NUMBER  # noqa: PLW0603 (what users do)
        GLOBAL_NUMBER = u

    return lambda t, x, p, s: [GLOBAL_NUMBER], write


def global_pair() -> Made:
    return lambda t, x, p, s: [GLOBAL_PAIR[1][0]], _set(GLOBAL_PAIR[1], 0)


def closure_list() -> Made:
    held = [0.0]
    return lambda t, x, p, s: [held[0]], _set(held, 0)


def closure_array() -> Made:
    held = np.zeros(())
    return lambda t, x, p, s: [float(held)], _set(held, ())


def closure_number() -> Made:
    held = 0.0

    def write(u: float) -> None:
        nonlocal held
        held = u

    return lambda t, x, p, s: [held], write


def dictionary() -> Made:
    held = {"u": 0.0}
    return lambda t, x, p, s: [held["u"]], _set(held, "u")


def attribute() -> Made:
    class Held:
        u = 0.0

    held = Held()
    return lambda t, x, p, s: [held.u], lambda u: setattr(held, "u", u)


def module_attribute() -> Made:
    vars(SETTINGS)["u"] = 0.0
    return lambda t, x, p, s: [SETTINGS.u], _set(vars(SETTINGS), "u")


def function_attribute() -> Made:
    def field(t: float, x: Any, p: Any, s: Any) -> list[float]:
        return [vars(field)["u"]]

    vars(field)["u"] = 0.0
    return field, _set(vars(field), "u")


def default_array() -> Made:
    held = np.zeros(1)

    def field(t: float, x: Any, p: Any, s: Any, held: Any = held) -> list[float]:
        return [held[0]]

    return field, _set(held, 0)


def default_rebound() -> Made:
    def field(t: float, x: Any, p: Any, s: Any, held: float = 0.0) -> list[float]:
        return [held]

    def write(u: float) -> None:
        field.__defaults__ = (u,)

    return field, write


def helper() -> Made:
    def inner() -> Any:
        return GLOBAL_ARRAY[0]

    return lambda t, x, p, s: [inner()], _set(GLOBAL_ARRAY, 0)


def callable_object() -> Made:
    class Field:
        u = 0.0

        def __call__(self, t: float, x: Any, p: Any, s: Any) -> list[float]:
            return [self.u]

    field = Field()
    return field, lambda u: setattr(field, "u", u)


IMPURE = (
    global_array, global_number, global_pair, closure_list, closure_array, closure_number, dictionary,
    attribute, module_attribute, function_attribute, default_array, default_rebound, helper, callable_object,
)  # fmt: skip


@pytest.fixture
def replacements(monkeypatch: pytest.MonkeyPatch) -> list[replacement.Replacement]:
    """Fields are compiled after 300 calls; what decides about it, for each run."""
    monkeypatch.setattr(replacement, "COMPILE_AFTER", 300)
    made: list[replacement.Replacement] = []
    begin = replacement.Replacement.__init__

    def seen(self: replacement.Replacement, *arguments: Any) -> None:
        begin(self, *arguments)
        made.append(self)

    monkeypatch.setattr(replacement.Replacement, "__init__", seen)
    return made


def held_controller(made: Made, gain: float, period: float) -> System:
    """x' = u with u = -gain x taken at every instant of a clock."""
    field, write = made
    write(0.0)

    def sample(t: float, x: Any, p: Any) -> Any:
        write(-gain * float(x[0]))
        return x

    return System(field=field, states="x", time_events=[TimeEvent("clock", period=period, reset=sample)])


@pytest.mark.usefixtures("replacements")
@pytest.mark.parametrize("make", IMPURE, ids=lambda make: make.__name__)
def test_11_17_a_held_input_is_never_frozen(make: Callable[[], Made]) -> None:
    # x_(k+1) = (1 - gain period) x_k, and x stands still before the first sample.
    gain, period, count = 1.5, 0.1, 60
    system = held_controller(make(), gain, period)
    solution = solve(system, (2.0,), (0, count * period), max_step=0.02)
    assert solution.success
    assert solution.x_end[0] == pytest.approx(2 * (1 - gain * period) ** (count - 1), rel=1e-9)


def test_11_17_a_number_that_is_bound_anew_ends_the_use_of_machine_code(
    replacements: list[replacement.Replacement],
) -> None:
    rate = -1.0

    def field(t: float, x: Any, p: Any, s: Any) -> list[float]:
        return [rate * x[0]]

    def switch(t: float, x: Any, p: Any) -> Any:
        nonlocal rate
        rate = -2.0
        return x

    system = System(field=field, states="x", time_events=[TimeEvent("once", times=(3.0,), reset=switch)])
    solution = solve(system, (1.0,), (0, 5), max_step=0.02, rtol=1e-10)
    assert solution.x_end[0] == pytest.approx(math.exp(-3 - 4), rel=1e-9)
    assert replacements[0].found is not None
    assert replacements[0].code is None


SHAPES = (
    lambda a, b: lambda t, x, p, s: [x[1], -a * x[0] - p.c * x[1] + b * math.sin(t)],
    lambda a, b: lambda t, x, p, s: (x[1] * FACTOR, -a * np.tanh(x[0]) - abs(b) * s[0] - p[0] * x[1]),
    lambda a, b: lambda t, x, p, s: np.array([x[1], -a * x[0] ** 3 - math.exp(-b * b) * x[1] - s[0]]),
    lambda a, b: lambda t, x, p, s: [q * (1.0 - (1.0 + a) * k) for k, q in enumerate(x[::-1])],
)


@settings(max_examples=max(2, settings().max_examples // 25))
@given(st.sampled_from(SHAPES), st.floats(0.2, 3), st.floats(-1, 1), st.floats(0.1, 1))
def test_11_17_pure_fields_are_the_same_compiled(shape: Any, a: float, b: float, c: float) -> None:
    field = shape(a, b)
    assert purity(field).reason == ""
    surfaces = [Surface("v", lambda t, x, p: x[1] - 0.05)]
    system = System(field=field, surfaces=surfaces, states="x v", parameters={"c": c})
    ends = [
        solve(system, (1.0, 0.3), (0, 4), compile=flag, nonunique="stick", rtol=1e-11)
        for flag in (False, True)
    ]
    assert ends[0].status == ends[1].status
    np.testing.assert_allclose(ends[1].x_end, ends[0].x_end, rtol=1e-9, atol=1e-11)


def test_11_17_pure_fields_are_compiled_after_many_calls(
    replacements: list[replacement.Replacement],
) -> None:
    offset = np.float64(2.0)

    def field(t: float, x: Any, p: Any, s: Any, scale: float = 1.0) -> list[float]:
        turn = [q * scale for q in (x[1], -x[0])]
        return [turn[0], turn[1] * FACTOR + 0.0 * (offset + math.pi + np.sin(t))]

    solution = solve(System(field=field, states="x y"), (0.0, 1.0), (0, 30), max_step=0.05, rtol=1e-11)
    (used,) = replacements
    assert used.code is not None
    assert used.calls < solution.nfev
    np.testing.assert_allclose(solution.x_end, [math.sin(30), math.cos(30)], atol=1e-8)


@pytest.mark.parametrize(
    ("field", "why"),
    [
        (lambda t, x, p, s: np.random.default_rng(1).random() * x, "random"),
        (lambda t, x, p, s: __import__("time").time() * x, "__import__"),
        (lambda t, x, p, s: print(x) or x, "print"),
        (lambda t, x, p, s: [held.pop() for held in [GLOBAL_PAIR]] and x, "GLOBAL_PAIR"),
        (lambda t, x, p, s: SETTINGS.__dict__["u"] * x, "__dict__"),
        (lambda t, x, p, s: GLOBAL_ARRAY.sum() * x, "sum of GLOBAL_ARRAY"),
        (types.MethodType(lambda self, t, x, p, s: x, 1), "not a plain function"),
        (max, "not a plain function"),
    ],
)
def test_11_17_what_can_change_is_named(field: Any, why: str) -> None:
    assert why in purity(field).reason


def test_11_17_errors_of_the_plain_field_come_unchanged(replacements: list[replacement.Replacement]) -> None:
    def root(t: float, x: Any, p: Any, s: Any) -> list[float]:
        return [0.0 * max(0.0, math.sqrt(2.5 - t))]

    def over(t: float, x: Any, p: Any, s: Any) -> list[float]:
        return [1.0 / (1.0 + math.exp(300.0 * t))]

    def beyond(t: float, x: Any, p: Any, s: Any) -> list[float]:
        return [x[3] if t > 2.5 else 1.0]

    for field, kind in ((root, ValueError), (over, OverflowError), (beyond, IndexError)):
        with pytest.raises(kind):
            solve(System(field=field, states="x"), (0.0,), (0, 5), max_step=0.02)
    assert all(used.code is not None for used in replacements)


def test_11_17_compile_on_request() -> None:
    held = np.array([-1.0])

    def memory(t: float, x: Any, p: Any, s: Any) -> list[float]:
        return [held[0] * x[0]]

    def double(t: float, x: Any, p: Any) -> Any:
        held[0] *= 2.0
        return x

    def strange(t: float, x: Any, p: Any, s: Any) -> list[float]:
        return [p["k"] * x[0]]

    clock = TimeEvent("clock", period=1.0, reset=double)
    asked = System(field=memory, states="x", time_events=[clock], compile=True)
    with pytest.raises(ModelError, match=r"compile=True, but at t = 1 .* has changed since"):
        solve(asked, (1.0,), (0, 3))
    constant = System(field=memory, states="x", compile=True)
    rate = float(held[0])
    assert solve(constant, (1.0,), (0, 1)).x_end[0] == pytest.approx(math.exp(rate), rel=1e-8)
    many = solve_many(constant, [[1.0], [2.0]], (0, 1))
    np.testing.assert_allclose(many.x[:, 0], np.array([1, 2]) * math.exp(rate), rtol=1e-8)
    with pytest.raises(ModelError, match=r"compile=True, but the field cannot be compiled"):
        solve(System(field=strange, states="x", parameters={"k": 1}), (1.0,), (0, 1), compile=True)
    with pytest.raises(UsageError, match=r"compile is 1\.5"):
        solve(constant, (1.0,), (0, 1), compile=1.5)


def test_11_17_never_compiled_where_that_is_said(replacements: list[replacement.Replacement]) -> None:
    system = System(field=lambda t, x, p, s: [-x[0]], states="x", compile=False)
    solve(system, (1.0,), (0, 10), max_step=0.02)
    assert replacements[0].calls > 300
    assert replacements[0].code is None
    (x,) = states("x")
    with pytest.raises(UsageError, match="compile is False, but"):
        solve(System({x: -x}), (1.0,), (0, 1), compile=False)
    with pytest.raises(ModelError, match="compile=False is for System"):
        System({x: -x}, compile=False)
