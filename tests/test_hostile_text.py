"""Names that were made to act (escapes, tags, formulas, commands of LaTeX) through every output."""

import csv
import html.parser
import io
import json
import os
import random
import re
import unicodedata
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path

import networkx as nx
import numpy as np
import pytest
from command import strict
from hypothesis import given
from hypothesis import strategies as st

from filippov import Problem, Solution, Surface, Sweep, System, UsageError
from filippov.app.bank.compare import SolverTable, solvers_text
from filippov.app.bank.reference.row import SolverRow
from filippov.app.bank.row import Row, rows_text
from filippov.app.cli.main import main
from filippov.app.cli.outputs import Outputs
from filippov.app.cli.sweep import FILES
from filippov.app.report.page import document
from filippov.app.report.part import Chapter, Picture, TextTable, Words
from filippov.base import progress
from filippov.base.csv_text import csv_text
from filippov.base.escape import LINES, cell, figure_text, latex, markdown, printable
from filippov.base.json_text import json_text
from filippov.sweep.dataset import write_csv, write_netcdf

SIZE = {"ci": 3, "nightly": 400}.get(os.environ.get("FILIPPOV_PROFILE", ""), 2)
PIECES = (
    "\x1b[31m", "\x1b]0;title\x07", "\r", "\n", "\t", "\x7f", "\x9b2J", "\u202e", "\u2028", "\ufffe",
    "\ufeff", "<script>alert(1)</script>", "<img src=x onerror=y>", "</td>", "-->", "&lt;", "=1+1",
    "=cmd|'/c calc'!A0", "+1+A1", "-2+A1", "@SUM(A1)", "＝1", " =1", "$", "$x$", "$\\frac{", "{", "}", "\\",
    "\\input{passwd}", "%n", "](javascript:x)", "[a]", "`", "*", "_", "|", "#", '"', "'", ",", ";", "\\n",
    "\\N", "a", "é", "力", "0", "+",
)  # fmt: skip
TEXTS = st.one_of(st.text(), st.lists(st.sampled_from(PIECES), min_size=1, max_size=6).map("".join))
MODEL = """
from filippov import Parameter, Problem, Surface, System, sign, states, parameters

x, v = states("x v")
p = parameters(k=1.0, F=Parameter(0.3, unit={unit!r}, description={description!r}))
brake = System({{x: v, v: -p.k*x - p.F*sign(v)}}, surfaces=[Surface({name!r}, v)])
stop = Problem(brake, x0=(0, 1), t_span=(0, 3))
"""


def hostile(draw: random.Random, *without: str) -> str:
    text = "".join(draw.choice(PIECES) for _ in range(draw.randint(1, 5)))
    for piece in without:
        text = text.replace(piece, "")
    return text.strip() or "="


def unseen(text: str, keep: str = "\n") -> list[str]:
    """Characters that no output may hold: controls, directions, surrogates, line ends of Unicode."""
    wrong = ("Cc", "Cf", "Cs", "Cn", "Zl", "Zp")
    return [c for c in text if c not in keep and unicodedata.category(c) in wrong]


def is_formula(text: str) -> bool:
    if not text or text.lstrip()[:1] not in tuple("=+-@＝＋－＠"):
        return False
    if set(text) <= set("+-0"):
        return False
    try:
        float(text)
    except ValueError:
        return True
    return False


def check_csv(text: str) -> None:
    assert not unseen(text)
    rows = list(csv.reader(io.StringIO(text), strict=True))
    assert len({len(row) for row in rows}) == 1
    assert not [value for row in rows for value in row if is_formula(value)]


def check_tex(text: str) -> None:
    assert not unseen(text)
    bare = re.sub(r"\\[{}\\]", "", text)
    assert bare.count("{") == bare.count("}")
    assert r"\input" not in text
    assert re.sub(r"\\\$", "", text).count("$") % 2 == 0


def check_file(path: Path) -> None:
    """That a file is what its suffix says, with nothing in it that acts."""
    kind = path.suffix
    if kind == ".png":
        assert path.read_bytes().startswith(b"\x89PNG")
    elif kind == ".npz":
        assert Solution.load(path).success if path.name == "solution.npz" else np.load(path).files
    elif kind == ".nc":
        import xarray

        with xarray.open_dataset(path, engine="h5netcdf") as data:
            assert data.sizes
    else:
        text = path.read_text(encoding="utf-8")
        assert not unseen(text), path.name
        if kind == ".json":
            strict(text)
        elif kind == ".csv":
            check_csv(text)
        elif kind == ".md":
            assert not re.search(r"<[a-zA-Z/!?]|\]\(", text)
        elif kind == ".tex":
            check_tex(text)
        elif kind == ".graphml":
            assert nx.read_graphml(path).nodes
        elif kind == ".dot":
            assert re.fullmatch(r'(?:[^"]|"(?:[^"\\]|\\.)*")*', text)
        else:
            assert kind == ".txt", path.name


@pytest.fixture(autouse=True)
def talkative(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setattr(progress, "PATIENCE", 0.0)
    monkeypatch.setattr(progress, "EVERY", 0.0)
    return


SECTION = (
    "--coordinate", "x", "--event", "crossing", "--parametrisation", "x=d,v=0", "--interval", "0.1", "1",
)  # fmt: skip
COMMANDS: dict[str, tuple[str, ...]] = {
    "simulate": ("--events", "x - 1/2"),
    "graph": (),
    "stability": (),
    "ensemble": ("--over", "x0.x=0:1:3"),
    "describing-function": (),
    "event-map": (*SECTION, "--points", "3"),
    "models describe": (),
}  # fmt: skip


@pytest.mark.parametrize("seed", range(SIZE))
def test_11_23_nothing_that_a_name_holds_acts_in_any_output(
    seed: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    draw = random.Random(seed)  # noqa: S311
    name = hostile(draw, ",")  # a comma stands between surfaces on the command line
    text = MODEL.format(name=name, unit=hostile(draw), description=hostile(draw))
    model = tmp_path / (hostile(draw, "/")[:60] + f"{seed}.py")
    model.write_text(text, encoding="utf-8")
    for command, words in COMMANDS.items():
        given = [*words, "--surface", name] if "event-map" in command else words
        out = [] if command.startswith("models") else ["-o", str(tmp_path / command)]
        code = main([*command.split(), f"{model}:stop", *given, *out, "--json"])
        printed, said = capsys.readouterr()
        assert not unseen(said, LINES), (command, said)
        assert code == 0, (command, said)
        assert not unseen(printed), command
        assert strict(printed)
        for path in (tmp_path / command).iterdir() if out else ():
            check_file(path)
    # A model that is not there, under such a name.
    assert main(["simulate", f"{tmp_path}/{hostile(draw, '/')}.py:{hostile(draw)}"]) in (1, 2)
    assert not unseen(capsys.readouterr().err, LINES)


def test_11_23_what_a_model_raises_acts_in_no_table_of_a_sweep(tmp_path: Path) -> None:
    said = "=1+1\0\x1b[31m\r\n<b>\ud800"

    def field(t: float, x: np.ndarray, p: object, s: object) -> list[float]:
        raise ValueError(said)

    surface = Surface("=1+1", lambda t, x, p: x[1])
    system = System(field=field, surfaces=[surface], states="x v", parameters={"k": 1.0}, compile=False)
    sweep = Sweep(Problem(system, (0, 1), (0, 1)), {"k": [1.0, 2.0]}, measure=["end(x)"])
    with ThreadPoolExecutor(1) as threads:
        table = sweep.run(tmp_path / "out", executor=threads)
    assert list(table.failed) == [0, 1]
    check_file(write_csv(table, tmp_path / "results.csv"))
    check_file(write_netcdf(table, tmp_path / "results.nc"))
    for path in (tmp_path / "out").glob("*.json"):
        check_file(path)


def test_11_23_beginning_afresh_removes_no_table_that_no_sweep_wrote(tmp_path: Path) -> None:
    for name in FILES:
        (tmp_path / name).write_text("{}", encoding="utf-8")
        with pytest.raises(UsageError, match=r"was not written by this sweep.*Move it away"):
            Outputs(tmp_path, FILES)
        assert {path.name for path in tmp_path.iterdir()} == {name}
        (tmp_path / name).unlink()
    outputs = Outputs(tmp_path, FILES)
    for name in FILES:
        (tmp_path / name).write_text("{}", encoding="utf-8")
    outputs.keep()
    Outputs(tmp_path, FILES).remove()
    assert not list(tmp_path.iterdir())


@given(TEXTS)
def test_11_23_escaped_text_is_harmless_and_plain_text_is_left_alone(text: str) -> None:
    assert not unseen(printable(text), "")
    assert not unseen(figure_text(text), LINES)
    assert not is_formula(cell(text))
    check_tex(latex(text))
    assert not re.search(r"(?<!\\)[$`*|]|<|\]\(", markdown(text))
    assert json.loads(json_text({text: text})) == {text: text}
    assert not unseen(json_text([text]))
    if text.isprintable():
        assert printable(text) == text


@given(st.floats() | st.integers() | st.sampled_from(["+", "-", "0", "+0-", "-+", "0-", "x", "a-b"]))
def test_11_23_numbers_and_modes_are_cells_as_they_are(value: float | str) -> None:
    (row,) = csv.reader(io.StringIO(csv_text(("a",), [[value]]).partition("\n")[2]))
    (again,) = row or [""]
    assert cell(again) == again
    if isinstance(value, str):
        assert again == value
    else:
        assert type(value)(again) == value or np.isnan(value)


class Tags(html.parser.HTMLParser):
    def __init__(self, text: str) -> None:
        super().__init__()
        self.found: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found.append(f"{tag} {' '.join(sorted(name for name, _ in attrs))}")


def page_of(text: str) -> str:
    """A page with the text at every place that takes one."""
    parts = [
        TextTable(text, (text, "b"), ((text, text),), note=text, source=text), Words("p", text),
        Words("source", text), Words("pre", text), Words("dl", [(text, text)]),
        Picture("name", text, text, object, text),  # type: ignore[arg-type]
    ]  # fmt: skip
    return document(text, text, [Chapter("anchor", text, parts)], {}, {"name": "<svg><g></g></svg>"})


@given(TEXTS.filter(bool))
def test_11_23_text_makes_no_tag_in_a_page(text: str) -> None:
    page = page_of(text)
    # What stands between backticks is set as code, which is no tag of the text's own.
    found = [tag for tag in Tags(page).found if not tag.startswith("code")]
    assert found == [tag for tag in Tags(page_of("plain")).found if not tag.startswith("code")]
    assert not unseen(page, LINES)


@pytest.mark.parametrize(
    ("text", "marked"), [("`", 0), ("a ` b", 0), ("``", 0), ("`a`", 1), ("`a` `<b>` `", 2)]
)
def test_11_23_backticks_make_code_and_nothing_else(text: str, marked: int) -> None:
    """In a note, paragraphs, a definition and the sources of a table, a figure and the page."""
    page, plain = page_of(text), page_of("plain")
    assert page.count("<code>") == page.count("</code>") == 6 * marked
    assert page.count("<b>") == plain.count("<b>")


@given(TEXTS, TEXTS)
def test_11_23_a_row_of_a_bank_is_one_line(name: str, message: str) -> None:
    row = Row(name, False, 0.1, 0.2, ("a",), (name,), "error", 0.1, message)
    text = rows_text([row])
    assert not unseen(text)
    assert text.count("\n") == 3
    row = SolverRow(name, "scipy RK45", "cannot", False, None, message)
    solvers = SolverTable((row,), {}, 1e-8, 1e-6, 9, 1.0)
    assert not unseen(solvers_text(solvers))
    assert solvers_text(solvers).count("\n") == 9


def test_results_whose_run_was_ended_between_two_of_them_are_replaced_by_the_next(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def run(text: str) -> None:
        outputs = Outputs(tmp_path, FILES)
        for name in FILES:
            outputs.write(tmp_path / name, lambda path: path.write_text(text, encoding="utf-8"))
        outputs.keep()

    replace, calls = Path.replace, 0
    for last in range(1, 10):
        run("before")
        calls = 0

        def ended(path: Path, target: Path, last: int = last) -> Path:
            nonlocal calls
            calls += 1
            if calls == last:
                raise KeyboardInterrupt
            return replace(path, target)

        with monkeypatch.context() as patched, suppress(KeyboardInterrupt):
            patched.setattr(Path, "replace", ended)
            run(f"ended at {last}")
        (tmp_path / ".results.csv.0123456789abcdef.tmp").touch()
        run("after")
        assert {path.name for path in tmp_path.iterdir()} == {*FILES, "written.json"}
        assert {(tmp_path / name).read_text(encoding="utf-8") for name in FILES} == {"after"}
    assert calls == 7  # three files, each noted before, and once all of them
    (tmp_path / FILES[0]).write_text("mine", encoding="utf-8")
    with pytest.raises(UsageError, match="was not written by this sweep"):
        Outputs(tmp_path, FILES)
