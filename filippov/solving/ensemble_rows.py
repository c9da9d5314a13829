"""What `solve_many` is given: a row of states and a row of parameters for each trajectory."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from filippov.base.arrays import Array
from filippov.base.errors import ModelError, UsageError
from filippov.base.given import number_array, shown
from filippov.base.labelled import by_label, in_order
from filippov.base.names import unknown
from filippov.base.quantity import is_quantity, plain
from filippov.base.status import Status
from filippov.model.system import System
from filippov.solving.state.options import check_state, without_units


class End(NamedTuple):
    """The end of one trajectory: the time and state (n,) reached, and the mode, status and message there."""

    t: float
    x: Array
    mode: npt.NDArray[np.int64]
    status: Status
    message: str


def rows_of(system: System, x0: Any, parameters: Mapping[str, Any]) -> tuple[Array, Array]:
    """Initial states (k, n) and rows of parameters (k, P). Raises UsageError, ModelError.

    Of several rows some may hold what is not finite (`not_finite`).
    """
    if is_quantity(x0):
        raise UsageError("x0 is a quantity with a unit, expected numbers in the units of the states.")
    states = np.atleast_2d(number_array("x0", _without_units(_by_name(x0, system), system)))
    if states.ndim != 2 or states.shape[1] != system.dimension:
        raise UsageError(
            f"x0 has shape {np.shape(x0)}, expected (k, {system.dimension}) "
            f"(states: {', '.join(system.states)}), a row for each run: "
            f"x0=[({', '.join('0' for _ in system.states)}{',' * (system.dimension == 1)}), ...]."
        )
    finite = np.isfinite(states)
    if states.size and not finite.all(axis=1).any():
        raise UsageError(not_finite(system, 0, states[0], np.zeros(0)))
    units = {name: system.parameters[name].unit for name in system.parameters.names}
    given = {
        k: [plain(one, units.get(k, ""), f"parameter {k!r}") for one in q] if isinstance(q, list | tuple)
        else plain(q, units.get(k, ""), f"parameter {k!r}")
        for k, q in parameters.items()
    }  # fmt: skip
    single, columns = dict(given), {}
    for name, value in given.items():
        if not isinstance(value, float) and np.ndim(value) != 0:
            columns[name] = number_array(f"parameter {name!r}", single.pop(name))
            if columns[name].ndim != 1 or not columns[name].size:
                raise UsageError(f"parameter {name!r} is {shown(value)}, expected a number or k numbers.")
    lengths = {len(column) for column in columns.values()} | {len(states)}
    count = max(lengths)
    if not lengths <= {1, count}:
        raise UsageError(f"x0 and parameters have lengths {sorted(lengths)}, expected one length or 1.")
    known = {name: column[np.isfinite(column)] for name, column in columns.items()}
    for name in columns:
        if not known[name].size:
            raise UsageError(f"parameter {name!r} is {shown(given[name])}, expected finite numbers.")
    base = system.parameters.resolve({**single, **{k: float(column[0]) for k, column in known.items()}})
    values = np.empty((count, len(base)))
    values[:] = base
    for name, column in columns.items():
        declared = system.parameters[name]
        for extreme in (float(np.min(known[name])), float(np.max(known[name]))):
            declared.check(extreme, f"parameter {name!r}")
        values[:, system.parameters.index(name)] = column
    return states if len(states) == count else np.repeat(states, count, axis=0), values


def _by_name(x0: Any, system: System) -> Any:
    """Columns of states by name, of a table or a dict, or rows of which each has names, as rows in order."""
    if isinstance(x0, Mapping):
        names = {str(getattr(key, "name", key)): value for key, value in x0.items()}
        for name in names:
            if name not in system.states:
                raise UsageError(unknown("state", name, system.states))
        missing = [name for name in system.states if name not in names]
        if missing:
            raise UsageError(
                f"x0 has no value for {', '.join(missing)}; expected one for each of {system.states}."
            )
        columns: list[Any] | None = [names[name] for name in system.states]
    else:
        columns = in_order(x0, system.states, "x0")
    if columns is not None:
        named = zip(system.states, columns, strict=True)
        made = [np.atleast_1d(number_array(f"x0: {name!r}", column)) for name, column in named]
        lengths = {len(column) for column in made}
        if any(column.ndim != 1 for column in made) or not lengths <= {1, max(lengths)}:
            raise UsageError(f"x0: its columns have lengths {sorted(lengths)}, expected one length or 1.")
        return np.column_stack(np.broadcast_arrays(*made))
    if isinstance(x0, list | tuple) and any(isinstance(row, Mapping) or by_label(row) for row in x0):
        return [check_state(row, system) for row in x0]
    return x0


def _without_units(x0: Any, system: System) -> Any:
    """One state, or rows of states, with the quantities in the units of the labels."""
    one = without_units(x0, system)
    if one is not x0:
        return one
    rows = x0.tolist() if isinstance(x0, np.ndarray) and x0.dtype == object else x0
    if not isinstance(rows, list | tuple):
        return x0
    return [without_units(row, system, f"x0[{i}]") for i, row in enumerate(rows)]


def unusable(system: System, states: Array, values: Array) -> dict[int, str]:
    """Why rows cannot be run, by row: a number that is not finite, a width or an instant that cannot be.

    Raises the first of these, a ModelError or what a function of the user's raised, where no row is left.
    """
    finite = np.isfinite(states).all(axis=1) & np.isfinite(values).all(axis=1)
    told = {k: not_finite(system, k, states[k], values[k]) for k in np.flatnonzero(~finite).tolist()}
    at = np.flatnonzero(finite)
    refused = _refused(system, values[at])
    if len(refused) == len(at) > 0:
        raise refused[0]
    for k, error in refused.items():
        name = "" if isinstance(error, ModelError) else f"{type(error).__name__}: "
        told[int(at[k])] = f"row {at[k]}: {name}{error}"
    return told


def not_finite(system: System, row: int, state: Array, values: Array) -> str:
    """Why a row cannot be run: the first of its numbers that is not finite; "" where all are."""
    named = [*(f"state {name!r}" for name in system.states), *(f"parameter {n!r}" for n in system.parameters)]
    for name, value in zip(named, [*state.tolist(), *values.tolist()], strict=False):
        if not math.isfinite(value):
            where = f"x0[{row}]" if name.startswith("state") else f"row {row}"
            return f"{where}: {name} is {value}, expected a finite number."
    return ""


def _refused(system: System, values: Array) -> dict[int, Exception]:
    """What makes rows of parameters (k, P) no system, by row: widths and instants that cannot be."""
    if not system.variable_widths and not system.clocked:
        return {}
    from filippov.model.comparators.hysteresis import check_widths

    form, errors = system.symbolic, dict[int, Exception]()
    # Of many parameters few stand in widths and instants; functions may read all of them.
    instants = [e for event in system.time_events for e in event.expressions()]
    asked = [*(form.widths if form else ()), *instants]
    inside = {s.name for e in asked if e is not None for s in e.free_symbols}
    places = [i for i, name in enumerate(system.parameters.names) if form is None or name in inside]
    _, first, of = np.unique(values[:, places], axis=0, return_index=True, return_inverse=True)
    for k, row in enumerate(values[first]):
        try:
            if form is not None:
                check_widths(form, system.surfaces, row)
            known = dict(zip(system.parameters.names, row.tolist(), strict=True))
            for event in system.time_events:
                event.numbers(system.parameters.record(row), known)
        except Exception as error:  # noqa: BLE001  # what a user's function raises is of its row only
            errors[k] = error
    return {row: errors[k] for row, k in enumerate(of.reshape(-1).tolist()) if k in errors}
