"""Marks and jumps of figures: labels that do not stand on one another, impacts as jumps."""

import matplotlib.pyplot as plt
import numpy as np

from filippov import Surface, System, cos, states, t
from filippov.analysis import find_orbit
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
