"""A solution and its events for other packages: xarray, for netCDF and labelled arrays, and pandas."""

from __future__ import annotations

import importlib
from typing import Any

import numpy as np

from filippov.base.errors import UsageError
from filippov.base.status import mode_text
from filippov.solving.solution import Solution
from filippov.solving.state.events import Events

_KINDS: dict[str, type] = {
    **dict.fromkeys(("surface", "kind", "before", "after", "note"), str), "direction": int, "group": int,
}  # fmt: skip


def dataset(solution: Solution) -> Any:
    """The states over t; event_surface, event_kind, event_before, event_after and <state>_at_event over
    `event`.

    The coordinate event_t holds the times of the events. Attributes: status, message, and the parameters as
    parameter_<name>, with their units as unit_<name> where they have one. Raises ImportError without xarray,
    UsageError for a state named t or event.
    """
    try:
        xarray: Any = importlib.import_module("xarray")
    except ImportError:
        raise ImportError(
            "to_xarray needs xarray, which is not installed: pip install filippov[tables]"
        ) from None
    states, events = solution.system.states, list(solution.events)
    parameters = solution.system.parameters
    variables: dict[str, Any] = {name: (("t",), solution.y[i]) for i, name in enumerate(states)}
    at = {
        "event_surface": np.array([event.surface for event in events], dtype=np.str_),
        "event_kind": np.array([str(event.kind) for event in events], dtype=np.str_),
        "event_before": np.array([mode_text(event.before) for event in events], dtype=np.str_),
        "event_after": np.array([mode_text(event.after) for event in events], dtype=np.str_),
    } | {f"{name}_at_event": np.array([event.x[i] for event in events]) for i, name in enumerate(states)}
    taken = sorted(set(variables) & {*at, "t", "event", "event_t"})
    if taken:
        raise UsageError(f"the state {taken[0]!r} has the name of a column of events. Rename the state.")
    variables |= {name: (("event",), values) for name, values in at.items()}
    attributes: dict[str, Any] = {"status": str(solution.status), "message": solution.message}
    attributes |= {f"parameter_{name}": value for name, value in solution.problem.parameters.items()}
    attributes |= {f"unit_{name}": parameters[name].unit for name in parameters if parameters[name].unit}
    coordinates = {"t": solution.t, "event_t": (("event",), np.array([event.t for event in events]))}
    return xarray.Dataset(variables, coords=coordinates, attrs=attributes)


def frame(solution: Solution) -> Any:
    """A pandas.DataFrame: states and outputs over the index t, as they stand at solution.t.

    Where the state jumps, t appears twice. attrs: status, message, parameters, labels. Raises ImportError
    without pandas.
    """
    pandas, system = _pandas(), solution.system
    names = (*system.states, *(system.outputs if solution.sol is not None else ()))
    out = pandas.DataFrame({name: solution[name] for name in names}, index=solution.t)
    out.index.name = "t"
    out.attrs = {
        "status": solution.status.value, "message": solution.message, "labels": dict(system.labels),
        "parameters": dict(solution.problem.parameters),
    }  # fmt: skip
    return out


def event_frame(events: Events) -> Any:
    """A pandas.DataFrame with one row per event: what it was, and the state before and after it.

    The state after is NaN where it does not jump. Raises ImportError without pandas.
    """
    pandas = _pandas()
    n = len(events[0].x) if len(events) else len(events.states or ())
    states = events.states or tuple(f"x{i}" for i in range(n))
    columns: dict[str, Any] = {
        "t": events.t, "surface": [e.surface for e in events], "kind": [str(e.kind) for e in events],
        "before": [mode_text(e.before) for e in events], "after": [mode_text(e.after) for e in events],
        "direction": [e.direction for e in events], "multiplier": [e.multiplier for e in events],
        "residual": [e.residual for e in events], "group": [e.group for e in events],
        "note": [e.note for e in events],
    }  # fmt: skip
    none = np.full(n, np.nan)
    after = [none if e.x_after is None else e.x_after for e in events]
    for i, name in enumerate(states):
        columns[name] = [float(e.x[i]) for e in events]
        columns[f"{name}_after"] = [float(x[i]) for x in after]
    # Without rows pandas takes every column for numbers: the tables of two runs would not fit together.
    return pandas.DataFrame(columns) if len(events) else pandas.DataFrame(columns).astype(_KINDS)


def _pandas() -> Any:
    try:
        return importlib.import_module("pandas")
    except ImportError:
        raise ImportError("to_pandas needs pandas, which is not installed: pip install pandas") from None
