"""The explorer: its settings and links, what its figures hold, its files, its server; without a browser."""

import base64
import csv
import io
import json
import math
import re
import subprocess
import sys
from contextlib import suppress
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from filippov import Parameter, Smooth, Surface, System, parameters, sign, solve, states
from filippov.analysis import EventMap, Section
from filippov.app import Explorer
from filippov.app.cli.main import main
from filippov.app.explorer.field import slider_range
from filippov.app.explorer.look import packed
from filippov.app.explorer.pictures import draw, draw_diagram
from filippov.app.explorer.solutions import PostponedError
from filippov.app.explorer.view import LONGEST, View
from filippov.base.errors import UsageError
from filippov.models import registry

ROOT = Path(__file__).resolve().parent.parent
Q = math.pi / 2


def block() -> System:
    """x'' = -x - k sign(x'), x(0) = 3, x'(0) = 0: half turns of pi, each 2k nearer, until |x| <= k."""
    x, v = states("x v")
    p = parameters(k=Parameter(0.4, "N", lower=0.0, upper=5.0, description="friction <b>"))
    return System(
        {x: v, v: -x - p.k * sign(v)}, parameters=p, labels={"x": "position [m]"},
        outputs={"force": -x, "friction": p.k * sign(v)},
        surfaces=[Surface("v", v), Surface("wall", x - 2, kind="observer")],
    )  # fmt: skip


SECTION = Section("v", "crossing", "x", {"x": "d", "v": "0"})
MODEL = Explorer(block(), (3, 0), (0, 12), section=SECTION, interval=(0.5, 4.0), name="a <block>")


def trace(figure: dict[str, Any], name: str) -> dict[str, Any]:
    return next(item for item in figure["data"] if item["name"] == name)


def row(values: Any) -> np.ndarray:
    return np.array([math.nan if value is None else value for value in values], dtype=float)


# -- settings and links --------------------------------------------------------------------------------------

NUMBERS = st.floats(-1e300, 1e300, allow_nan=False)


@given(
    NUMBERS, NUMBERS, st.floats(0, 5), st.floats(1e-9, 1e3), st.sampled_from(["Exact", "Smooth", "Switch"])
)
def test_16_8_a_link_restores_the_view(x: float, v: float, k: float, width: float, against: str) -> None:
    values = {"x0.x": x, "x0.v": v, "p.k": k, "width": width, "against": against, "y": "x", "order": 3}
    view = View(MODEL.subject, values)
    again = View.from_query(MODEL.subject, "http://127.0.0.1:1/?" + view.query)
    assert again.values == view.values
    assert again.query == view.query
    assert View.from_query(MODEL.subject, "").query == ""


@pytest.mark.parametrize(
    ("query", "said"),
    [
        ("p.K=3", "did you mean 'p.k'"), ("p.k=9", r"outside its bounds \[0, 5\]"), ("p.k=nan", "finite"),
        ("p.k=__import__('os')", "expected a number"), ("p.k=1_0", "expected a number"), ("p.k=", "nothing"),
        ("x0.x=1e999", "finite"), ("t0=5&t1=2", "expected t0 < t1"), ("against=Smoth", "Smooth"),
        ("width=0", "> 0"), ("order=1.5", "whole number"), ("order=99", "1 to 8"),
        ("p.k=1&p.k=2", "more than once"),
        ("p.k", "name=value"), ("p.k=" + "1" * LONGEST, "characters"), ("x=<script>", "unknown choice"),
        ("low=3&high=1", "low < high"), ("&".join(f"a{i}=1" for i in range(300)), "name=value"),
        ("p.k=" + "1" * 65, "expected a number"),
    ],
)  # fmt: skip
def test_16_8_a_wrong_link_is_refused_by_name(query: str, said: str) -> None:
    with pytest.raises(UsageError, match=said):
        View.from_query(MODEL.subject, query)


@given(st.text(max_size=60))
def test_16_8_no_text_after_the_question_mark_is_more_than_refused(text: str) -> None:
    with suppress(UsageError):
        assert View.from_query(MODEL.subject, text).values == View(MODEL.subject).values


@given(st.floats(-1e6, 1e6), st.one_of(st.none(), st.floats(0, 1e6)), st.one_of(st.none(), st.floats(0, 1e6)))
@example(100000.4140625, 0.0, 6.103515625e-05)
@example(5e-324, None, 0.0)
@example(5e-324, 5e-324, None)
@example(1.6, 1.0, None)
def test_16_8_a_slider_keeps_within_the_bounds(
    value: float, below: float | None, above: float | None
) -> None:
    lower, upper = (None if below is None else value - below), (None if above is None else value + above)
    parameter = Parameter(value, lower=lower, upper=upper)
    found = slider_range(parameter, value)
    if found is None:
        assert lower is not None
        assert upper is not None
        assert upper - lower < 1e-6 * max(1.0, abs(value))
        return
    low, high, step = found
    assert low < high
    assert 2 <= round((high - low) / step) <= 201
    for end in (low, high):
        parameter.check(end, "an end")


def test_16_8_changes_by_keyword() -> None:
    assert MODEL.query(k=0.4, x0=(3, 0)) == MODEL.query() == ""
    assert MODEL.query({"p.k": 0.7}, x0={"v": 1}, t1=8) == "p.k=0.7&x0.v=1.0&t1=8.0"
    p = parameters(width=2.0)
    twins = Explorer(System({states("x")[0]: 0 * p.width}, parameters=p))
    assert twins.view({"p.width": 3, "width": 5}).parameters == {"width": 3.0}
    with pytest.raises(UsageError, match="a parameter and a setting"):
        twins.view(width=3)
    with pytest.raises(UsageError, match="did you mean 'k'"):
        MODEL.view(K=1)


# -- figures -------------------------------------------------------------------------------------------------


def test_16_8_figures_hold_the_closed_form() -> None:
    """x = (3 - k) cos t + k until pi, then the centre is at -k; v = 0 at every pi until it sticks."""
    figures = MODEL.figures(k=0.4, t1=9)
    curve = trace(figures["time"], "exact")
    t, x = row(curve["x"]), row(curve["y"])
    turns = np.minimum(t // math.pi, 2)
    centre, reach = np.where(turns % 2 == 0, 0.4, -0.4), 3 - 0.8 * turns - 0.4
    np.testing.assert_allclose(x, centre + reach * np.cos(t), atol=1e-8)
    force = next(item for item in figures["time"]["data"] if item["yaxis"] == "y3")
    np.testing.assert_allclose(row(force["y"]), -np.interp(row(force["x"]), t, x), atol=1e-3)
    bands = {shape["name"]: shape["path"].count("M") for shape in figures["time"]["layout"]["shapes"]}
    # v < 0 in the first and third half turn; the wall at 2 is passed in the first.
    assert bands == {"mode -+": 1, "mode --": 2, "mode +-": 1}
    assert figures["time"]["layout"]["yaxis"]["title"]["text"] == "position [m]"
    lines = {item["name"]: item for item in figures["phase"]["data"] if item["type"] == "contour"}
    assert set(lines) == {"v = 0", "wall = 0"}
    height = np.array(lines["wall = 0"]["z"], dtype=float)
    np.testing.assert_allclose(
        height, np.tile(row(lines["wall = 0"]["x"]) - 2, (height.shape[0], 1)), atol=1e-12
    )


def test_16_8_the_map_and_the_diagram_hold_the_closed_form() -> None:
    """R(d) = -(d - 2k) for d > 3k, one crossing later; nothing returns from where it sticks, |R(d)| <= k."""
    found = MODEL.solutions.map(MODEL.view(k=0.4, d=4.0))
    assert found is not None
    known = np.isfinite(found.image) & (found.d > 1.2)
    assert np.all(known == (found.d > 1.2))
    np.testing.assert_allclose(found.image[known], 0.8 - found.d[known], atol=1e-8)
    figures = MODEL.figures(k=0.4, d=4.0)
    cobweb = trace(figures["map"], "cobweb")
    np.testing.assert_allclose(row(cobweb["x"])[:4], [4.0, 4.0, -3.2, -3.2], atol=1e-8)
    assert figures["diagram"]["data"][0]["name"] == "here"
    assert trace(figures["diagram"], "here")["x"] == []


def test_16_8_a_section_is_found_along_the_motion_and_holds_the_closed_form(tmp_path: Path) -> None:
    """The wheel: w -> cos(2a) sqrt(w^2 + 4 sin(slope) sin(a)) from spoke to spoke (McGeer)."""
    made = Explorer(registry.get("rimless_wheel"))
    assert made.subject.section == Section("next spoke", "reset", "w", t_max=made.subject.section.t_max)
    assert "d" not in made.start.values

    def after(w: Any, slope: float) -> Any:
        return math.cos(0.6) * np.sqrt(w**2 + 4 * math.sin(slope) * math.sin(0.3))

    found = made.solutions.map(made.view(order=2))
    assert len(found.d) == 72 - 2
    np.testing.assert_allclose(found.image, after(after(found.d, 0.1), 0.1), rtol=1e-7)
    figures = made.figures(over="slope", low=0.08, high=0.3, order=1)
    cobweb = trace(figures["map"], "cobweb")
    np.testing.assert_allclose(row(cobweb["y"])[2::2], after(row(cobweb["x"])[1:-1:2], 0.1), rtol=1e-7)
    assert len(trace(figures["map"], "R(d) along the solution")["x"]) == 35
    values, d = made.solutions.diagram(made.view(over="slope", low=0.08, high=0.3))
    for slope, iterates in zip(values[::10], d[::10], strict=True):
        # To the first spoke from x0 = (-0.2, 0.8), then one after the other.
        w = math.cos(0.6) * math.sqrt(0.8**2 + 2 * (math.cos(0.2) - math.cos(slope + 0.3)))
        exact = [w := w if k == 0 else float(after(w, slope)) for k in range(36)]
        np.testing.assert_allclose(iterates, exact[24:], rtol=1e-7)
    here = trace(figures["diagram"], "here")
    np.testing.assert_allclose(
        here["y"], math.sqrt(4 * math.sin(0.1) * math.sin(0.3)) / math.tan(0.6), rtol=1e-3
    )
    made.export(tmp_path)
    assert "returns(system, section, x0, 24" in (tmp_path / "view.py").read_text()
    assert float((tmp_path / "map.csv").read_text().split("\n")[1].split(",")[0]) == pytest.approx(found.d[0])


def test_16_2_the_film_is_where_the_solution_is() -> None:
    """Half turns about -k and k from x = 3, then rest: in closed form."""
    played = draw(MODEL.solutions, {}).film
    assert played is not None
    t, x, v = (np.array(played[key]) for key in "txy")
    assert t[0] == 0
    assert t[-1] == 12
    assert np.all(np.diff(t) >= 0)
    turns = np.minimum(np.floor(t / math.pi), 3)
    size, centre = 3 - 0.8 * turns - 0.4, np.where(turns % 2 == 0, 0.4, -0.4)
    moved = centre + np.where(turns % 2 == 0, 1, -1) * size * np.cos(t - turns * math.pi)
    assert np.allclose(x, moved, atol=1e-7)
    assert np.allclose(v, -np.where(turns % 2 == 0, 1, -1) * size * np.sin(t - turns * math.pi), atol=1e-7)
    # The sign of v is the first of a mode; the wall at x = 2 is passed on the way.
    signs = [next(stay) for _, stay in groupby(played["modes"], key=lambda mode: mode[1][5])]
    assert [text[5] for _, text in signs] == ["-", "+", "-", "+"]
    assert np.allclose([time for time, _ in signs], np.arange(4) * math.pi)
    assert len(played["modes"]) == 5
    json.dumps(played, allow_nan=False)


def test_16_8_a_diagram_makes_way_for_a_redraw() -> None:
    held = MODEL.solutions.hurry
    held.set()
    try:
        with pytest.raises(PostponedError):
            draw_diagram(MODEL.solutions, {"p.k": 0.123, "order": 2})
    finally:
        held.clear()
    assert draw_diagram(MODEL.solutions, {"p.k": 0.123, "order": 2}) is not None


def test_16_8_sliding_arcs_are_thick_and_the_graph_counts_transitions() -> None:
    figures = MODEL.figures(k=2.0, t1=6)
    # From 3 to 1 in pi; there |x| <= k, so it sticks.
    assert trace(figures["phase"], "sliding")["line"]["width"] > 3
    slid = row(trace(figures["phase"], "sliding")["x"])
    np.testing.assert_allclose(slid[np.isfinite(slid)], 1.0, atol=1e-8)
    assert "sliding entry" in [item.get("name") for item in figures["graph"]["data"]]
    boxes = [item for item in figures["graph"]["data"] if item.get("marker", {}).get("symbol") == "square"]
    assert len(boxes) == 1
    # A crossing passes the box of the mode between its two modes, and its number stands on the far side.
    there = figures["graph"]["data"]
    for arc in (item for item in there if item.get("name") == "crossing"):
        x, y = row(arc["x"]), row(arc["y"])
        near = np.hypot(x - boxes[0]["x"][0], y - boxes[0]["y"][0])
        assert np.min(near) > 0.5
        assert arc["textposition"] == ("top center" if np.mean(y) > boxes[0]["y"][0] else "bottom center")


def test_16_8_the_map_has_a_letter_that_the_model_does_not_use() -> None:
    """R for return; in a converter R is its load."""
    for name, letter in (("hunting", "R"), ("buck_hysteresis", "M")):
        shown = Explorer(registry.get(name))
        drawn = shown.figures()["map"]
        shown.close()
        assert drawn["layout"]["yaxis"]["title"]["text"] == f"{letter}(d): one return later"
        assert any(item["name"].startswith(f"{letter}(d)") for item in drawn["data"])


def test_16_8_a_comparator_stands_beside_the_exact_motion() -> None:
    drawn = draw(MODEL.solutions, {"p.k": 2.0, "against": "Smooth", "width": 0.1, "t1": 6})
    exact, smooth = (trace(drawn.figures["time"], name) for name in ("exact", "Smooth"))
    other = solve(block().with_comparator(Smooth(0.1)), (3, 0), (0, 6), parameters={"k": 2.0})
    assert row(smooth["y"])[-1] == pytest.approx(other["x"][-1], abs=1e-7)
    assert row(exact["y"])[-1] == pytest.approx(1.0, abs=1e-8)
    assert drawn.good


def test_16_8_numbers_go_to_the_browser_as_they_are() -> None:
    values = [0.1 * k if k % 7 else None for k in range(100)]
    sent = packed({"data": [{"x": values, "z": [[1.0] * 40]}], "layout": {"shapes": [], "range": [0, 1]}})
    assert sent["data"][0]["z"] == [[1.0] * 40]
    held = np.frombuffer(base64.b64decode(sent["data"][0]["x"]["bdata"]), dtype="<f8")
    np.testing.assert_array_equal(held, row(values))


@pytest.mark.parametrize("kind", ["Smooth", "Switch", "Karnopp"])
def test_16_8_outputs_are_those_of_the_comparator(kind: str) -> None:
    """What is read as friction is what the equation v' = -x - friction has, between the events."""
    view = MODEL.view({"against": kind, "width": 0.1, "p.k": 0.6, "t1": 11})
    other = MODEL.solutions.other(view)
    assert other is not None
    assert other.sol is not None
    t = np.linspace(0.1, 10.9, 300)
    t = t[[min((abs(e.t - each) for e in other.events), default=1) > 1e-4 for each in t]]
    rate = (other.sol(t + 1e-6)[1] - other.sol(t - 1e-6)[1]) / 2e-6
    read = other.evaluate("friction", t)
    np.testing.assert_allclose(rate, -other.sol(t)[0] - read, atol=2e-5)
    assert np.ptp(read) > 1


def test_16_8_a_comparator_that_does_not_fit_is_told_of() -> None:
    x, v = states("x v")
    loose = Explorer(System({x: -sign(x + v), v: -v}), (1, 1), (0, 2))
    drawn = draw(loose.solutions, {"against": "Karnopp"})
    assert "No Karnopp beside it" in drawn.said
    assert drawn.good


# -- faults --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"p.k": None}, "p.k: nothing was given"), ({"x0.x": "a"}, "expected a number"),
        ({"t1": 1e9}, "Ended early"), ({"p.k": -1}, "outside its bounds"), ({"no": 1}, "unknown setting"),
    ],
)  # fmt: skip
def test_16_8_what_is_wrong_is_said_on_the_page(values: dict[str, Any], said: str) -> None:
    drawn = draw(MODEL.solutions, {"p.k": 0.0, **values})
    assert said in drawn.said
    assert not drawn.good
    assert bool(drawn.figures) == ("Not redrawn" not in drawn.said)


def test_16_8_a_function_that_fails_is_told_of() -> None:
    def field(t: float, x: Any, p: Any, s: Any) -> list[float]:
        if p.k > 1:
            raise KeyError("no such row")
        return [x[1], -x[0] - p.k * s[0]]

    plain = System(
        field=field, surfaces=[Surface("v", lambda t, x, p: x[1])], states="x v", parameters={"k": 0.5}
    )
    made = Explorer(plain, (1, 0), (0, 4))
    good = draw(made.solutions, {})
    assert good.good
    assert {item["name"] for item in good.figures["phase"]["data"]} >= {"v = 0", "exact"}
    bad = draw(made.solutions, {"p.k": 2})
    assert "no such row" in bad.said
    assert not bad.good
    assert draw_diagram(made.solutions, {}) is None


def test_16_8_a_wrong_subject_is_refused() -> None:
    with pytest.raises(UsageError, match="expected a System"):
        Explorer("hunting")
    with pytest.raises(UsageError, match="interval is None"):
        Explorer(block(), (3, 0), (0, 1), section=SECTION)
    with pytest.raises(UsageError, match=r"t_span is \(1, 0\)|backward"):
        Explorer(block(), (3, 0), (1, 0))


# -- files ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["hunting", "a file"])
def test_16_8_the_script_makes_the_data_again(name: str, tmp_path: Path) -> None:
    if name == "a file":
        MODEL.export(tmp_path, k=0.8, against="Smooth")
    else:
        assert main(["explore", name, "-p", "P=20", "-o", str(tmp_path), "--quiet"]) == 0
    written = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    assert written["solution.png"].startswith(b"\x89PNG")
    code = "import sys; sys.path.insert(0, sys.argv[1]); import runpy; runpy.run_path('view.py')"
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code, str(ROOT)], cwd=tmp_path, capture_output=True, text=True,
        timeout=120, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    old, new = (list(csv.reader(io.StringIO(text.decode()))) for text in (
        written["solution.csv"], (tmp_path / "solution.csv").read_bytes()))  # fmt: skip
    assert old[0] == new[0]
    assert [[float(v) for v in line] for line in old[1:]] == [[float(v) for v in line] for line in new[1:]]


def test_16_8_the_command_takes_its_flags_into_the_link(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["explore", "hunting", "-p", "P=20", "--x0", "x=0.2", "--t-span", "0", "5", "--view", "?p.m=1.1"]
    assert main([*words, "-o", str(tmp_path), "--json", "--quiet"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["query"] == "p.m=1.1&p.P=20.0&x0.x=0.2&t1=5.0"
    model = registry.get("hunting")
    exact = solve(model.build(), (0.2, 0, 0), (0, 5), parameters={"P": 20, "m": 1.1})
    assert told["x_end"] == dict(zip("xvz", exact.x_end.tolist(), strict=True))
    rows = list(csv.DictReader(io.StringIO((tmp_path / "map.csv").read_text())))
    event_map = EventMap(model.build(), Section.from_model(model), parameters={"P": 20, "m": 1.1})
    for line in rows[10::40]:
        assert float(line["R"]) == pytest.approx(event_map(float(line["d"])), abs=1e-6)
    assert main(["explore", "hunting", "--view", "p.Q=1"]) == 2
    assert "did you mean" in capsys.readouterr().err


# -- the server ----------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def client() -> Any:
    pytest.importorskip("dash")
    from filippov.app.explorer.server import application

    return application(MODEL.solutions, MODEL.view(k=0.8)).server.test_client()


def test_16_8_the_page_names_no_other_machine(client: Any) -> None:
    answer = client.get("/", headers={"Host": "127.0.0.1"})
    assert answer.status_code == 200
    assert not re.findall(r"(?:src|href)=.https?:", answer.text)
    assert answer.headers["Content-Security-Policy"].startswith("default-src 'self'")
    layout = client.get("/_dash-layout", headers={"Host": "127.0.0.1"}).text
    assert (
        "a <block>" in json.loads(layout)["props"]["children"][1]["props"]["children"][0]["props"]["children"]
    )
    assert client.get("/", headers={"Host": "evil.example"}).status_code == 403


def test_16_8_files_by_link(client: Any) -> None:
    here = {"Host": "localhost:80"}
    answer = client.get("/export/solution.csv?p.k=2.0&t1=6", headers=here)
    assert float(answer.text.splitlines()[-1].split(",")[1]) == pytest.approx(1.0, abs=1e-8)
    assert client.get("/export/map.csv?p.k=9", headers=here).status_code == 400
    assert "root:" not in client.get("/export/../../etc/passwd", headers=here).text
    assert client.get("/export/secrets", headers=here).status_code == 404


def test_16_8_redraw_through_the_server(client: Any) -> None:
    held = {item.id: item.default for item in MODEL.start.fields.values()} | {"p-k": 2.0}
    here = {"Host": "127.0.0.1"}
    body = {"settings": held, "search": "?p.k=99"}
    made = client.post("/redraw", json=body, headers=here).json
    assert "Solved to t = 12" in made["said"]
    assert made["good"]
    assert made["query"] == "p.k=2.0"
    assert set(made["figures"]) == {"time", "phase", "graph", "map"}
    held["p-k"] = 0.4
    made = client.post("/redraw", json=body, headers=here).json
    assert "The link was not taken: p.k" in made["said"]
    assert not made["good"]
    swept = client.post("/diagram", json=body, headers=here).json
    assert [trace["name"] for trace in swept["data"]] == ["here", "iterates"]
    for wrong in ({}, [], {"settings": 3}):
        assert client.post("/redraw", json=wrong, headers=here).status_code == 400
    assert client.post("/redraw", json=body, headers={"Host": "evil.example"}).status_code == 403
