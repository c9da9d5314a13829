"""Figures of maps and diagrams: what is drawn is what the objects hold."""

from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import matplotlib as mpl
import numpy as np
import pytest

from filippov.base.errors import UsageError
from filippov.plot.maps import plot_diagram, plot_event_map, plot_iterates
from filippov.plot.place import label_beside
from filippov.plot.style import log_ticks, new_figure, panel_label, style

mpl.use("Agg")


@pytest.fixture(autouse=True)
def closed() -> Iterator[None]:
    yield
    from matplotlib import pyplot as plt

    plt.close("all")


class Halving:
    """R(d) = d/2 below 0.5 and d/2 - 0.4 above it; no return beyond 0.9."""

    def __call__(self, d: Any) -> Any:
        values = np.asarray(d, dtype=float)
        return np.where(values > 0.9, np.nan, values / 2 - 0.4 * (values > 0.5))

    def iterate(self, d: float, n: int) -> np.ndarray:
        return d / 2.0 ** np.arange(n + 1)


def point(d: float, kind: str = "limit cycle", stable: bool = True) -> SimpleNamespace:
    return SimpleNamespace(d=d, kind=kind, stable=stable, verdict="stable" if stable else "unstable")


def line(figure: Any, label: str) -> Any:
    (found,) = (entry for entry in figure.axes[0].lines if entry.get_label() == label)
    return found


def test_a_map_is_drawn_with_gaps_at_jumps_and_where_it_has_no_value() -> None:
    at_rest = point(0.0, "equilibrium set")
    drawn = plot_event_map(Halving(), 0.0, 1.0, points=101, fixed=[at_rest], orbit=[0.4, 0.2, 0.1])
    x, y = line(drawn, "R(d)").get_data()
    inside = np.isfinite(y)
    assert np.allclose(y[inside], Halving()(x[inside]))
    assert np.nanmax(x[inside]) == pytest.approx(0.9)
    gap = np.flatnonzero(np.isnan(x))
    assert len(gap) == 1
    assert x[gap[0] - 1] <= 0.5 < x[gap[0] + 1]
    assert np.array_equal(line(drawn, "orbit").get_data(), [[0.4, 0.2], [0.2, 0.1]])
    assert line(drawn, "stable equilibrium set").get_marker() == "s"


def test_samples_are_used_where_they_are_given() -> None:
    def never(d: Any) -> Any:
        raise AssertionError(d)

    drawn = plot_event_map(never, 0, 1, samples=([0, 0.5, 1], [1, 2, 3]), labels={"P": "next"})
    assert drawn.axes[0].get_ylabel() == "next"  # "P" is the earlier name of "image"
    assert np.array_equal(line(drawn, "R(d)").get_ydata(), [1, 2, 3])


def test_a_cobweb_goes_from_the_map_to_the_diagonal_and_back() -> None:
    x, y = line(plot_iterates(Halving(), 0.4, 3), "3 iterates").get_data()
    assert np.allclose(x, [0.4, 0.4, 0.2, 0.2, 0.1, 0.1, 0.05])
    assert np.allclose(y, [0.4, 0.2, 0.2, 0.1, 0.1, 0.05, 0.05])


def test_a_diagram_marks_kind_and_stability() -> None:
    diagram = SimpleNamespace(
        parameter="P", values=(1.0, 2.0), folds=[(1.5, 0.2)], stability_changes=[1.7],
        points=((point(0.0, "equilibrium set"), point(0.1, stable=False), point(0.3)),
                (point(0.0, "equilibrium set", stable=False),)),
        branches=[SimpleNamespace(values=(1.0, 2.0), d=np.array([0.3, 0.2]), stable=np.array([True, False]))],
        special=[SimpleNamespace(kind="period doubling", value=1.2, d=0.25)],
    )  # fmt: skip
    drawn = plot_diagram(diagram, bounds={"Routh-Hurwitz": 29.0}, labels={"parameter": "gain"})
    assert np.array_equal(line(drawn, "stable cycle").get_data(), [[1.0], [0.3]])
    assert line(drawn, "unstable cycle").get_markerfacecolor() == "white"
    assert np.array_equal(line(drawn, "unstable equilibrium set").get_data(), [[2.0], [0.0]])
    assert np.array_equal(line(drawn, "fold").get_data(), [[1.5], [0.2]])
    assert np.array_equal(line(drawn, "Routh-Hurwitz 29").get_xdata(), [29.0, 29.0])
    assert np.array_equal(line(drawn, "period doubling").get_data(), [[1.2], [0.25]])
    assert drawn.axes[0].get_xlabel() == "gain"


def test_wrong_arguments_are_refused() -> None:
    with pytest.raises(UsageError, match="expected lo < hi"):
        plot_event_map(Halving(), 1, 0)
    with pytest.raises(UsageError, match="n is 0, expected a whole number of at least 1"):
        plot_iterates(Halving(), 0.4, 0)
    with pytest.raises(UsageError, match="did you mean 'd'"):
        plot_event_map(Halving(), 0, 1, labels={"D": "x"})


def test_16_10_a_label_lies_on_no_line_and_on_no_other_label() -> None:
    with style():
        figure = new_figure(5.0, 4.0)
        ax = figure.subplots()
        x = np.linspace(0, 1, 200)
        for rise in (0.0, 0.3, 0.6):
            ax.plot(x, 0.5 + rise * (x - 0.5))
        for word in ("21.015", "26.6019"):
            label_beside(ax, 0.5, 0.5, word, "black")
        figure.draw_without_rendering()
        boxes = [text.get_window_extent() for text in ax.texts]
    for box in boxes:
        for entry in ax.lines:
            assert not any(box.contains(*p) for p in entry.get_transform().transform(entry.get_xydata()))
    assert not boxes[0].overlaps(boxes[1])


def test_16_10_small_cycles_are_magnified_in_an_inset() -> None:
    diagram = SimpleNamespace(
        parameter="P", values=(1.0, 2.0), folds=[], stability_changes=[2.1], special=[], branches=[],
        points=((point(0.3),), (point(0.001),)),
    )  # fmt: skip
    (inner,) = plot_diagram(diagram, inset=True).axes[0].child_axes
    low, high = inner.get_xlim()
    assert 1.5 < low < 2.0
    assert 2.1 < high < 2.5
    assert 0.001 < inner.get_ylim()[1] < 0.002
    assert not plot_diagram(diagram).axes[0].child_axes
    # A line across the diagram does not run through it, nor through its labels.
    drawn = plot_diagram(diagram, inset=True, bounds={"Routh-Hurwitz": 1.9})
    (ax,) = drawn.axes
    drawn.draw_without_rendering()
    box = ax.child_axes[0].get_tightbbox()
    assert box.x1 < ax.transData.transform((1.9, 0.0))[0]


def test_a_steep_map_has_no_gap_and_a_jump_has_one() -> None:
    """tanh(2000 (d - 0.3)) rises by 2 within 0.004, a step of 399 points; sign(d - 0.3) jumps there."""
    for function, gaps in ((lambda d: np.tanh(2000 * (d - 0.3)), 0), (lambda d: np.sign(d - 0.3), 1)):
        figure = plot_event_map(function, 0.0, 1.0)
        d, image = line(figure, "R(d)").get_data()
        assert np.count_nonzero(np.isnan(image)) == gaps
        here = np.isfinite(image)
        assert np.max(np.abs(image[here] - function(np.asarray(d)[here]))) < 1e-12


def test_log_axes_have_two_numbers() -> None:
    """From 1,800 to 40,000 there is one power of ten: 2,000, 5,000 and 20,000 are numbered as well."""
    with style():
        ax = new_figure(4, 3).subplots()
        ax.loglog([1800, 40000], [1e-9, 1e-2])
        log_ticks(ax.xaxis)
        log_ticks(ax.yaxis)
        ax.figure.canvas.draw()
    inside = [t.get_text() for t in ax.get_xticklabels(which="both") if 1800 <= t.get_position()[0] <= 40000]
    assert sorted(map(float, filter(None, inside))) == [2000, 5000, 10000, 20000]
    assert not any(tick.get_text() for tick in ax.get_yticklabels(minor=True))


def test_long_labels_of_low_panels_have_two_lines() -> None:
    assert panel_label("integral part of the effort") == "integral part\nof the effort"
    assert panel_label("position of the slider [m]") == "position of the slider\n[m]"
    assert panel_label("velocity v [m/s]") == "velocity v [m/s]"
