"""Normal form of a special point: its coefficients and what they predict, by kind.

    fold, period doubling, symmetry breaking, Neimark-Sacker, Hopf    `smooth_normal_form`
    grazing, C-bifurcation, grazing-, crossing-, switching-, adding-sliding    `border_normal_form`
    boundary equilibrium    `boundary_normal_form`

A continuation puts them into `coefficients` and `predicts` of the special points that it finds.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from filippov.analysis.bifurcations.border_normal_form import TOUCHED, border_form
from filippov.analysis.bifurcations.boundary_normal_form import boundary
from filippov.analysis.bifurcations.branch import BranchPoint
from filippov.analysis.bifurcations.branch_problem import MapProblem, OrbitProblem
from filippov.analysis.bifurcations.corrector import FAILURES
from filippov.analysis.bifurcations.equilibrium_branch import EquilibriumProblem
from filippov.analysis.bifurcations.function_problem import FunctionProblem
from filippov.analysis.bifurcations.sliding_border import ADDING, ARRIVALS
from filippov.analysis.bifurcations.smooth_normal_form import Form, doubling, fold, hopf, neimark_sacker
from filippov.base.errors import UsageError

BORDER = (*TOUCHED, *ARRIVALS, ADDING)
KINDS = (
    "fold", "period doubling", "symmetry breaking", "Neimark-Sacker", "Hopf", "boundary equilibrium", *BORDER,
)  # fmt: skip


def normal_form(problem: Any, point: BranchPoint, width: float, name: str) -> Form:
    """Coefficients by name and what they predict; both empty for a point without a normal form here.

    problem  the equations that the point solves; width: of the bounds; name: of the parameter

    Raises UsageError where the coefficients are not known, and what `solve` raises.
    """
    u, value, kind = np.array(point.u), point.value, point.special
    maps = isinstance(problem, MapProblem | OrbitProblem)
    if isinstance(problem, OrbitProblem):
        problem = problem.at_phase(point.phase) if point.phase else problem
        if kind in BORDER:
            return border_form(problem, point, width, name)
    if isinstance(problem, EquilibriumProblem):
        if kind == "Hopf":
            return hopf(problem, u, value, width, name)
        if kind == "boundary equilibrium":
            if len(point.onto) > 1:
                raise UsageError("more than two branches meet on the kinks there.")
            return boundary(problem, point.test, u, value, point.onto[0]).form(value, width, name)
    if kind == "fold" and (maps or isinstance(problem, EquilibriumProblem | FunctionProblem)):
        return fold(problem, u, value, width, name)
    if maps and kind in ("period doubling", "symmetry breaking"):
        return doubling(problem, u, value, width, name, kind == "symmetry breaking")
    if maps and kind == "Neimark-Sacker":
        return neimark_sacker(problem, u, value, width, name)
    return {}, ""


def described(problem: Any, point: BranchPoint, width: float, name: str) -> BranchPoint:
    """The point with its coefficients and what they predict, or with the reason why they are not known."""
    if point.special not in KINDS:
        return point
    try:
        coefficients, predicts = normal_form(problem, point, width, name)
    except (*FAILURES, UsageError, ValueError) as error:
        # A failure of the normal form does not end a continuation.
        return replace(point, predicts=f"no normal form: {error}")
    return replace(point, coefficients=coefficients, predicts=predicts)
