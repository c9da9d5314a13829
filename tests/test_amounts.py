"""Amounts beyond what a memory holds are refused by name, in Python and at the command line."""

import contextlib
import io
from collections.abc import Callable

import pytest

from filippov import Problem, Sweep, System, UsageError, sign, solve, states
from filippov.analysis import attractors, find_orbit, regions, returns, tune
from filippov.analysis.maps.section import Section
from filippov.app.cli.main import main

X, V = states("x v")
DRY = System({X: V, V: -X - 0.5 * sign(V)})
BOX = {"x": (-1, 1), "v": (-1, 1)}
CUT = Section("v", kind="sliding entry", coordinate="x")
HUGE = 10**18


@pytest.mark.parametrize(
    ("name", "call"),
    [
        ("samples", lambda: attractors(DRY, BOX, samples=HUGE)),
        ("resolution", lambda: attractors(DRY, BOX, plane=("x", "v"), resolution=HUGE)),
        ("count", lambda: returns(DRY, CUT, (1, 0), HUGE)),
        ("nodes", lambda: find_orbit(DRY, (1, 0), nodes=HUGE)),
        ("points", lambda: solve(DRY, (1, 0), (0, 1)).plot(points=HUGE)),
        ("samples", lambda: tune(DRY, CUT, {"a": (0, 1)}, (0, 1), samples=HUGE)),
        ("points", lambda: regions(DRY, CUT, ("a", (0, 1)), ("b", (0, 1)), (0, 1), points=HUGE)),
    ],
)  # fmt: skip
def test_amounts_are_bounded(name: str, call: Callable[[], object]) -> None:
    with pytest.raises(UsageError, match=rf"{name} is 10{{18}}, expected a whole number from \d to 1"):
        call()


@pytest.mark.parametrize("samples", ["sobol", "latin_hypercube"])
def test_points_of_a_sweep_are_bounded(samples: str) -> None:
    run = Problem(DRY, (1, 0), (0, 1))
    with pytest.raises(UsageError, match=r"n is 10{18}, expected at most 50000000: make several sweeps"):
        Sweep(run, over={"x0.x": (0, 1)}, measure="end", samples=samples, n=HUGE)


def test_what_is_beyond_all_numbers_is_said_so() -> None:
    with pytest.raises(UsageError, match="from 1 to 9223372036854775807"):
        solve(DRY, (1, 0), (0, 1), max_events=10**30)


@pytest.mark.parametrize("command", ["sweep", "bifurcation", "regions"])
def test_ranges_at_the_command_line_are_bounded(command: str) -> None:
    said = io.StringIO()
    with contextlib.redirect_stderr(said):
        assert main([command, "hunting", "--over", "P=5:60:1e18", "-o", "unused"]) == 2
    assert "P is '1e18', expected a whole number from 1 to 100000000." in said.getvalue()
