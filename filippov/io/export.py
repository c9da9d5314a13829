"""A solution as an xarray.Dataset, for export to netCDF and for work with labelled arrays."""

from __future__ import annotations

import importlib
from typing import Any

import numpy as np

from filippov.base.errors import UsageError
from filippov.base.status import mode_text
from filippov.solving.solution import Solution


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
