"""Numbers in params of python-control's systems are parameters; what is asked for by value is not."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from filippov import ModelError, parameters, solve

control = pytest.importorskip("control")
from filippov.interop import from_control  # noqa: E402

DECAY: dict[str, Any] = {"inputs": 0, "states": ["a"], "outputs": ["a"], "name": "decay"}


def decay(rate: Any, params: Any, name: str = "decay", **more: Any) -> Any:
    """a' = rate(a, p), as a system."""
    words = {**DECAY, "name": name, **more}
    return control.nlsys(lambda t, a, u, p: [rate(a[0], p)], None, params=params, **words)


RATES: dict[str, tuple[Any, Any, Any]] = {
    "product": (lambda a, p: -p["k"] * a, {"k": 2.0}, {"k": 3.0}),
    "whole number": (lambda a, p: -p["k"] * a, {"k": 2}, {"k": 3.0}),
    "number of numpy": (lambda a, p: -p["k"] * a, {"k": np.float64(2.0)}, {"k": 0.0}),
    "within a function": (
        lambda a, p: -np.sin(p["k"]) * a + np.tanh(p["c"] * a), {"k": 1.0, "c": 0.5}, {"c": 2.0},
    ),
    "power": (lambda a, p: -(p["k"] ** p["n"]) * a, {"k": 2.0, "n": 2}, {"n": 3.0}),
    "with a default": (lambda a, p: -p.get("k", 7.0) * a, {"k": 2.0}, {"k": 1.0}),
    "sign": (lambda a, p: -p["k"] * np.sign(a - p["c"]), {"k": 2.0, "c": 0.5}, {"k": 0.25}),
    "beside an array": (lambda a, p: -p["k"] * p["w"].sum() * a, {"k": 2.0, "w": np.ones(2)}, {"k": 1.0}),
}  # fmt: skip


@pytest.mark.parametrize("name", RATES)
def test_numbers_are_parameters_and_mean_what_they_mean_in_python_control(name: str) -> None:
    rate, params, changed = RATES[name]
    system = from_control(decay(rate, params))
    assert set(system.parameters.names) == {q for q, v in params.items() if not isinstance(v, np.ndarray)}
    for values in ({}, changed):
        run = solve(system, (1.1,), (0, 2), parameters=values)
        other = from_control(decay(rate, {**params, **values}))
        assert run.x_end == pytest.approx(solve(other, (1.1,), (0, 2)).x_end, rel=1e-9)
        if name != "sign":
            theirs = control.input_output_response(
                decay(rate, params), np.linspace(0, 2, 9), X0=[1.1], params=values,
                solve_ivp_kwargs={"rtol": 1e-9, "atol": 1e-12},
            )  # fmt: skip
            assert run.x_end == pytest.approx(np.ravel(theirs.states)[-1:], rel=1e-6)


KEPT: dict[str, tuple[Any, Any]] = {
    "asked by ==": (lambda a, p: -p["k"] * a if p["mode"] == 1 else -9.0 * a, {"k": 2.0, "mode": 1}),
    "asked by == and used": (
        lambda a, p: -p["k"] * a if p["mode"] == 0 else -p["mode"] * a, {"k": 2.0, "mode": 2},
    ),
    "asked by >": (lambda a, p: -p["k"] * a if p["mode"] > 0 else a, {"k": 2.0, "mode": 1.0}),
    "a count": (lambda a, p: -p["k"] * sum(a for _ in range(p["mode"])), {"k": 1.0, "mode": 2}),
    "an index": (lambda a, p: -p["k"] * [1.0, 2.0, 3.0][p["mode"]] * a, {"k": 2.0, "mode": 1}),
    "a flag": (lambda a, p: -p["k"] * a * (1 if p["mode"] else 2), {"k": 2.0, "mode": True}),
    "a text": (lambda a, p: -p["k"] * a * len(p["mode"]), {"k": 2.0, "mode": "a"}),
    "rounded": (lambda a, p: -p["k"] * round(p["mode"]) * a, {"k": 2.0, "mode": 1.2}),
    "float": (lambda a, p: -p["k"] * float(p["mode"]) * a, {"k": 2.0, "mode": 1.5}),
}  # fmt: skip


@pytest.mark.parametrize("name", KEPT)
def test_what_is_asked_for_by_value_keeps_it(name: str) -> None:
    """No parameter that would do nothing: setting it is refused by name. The others still are parameters."""
    rate, params = KEPT[name]
    system = from_control(decay(rate, params))
    assert "mode" not in system.parameters.names
    slope = float(rate(1.0, params))
    assert solve(system, (1.0,), (0, 1)).x_end == pytest.approx([np.exp(slope)], rel=1e-8)
    with pytest.raises(ModelError, match="mode"):
        solve(system, (1.0,), (0, 1), parameters={"mode": 2})


def test_a_name_has_one_value_in_a_diagram_that_of_the_last_block_as_in_python_control() -> None:
    first = decay(lambda a, p: -p["k"] * a, {"k": 2.0, "c": 1.0}, name="one")
    words = {"name": "two", "states": ["b"], "outputs": ["b"]}
    second = decay(lambda a, p: -p["k"] * a + p["c"], {"k": 3.0, "c": 1.0}, **words)
    whole = control.interconnect([first, second], connections=False, outlist=["one.a", "two.b"])
    system = from_control(whole)
    assert set(system.parameters.names) == {"k", "c"}
    for values in ({}, {"k": 0.5}):
        theirs = control.input_output_response(
            whole, np.linspace(0, 1, 5), X0=[1.0, 1.0], params=values, solve_ivp_kwargs={"rtol": 1e-9},
        )  # fmt: skip
        ours = solve(system, (1.0, 1.0), (0, 1), parameters=values)
        assert ours.x_end == pytest.approx(theirs.states[:, -1], rel=1e-5)


def test_params_of_a_diagram_go_before_those_of_its_systems() -> None:
    first = decay(lambda a, p: -p["k"] * a, {"k": 2.0}, name="one")
    whole = control.interconnect([first], connections=False, outlist=["one.a"], params={"k": 0.5})
    system = from_control(whole)
    theirs = control.input_output_response(whole, np.linspace(0, 1, 5), X0=[1.0])
    assert np.ravel(theirs.states)[-1] == pytest.approx(np.exp(-0.5), rel=1e-3)
    assert solve(system, (1.0,), (0, 1)).x_end == pytest.approx([np.exp(-0.5)], rel=1e-8)
    assert solve(system, (1.0,), (0, 1), parameters={"k": 1.0}).x_end == pytest.approx([np.exp(-1)], rel=1e-8)


def test_names_of_states_and_of_parameters_in_inputs_are_taken() -> None:
    q = parameters(k=5.0)
    made = control.nlsys(
        lambda t, a, u, p: [-p["k"] * a[0] - p["a"] * a[0] + u[0]], None, inputs=["u"], states=["a"],
        outputs=["a"], params={"k": 2.0, "a": 1.0}, name="plant",
    )  # fmt: skip
    system = from_control(made, {"u": q.k})
    assert set(system.parameters.names) == {"k", "plant_k", "plant_a"}
    assert system.parameters["k"].default == 5.0
    assert solve(system, (1.0,), (0, 50)).x_end == pytest.approx([5 / 3])
