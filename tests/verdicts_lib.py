"""The verdict of the report on a case of tests/stability_models.py."""
from __future__ import annotations
import numpy as np
import sympy
from filippov.analysis.equilibrium import EquilibriumSet
from filippov.analysis.stability import stability_report

NEAR = 1e-6


def near(case, item, values):
    e = item.equilibrium
    at = np.array(case.at, float)
    if isinstance(e, EquilibriumSet):
        x = [sympy.sympify(q).subs(values) for q in e.x]
        from scipy.optimize import lsq_linear
        free = list(e.free)
        f = sympy.lambdify(free, x)
        lo = np.array([max(b[0], -1e3) for b in e.bounds]); hi = np.array([min(b[1], 1e3) for b in e.bounds])
        from scipy.optimize import least_squares
        mid = np.clip(np.zeros(len(lo)), lo + 1e-3*(hi-lo), hi-1e-3*(hi-lo))
        r = least_squares(lambda c: np.array(f(*c), float) - at, mid, bounds=(lo - 1e-12, hi + 1e-12), xtol=1e-15, ftol=1e-15, gtol=1e-15)
        return np.max(np.abs(r.fun)) < NEAR
    return np.max(np.abs(np.array(e.value) - at)) < NEAR


def verdict(case):
    report = stability_report(case.system, budget=20.0)
    values = {q: q.parameter.default for q in case.system.symbolic.p}
    said = {i.answer for i in report.items if near(case, i, values)}
    for answer in ("unstable", "undecided", "stable", "asymptotically stable"):
        if answer in said:
            return answer
    return "missing"
