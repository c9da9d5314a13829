"""The documentation tells the truth: its code runs, the README prints what it says, links lead somewhere.

Each page holds its expected numbers in `assert` lines and runs in a process of its own, warnings as errors:
by `make docs`, and here where that has not built the pages from the sources as they are.
"""

from __future__ import annotations

import importlib
import importlib.util
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from made import is_current
from test_layout import SOURCES

import filippov
from filippov.analysis import find_orbit
from filippov.app.cli.catalogue import commands
from filippov.app.cli.main import main
from filippov.models import get

ROOT = Path(__file__).resolve().parent.parent
PAGES = sorted((ROOT / "docs").glob("*.md"))
TEXTS = [*PAGES, ROOT / "README.md", ROOT / "CONTRIBUTING.md"]
CELL = re.compile(r"^```\{code-cell\}[^\n]*\n(.*?)^```$", re.DOTALL | re.MULTILINE)
OPTION = re.compile(r"^:[\w-]+:[^\n]*\n", re.MULTILINE)
LINK = re.compile(r"\]\(([^)#\s]+)(#[^)]*)?\)")
NAMED = re.compile(r"`((?:tests|docs|filippov|models|analysis)/[\w./-]+)`")
# "Leine & van de Wouw 2008", "Den Hartog (1931)", "Kuznetsov, Rinaldi & Gragnani 2003".
PART = r"(?:(?:di|van de|Den|El|Vander|Canudas de) )?[A-Z][\w'-]+(?: de Wit)?"
SOURCE = re.compile(rf"({PART})(?:(?:, | & )(?:{PART}))* \(?((?:19|20)\d\d)\b")
README = (ROOT / "README.md").read_text(encoding="utf-8")


def code_of(page: Path) -> str:
    """The cells of a page, one below the other."""
    return "\n".join(OPTION.sub("", cell) for cell in CELL.findall(page.read_text(encoding="utf-8")))


def run(code: str, folder: Path) -> subprocess.CompletedProcess[str]:
    script = folder / "page.py"
    script.write_text(code, encoding="utf-8")
    path = os.pathsep.join(filter(None, (str(ROOT), os.environ.get("PYTHONPATH"))))
    environment = {**os.environ, "PYTHONPATH": path, "MPLBACKEND": "Agg", "PYTHONIOENCODING": "utf-8"}
    command = [sys.executable, "-W", "error", str(script)]
    return subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, encoding="utf-8", check=False
    )


@pytest.mark.parametrize("page", [page for page in PAGES if code_of(page)], ids=lambda page: page.stem)
def test_page_runs_and_its_numbers_hold(page: Path, tmp_path: Path) -> None:
    code = code_of(page)
    assert "assert " in code, f"{page.name} pins no number"
    if is_current(ROOT / "docs" / "_build" / "html"):
        return
    done = run(code, tmp_path)
    assert done.returncode == 0, done.stderr[-3000:]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_16_7_pages_that_draw_show_their_pictures(page: Path) -> None:
    """As many as cells that make a figure and do not close it, on the pages as they were built."""
    build = ROOT / "docs" / "_build" / "html"
    drawing = [
        cell for cell in CELL.findall(page.read_text(encoding="utf-8"))
        if re.search(r"\bplot\(|\bplot_\w+\(|plt\.subplots\(", cell) and "plt.close" not in cell
    ]  # fmt: skip
    if drawing and is_current(build):
        shown = (build / f"{page.stem}.html").read_text(encoding="utf-8")
        assert len(re.findall(r"<img [^>]*(?:_images/[0-9a-f]{40,}|data:image)", shown)) >= len(drawing)


def test_every_page_is_in_the_index() -> None:
    index = (ROOT / "docs" / "index.md").read_text(encoding="utf-8")
    trees = re.findall(r"```\{toctree\}\n(.*?)```", index, re.DOTALL)
    listed = {line for tree in trees for line in tree.splitlines()}
    assert {page.stem for page in PAGES} - {"index"} <= listed


@pytest.mark.parametrize("text", TEXTS, ids=lambda text: text.stem)
def test_links_to_files_lead_somewhere(text: Path) -> None:
    links = [found[1] for found in LINK.finditer(text.read_text(encoding="utf-8")) if "://" not in found[1]]
    missing = [link for link in links if not (text.parent / link).exists()]
    assert not missing


@pytest.mark.parametrize("text", TEXTS, ids=lambda text: text.stem)
def test_files_that_are_named_exist(text: Path) -> None:
    named = NAMED.findall(text.read_text(encoding="utf-8"))
    missing = [name for name in named if not name.startswith("docs/_build") and not (ROOT / name).exists()]
    assert not missing


def sources(text: str) -> set[tuple[str, str]]:
    """(first author, year) of what a text cites."""
    plain = re.sub(r"\s+", " ", text).replace("\u00e9", "e")
    return {found.groups() for found in SOURCE.finditer(plain)}  # type: ignore[misc]


def test_12_sources_of_pages_are_in_the_references() -> None:
    listed = (ROOT / "docs" / "references.md").read_text(encoding="utf-8")
    heads = sources("; ".join(re.findall(r"^(\S.* \d{4})$", listed, re.MULTILINE)))
    missing = {page.stem: sources(page.read_text(encoding="utf-8")) - heads for page in PAGES}
    assert not {page: cited for page, cited in missing.items() if cited}
    assert ("Ueda", "1980") in heads
    assert len(heads) > 70


def test_readme_example_prints_what_it_says(tmp_path: Path) -> None:
    shown = re.findall(r"```python\n(.*?)```\n+It prints\n+```text\n(.*?)```", README, re.DOTALL)
    assert shown
    for code, output in shown:
        assert len([line for line in code.splitlines() if line.strip()]) < 15
        done = run(code, tmp_path)
        assert done.returncode == 0, done.stderr[-3000:]
        assert done.stdout == output


def test_readme_names_targets_of_the_makefile() -> None:
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    targets = set(re.findall(r"^([\w-]+):", makefile, re.MULTILINE))
    named = set(re.findall(r"(?:^    |`)make ([a-z][\w-]*)", README, re.MULTILINE))
    assert {"study", "test"} <= named <= targets


def test_every_public_name_is_in_the_reference() -> None:
    reference = (ROOT / "docs" / "api.md").read_text(encoding="utf-8")
    missing = [name for name in filippov.__all__ if f"`{name}`" not in reference]
    assert not missing


def test_the_list_of_names_says_what_the_docstrings_say() -> None:
    """It is written by docs/names.py; every public name has a line, and `help` begins with it."""
    page = (ROOT / "docs" / "api.md").read_text(encoding="utf-8")
    spec = importlib.util.spec_from_file_location("names_of_docs", ROOT / "docs" / "names.py")
    assert spec is not None
    assert spec.loader is not None
    names = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(names)
    assert names.with_list(page) == page, "run python docs/names.py"
    part = page.partition("## All names in one line each")[2].partition("## Short names")[0]
    lines = dict(re.findall(r"^- `(\w+)`: (.+)$", part, re.MULTILINE))
    of_sympy = set(re.findall(r"`(\w+)`", part.partition("- of sympy: ")[2].partition("\n")[0]))
    assert set(filippov.__all__) <= lines.keys() | of_sympy
    for name in ("solve", "System", "Surface"):
        said = " ".join((getattr(filippov, name).__doc__ or "").split())
        assert said.startswith(lines[name]), name


def test_13_1_every_module_is_public_or_private_on_the_page() -> None:
    reference = (ROOT / "docs" / "api.md").read_text(encoding="utf-8")
    public = re.findall(r"automodule:: (\S+)", reference)
    table = reference.partition("## Private modules")[2]
    rows = re.findall(r"^\| `(filippov[\w.]*)` \| (`.*`) \|$", table, re.MULTILINE)
    private = [f"{room}.{name}" for room, names in rows for name in re.findall(r"`(\w+)`", names)]
    modules = {name for name, path in SOURCES.items() if path.name != "__init__.py"}
    own = {name for name in modules if not name.startswith(("filippov.app.", "filippov.kernel."))}
    known = {name for name in own if not name.rpartition(".")[2].startswith("_")}
    assert len(public) == len(set(public))
    assert not set(public) & set(private)
    assert known <= {*public, *private}, "say in docs/api.md whether these are public"
    assert {*public, *private} <= modules


def test_13_1_short_names_and_pages_use_public_modules_only() -> None:
    public = set(re.findall(r"automodule:: (\S+)", (ROOT / "docs" / "api.md").read_text(encoding="utf-8")))
    for name in ("filippov", *(f"filippov.{room}" for room in ("analysis", "graphs", "plot"))):
        places = importlib.import_module(name).EXPORTS.values()
        assert {f"{name}.{place}" for place in places} <= public
    inside = ("filippov.app", "filippov.kernel")  # pages on them show what they do
    for page in TEXTS:
        used = re.findall(r"^from (filippov[\w.]*) import", page.read_text(encoding="utf-8"), re.MULTILINE)
        modules = {name for name in used if name in SOURCES and SOURCES[name].name != "__init__.py"}
        assert {name for name in modules if not name.startswith(inside)} <= public, page.name


def test_every_committed_picture_is_drawn_by_code_of_the_docs_and_shown() -> None:
    static = (ROOT / "docs" / "_static").iterdir()
    pictures = {path.name for path in static if path.suffix in (".png", ".svg")}
    scripts = "".join((ROOT / "docs" / name).read_text() for name in ("figures.py", "screenshots.py"))
    assert {name for name in pictures if f'"{name}"' not in scripts} == set()
    link = re.compile(r"!\[[^\]]*\]\(\S*_static/([\w.-]+)\)")
    shown = {name for page in TEXTS for name in link.findall(page.read_text())}
    assert shown == pictures


def test_16_7_every_command_stands_on_the_page_of_commands() -> None:
    page = (ROOT / "docs" / "cli.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (`[^|]+`) \|", page, re.MULTILINE)
    named = {name for row in rows for name in re.findall(r"`(\w[\w-]*)", row)}
    assert set(commands()) <= named


def test_16_10_the_readme_tells_how_far_the_mass_hunts_with_its_first_gains(tmp_path: Path) -> None:
    """The cycle of the identified law at P = I = 10, solved for, against the metres that the README names."""
    data = ROOT / "docs" / "_static" / "friction.csv"
    assert main(["identify", str(data), "--fixed", "m=1", "--fixed", "beta=2", "-o", str(tmp_path)]) == 0
    law = json.loads((tmp_path / "identified.json").read_text(encoding="utf-8"))["values"]
    assert f"Fs = {law['Fs']:.3f} N, Fc = {law['Fc']:.3f} N" in README
    cycle = find_orbit(get("hunting").build(), (0.25, 0, 0), parameters={**law, "P": 10, "I": 10})
    assert f"hunts forever, at {cycle.amplitude['x']:.3f} m" in README
