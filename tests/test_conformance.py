"""What every registered model must do: build, keep its identity, and be solved rightly."""

from __future__ import annotations

import json
import math
import pickle
import subprocess
import sys
from collections.abc import Callable
from functools import cache, partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy as sp

from filippov import Exact, Status, models, solve
from filippov.model.symbolic import SymbolicForm
from filippov.model.symbols import t
from filippov.model.system import System
from filippov.models import Coulomb, Hyperbolic, Model
from filippov.models.belt import belt
from filippov.models.mass import controlled_mass
from filippov.models.oscillator import oscillator
from filippov.models.registry import BUILT_IN
from filippov.models.sliding_mode import sliding_mode

ROOT = Path(__file__).resolve().parent.parent
LOOSE, TIGHT = 1e-8, 1e-11
EVERY_MODEL = pytest.mark.parametrize("name", sorted(BUILT_IN))


@cache
def system_of(name: str) -> System:
    system: System = models.get(name).build()
    return system


def form_of(system: System) -> SymbolicForm:
    assert system.symbolic is not None
    return system.symbolic


def run(system: System, model: Model, rtol: float) -> Any:
    return solve(system, x0=model.x0, t_span=model.t_span, rtol=rtol, atol=rtol * 1e-3)


@cache
def solution_of(name: str, rtol: float = TIGHT) -> Any:
    return run(system_of(name), models.get(name), rtol)


def evaluator(system: System, expressions: Any) -> Callable[[float, Any], Any]:
    """Expressions as a function of t and x at the default parameters, by sympy's own code printer."""
    form = form_of(system)
    f = sp.lambdify((t, form.x, form.p), list(expressions), "numpy")
    return lambda time, x: f(time, x, system.parameters.defaults)


def inner_times(segment: Any, count: int = 9) -> list[float]:
    return [segment.t0 + (segment.t1 - segment.t0) * (k + 0.5) / count for k in range(count)]


def text(mode: tuple[int, ...]) -> str:
    return "".join("-0+"[m + 1] for m in mode)


# -- the system ----------------------------------------------------------------------------------------


@EVERY_MODEL
def test_model_is_complete(name: str) -> None:
    model, system = models.get(name), system_of(name)
    assert len(model.x0) == system.dimension
    assert model.t_span[0] < model.t_span[1]
    assert all(surface.name for surface in system.surfaces)
    modes = [q.mode for q in model.invariants if q.mode is not None]
    assert all(len(mode) == len(system.surfaces) for mode in modes)
    assert all(system.parameters[q].description for q in system.parameters)


@EVERY_MODEL
def test_two_builds_and_a_pickled_one_are_equal(name: str) -> None:
    model, system = models.get(name), system_of(name)
    copy = pickle.loads(pickle.dumps(system))  # noqa: S301
    assert system == model.build() == copy
    assert system.digest == model.build().digest == copy.digest
    assert pickle.loads(pickle.dumps(model)).build() == system  # noqa: S301


def test_digests_are_the_same_in_another_process() -> None:
    code = (
        "import json; from filippov import models as m;"
        "print(json.dumps({name: m.get(name).build().digest for name in m.names()}))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
        env={"PYTHONHASHSEED": "5"},
    )
    assert done.returncode == 0, done.stderr
    other = json.loads(done.stdout)
    assert other == {name: system_of(name).digest for name in BUILT_IN}
    assert len({system_of(name) for name in BUILT_IN}) == len(BUILT_IN)


@EVERY_MODEL
def test_field_is_finite_in_the_modes_at_the_initial_state(name: str) -> None:
    model, system = models.get(name), system_of(name)
    form = form_of(system)
    x0 = np.array(model.x0)
    h = evaluator(system, form.plain_h())(model.t_span[0], x0)
    for side in (1, -1):
        mode = tuple(int(np.sign(value)) or side for value in h)
        field = evaluator(system, form.at_mode(mode))(model.t_span[0], x0)
        assert np.isfinite(np.array(field, dtype=float)).all()


# -- its solution --------------------------------------------------------------------------------------


@EVERY_MODEL
@pytest.mark.parametrize("rtol", [LOOSE, TIGHT])
def test_default_run_succeeds(name: str, rtol: float) -> None:
    solution = solution_of(name, rtol)
    assert solution.status is Status.SUCCESS, solution.message
    assert solution.t[-1] == models.get(name).t_span[1]


@EVERY_MODEL
def test_segments_add_up_to_the_span(name: str) -> None:
    segments, span = solution_of(name).segments, models.get(name).t_span
    assert segments[0].t0 == span[0]
    assert segments[-1].t1 == span[1]
    assert all(one.t1 == other.t0 for one, other in pairwise(segments))
    assert math.fsum(q.t1 - q.t0 for q in segments) == pytest.approx(span[1] - span[0], rel=1e-15)


@EVERY_MODEL
def test_surfaces_are_held_while_sliding_and_kept_on_their_side(name: str) -> None:
    system, solution = system_of(name), solution_of(name)
    h = evaluator(system, form_of(system).plain_h())
    scale = np.maximum(1.0, np.max(np.abs([h(time, solution.sol(time)) for time in solution.t]), axis=0))
    for segment in solution.segments:
        for time in inner_times(segment):
            values = np.array(h(time, solution.sol(time)), dtype=float) / scale
            for value, mode, surface in zip(values, segment.mode, system.surfaces, strict=True):
                if mode == 0:
                    assert abs(value) <= 1e-9
                elif surface.width == 0:
                    assert value * mode >= -1e-9


@EVERY_MODEL
def test_multipliers_hold_the_surface_and_lie_in_their_set(name: str) -> None:
    """At each multiplier that the solver reports d/dt h = 0, and it is in [lo, hi]."""
    system, solution = system_of(name), solution_of(name)
    form = form_of(system)
    names = [surface.name for surface in system.surfaces]
    bounds = evaluator(system, [b for pair in form.radius for b in pair])
    for segment in solution.segments:
        if 0 not in segment.mode:
            continue
        rates = sp.lambdify((t, form.x, form.p, form.s), form.rates(segment.mode), "numpy")
        for time in inner_times(segment, 3):
            x = solution.sol(time)
            s = [float(solution.multiplier(q, time)) for q in names]
            at = rates(time, x, system.parameters.defaults, s)
            ends = [rates(time, x, system.parameters.defaults, [m] * len(s)) for m in (1, -1)]
            for i, mode in enumerate(segment.mode):
                if mode == 0:
                    assert abs(at[i]) <= 1e-9 * (1 + abs(ends[0][i]) + abs(ends[1][i]))
                    low, high = bounds(time, x)[2 * i : 2 * i + 2]
                    assert low - 1e-7 <= s[i] <= high + 1e-7


@EVERY_MODEL
def test_invariants_are_conserved(name: str) -> None:
    model, solution = models.get(name), solution_of(name)
    p = system_of(name).parameters
    record = p.record(p.resolve())
    for invariant in model.invariants:
        met = [q for q in solution.segments if invariant.mode in (None, text(q.mode))]
        assert met, f"{invariant.name}: the default run has no segment in mode {invariant.mode}"
        for segment in met:
            values = [invariant.function(time, solution.sol(time), record) for time in inner_times(segment)]
            assert np.ptp(values) <= 1e-8 * max(1.0, np.max(np.abs(values)))


def test_stick_position_is_constant_to_the_last_bit() -> None:
    solution = solution_of("hunting")
    sticks = [q for q in solution.segments if q.mode == (0,)]
    assert len(sticks) > 10
    for segment in sticks:
        states = np.array([solution.sol(time) for time in inner_times(segment)])
        assert np.ptp(states[:, 0]) == 0
        assert np.max(np.abs(states[:, 1])) <= 1e-14


@EVERY_MODEL
def test_two_tolerances_agree(name: str) -> None:
    one, other = solution_of(name, LOOSE), solution_of(name, TIGHT)
    assert one.modes == other.modes
    np.testing.assert_allclose(one.y[:, -1], other.y[:, -1], rtol=2e-6, atol=2e-6)


def reversed_surfaces(system: System) -> System:
    form, h = form_of(system), form_of(system).plain_h()
    plain: dict[Any, Any] = {s: sp.sign(g) for s, g in zip(form.s, h, strict=True)}
    plain |= {a: sp.Abs(g) for a, g in zip(form.a, h, strict=True)}
    equations = {x: f.xreplace(plain) for x, f in zip(form.x, form.field, strict=True)}
    return System(equations, surfaces=system.surfaces[::-1], time_events=system.time_events)


# The order is given by the equations: a curve made of |v|, and the two limits of one Min and Max.
ORDERED = {"fuller", "anti_windup"}


@pytest.mark.parametrize(
    "name", [n for n in sorted(BUILT_IN) if len(system_of(n).surfaces) > 1 and n not in ORDERED]
)
def test_order_of_surfaces_does_not_matter(name: str) -> None:
    system = system_of(name)
    assert system.comparator == Exact()
    turned = reversed_surfaces(system)
    assert [q.name for q in turned.surfaces] == [q.name for q in system.surfaces][::-1]
    one, other = solution_of(name), run(turned, models.get(name), TIGHT)
    assert other.modes == tuple(mode[::-1] for mode in one.modes)
    np.testing.assert_allclose(one.y[:, -1], other.y[:, -1], rtol=1e-9, atol=1e-9)


# -- published and closed-form values ------------------------------------------------------------------

# Thirty-digit extrapolation and closed forms; model, initial state, end, state there.
KNOWN: dict[str, tuple[Callable[[], System], tuple[float, ...], float, tuple[float, ...]]] = {
    "belt, alternate friction": (belt, (0, 0), 40, (0.77123645490135267, 0.2)),
    "belt, 1/(1 + |v|)": (
        partial(belt, Hyperbolic(1, gamma=1)), (0, 0), 20, (0.28493658955419935, 0.2)
    ),
    "oscillator, from 3": (oscillator, (3, 0), 20, (-0.2, 0)),
    "oscillator, from (12, 6)": (partial(oscillator, Coulomb(1)), (12, 6), 100, (0.68217893672364685, 0)),
    "oscillator, forced": (
        partial(oscillator, Coulomb(0.6), A=1, omega=0.6),
        (1, 0),
        160,
        (0.9678434990048272, -0.68387488142669078),
    ),
    "PD with Coulomb friction": (
        partial(controlled_mass, Coulomb(1), models.PD(P=4, D=0.25)), (-2, 0), 20, (0.12664897939763765, 0)
    ),
    "sliding mode": (partial(sliding_mode, A=0), (1, 0), 3, (0.062411055733349042, -0.062411055733349042)),
    **{
        name: (models.get(name).build, models.get(name).x0, models.get(name).t_span[1], state)
        for name, state in {
            "relay": (-0.044512934367956073, -1.7271331438945697, -3.2115316760889623),
            "relay_aperiodic": (0.046808245349998086, 1.1865451604507089, 0.56508307138111934),
            "relay_two_slides": (0, -0.82057425530346121, 0.80113124895711046),
            "switching_predator": (0.061143032744133846, 0.12228606548826769, 1.6719408697897226),
            "twisting": (-0.00023492201942882898, -0.059777038760109998),
            "two_gene": (8, 8),
        }.items()
    },
}  # fmt: skip


@pytest.mark.parametrize("case", KNOWN)
def test_known_final_states(case: str) -> None:
    build, x0, end, expected = KNOWN[case]
    solution = solve(build(), x0=x0, t_span=(0, end), rtol=1e-11, atol=1e-13)
    assert solution.success, solution.message
    np.testing.assert_allclose(solution.y[:, -1], expected, rtol=1e-8, atol=1e-8)


def test_thermostat_switches_at_the_times_of_its_exponentials() -> None:
    heat = 10 * math.log((38 - 22) / (38 - 23.5))
    cool = 10 * math.log((23.5 - 18) / (22 - 18))
    first = 10 * math.log((38 - 15) / (38 - 23.5))
    times = [e.t for e in solution_of("thermostat").events]
    assert times[:4] == pytest.approx(
        [first, first + cool, first + cool + heat, first + 2 * cool + heat], rel=1e-10
    )


def test_static_friction_on_a_belt_has_the_closed_period() -> None:
    """Stick until k x = Fs, slip about Fc/k until v = vb again: 5 + 3.902605407814523."""
    entries = [e.t for e in solution_of("belt_static").events if e.after == (0,)]
    assert np.diff(entries)[1:] == pytest.approx(8.902605407814523, rel=1e-9)


@pytest.mark.parametrize("name", ["hunting_switch", "hunting_karnopp"])
def test_band_models_tend_to_the_inclusion(name: str) -> None:
    exact = solution_of("hunting").y[:, -1]
    model = models.get(name)
    errors = []
    for width in (1e-3, 1e-4, 1e-6):
        solution = run(model.build(width), model, 1e-10)
        assert solution.success, solution.message
        errors.append(np.max(np.abs(solution.y[:, -1] - exact)))
    assert errors[0] > errors[1] > errors[2]
    assert errors[2] < 1e-5
