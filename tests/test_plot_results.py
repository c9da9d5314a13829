"""Figures of what is no result of theirs: what was given, what was expected, what to write."""

import matplotlib.pyplot as plt
import numpy as np
import pytest

import filippov.plot
from filippov import System, UsageError, sign, solve, states

x, v = states("x v")
OSCILLATOR = System({x: v, v: -x - 0.3 * sign(v)})
SOLUTION = solve(OSCILLATOR, (1.0, 0.0), (0.0, 3.0))
WRONG = {
    "text": "pendulum", "None": None, "number": 3, "System": OSCILLATOR, "list": [OSCILLATOR],
    "array": np.zeros(3), "class": System, "dict": {}, "Problem": SOLUTION.problem,
}  # fmt: skip
# What the second place is filled with, where there is one.
REST = {"plot_event_map": (0.0, 1.0), "plot_iterates": (0.1,), "plot_identification": (lambda v, values: v,)}


@pytest.mark.parametrize("name", filippov.plot.__all__)
@pytest.mark.parametrize("given", WRONG)
def test_another_kind_is_refused_with_what_was_expected(name, given):
    drawn = plt.get_fignums()
    with pytest.raises(UsageError, match=r"expected a|expected what|there is no"):
        getattr(filippov.plot, name)(WRONG[given], *REST.get(name, ()))
    assert plt.get_fignums() == drawn


@pytest.mark.parametrize("name", sorted({*filippov.plot.__all__} - {"plot_solution", "plot_phase"}))
def test_a_solution_is_no_result_of_an_analysis(name):
    with pytest.raises(UsageError, match="expected"):
        getattr(filippov.plot, name)(SOLUTION, *REST.get(name, ()))


def test_what_to_write():
    cases = {
        r"plot_orbit\(find_orbit\(...\)\)": lambda: filippov.plot.plot_orbit(OSCILLATOR),
        r"plot_graph\(observed_graph\(solution\)\)": lambda: filippov.plot.plot_graph(SOLUTION),
        r"A Solution has a figure of its own: write .plot\(\)": lambda: filippov.plot.plot_regions(SOLUTION),
        r"what solve\(system, x0, t_span\) returns": lambda: filippov.plot.plot_phase(OSCILLATOR),
        r"figure is 'a' \(str\), expected a Figure": lambda: SOLUTION.plot(figure="a"),
    }
    for said, wrong in cases.items():
        with pytest.raises(UsageError, match=said):
            wrong()


def test_a_figure_is_told_from_its_axes():
    figure = plt.figure()
    with pytest.raises(UsageError, match="axes are made in it"):
        SOLUTION.plot(figure=figure.subplots())
    assert SOLUTION.plot(figure=plt.figure().subfigures(1, 2)[0]).axes
    plt.close("all")


def test_one_or_several():
    one = type("Branch", (), {"parameter": "P", "points": [], "plot": None})()
    with pytest.raises(UsageError, match=r"a Branch, expected a list .* Write plot_branches\(\[result\]\)"):
        filippov.plot.plot_branches(one)
    orbit = type("Orbit", (), {"system": None, "pieces": (), "period": 1.0, "word": ""})()
    with pytest.raises(UsageError, match=r"a list of Orbit, .* plot_orbit\(results\[0\]\)"):
        filippov.plot.plot_orbit([orbit])
