"""Reading a solution: outputs, expressions with their signs, segments by mode, tables, notebooks."""

import pickle
from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")

import numpy as np
import pytest
import sympy
from matplotlib import pyplot as plt

from filippov import (
    Band,
    Heaviside,
    Max,
    ModelError,
    Parameter,
    Piecewise,
    Solution,
    Surface,
    System,
    UsageError,
    parameters,
    sign,
    solve,
    states,
)  # fmt: skip
from filippov.analysis.comparisons.comparison_result import Comparison
from filippov.analysis.local_stability.stability import StabilityReport
from filippov.app.cli.main import main
from filippov.model.symbolic import Select
from filippov.models import registry

x, v = states("x v")
p = parameters(k=Parameter(1, "N/m"), mu=Parameter(0.2, "N"))
FRICTION = p.mu * sign(v)
OUTPUTS = {
    "friction": FRICTION,
    "turned": 3 * sign(-v),
    "chosen": Piecewise((1, v > 0), (-2, True)),
    "half": Heaviside(v),
    "largest": Max(v, 0) + abs(v),
    "elsewhere": sign(x - p.mu),
}
LABELS = {"t": "time [s]", "x": "position [m]", "friction": "friction [N]"}
OSCILLATOR = System({x: v, v: -p.k * x - FRICTION}, outputs=OUTPUTS, labels=LABELS)


@pytest.fixture(scope="module")
def motion() -> Solution:
    """Turns at pi and 2 pi, sticks at 3 pi in x = 0.1: there mu s = -0.1."""
    return solve(OSCILLATOR, (1.1, 0), (0, 12))


def test_16_2_signs_in_stick_are_multipliers_in_the_sense_that_was_written(motion: Solution) -> None:
    slip, stick = np.array([1.0, 4.0]), 10.0
    assert motion.evaluate("friction", slip) == pytest.approx([-0.2, 0.2])
    expected = {"friction": -0.1, "turned": 1.5, "chosen": -1.25, "half": 0.25, "largest": 0, "elsewhere": -1}
    for name, value in expected.items():
        assert motion.evaluate(name, stick) == pytest.approx(value, abs=1e-8), name
    assert motion.evaluate("k*x + friction", stick) == pytest.approx(0, abs=1e-9)
    assert motion.evaluate(-2 * sign(-v) * p.mu, stick) == pytest.approx(-0.2, abs=1e-8)
    assert motion.evaluate("v", slip) == pytest.approx(motion.sol(slip)[1])
    entry = motion.events[-1].t
    assert [motion.evaluate(sign(v), entry, side=side) for side in "-+"] == pytest.approx([-1, -0.5])
    assert motion.evaluate("sign(v)", np.array([[1.0], [4.0]])).tolist() == [[-1.0], [1.0]]


def test_16_2_values_at_the_times_of_the_solution(motion: Solution) -> None:
    assert np.array_equal(motion.evaluate("friction"), motion["friction"])
    assert np.array_equal(motion.evaluate("x + v"), motion.y[0] + motion.y[1])
    assert np.array_equal(motion.multiplier("v"), motion.multiplier("v", motion.t))
    assert np.array_equal(motion["x"], motion.y[0])
    assert np.array_equal(motion[v], motion.y[1])
    assert np.array_equal(motion["t"], motion.t)
    assert motion["friction"] == pytest.approx(motion.evaluate(FRICTION, motion.t))
    again = pickle.loads(pickle.dumps(motion))  # noqa: S301
    assert np.array_equal(again["friction"], motion["friction"])
    assert again.segments.surfaces == ("v",)


def test_16_2_jumps_have_a_value_before_and_after() -> None:
    """A ball falls from 1 with g = 2: it is on the ground at t = 1 with v = -2, then 1."""
    y, w = states("y w")
    fall = System({y: w, w: -2}, surfaces=[Surface("floor", y, reset={w: -w / 2})], outputs={"speed": abs(w)})
    run = solve(fall, (1, 0), (0, 1.5))
    at = np.flatnonzero(np.isclose(run.t, 1.0, atol=1e-12))
    assert run["speed"][at] == pytest.approx([2, 1])
    assert [run.evaluate("w", run.jumps[0], side=side) for side in "-+"] == pytest.approx([-2, 1])
    assert run.events.count("floor", "reset") == 1


def _written(system: System, f: Any) -> Any:
    """An equation as a user would write it, with signs of the switching functions."""
    form = system.symbolic
    assert form is not None
    values: dict[Any, Any] = {}
    for s, a, h in zip(form.s, form.a, form.plain_h(), strict=True):
        values |= {s: sympy.sign(h), a: sympy.Abs(h)}

    def branch(c: Any, plus: Any, minus: Any) -> Any:
        return sympy.Piecewise((plus, c.args[0] > 0), (minus, True))

    return f.xreplace(values).replace(Select, branch)


@pytest.mark.parametrize("name", ["hunting_static", "two_blocks", "relay", "twisting", "threshold_harvest"])
def test_16_2_a_right_hand_side_read_is_the_rate_of_the_motion(name: str) -> None:
    """In every mode, also where several surfaces slide, d/dt of the dense output is what is evaluated."""
    model = registry.get(name)
    system = model.build()
    run = solve(system, model.x0, model.t_span, rtol=1e-11, zeno="continue", nonunique="stick")
    form = system.symbolic
    assert form is not None
    assert run.sol is not None
    shown: set[Any] = set()
    for segment in run.segments:
        if segment.mode in shown or segment.dwell < 1e-6:
            continue
        shown.add(segment.mode)
        t = segment.t0 + 0.437 * (segment.t1 - segment.t0)
        found = [run.evaluate(_written(system, f), t) for f in form.field]
        rate = run.sol.rate(t)
        assert found == pytest.approx(rate, rel=1e-5, abs=1e-5 * (1 + np.max(np.abs(rate)))), segment
    assert any(0 in mode for mode in shown) == any(0 in segment.mode for segment in run.segments)


def test_16_2_a_comparator_stands_for_the_sign_in_outputs_too() -> None:
    """In the band the friction balances the spring up to the acceleration of the creep."""
    width = 1e-3
    run = solve(OSCILLATOR.with_comparator(Band(width)), (1.1, 0), (0, 12))
    inside = run.evaluate("v", 11.5) / width
    assert abs(inside) < 1
    assert run.evaluate("friction", 11.5) == pytest.approx(0.2 * inside, abs=1e-12)
    assert run.evaluate("chosen", 11.5) == pytest.approx(-0.5 + 1.5 * inside, abs=1e-12)


def test_16_2_systems_of_functions_have_functions_as_outputs() -> None:
    system = System(
        field=lambda t, y, q, s: [y[1], -y[0] - 0.2 * s[0]],
        surfaces=[Surface("v", lambda t, y, q: y[1])],
        states="x v",
        outputs={"friction": lambda t, y, q, s: 0.2 * s[0]},
    )
    run = solve(system, (1.1, 0), (0, 12))
    assert run.evaluate("friction", [1.0, 4.0, 10.0]) == pytest.approx([-0.2, 0.2, -0.1])
    assert run.evaluate(lambda t, y, q, s: y[0] + t, 10.0) == pytest.approx(10.1)
    with pytest.raises(UsageError, match="made of functions"):
        run.evaluate("x + v", 1.0)
    with pytest.raises(ModelError, match=r"f\(t, x, p, s\)"):
        System(field=lambda *_: [0.0], states="x", outputs={"a": x})


def test_16_2_segments_by_mode(motion: Solution) -> None:
    stick, slip = motion.segments.of("stick"), motion.segments.of("slip")
    assert stick.durations == pytest.approx([12 - 3 * np.pi])
    assert slip.durations == pytest.approx([np.pi] * 3)
    assert motion.segments.of("-").durations == pytest.approx([np.pi] * 2)
    assert motion.segments.of("sliding", surface="v") == stick
    assert len(motion.segments.of("*")) == 4
    for wrong in ("stik", "+-", ""):
        with pytest.raises(UsageError, match=r"mode is .* expected one of stick"):
            motion.segments.of(wrong)
    with pytest.raises(UsageError, match="unknown surface 'w'"):
        motion.segments.of("stick", surface="w")


def test_16_2_events_are_counted_and_unknown_names_refused(motion: Solution) -> None:
    assert motion.events.count("v") == 3
    assert motion.events.count(kind="crossing") == 2
    assert motion.events.count("-v", "crossing", 1) == motion.events.count("v", "crossing", -1) == 1
    assert motion.events.count(motion.events[0]) == 1
    for ask in (motion.events.of, motion.events.count, motion.events[:1].of):
        with pytest.raises(UsageError, match="unknown surface or event 'typo'; known: v"):
            ask("typo")
        with pytest.raises(UsageError, match="unknown kind of event 'cross'"):
            ask("v", "cross")
        with pytest.raises(UsageError, match="direction is 2"):
            ask("v", None, 2)


WRONG = {
    "unknown name 'effort'": lambda run: run["effort"],
    r"unknown name 'q'": lambda run: run.evaluate("x + q", 1.0),
    "unknown name 'w'": lambda run: run.evaluate(states("w")[0], 1.0),
    "outside the solved span": lambda run: run.evaluate("x", 99.0),
    "side is 'after'": lambda run: run.evaluate("x", 1.0, side="after"),
    "expected a file name that ends in .gif": lambda run: run.animate("film.avi"),
    "there is no folder": lambda run: run.animate("nowhere/film.gif"),
    "unknown state or output 'y'": lambda run: run.plot("y"),
}


@pytest.mark.parametrize("text", WRONG)
def test_16_2_what_cannot_be_read_is_named(text: str, motion: Solution) -> None:
    with pytest.raises((UsageError, ModelError), match=text):
        WRONG[text](motion)


def test_16_2_wrong_outputs_and_labels_are_refused() -> None:
    equations = {x: v, v: -p.k * x}
    for text, more in {
        "name of a state": {"outputs": {"x": v}},
        "both an output and a parameter": {"outputs": {"k": v}},
        "Python keyword": {"outputs": {"for": v}},
        "expected a dict": {"outputs": [v]},
        "is no state with an equation": {"outputs": {"a": states("w")[0]}},
        "Text is never parsed": {"outputs": {"a": "x + v"}},
        "unknown label 'y'": {"labels": {"y": "a"}},
        "expected texts by name": {"labels": {"x": 1}},
    }.items():
        with pytest.raises(ModelError, match=text):
            System(equations, **more)
    extra = System(equations, outputs={"work": p.mu * x})
    assert extra.parameters.names == ("k", "mu")


def test_16_2_outputs_and_labels_are_kept(motion: Solution, tmp_path: Path) -> None:
    loaded = Solution.load(motion.save(tmp_path / "run.npz"))
    assert loaded.system == motion.system
    assert loaded.system.labels == LABELS
    assert np.array_equal(loaded["chosen"], motion["chosen"])
    with pytest.raises(UsageError, match="unknown surface or event 'typo'"):
        loaded.events.of("typo")
    bare = System({x: v, v: -p.k * x - FRICTION})
    assert bare != OSCILLATOR
    assert bare.digest == OSCILLATOR.digest


def test_16_2_tables_of_pandas(motion: Solution) -> None:
    pytest.importorskip("pandas")
    table, events = motion.to_pandas(), motion.events.to_pandas()
    assert list(table.columns) == ["x", "v", *OUTPUTS]
    assert table["friction"].iloc[-1] == pytest.approx(-0.1)
    assert table.attrs["labels"] == LABELS
    assert events["x"].tolist() == pytest.approx([-0.7, 0.3, 0.1])
    assert events["kind"].tolist() == ["crossing", "crossing", "sliding entry"]


def test_16_2_what_a_notebook_shows(motion: Solution) -> None:
    hostile = System({x: -sign(x)}, surfaces=[Surface("<b>", x)])
    shown = solve(hostile, (0.5,), (0, 1))
    for text in (shown._repr_html_(), shown.events._repr_html_()):
        assert "&lt;b&gt;" in text
        assert "<b>" not in text
    assert "The end of t_span was reached." in motion._repr_html_()
    assert motion.events._repr_html_().count("<tr>") == 4
    equations = OSCILLATOR._repr_latex_()
    for part in (r"\dot{v} &= - k x - \mu \operatorname{sign}", r"\text{N/m}", r"\text{v: }& v = 0"):
        assert part in equations
    assert r"\dot x = f" in System(field=lambda *_: [0.0], states="x")._repr_latex_()


@pytest.mark.parametrize("report", [StabilityReport, Comparison])
def test_16_2_reports_are_shown_as_text(report: Any) -> None:
    told = type("Told", (report,), {"to_text": lambda self: "P < 1"})
    assert object.__new__(told)._repr_html_() == "<pre>P &lt; 1</pre>"


# A cell of a notebook, and how many pictures it shows.
CELLS = {
    "run.plot()": 1, "figure = run.plot()": 1, "figure": 1, "run.plot(); other = run.plot()": 2,
    "figure = run.plot(); display(figure)": 1,
    "from matplotlib import pyplot as plt; plt.plot([1, 2]);": 1, "plt.ion(); late = run.plot()": 1,
    "plt.close('all'); figure": 1, "import matplotlib as mpl": 0, "for _ in range(2): run.plot()": 2,
    "plt.plot([1, 2]);": 1,
}  # fmt: skip


@pytest.mark.parametrize("inline", ["%matplotlib inline", ""], ids=["asked for", "by default"])
def test_16_2_one_figure_a_cell(inline: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In a kernel as notebooks and the pages have it, with its own way of showing figures."""
    monkeypatch.delenv("MPLBACKEND", raising=False)  # what other tests have chosen
    import nbformat
    from nbclient import NotebookClient

    first = f"""{inline}
from filippov import System, sign, solve, states
x, v = states('x v')
run = solve(System({{x: v, v: -x - sign(v)}}), (5, 0), (0, 9))"""
    book = nbformat.v4.new_notebook(
        cells=[nbformat.v4.new_code_cell(source) for source in (first, *CELLS)]
    )
    NotebookClient(book, kernel_name="python3", resources={"metadata": {"path": str(tmp_path)}}).execute()
    shown = [[out for out in cell.outputs if "image/png" in out.get("data", {})] for cell in book.cells[1:]]
    assert dict(zip(CELLS, map(len, shown), strict=True)) == CELLS


def test_16_2_figures_show_outputs_and_units(motion: Solution) -> None:
    figure = motion.plot(["x", "v", "friction", "k*x + friction"])
    assert [ax.get_ylabel() for ax in figure.axes] == ["position [m]", "v", "friction [N]", "k*x + friction"]
    assert figure.axes[-1].get_xlabel() == "time [s]"
    t, drawn = figure.axes[2].lines[0].get_data()
    assert np.nanmin(np.abs(drawn[t > 9.5] + 0.1)) < 1e-8
    assert np.isnan(drawn).sum() == 3, "a gap at each jump"
    assert len(motion.plot().figure.axes) == 2 + len(OUTPUTS)
    plt.close("all")


def test_16_2_every_model_with_dimensions_names_its_axes() -> None:
    """A state of a model whose parameters have units has a label with one."""
    for name in ("hunting", "hunting_lugre", "belt", "two_blocks", "chain", "buck_pwm", "thermostat"):
        system = registry.get(name).build()
        assert set(system.labels) == {"t", *system.states}, name
        assert all("[" in text for text in system.labels.values())


def test_16_2_from_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model = tmp_path / "own.py"
    model.write_text(
        "from filippov import System, sign, states\nx, v = states('x v')\n"
        "s = System({x: v, v: -x - 0.2*sign(v)}, outputs={'friction': 0.2*sign(v)})\n"
    )
    words = ["simulate", f"{model}:s", "--x0", "1.1,0", "--t-span", "0", "12", "--points", "13", "--quiet"]
    assert main([*words, "--evaluate", "x + friction", "-o", str(tmp_path / "out")]) == 0
    rows = (tmp_path / "out" / "trajectory.csv").read_text().splitlines()
    assert rows[0] == "t,x,v,friction,x + friction"
    assert [float(cell) for cell in rows[-1].split(",")[3:]] == pytest.approx([-0.1, 0], abs=1e-8)
    for more, text in {
        ("--evaluate", "x + q"): "unknown name 'q'",
        ("--animate", "film.gif"): "give -o DIR",
        ("--animate", "film.avi", "-o", str(tmp_path)): "ends in .gif or .mp4",
    }.items():
        assert main([*words, *more]) == 2
        assert text in capsys.readouterr().err


def test_16_2_a_table_of_no_events_has_the_columns_of_one_with_some(motion: Solution) -> None:
    """Tables of several runs are put below each other, and read back from files that keep the kinds."""
    pandas = pytest.importorskip("pandas")
    none, some = motion.events.of("v", "grazing").to_pandas(), motion.events.to_pandas()
    assert len(none) == 0 < len(some)
    assert none.dtypes.to_dict() == some.dtypes.to_dict()
    assert pandas.concat([none, some]).dtypes.to_dict() == some.dtypes.to_dict()


def test_16_2_a_film(motion: Solution, tmp_path: Path) -> None:
    from PIL import Image

    path = motion.animate(tmp_path / "film.gif", "x", frames=3, seconds=1)
    with Image.open(path) as film:
        assert film.n_frames == 3
        dark = []
        for k in range(3):
            film.seek(k)
            dark.append(np.mean(np.array(film.convert("L"))[60:380] < 90, axis=0))  # of each column of pixels
    bars = [float(np.argmax(one - np.mean(dark, axis=0))) for one in dark]
    # The present moves evenly from one end of the axis to the other; each place is known to a pixel.
    assert bars[1] - bars[0] == pytest.approx(bars[2] - bars[1], abs=4.0)
    assert bars[2] - bars[0] > 300
    assert [file.name for file in tmp_path.iterdir()] == ["film.gif"]


def test_16_2_a_stay_on_one_of_several_surfaces_is_one_span() -> None:
    """Two masses apart, x'' = -x - mu sgn(x'): what one does cuts the segments of the other's stick."""
    y, w = states("y w")
    pair = System({x: v, v: -x - 0.2 * sign(v), y: w, w: -4 * y - 0.2 * sign(w)})
    run = solve(pair, (0.5, 0, 0.52, 0), (0, 12))
    rests = [np.pi, 5 * np.pi / 2]  # at -0.1; at -0.02, after five half periods that take 0.1 each
    assert len(run.segments.of("stick", "v")) > 1
    for surface, begin in zip(("v", "w"), rests, strict=True):
        assert run.segments.of("stick", surface).spans == pytest.approx(np.array([[begin, 12.0]]), abs=1e-7)
    assert run.segments.of("slip").spans == pytest.approx(np.array([[0, np.pi]]), abs=1e-7)
    assert run.segments.of("stick", "v").of("slip", "v").spans.shape == (0, 2)
