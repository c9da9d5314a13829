"""Labels of the axes of a comparison's figures, with the units of the exact system."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import sympy

from filippov.analysis.comparisons.solution_events import places_of
from filippov.base.escape import figure_text
from filippov.base.label import unit_of
from filippov.model.system import System
from filippov.plot.style import axis_label


def section_labels(system: System, section: Any, slips: bool) -> dict[str, str]:
    """Labels of what is drawn over a section; slips: whether the drift is the way slipped, a place."""
    return {
        "width": _with_unit("half-width of the band", _common(system, [section.surface])),
        "error_R": _with_unit("error of R(d)", _unit(system, str(section.coordinate))),
        "drift": _with_unit("drift during stick", _way(system, [section.surface]) if slips else ""),
    }


def solution_labels(system: System, surfaces: Sequence[str], timed: Sequence[bool]) -> dict[str, str]:
    """Labels of what is drawn along a solution; timed: of each approximation, whether its width is a step."""
    width = _with_unit("half-width", _common(system, surfaces))
    if any(timed):
        step = _with_unit("step", _unit(system, "t"))
        width = step if all(timed) else f"{width}, or {step}"
    return {
        "width": width, "error_state": "error of the states over their extent",
        "error_final": "error of the final state over its extent",
        "error_times": _with_unit("error of event times", _unit(system, "t")),
        "drift": _with_unit("drift in stick", _way(system, surfaces)),
    }  # fmt: skip


def _with_unit(words: str, unit: str) -> str:
    return figure_text(f"{words} [{unit}]") if unit else words


def _unit(system: System, name: str) -> str:
    return unit_of(axis_label(system, name))


def _common(system: System, surfaces: Sequence[str]) -> str:
    """The unit that h has on every one of the surfaces, "" where it is not known of one or they differ."""
    units = {_height(system, name) for name in surfaces}
    return units.pop() if len(units) == 1 else ""


def _height(system: System, surface: str) -> str:
    """The unit of h = x - w, of its states and parameters; "" where h is anything else, as its unit is not
    written anywhere then."""
    form = system.symbolic
    if form is None:
        return ""
    h = sympy.expand(form.h[system.surface_index(surface)])
    units = set()
    for term in sympy.Add.make_args(h):
        factor, rest = term.as_coeff_Mul()
        if rest == 1:
            continue  # a number has the unit of what it stands beside
        if float(abs(factor)) != 1.0 or rest not in (*form.x, *form.p):
            return ""
        units.add(_unit(system, rest.name))
    return units.pop() if len(units) == 1 else ""


def _way(system: System, surfaces: Sequence[str]) -> str:
    """The unit of the way slipped on the surfaces, where a state is the place."""
    places = [places_of(system, name) for name in surfaces]
    units = {_unit(system, system.states[k]) for found in places for k, _, _ in found} | {
        "" for found in places if not found
    }
    return units.pop() if len(units) == 1 else ""
