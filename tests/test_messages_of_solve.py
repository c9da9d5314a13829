"""What `solve` says of what is no system, of a state under two names and of spans in scipy's order."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from filippov import ModelError, Problem, Surface, System, UsageError, models, sign, solve, solve_many, states

x, v = states("x v")
MASS = System({x: v, v: -x - 0.2 * sign(v)})
# What is given for a system -> what to write instead.
OBJECTS: dict[str, tuple[Any, str]] = {
    "function": (lambda t, x: -x, "System(field=f, states='x v')"),
    "callable object": (np.sin, "System(field=f, states='x v')"),
    "equations": ({x: v, v: -x}, "System({x: v, v: ...})"),
    "text of equations": ({"x": "-x"}, "System({x: v, v: ...})"),
    "one expression": (-x, "System({x: v, v: ...})"),
    "list": ([v, -x], "System({x: v, v: ...})"),
    "number": (3, "System({x: v, v: ...})"),
    "nothing": (None, "System({x: v, v: ...})"),
    "name of a model": ("relay", "models.get('relay').build()"),
    "model": (models.get("relay"), "models.get('relay').build()"),
    "class": (System, "System({x: v, v: ...})"),
    "solution": (solve(MASS, (1, 0), (0, 0.1)), "System({x: v, v: ...})"),
}  # fmt: skip


@pytest.mark.parametrize("kind", OBJECTS)
@pytest.mark.parametrize("call", [solve, solve_many, Problem], ids=lambda call: call.__name__)
def test_what_is_no_system_is_told_before_a_state_under_two_names(call: Any, kind: str) -> None:
    """Whatever the order of the rest: scipy's, or its name y0 for the state."""
    given, cure = OBJECTS[kind]
    for rest in (((0, 12),), ((0, 12), (1, 0)), ((1, 0), (0, 12))):
        for named in ({"y0": (1, 0)}, {}):
            if len(rest) == 1 and not named:
                continue
            with pytest.raises(UsageError) as caught:
                call(given, *rest, **named)
            said = str(caught.value)
            assert said.startswith(f"{call.__name__} was given "), said
            assert cure in said
            assert len(said) < 500


@pytest.mark.parametrize("call", [solve, solve_many, Problem], ids=lambda call: call.__name__)
@pytest.mark.parametrize("name", ["y0", "x0"])
def test_a_span_in_order_beside_a_state_by_name_is_told_as_scipys_order(call: Any, name: str) -> None:
    state: Any = [(1, 0)] if call is solve_many else (1, 0)
    with pytest.raises(UsageError) as caught:
        call(MASS, (0, 12), **{name: state})
    said = str(caught.value)
    assert "(0, 12) in order" in said
    assert ("y0 and x0 mean the same" if name == "y0" else "x0 is given twice") in said
    assert "The order is" in said
    assert "t_span=(0, 12)" in str(caught.value)
    call(MASS, t_span=(0, 1), **{name: state})


@pytest.mark.parametrize("span", [(1.0, 1.0), (0, 0), [2.5, 2.5]])
def test_a_span_of_no_length_in_scipys_order_is_told(span: Any) -> None:
    with pytest.raises(UsageError, match="the order of scipy's solve_ivp") as caught:
        solve(MASS, span, (1.0, 0.0))
    assert "x0=(1.0, 0.0)" in str(caught.value)


@pytest.mark.parametrize("state", [(1.0, 1.0), [0, 0], np.array([2.5, 2.5])])
def test_a_state_that_is_taken_for_a_span_of_no_length_is_told_by_the_solution(state: Any) -> None:
    """Such a span may be meant: the run is made, and its message says what it did."""
    run = solve(MASS, (0, 12), state)
    assert run.success
    assert "t_span has no length" in run.message
    assert "t_span=(0.0, 12.0)" in run.message
    assert "scipy" not in solve(MASS, (1, 0.5), (1, 1)).message
    assert "no length" not in solve(MASS, (0, 12), (0, 1)).message


@pytest.mark.parametrize("value", [x == 0, x != 0, True, np.True_, np.bool_(False)], ids=repr)
@pytest.mark.parametrize("place", ["equation", "output", "reset"])
def test_a_comparison_by_equality_in_place_of_an_expression_is_refused(place: str, value: Any) -> None:
    made = {
        "equation": lambda: System({x: value}),
        "output": lambda: System({x: -x}, outputs={"y": value}),
        "reset": lambda: System({x: v, v: -1}, surfaces=[Surface("floor", x, reset={v: value})]),
    }
    with pytest.raises(ModelError) as caught:
        made[place]()
    assert "== compares names" in str(caught.value)
    assert "Piecewise((a, x > 0), (b, True))" in str(caught.value)
