"""The verdicts of the stability report on tests/stability_models.py: none is wrong, few are missing."""

from __future__ import annotations

import os

import numpy as np
import pytest
import sympy
from scipy.optimize import least_squares
from stability_models import AS, KINDS, UN, Case, cases
from verdict_draws import examine

from filippov.analysis.local_stability.stability import StabilityReport, stability_report
from filippov.analysis.steady.equilibrium import EquilibriumPoint, EquilibriumSet

DRAWS = {"ci": 5, "nightly": 50}.get(os.environ.get("FILIPPOV_PROFILE", ""), 3)
NEAR = 1e-6
MOST_OPEN = 5


def covers(equilibrium: EquilibriumPoint | EquilibriumSet, at: tuple[float, ...], values: dict) -> bool:
    """Whether a state is the equilibrium, or a point of the set."""
    place = np.array(at, dtype=float)
    if isinstance(equilibrium, EquilibriumPoint):
        return bool(np.max(np.abs(np.array(equilibrium.value) - place)) < NEAR)
    x = sympy.lambdify(equilibrium.free, [e.subs(values) for e in equilibrium.x])
    low, high = (np.clip([b[k] for b in equilibrium.bounds], -1e3, 1e3) for k in (0, 1))
    found = least_squares(
        lambda c: np.array(x(*c), dtype=float) - place, np.clip(0.0, low + 1e-3, high - 1e-3),
        bounds=(low - 1e-9, high + 1e-9), xtol=1e-15, ftol=1e-15, gtol=1e-15,
    )  # fmt: skip
    return bool(np.max(np.abs(found.fun)) < NEAR)


def verdict(case: Case, report: StabilityReport) -> str:
    """What the report says of the case's equilibrium; "missing" where it does not list it."""
    assert case.system.symbolic is not None
    values = {q: q.parameter.default for q in case.system.symbolic.p}
    said = {item.answer for item in report.items if covers(item.equilibrium, case.at, values)}
    return next((a for a in (UN, "undecided", "stable", AS) if a in said), "missing")


@pytest.mark.parametrize("kind", KINDS)
def test_12_11_no_verdict_is_wrong(kind: str) -> None:
    """A verdict is the truth or "undecided"; "stable" says less than the truth of what also attracts."""
    for case in KINDS[kind]():
        report = stability_report(case.system, budget=60.0)
        said = verdict(case, report)
        OPEN[case.name] = said in {"undecided", "missing"} or (said == "stable" and case.truth == AS)
        assert OPEN[case.name] or said == case.truth, f"{case.name}: {said}, but {case.truth} ({case.reason})"


# One of each kind; `tests/campaigns.py verdicts` draws them at will.
@pytest.mark.parametrize("seed", range(DRAWS))
def test_12_random_systems_have_the_verdicts_of_their_motions(seed: int) -> None:
    faults, _ = examine(seed)
    assert not faults


OPEN: dict[str, bool] = {}


def test_12_11_at_most_five_are_open() -> None:
    """Counts what the tests above found; run alone it finds it itself."""
    every = cases()
    assert len(every) >= 90
    assert len({case.name for case in every}) == len(every)
    for case in every:
        if case.name not in OPEN:
            said = verdict(case, stability_report(case.system, budget=60.0))
            OPEN[case.name] = said in {"undecided", "missing"} or (said == "stable" and case.truth == AS)
    left = sorted(name for name, is_open in OPEN.items() if is_open)
    assert len(left) <= MOST_OPEN, left
