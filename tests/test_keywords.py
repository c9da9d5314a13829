"""The keywords of what solves: typed, one list for all, with the words of scipy and MATLAB answered."""

import inspect
import itertools
from dataclasses import fields
from pathlib import Path
from typing import Any, get_args, get_type_hints

import numpy as np
import pytest

from filippov import Problem, Sweep, System, UsageError, sign, solve, solve_many, states
from filippov.analysis.maps.section import Section
from filippov.analysis.sensitivity.lyapunov import lyapunov
from filippov.app.cli.main import main
from filippov.kernel.codegen.interpreted import BACKENDS
from filippov.kernel.tables.layout import RULES
from filippov.models.registry import SectionData
from filippov.solving.state import option_types
from filippov.solving.state.options import METHODS, Options

x, v = states("x v")
OSCILLATOR = System({x: v, v: -x - 0.1 * sign(v)})
DEFAULTS = {f.name: None if f.name == "atol" else f.default for f in fields(Options)}
# What has no meaning for ends and tables.
LESS = {
    solve: set(),
    solve_many: {"max_time", "on_graze", "dense_output", "save_events", "backend", "dt", "theta"},
    Sweep: {"max_time", "dense_output", "save_events", "compile", "backend", "dt", "theta"},
}


@pytest.mark.parametrize("call", LESS, ids=lambda call: call.__name__)
def test_16_1_signatures_hold_every_option_with_its_default(call: Any) -> None:
    """No **options: completion and help list what can be given."""
    held = inspect.signature(call).parameters
    assert all(q.kind not in (q.VAR_KEYWORD, q.VAR_POSITIONAL) for q in held.values())
    options = {name: q.default for name, q in held.items() if name in DEFAULTS}
    assert options == {name: value for name, value in DEFAULTS.items() if name not in LESS[call]}
    assert all(q.annotation != "Any" for name, q in held.items() if name in DEFAULTS)


def test_16_1_types_hold_every_option_and_every_word() -> None:
    """The types of completion and the checks at run time are of one list."""
    assert set(get_type_hints(option_types.RunOptions)) == set(DEFAULTS)
    assert set(get_args(option_types.MethodName)) == {*METHODS, "RK45"}
    assert set(get_args(option_types.SlidingRule)) == set(RULES)
    assert set(get_args(option_types.Backend)) == set(BACKENDS)
    words = {"on_graze": option_types.OnGraze, "zeno": option_types.OnZeno, "save_events": option_types.Kept}
    for name, kind in {**words, "simultaneous": option_types.Together}.items():
        for word in get_args(kind):
            assert getattr(Options(**{name: word}), name) == word
        with pytest.raises(UsageError, match=f"unknown value of {name}"):
            Options(**{name: "other"})
    for call in (Problem, Problem.remake):
        assert all(q.kind is not q.VAR_KEYWORD for q in inspect.signature(call).parameters.values())


def test_16_1_the_words_of_scipy_mean_the_same() -> None:
    """Closed form: x = 0.9 cos t + 0.1 until it turns at pi."""
    problem = Problem(OSCILLATOR, y0=(1, 0), t_span=(0, 3))  # type: ignore[call-arg]
    for solution in (
        solve(problem),
        solve(OSCILLATOR, y0=(1, 0), t_span=(0, 3)),  # type: ignore[call-overload]
        solve(OSCILLATOR, (1, 0), (0, 3), method="RK45", rtol=1e-10, max_step=0.1, first_step=0.01),
        solve(OSCILLATOR, (1, 0), (0, 3), t_eval=[1.0, 3.0], dense_output=True),
    ):
        assert solution.x_end[0] == pytest.approx(0.9 * np.cos(3) + 0.1, abs=1e-8)
    many = solve_many(OSCILLATOR, y0=[(1, 0)], t_span=(0, 3))  # type: ignore[call-arg]
    assert many.x[0, 0] == pytest.approx(0.9 * np.cos(3) + 0.1, abs=1e-8)
    assert solve(problem.remake(y0=(0, 0))).x_end[0] == 0  # type: ignore[call-arg]


OTHERS = {
    "args": "parameters={'m': 2.0}", "fun": "first argument", "jac": "not needed", "vectorized": "solve_many",
    "RelTol": "rtol=1e-9", "AbsTol": "atol=", "MaxStep": "max_step", "InitialStep": "first_step",
    "params": "parameters=", "parameter": "did you mean 'parameters'", "toll": "did you mean",
    "events_": "did you mean 'events'", "Method": "did you mean 'method'", "dt": "max_step",
    "min_step": "not needed", "width": "with_comparator", "hmax": "max_step", "tol": "rtol",
}  # fmt: skip


@pytest.mark.parametrize("name", OTHERS)
def test_16_1_other_words_are_answered_with_the_equivalent(name: str) -> None:
    """Each message says what to write instead, wherever the keyword is given."""
    for call in (solve, solve_many, Problem):
        if call is solve or name not in ("toll", "events_", "Method"):
            with pytest.raises(UsageError) as caught:
                call(OSCILLATOR, (1, 0), (0, 1), **{name: 1})  # type: ignore[operator]
            assert name in str(caught.value)
            assert OTHERS[name] in str(caught.value)


@pytest.mark.parametrize("name", ["BDF", "LSODA", "RK23", "ode45", "ode15s", "ode23", "ode113", "rk4", 5])
def test_16_1_other_methods_are_answered_with_the_equivalent(name: Any) -> None:
    with pytest.raises(UsageError, match=r"(?s)DP5|Radau|DOP853") as caught:
        solve(OSCILLATOR, (1, 0), (0, 1), method=name)
    assert repr(name) in str(caught.value)


def test_16_1_values_in_order_and_missing_ones() -> None:
    calls = {
        r"at most 3 \(system, x0, t_span\).*by name": lambda: solve(OSCILLATOR, (1, 0), (0, 1), "RK45"),
        "solve needs system": solve,
        "Problem needs x0, t_span": lambda: Problem(OSCILLATOR),
        "y0 and x0 mean the same": lambda: solve(OSCILLATOR, (1, 0), (0, 1), y0=(1, 0)),
        "an option of the run": lambda: Problem(OSCILLATOR, (1, 0), (0, 1), rtol=1e-3),
        "solve_many keeps the ends only": lambda: solve_many(OSCILLATOR, [(1, 0)], (0, 1), t_eval=[1]),
        "need nonunique='branch'": lambda: solve(OSCILLATOR, (1, 0), (0, 1), max_depth=3),
    }
    for text, call in calls.items():
        with pytest.raises(UsageError, match=text):
            call()


def test_16_1_a_run_backwards_says_so() -> None:
    """In message and summary, and only then."""
    there = solve(OSCILLATOR, (1, 0), (0, 2))
    back = solve(OSCILLATOR, there.x_end, (2, 0), backward=True, rtol=1e-11)
    assert back.x_end == pytest.approx([1, 0], abs=1e-8)
    assert "ran backwards in time, from t = 2 to t = 0." in back.message
    assert "backwards from 2" in repr(back)
    assert "backwards" not in there.message + repr(there)


def test_16_1_options_at_their_defaults_are_no_options() -> None:
    """A sweep with a default spelled out is the sweep without it: its stored points are found again."""
    problem = Problem(OSCILLATOR, (1, 0), (0, 1))
    plain = Sweep(problem, {"x0.x": [1.0]})
    assert Sweep(problem, {"x0.x": [1.0]}, zeno="stop", max_step=float("inf")).fields == plain.fields
    changed = [{"zeno": "continue"}, {"rtol": 1e-8}, {"atol": 1e-12}, {"atol": [1e-12, 1e-9]}]
    for one, other in itertools.combinations([{}, *changed], 2):
        first, second = (Sweep(problem, {"x0.x": [1.0]}, **given).fields for given in (one, other))
        assert first != second


# -- earlier names of keywords --------------------------------------------------------------------------


def test_13_7_a_section_takes_its_parametrisation_under_the_earlier_name() -> None:
    start = {"x": "d", "v": 0}
    now = Section("v", "crossing", "x", parametrisation=start)
    assert Section("v", "crossing", "x", lift=start) == now  # type: ignore[call-arg]
    assert now.lift == start
    assert SectionData("v", "crossing", "x", lift=start, interval=(0, 1)).parametrisation == start  # type: ignore[call-arg]
    with pytest.raises(UsageError, match="lift and parametrisation mean the same"):
        Section("v", "crossing", "x", start, lift=start)  # type: ignore[call-arg]


def test_13_7_the_interval_of_exponents_has_its_earlier_name() -> None:
    """x' = -x/2: the exponent is -1/2."""
    found = lyapunov(System({x: -x / 2}), (1.0,), 20.0, stretch=1.0)  # type: ignore[call-arg]
    assert found.exponents == pytest.approx([-0.5], abs=1e-8)


@pytest.mark.parametrize(
    "words", [("--stretch", "4e-4"), ("--interval", "4e-4"), ()], ids=["earlier", "present", "file"]
)
def test_13_7_flags_and_files_take_earlier_names(
    words: tuple[str, ...], tmp_path: Path
) -> None:
    """Over ten periods of a converter: a decomposition each, of which the first only turns the basis."""
    file = tmp_path / "chaos.toml"
    file.write_text("duration = 4e-3\n" + ("" if words else "stretch = 4e-4\n"), encoding="utf-8")
    command = ["lyapunov", "buck_pwm", "-p", "Vin=20", "--config", str(file), *words]
    assert main([*command, "-o", str(tmp_path)]) == 0
    assert len((tmp_path / "exponents.csv").read_text(encoding="utf-8").splitlines()) == 1 + 9


def test_13_7_both_names_at_once_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["lyapunov", "buck_pwm", "--duration", "1", "--stretch", "1", "--interval", "1"]
    assert main([*words, "-o", str(tmp_path)]) == 2
    assert "'stretch' and 'interval' mean the same" in capsys.readouterr().err
