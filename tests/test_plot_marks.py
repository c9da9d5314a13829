"""Marks and jumps of figures: labels that do not stand on one another, impacts as jumps."""

import matplotlib.pyplot as plt
import numpy as np

from filippov import Surface, System, cos, parameters, sign, solve, states, t
from filippov.analysis import continuation, find_orbit
from filippov.plot import plot_graph
from filippov.plot.place import label_beside


def test_labels_of_points_that_are_close_stand_apart() -> None:
    figure, ax = plt.subplots()
    ax.plot([0, 1, 0.5], [0, 1, 0.2])
    for k in range(6):
        label_beside(ax, 1.0 + 1e-6 * k, 1.0, f"{1.0 + 1e-5 * k:.6g}", "black")
    label_beside(ax, 1.0, 1.0, "1", "black")
    figure.draw_without_rendering()
    boxes = [label.get_window_extent() for label in ax.texts]
    assert len(boxes) == 6
    assert not any(a.overlaps(b) for k, a in enumerate(boxes) for b in boxes[:k])


def test_an_impact_of_an_orbit_is_a_jump() -> None:
    """Every line goes over the impact at one instant, from the speed before to that after."""
    x, v = states("x v")
    stop = Surface("stop", x - 1, reset={v: -0.5 * v}, side="-")
    orbit = find_orbit(System({x: v, v: -x - 0.4 * v + 4 * cos(2 * t)}, surfaces=[stop]), (0, 0))
    (impact,) = orbit.events
    line = max(orbit.plot(states=["v"]).axes[0].lines, key=lambda line: len(line.get_xdata()))
    at = np.flatnonzero(np.asarray(line.get_xdata()) == impact.t)
    assert len(at) == 2
    np.testing.assert_allclose(np.asarray(line.get_ydata())[at], [impact.x[1], -0.5 * impact.x[1]], rtol=1e-9)


def test_the_legend_keeps_clear_of_the_power_of_ten_of_an_axis() -> None:
    x, v = states("x v")
    figure = solve(System({x: v, v: -x - 2e-10 * sign(v)}), (1.1e-9, 0), (0, 12)).plot()
    figure.draw_without_rendering()
    ax = figure.axes[0]
    power = ax.yaxis.get_offset_text()
    assert power.get_text()
    assert not power.get_window_extent().overlaps(ax.get_legend().get_window_extent())


def test_the_legend_of_a_graph_keeps_clear_of_its_edges() -> None:
    x, v, y, w = states("x v y w")
    rub = 0.3 * sign(v - w)
    pull = (rub - 0.5 * sign(w) + 1.5 * cos(0.9 * t)) / 2
    masses = System({x: v, v: 4 * (y - x) - rub, y: w, w: 2 * x - 4 * y + pull})
    figure = plot_graph(solve(masses, (0.5, 0, 0, 0.1), (0, 20)).mode_graph())
    figure.draw_without_rendering()
    ax = next(ax for ax in figure.axes if ax.get_legend() is not None)
    legend = ax.get_legend().get_window_extent()
    assert not any(text.get_window_extent().overlaps(legend) for text in ax.texts)


def test_a_branch_is_drawn_over_what_varies() -> None:
    """Not over the period that the force gives: x'' + 0.4 x' + x = a cos 2t has amplitudes like a."""
    x, v = states("x v")
    p = parameters(a=1.0)
    system = System({x: v, v: -x - 0.4 * v + p.a * cos(2 * t)})
    run = continuation(system, find_orbit(system, (0, 0)), parameter="a", bounds=(1.0, 2.0), max_points=5)
    run.run()
    (line,) = run.branch.plot().axes[0].lines
    values, heights = np.asarray(line.get_xdata(), float), np.asarray(line.get_ydata(), float)
    np.testing.assert_allclose(heights / values, 1 / np.hypot(3, 0.8), rtol=1e-8)
