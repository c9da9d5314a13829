"""Quantities of pint where numbers are given: converted by the units of the model, or refused by name."""

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from filippov import (
    Input,
    ModelError,
    Parameter,
    System,
    UsageError,
    parameters,
    sign,
    solve,
    solve_many,
    states,
)
from filippov.analysis import brute_force, compare, describing_function, find_orbit, lyapunov

pint = pytest.importorskip("pint")
Q = pint.UnitRegistry().Quantity
x, v = states("x v")
p = parameters(k=Parameter(1.0, "N/m"), mu=Parameter(0.5, "N"))
SYSTEM = System(
    {x: v, v: -p.k * x - v / 2 + p.mu * sign(v)}, labels={"x": "position [mm]", "v": "speed [m/s]"}
)
START, PLAIN = (Q(0.003, "m"), Q(100.0, "mm/s")), (3.0, 0.1)
ROWS: dict[str, Any] = {
    "one": START, "list": list(START), "array": np.array(START, dtype=object),
    "rows": [START, START], "array of rows": np.array([START, START], dtype=object), "mixed": [START, PLAIN],
}  # fmt: skip


@pytest.mark.parametrize("name", ROWS)
def test_rows_are_converted(name: str) -> None:
    found = solve_many(SYSTEM, ROWS[name], (0, 1))
    alone = solve(SYSTEM, PLAIN, (0, 1)).x_end
    assert len(found.x) == (1 if name in ("one", "list", "array") else 2)
    assert np.allclose(found.x, alone, rtol=1e-9)


@pytest.mark.parametrize("k", [Q(np.array([1.0, 2.0]), "N/mm"), [Q(1.0, "N/mm"), Q(2000.0, "N/m")]])
def test_parameters_in_rows_are_converted(k: Any) -> None:
    found = solve_many(SYSTEM, PLAIN, (0, 0.1), parameters={"k": k})
    assert np.array_equal(found.x, solve_many(SYSTEM, PLAIN, (0, 0.1), parameters={"k": [1e3, 2e3]}).x)


BY_NAME = dict(zip("xv", START, strict=True))


@pytest.mark.parametrize("guess", [START, list(START), np.array(START, dtype=object), BY_NAME])
def test_a_guess_is_converted(guess: Any) -> None:
    assert find_orbit(SYSTEM, guess).period == find_orbit(SYSTEM, PLAIN).period


REFUSED: dict[str, Callable[[], Any]] = {
    "x0": lambda: solve_many(SYSTEM, Q(np.ones((3, 2)), "mm"), (0, 1)),
    "v": lambda: solve_many(SYSTEM, [PLAIN, Q(np.ones(2), "mm")], (0, 1)),
    "x": lambda: solve_many(SYSTEM, [(Q(1, "s"), 0.1)], (0, 1)),
    "parameter 'k'": lambda: solve_many(SYSTEM, PLAIN, (0, 1), parameters={"k": [Q(1, "s"), Q(2, "s")]}),
    "t_span": lambda: solve_many(SYSTEM, PLAIN, (Q(0, "s"), Q(1, "s"))),
    "max_step": lambda: solve(SYSTEM, PLAIN, (0, 1), max_step=Q(1, "ms")),
    "atol": lambda: solve(SYSTEM, PLAIN, (0, 1), atol=[Q(1, "mm"), Q(1, "m/s")]),
    "values": lambda: brute_force(SYSTEM, None, "k", [Q(1, "N/m"), Q(2, "N/m")], PLAIN, transient=1, keep=1),
    "widths": lambda: compare(SYSTEM, PLAIN, (0, 1), widths=[1e-2, Q(1, "mm")]),
    "amplitudes": lambda: describing_function(SYSTEM, amplitudes=(Q(1, "mm"), Q(2, "mm"))),
    "period": lambda: find_orbit(SYSTEM, PLAIN, period=Q(6, "s")),
    "duration": lambda: lyapunov(SYSTEM, PLAIN, Q(3, "s"), interval=1.0),
    "unit": lambda: Input("F", [0, 1], [1, 2], unit="mN"),  # type: ignore[call-arg]
    "values of an input": lambda: Input("F", [0, 1], [1.0, Q(2, "N")]),
    "values, nested": lambda: Input("F", [0, 1], [1, Q(np.array(2.0), "N")]),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_converted_is_refused_by_name(name: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # that numpy strips a unit
        with pytest.raises((UsageError, ModelError), match=name.split(maxsplit=1)[0].strip(",")) as error:
            REFUSED[name]()
    assert type(error.value) in (UsageError, ModelError)
