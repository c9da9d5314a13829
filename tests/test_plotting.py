"""Figures: what is drawn is where the solution says, and matplotlib is asked for only then."""

from __future__ import annotations

import itertools
import subprocess
import sys
from collections.abc import Iterator
from typing import Any

import matplotlib as mpl

mpl.use("Agg")

import numpy as np
import pytest
import sympy as sp
from matplotlib import pyplot as plt
from matplotlib.figure import Figure

from filippov.base.errors import UsageError
from filippov.graphs.graph import observed_graph, possible_graph
from filippov.model.signals.input import Input
from filippov.model.symbols import states, t
from filippov.model.system import System
from filippov.model.time_event import TimeEvent
from filippov.models.registry import get
from filippov.plot.solution import plot_graph, plot_phase, plot_solution
from filippov.solving.solution import Solution
from filippov.solving.solver import solve

x, v, z = states("x v z")


@pytest.fixture(autouse=True)
def _close() -> Iterator[None]:
    yield
    plt.close("all")


@pytest.fixture(scope="module")
def motion() -> Solution:
    """x'' = -x - sign(x')/2 from x = 2.2: turns at t = pi, sticks at t = 2 pi in x = 0.2."""
    return solve(System({x: v, v: -x - sp.sign(v) / 2}), (2.2, 0), (0, 10))


def drawn(ax: Any) -> list[Any]:
    return [line for line in ax.get_lines() if len(line.get_xdata()) > 8]


def marks(ax: Any, label: str) -> Any:
    return next(line for line in ax.get_lines() if line.get_label() == label)


def test_solution_has_one_panel_a_state(motion: Solution) -> None:
    figure = plot_solution(motion, labels={"t": "time [s]", "x": "position [m]"}, title="Coulomb")
    assert [ax.get_ylabel() for ax in figure.axes] == ["position [m]", "v"]
    assert figure.axes[-1].get_xlabel() == "time [s]"
    (line,) = drawn(figure.axes[0])
    times, values = line.get_data()
    # First half period: x = 1/2 + 1.7 cos t.
    first = times <= np.pi
    assert np.allclose(values[first], 0.5 + 1.7 * np.cos(times[first]), atol=1e-8)
    entry = marks(figure.axes[0], "sliding entry")
    assert entry.get_xdata() == pytest.approx([2 * np.pi], abs=1e-8)
    assert entry.get_ydata() == pytest.approx([0.2], abs=1e-8)
    (band,) = figure.axes[0].collections
    corners = np.asarray(band.get_paths()[0].vertices)
    assert corners[:, 0].min() == pytest.approx(2 * np.pi, abs=1e-8)
    assert corners[:, 0].max() == pytest.approx(10)
    assert figure.axes[0].get_xlim() == (0, 10)


def test_multiplier_panel(motion: Solution) -> None:
    """While sticking the friction balances the spring: s / 2 = -x, s = -0.4."""
    figure = plot_solution(motion, "x", multiplier="v", labels={"multiplier": "2 F"})
    assert [ax.get_ylabel() for ax in figure.axes] == ["x", "2 F"]
    line = max(figure.axes[1].get_lines(), key=lambda item: len(np.asarray(item.get_xdata())))
    times, values = (np.asarray(data) for data in line.get_data())
    assert np.allclose(values[times > 6.3], -0.4, atol=1e-7)
    assert np.all(values[times < np.pi - 1e-6] == -1)


def test_phase_portrait(motion: Solution) -> None:
    ends = [(-0.5, 0.0), (0.5, 0.0)]
    figure = plot_phase(motion, equilibrium=ends, labels={"v": "velocity [m/s]"})
    (ax,) = figure.axes
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("x", "velocity [m/s]")
    assert marks(ax, "equilibria").get_xydata().tolist() == [[-0.5, 0.0], [0.5, 0.0]]
    thick = marks(ax, "sliding")
    assert np.allclose(thick.get_xdata(), 0.2, atol=1e-8)
    assert np.all(np.asarray(thick.get_ydata()) == thick.get_ydata()[0])
    assert marks(ax, "start").get_xydata().tolist() == [[2.2, 0.0]]
    swapped = plot_phase(motion, "v", "x", equilibrium=ends[0])
    assert marks(swapped.axes[0], "equilibria").get_xydata().tolist() == [[0.0, -0.5]]


def test_own_figure_is_used_and_style_is_put_back(motion: Solution) -> None:
    before = dict(mpl.rcParams)
    own = Figure()
    assert plot_solution(motion, figure=own) is own
    assert plot_phase(motion, figure=Figure()).axes
    assert motion.plot() is not own
    assert dict(mpl.rcParams) == before


def test_without_dense_output_and_without_extent() -> None:
    system = System({x: v, v: -x - sp.sign(v) / 2})
    coarse = solve(system, (2.2, 0), (0, 10), dense_output=False)
    figure = plot_solution(coarse)
    assert np.isin(
        coarse.events.t, np.concatenate([line.get_xdata() for line in figure.axes[0].get_lines()])
    ).all()
    plot_phase(coarse)
    plot_solution(solve(system, (2.2, 0), (1, 1)))
    plot_solution(solve(System({x: -x}), (1,), (0, -1), backward=True))


def test_wrong_names_are_refused(motion: Solution) -> None:
    with pytest.raises(UsageError, match="unknown state 'w'"):
        plot_solution(motion, ["w"])
    with pytest.raises(UsageError, match="unknown label 'y'"):
        plot_solution(motion, labels={"y": "m"})
    with pytest.raises(UsageError, match="unknown surface 'w'"):
        plot_solution(motion, multiplier="w")
    with pytest.raises(UsageError, match="needs two states"):
        plot_phase(solve(System({x: -x}), (1,), (0, 1)))
    with pytest.raises(UsageError, match="rows of 2 states"):
        plot_phase(motion, equilibrium=[[1, 2, 3]])
    with pytest.raises(UsageError, match="points is 1"):
        plot_solution(motion, points=1)


def texts(ax: Any) -> list[str]:
    return [text.get_text() for text in ax.texts]


def test_graph_shows_every_mode_and_guard() -> None:
    graph = possible_graph(System({x: v, v: -x - sp.sign(v) / 2, z: x + sp.cos(t)}))
    figure = plot_graph(graph, names={"0": "stick"}, title="oscillator")
    left, right = figure.axes
    assert {"stick (0)", "+", "-"} <= set(texts(left))
    lines = texts(right)
    for a, b, values in graph.edges(data=True):
        assert f"{a} → {b}   {values['formula']}" in lines
    assert len(left.patches) == graph.number_of_edges()
    figure.canvas.draw()


def test_graph_without_list_and_of_many_surfaces(motion: Solution) -> None:
    figure = plot_graph(observed_graph(motion), guards=False)
    (ax,) = figure.axes
    assert any(text.startswith("+\n1 ×") for text in texts(ax))
    names = states("a b c d")
    four = System({q: -sp.sign(q) + sp.cos(t) / 2 for q in names})
    plot_graph(possible_graph(four, "++++", limit=5)).canvas.draw()
    three = System({q: -sp.sign(q) + 2 * sp.cos(t) for q in names[:3]})
    places = plot_graph(possible_graph(three)).axes[0].texts
    assert len({tuple(np.round(text.get_position(), 6)) for text in places}) == len(places)
    plot_graph(possible_graph(System({x: -x}))).canvas.draw()
    with pytest.raises(UsageError, match="no modes"):
        plot_graph(observed_graph(motion).subgraph([]))


def test_without_matplotlib_the_extra_is_named(motion: Solution, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(ImportError, match=r"pip install filippov\[plots\]"):
        plot_solution(motion)


def test_importing_the_package_does_not_import_matplotlib() -> None:
    code = "import sys, filippov, filippov.plot.solution; print('matplotlib' in sys.modules)"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout.strip() == "False"


def test_16_jumps_stand_upright_within_a_segment() -> None:
    """A ramp that a clock sets back without a change of mode: from 1 to 0 at the instant, every period."""
    r, u = states("r u")
    clock = TimeEvent("clock", period=0.3, reset={r: 0})
    run = solve(System({r: sp.Rational(10, 3), u: -sp.sign(u - 9)}, time_events=[clock]), (0, 0), (0, 2))
    drawn = plot_solution(run, points=37)
    t_line, r_line = drawn.axes[0].lines[0].get_data()
    for instant in run.jumps:
        at = np.flatnonzero(np.asarray(t_line) == instant)
        assert np.asarray(r_line)[at] == pytest.approx([1, 0], abs=1e-9)
    assert len(run.jumps) == 6
    assert np.all(np.diff(t_line) >= 0)


def test_16_many_states_and_sliding_sets_fit_into_a_picture() -> None:
    """The first states only, and a row for each sliding surface; what is asked for is drawn."""
    names = states([f"v{i}" for i in range(14)])
    run = solve(System({u: -sp.sign(u) for u in names}), np.linspace(0.1, 1.4, 14), (0, 2))
    drawn = plot_solution(run, title="many")
    *panels, strip = drawn.axes
    assert [ax.get_ylabel() for ax in panels] == [f"v{i}" for i in range(12)]
    assert [text.get_text() for text in strip.get_yticklabels()] == [f"v{i}" for i in range(14)]
    assert "the first 12 of 14" in drawn.axes[0].get_title(loc="left")
    legend = drawn.axes[0].get_legend()
    assert legend is not None
    assert next(text.get_text() for text in legend.get_texts()) == "sliding on its own surface"
    # v' = -sign(v) from v0 = (i + 1)/10 slides from that time on.
    for i, (ax, bars) in enumerate(zip(panels, strip.collections, strict=False)):
        for band in (*ax.collections, bars):
            times = np.concatenate([path.vertices[:, 0] for path in band.get_paths()])
            assert [times.min(), times.max()] == pytest.approx([(i + 1) / 10, 2], abs=1e-8)
        (entry,) = [line for line in ax.get_lines() if line.get_marker() == "v"]
        assert entry.get_xdata() == pytest.approx([(i + 1) / 10], abs=1e-8)
    assert len(plot_solution(run, ["v0", "v13"]).axes) == 3
    plt.close("all")


def test_a_panel_shows_the_surfaces_of_its_own_state() -> None:
    """Two blocks that do not touch stop at times of their own: v' = -1 from 1, w' = -2 from 4."""
    a, b, u = states("a b u")
    rates = {a: v, v: -sp.sign(v), b: u, u: -2 * sp.sign(u), z: sp.cos(t)}
    system = System(rates, outputs={"force": -sp.sign(v), "sum": v + u})
    run = solve(system, (0, 1, 0, 4, 0), (0, 3))
    figure = plot_solution(run)
    stops = {"a": 1, "v": 1, "force": 1, "b": 2, "u": 2}
    assert [ax.get_ylabel() for ax in figure.axes] == ["a", "v", "b", "u", "z", "force", "sum"]
    for ax in figure.axes:
        stop = stops.get(ax.get_ylabel())
        edges = [float(np.min(band.get_paths()[0].vertices[:, 0])) for band in ax.collections]
        assert edges == pytest.approx([] if stop is None else [stop], abs=1e-8)
        if ax.get_ylabel() in system.states:
            entries = [line.get_xdata() for line in ax.get_lines() if line.get_marker() == "v"]
            assert np.ravel(entries) == pytest.approx([] if stop is None else [stop], abs=1e-8)
    legend = figure.axes[0].get_legend()
    assert legend is not None
    said = [text.get_text() for text in legend.get_texts()]
    assert said == ["sliding on v", "sliding on u", "sliding entry"]
    # A surface that no panel belongs to is in a row below.
    *panels, strip = plot_solution(run, ["a", "z"]).axes
    assert [ax.get_ylabel() for ax in panels] == ["a", "z"]
    assert [text.get_text() for text in strip.get_yticklabels()] == ["v", "u"]
    plt.close("all")


@pytest.mark.parametrize("name", ["woodpecker", "hunting_lugre", "drill_string", "violin"])
@pytest.mark.parametrize("draw", [plot_solution, plot_phase])
def test_labels_and_numbers_do_not_run_into_each_other(name, draw):
    model = get(name)
    start, end = model.t_span
    figure = draw(solve(model.build(), model.x0, (start, start + (end - start) / 4)))
    figure.canvas.draw()
    beside = [ax.yaxis.label.get_window_extent() for ax in figure.axes]
    assert not any(a.overlaps(b) for a, b in itertools.pairwise(beside))
    for ax in figure.axes:
        low, high = ax.get_xlim()
        ticks = zip(ax.get_xticks(), ax.get_xticklabels(), strict=False)
        below = [text.get_window_extent() for x, text in ticks if low <= x <= high and text.get_text()]
        assert not any(a.overlaps(b) for a, b in itertools.pairwise(below))


def drawn_counts(ax: Any) -> int:
    return sum(int(text.get_text()) for text in ax.texts if text.get_text().isdigit())


def test_a_large_possible_graph_is_drawn_in_groups() -> None:
    """Five relays side by side: every mode stands in the group of the surfaces that it slides on."""
    many = System({q: -sp.sign(q) for q in states("x0 x1 x2 x3 x4")})
    graph = possible_graph(many, limit=243)
    assert len(graph) > 40
    (ax,) = plot_graph(graph).axes
    said = [text.get_text() for text in ax.texts if "mode" in text.get_text()]
    sizes = [sum(mode.count("0") == k for mode in graph) for k in range(6)]
    assert said == [f"{k} slide{'s' * (k == 1)}\n{n} mode{'s' * (n > 1)}" for k, n in enumerate(sizes)]
    assert drawn_counts(ax) == graph.number_of_edges()
    assert ax.get_title(loc="left").startswith(f"{len(graph)} modes by how many of 5")


def test_of_a_large_observed_graph_the_modes_entered_most_often_stand_alone() -> None:
    """Six oscillators of different periods; of the others is drawn where they are entered and left."""
    rows: dict[Any, Any] = {}
    names = states("a b c d e f"), states("u0 u1 u2 u3 u4 u5")
    for k, (q, u) in enumerate(zip(*names, strict=True)):
        rows |= {q: u, u: -(1 + 0.7 * k) * q - 0.02 * sp.sign(u)}
    graph = observed_graph(solve(System(rows), [1.0, 0.3] * 6, (0, 30)))
    assert len(graph) > 40
    (ax,) = plot_graph(graph).axes
    visits = sorted((data["visits"] for _, data in graph.nodes(data=True)), reverse=True)
    texts = [text.get_text() for text in ax.texts]
    alone = [mode for mode in graph if any(text.split("\n")[0] == mode for text in texts)]
    assert sorted((graph.nodes[mode]["visits"] for mode in alone), reverse=True) == visits[:10]
    assert f"{len(graph) - 10} other modes" in texts
    edges = graph.edges(data=True)
    seen = sum(data["count"] for a, b, data in edges if a in alone or b in alone)
    assert drawn_counts(ax) == seen
    ax.figure.canvas.draw()
    boxes = [t.get_bbox_patch().get_window_extent() for t in ax.texts if not t.get_text().isdigit()]
    assert not any(a.overlaps(b) for k, a in enumerate(boxes) for b in boxes[:k])
    plt.close("all")


def test_work_on_a_graph_is_told_and_limited() -> None:
    q, w = states("q w")
    relays = System({q: -sp.sign(q), w: -sp.sign(w)})
    done = []
    graph = possible_graph(relays, "++", limit=3, progress=lambda k, of: done.append((k, of)))
    assert [k for k, _ in done] == [1, 2, 3]
    assert all(k <= of <= 3 for k, of in done)
    assert graph.graph["complete"] is False


@pytest.mark.parametrize("period", [None, 4.0])
def test_an_output_has_a_gap_where_an_input_jumps(period: float | None) -> None:
    """u = r - x with x' = u, no surface there: r goes from 1 to 2 at t = 1 and t = 2 is none of its jumps."""
    (x,) = states(["x"])
    r = Input("r", [0.0, 1.0, 4.0], [1.0, 2.0, 1.0], kind="hold", outside="hold", period=period)
    run = solve(System({x: r - x}, outputs={"u": r - x}), (0.0,), (0.0, 6.0))
    (line,) = [line for line in plot_solution(run, ["u"]).axes[0].lines if line.get_color() == "#d55e00"]
    t, u = line.get_data()
    gaps = [float(t[k]) for k in np.flatnonzero(np.isnan(u))]
    assert gaps == pytest.approx([1.0, 4.0, *([5.0] if period else [])])
    first = (t < 1.0) & np.isfinite(u)
    assert np.max(np.abs(u[first] - np.exp(-t[first]))) < 1e-6
    assert u[int(np.flatnonzero(np.isnan(u))[0]) + 1] == pytest.approx(1 + np.exp(-1.0), abs=1e-6)
