"""The folder of a sweep: whatever happens to its files, no wrong or mislabelled number comes out of it, and
no file of anyone else's is touched.

The oracle is the closed form of x' = -k x from x0, by name: k, x0.x, end(x) and twice say what they are.
"""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sweep_case import decay, serial, write_case

from filippov import Parameter, Problem, Stop, Surface, Sweep, System, UsageError, parameters, states
from filippov.app.cli.main import main
from filippov.sweep.dataset import load_table
from filippov.sweep.table import SweepTable
from filippov.sweep.toolchain import PACKAGES

NIGHTLY = os.environ.get("FILIPPOV_PROFILE") == "nightly"
OWN = {"manifest.json", "points.npz", "quarantine.json", "lock.json"}
K, X = (0.5, 1.0, 1.5, 2.0), (-1.0, 1.0, 2.0)


def asked(harm: Path, **changes: Any) -> Sweep:
    given: dict[str, Any] = {
        "over": {"k": K, "x0.x": X}, "measure": ["end(x)", "t_end", f"{harm}:plain"], "rtol": 1e-9, **changes
    }  # fmt: skip
    return Sweep(decay(), **given)


def right(table: SweepTable, whole: bool = True) -> None:
    """Whatever the table holds is what its names say, and it holds all of it where it is to be whole."""
    assert table.names == ("k", "x0.x")
    assert table.columns == ("end(x)", "t_end", "twice")
    pairs = [(k, x) for k in K for x in X]
    assert table.points.tolist() == [list(pair) for pair in pairs]
    assert table.units == {}
    for row, (k, x) in enumerate(pairs):
        if not whole and not table.known[row]:
            assert table.status[row] == ""
            continue
        if table.status[row] == "success":
            assert table["end(x)"][row] == pytest.approx(x * np.exp(-2 * k), rel=1e-7)
            assert table["t_end"][row] == 2
            assert table["twice"][row] == 2 * k
        else:
            assert table.status[row] == "quarantined"
            assert np.all(np.isnan(table.values[row]))


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """The folder of a sweep that is done, one point of it set aside, and the path of its measures."""
    place = tmp_path_factory.mktemp("sound")
    harm, out = write_case(place), place / "out"
    sweep = asked(harm)
    serial(sweep, out, chunk=5)
    from filippov.sweep.rows import failed_row
    from filippov.sweep.store import Store

    store = Store(out, sweep)
    single = Store(out, sweep)
    store.read()
    for path in sorted((out / "chunks").glob("*.npz"))[:1]:
        path.unlink()
    missing = [k for k, known in enumerate(single.read().known.tolist()) if not known]
    single.quarantine(failed_row(missing[0], 3, "quarantined", "the point ended its worker"))
    serial(sweep, out, chunk=3, resume=True)
    assert (out / "quarantine.json").exists()
    right(load_table(out))
    return out, harm


def content(folder: Path) -> dict[str, bytes]:
    """All files with what they hold, but for Python's own byte code."""
    files = (p for p in sorted(folder.rglob("*")) if p.is_file() and p.suffix != ".pyc")
    return {str(p.relative_to(folder)): p.read_bytes() for p in files}


def names(folder: Path) -> set[str]:
    """Names of the chunks of a sweep."""
    return {path.name for path in (folder / "chunks").iterdir()}


def tried(call: Callable[[], SweepTable]) -> SweepTable | None:
    """The table, None where it is refused by name with what to do."""
    try:
        return call()
    except UsageError as error:
        said = str(error)
    assert any(word in said for word in ("Move", "move", "Name", "afresh")), said
    return None


@settings(max_examples=600 if NIGHTLY else 40)
@given(data=st.data())
def test_11_19_a_flipped_byte_anywhere_gives_no_wrong_number(sound: tuple[Path, Path], data: Any) -> None:
    out, harm = sound
    work = out.parent / "copy"
    shutil.rmtree(work, ignore_errors=True)
    shutil.copytree(out, work)
    files = sorted(path for path in work.rglob("*") if path.is_file())
    path = data.draw(st.sampled_from(files), label="file")
    bytes_ = bytearray(path.read_bytes())
    for _ in range(data.draw(st.integers(1, 3), label="flips")):
        place = data.draw(st.integers(0, len(bytes_) - 1), label="place")
        bytes_[place] ^= data.draw(st.integers(1, 255), label="bits")
    path.write_bytes(bytes_)
    before = content(work)
    read = tried(lambda: load_table(work))
    assert content(work) == before  # reading changes nothing
    if read is not None:
        right(read, whole=False)
    table = tried(lambda: serial(asked(harm), work, resume=True, chunk=4))
    if table is not None:
        right(table)
        right(load_table(work))
    else:
        assert content(work) == before  # what was refused is as it was


@settings(max_examples=150 if NIGHTLY else 12)
@given(data=st.data())
def test_11_18_files_of_others_survive_everything(sound: tuple[Path, Path], data: Any) -> None:
    out, harm = sound
    work = out.parent / "foreign"
    shutil.rmtree(work, ignore_errors=True)
    if data.draw(st.booleans(), label="used before"):
        shutil.copytree(out, work)
        for name in sorted(OWN - {"lock.json"}):
            if data.draw(st.booleans(), label=f"{name} lost"):
                (work / name).unlink(missing_ok=True)
    (work / "chunks").mkdir(parents=True, exist_ok=True)
    anywhere = st.one_of(
        st.sampled_from(
            [*sorted(OWN), "table.csv", "chunks/a.npz", "chunks/.a.npz.x.tmp", ".manifest.json.a.tmp"]
        ),
        st.from_regex(r"\A(chunks/)?[0-9a-f]{16}-[0-9a-f]{28}\.npz\Z"),
        st.from_regex(r"\A(chunks/)?\.?[a-z0-9]{1,8}\.(npz|json|tmp)\Z"),
    )
    kinds = st.sampled_from(["text", "npz", "json", "empty"])
    foreign: dict[str, bytes] = {}
    files = st.dictionaries(anywhere, kinds, min_size=1, max_size=4)
    for name, kind in data.draw(files, label="files").items():
        path = work / name
        if (name, kind) == ("lock.json", "empty"):
            continue  # a lock that was cut off before a word of it was written
        if kind == "npz":
            np.savez(work / "made", points=np.arange(3.0))
            (work / "made.npz").replace(path)
        else:
            path.write_text({"text": "mine", "json": '{"format": "mine", "pid": 1}', "empty": ""}[kind])
        foreign[name] = path.read_bytes()
    ways = st.sampled_from(["run", "resume", "fresh", "other", "load"])
    for how in data.draw(st.lists(ways, min_size=1, max_size=3), label="how"):
        if how == "load":
            tried(lambda: load_table(work))
        else:
            over = {"k": [1.0, 2.0]} if how == "other" else {"k": K, "x0.x": X}
            table = tried(
                lambda how=how, over=over: serial(  # type: ignore[misc]
                    asked(harm, over=over), work, resume=how == "resume", fresh=how in ("fresh", "other")
                )
            )
            if table is not None and how != "other":
                right(table)
        for name, held in foreign.items():
            assert (work / name).read_bytes() == held, (how, name)


def test_11_18_a_folder_without_manifest_keeps_what_is_in_it(tmp_path: Path) -> None:
    sweep = asked(write_case(tmp_path))
    for name in ("points.npz", "quarantine.json", "chunks/mine.npz", "chunks/.mine.npz.tmp", "notes.txt"):
        work = tmp_path / name.replace("/", "-")
        (work / "chunks").mkdir(parents=True)
        (work / name).write_bytes(b"years of work")
        for how in ({}, {"resume": True}, {"fresh": True}):
            table = tried(lambda how=how, work=work: serial(sweep, work, **how))  # type: ignore[misc]
            assert (work / name).read_bytes() == b"years of work"
            assert table is None or name not in OWN


def test_11_18_a_lost_manifest_is_made_again_from_the_chunks(tmp_path: Path) -> None:
    sweep, out = asked(write_case(tmp_path)), tmp_path / "out"
    plain = serial(sweep, out, chunk=5)
    manifest = (out / "manifest.json").read_bytes()
    chunks = content(out / "chunks")
    (out / "manifest.json").unlink()
    assert load_table(out).content_hash == plain.content_hash
    with pytest.raises(UsageError, match="holds this sweep already"):
        serial(sweep, out)
    with pytest.raises(UsageError, match=r"holds another sweep.*rtol was 1e-09, is 1e-08"):
        serial(asked(tmp_path / "harm.py", rtol=1e-8), out, resume=True)
    (out / "points.npz").unlink()
    asked_again: list[Any] = []
    again = serial(sweep, out, resume=True, progress=lambda done, total: asked_again.append(done))
    assert asked_again == [12]  # nothing was computed
    assert again.content_hash == plain.content_hash == load_table(out).content_hash
    assert (out / "manifest.json").read_bytes() == manifest
    assert content(out / "chunks") == chunks


def test_11_18_fresh_removes_what_the_sweep_in_the_folder_wrote_and_nothing_else(tmp_path: Path) -> None:
    harm, out = write_case(tmp_path), tmp_path / "out"
    serial(asked(harm), out, chunk=5)
    other = tmp_path / "other"
    serial(asked(harm, rtol=1e-7), other, chunk=5)
    for path in (other / "chunks").glob("*.npz"):
        shutil.copy(path, out / "chunks")
    kept = names(other)
    old = names(out) - kept
    right(serial(asked(harm, rtol=1e-8), out, fresh=True, chunk=5))
    left = names(out)
    assert kept < left
    assert not old & left


def test_11_18_an_empty_name_is_not_the_current_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    write_case(tmp_path)
    monkeypatch.chdir(tmp_path)
    before = content(tmp_path)
    with pytest.raises(UsageError, match="folder is ''"):
        serial(asked(tmp_path / "harm.py"), "")  # type: ignore[arg-type]
    for command in (["sweep", "--config", "sweep.toml"], ["simulate", "hunting", "--t-span", "0", "1"]):
        assert main([*command, "-o", ""]) == 2
        assert "is '', expected" in capsys.readouterr().err
    assert content(tmp_path) == before


def test_11_18_the_command_keeps_files_that_it_did_not_write(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    write_case(tmp_path, count=4)
    monkeypatch.chdir(tmp_path)
    command = ["sweep", "--config", "sweep.toml", "-o", "out", "-j", "1"]
    out = tmp_path / "out"
    out.mkdir()
    for name in ("results.csv", "summary.json", "results.nc"):
        (out / name).write_text("mine")
        for words in (command, [*command, "--fresh"], [*command, "--resume"]):
            assert main(words) == 2
            assert name in capsys.readouterr().err
            assert content(out) == {name: b"mine"}
        (out / name).unlink()
    assert main(command) == 0
    assert main([*command, "--resume"]) == 0
    (out / "results.csv").write_text("mine, by hand")
    for words in ([*command, "--fresh"], [*command, "--resume"]):
        assert main(words) == 2
        assert (out / "results.csv").read_text() == "mine, by hand"
    (out / "results.csv").unlink()
    assert main([*command, "--fresh"]) == 0
    assert main([*command, "--resume"]) == 0


def test_11_19_a_store_of_the_first_format_is_refused_by_name(tmp_path: Path) -> None:
    out = tmp_path / "out"
    harm = write_case(tmp_path)
    serial(asked(harm), out)
    path = out / "manifest.json"
    found = json.loads(path.read_text())
    fields = found["fields"]
    key = __import__("hashlib").sha256(json.dumps(dict(sorted(fields.items()))).encode()).hexdigest()
    path.write_text(json.dumps({
        "format": "filippov sweep", "version": 1, "key": key, "fields": fields, "names": ["k", "x0.x"],
        "columns": found["columns"], "units": {}, "size": 12,
    }))  # fmt: skip
    before = content(out)
    for call in (
        lambda: load_table(out), lambda: serial(asked(harm), out, resume=True),
        lambda: serial(asked(harm), out, fresh=True),
    ):  # fmt: skip
        with pytest.raises(UsageError, match=r"format version 1, this filippov reads version 2 only.*afresh"):
            call()
        assert content(out) == before


def relay(e: float = 0.5, width: float = 0.0, side: Any = "+") -> System:
    x, v = states("x v")
    p = parameters(g=Parameter(9.81, unit="m/s^2"), P=1.0)
    surfaces = [
        Surface("floor", x, reset={v: -e * v}, side=side),
        Surface("relay", v - 100, width=width, radius=1 + e),
    ]
    from filippov import sign

    return System({x: v, v: -p.g + 0.01 * p.P * sign(v - 100)}, surfaces=surfaces)


def big(system: System, **changes: Any) -> Sweep:
    given: dict[str, Any] = {
        "over": {"P": [1, 2], "x0.x": [1, 2]}, "measure": ["end", "events(floor)"], "rtol": 1e-8, **changes
    }  # fmt: skip
    problem = Problem(
        system, given.pop("x0", (1.0, 0.0)), given.pop("t_span", (0, 0.2)), given.pop("values", {"g": 9.0})
    )
    return Sweep(problem, **given)


CHANGES: dict[str, tuple[Callable[[], Sweep], str]] = {
    "a number in a reset": (lambda: big(relay(e=0.6)), "model"),
    "a width": (lambda: big(relay(width=0.1)), "model"),
    "a side": (lambda: big(relay(side="both")), "model"),
    "a parameter": (lambda: big(relay(), values={"g": 9.1}), "parameters"),
    "the initial state": (lambda: big(relay(), x0=(1.0, 1e-9)), "x0"),
    "the span": (lambda: big(relay(), t_span=(0, 0.3)), "t_span"),
    "a value": (lambda: big(relay(), over={"P": [1, 2.5], "x0.x": [1, 2]}), "points"),
    "the order of values": (lambda: big(relay(), over={"P": [2, 1], "x0.x": [1, 2]}), "points"),
    "the number of points": (lambda: big(relay(), over={"P": [1, 2, 3], "x0.x": [1, 2]}), "points"),
    "what is varied": (lambda: big(relay(), over={"P": [1, 2], "x0.v": [1, 2]}), "names"),
    "the order of names": (lambda: big(relay(), over={"x0.x": [1, 2], "P": [1, 2]}), "names"),
    "a measure": (lambda: big(relay(), measure=["end", "events(relay)"]), "columns"),
    "the order of measures": (lambda: big(relay(), measure=["events(floor)", "end"]), "columns"),
    "an option": (lambda: big(relay(), rtol=1e-9), "rtol"),
    "another option": (lambda: big(relay(), atol=[1e-9, 1e-10]), "atol"),
    "a policy": (lambda: big(relay(), nonunique="stick"), "nonunique"),
    "a stop": (lambda: big(relay(), stop=Stop("floor", "reset")), "stop"),
    "the tail": (lambda: big(relay(), tail=0.25), "tail"),
}


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("done") / "out"
    serial(big(relay()), out)
    return out


@pytest.mark.parametrize("what", CHANGES)
def test_11_19_whatever_decides_a_result_is_named_when_it_changes(done: Path, what: str) -> None:
    change, name = CHANGES[what]
    before = content(done)
    with pytest.raises(UsageError, match=rf"holds another sweep, whose results do not mix.*\b{name} was "):
        serial(change(), done, resume=True)
    assert content(done) == before
    assert serial(big(relay()), done, resume=True).complete


def test_11_19_a_unit_is_part_of_what_is_asked(tmp_path: Path) -> None:
    def of(unit: str) -> Sweep:
        (x,) = states("x")
        p = parameters(k=Parameter(1.0, unit=unit))
        return Sweep(Problem(System({x: -p.k * x}), (1.0,), (0, 1)), {"k": [1, 2]})

    serial(of("1/s"), tmp_path)
    assert load_table(tmp_path).units == {"k": "1/s"}
    with pytest.raises(UsageError, match=r"units was \{'k': '1/s'\}, is \{'k': '1/min'\}"):
        serial(of("1/min"), tmp_path, resume=True)


@pytest.mark.parametrize("name", [*PACKAGES, "python", "machine", "filippov"])
def test_11_19_another_version_of_what_computes_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    from filippov.sweep import plan, toolchain

    sweep = Sweep(decay(), {"k": [1, 2]})
    serial(sweep, tmp_path)
    if name == "filippov":
        monkeypatch.setattr(plan, "own_sources", lambda: "edited")
    elif name in ("python", "machine"):
        whose = {"python": "python_version", "machine": "machine"}[name]
        monkeypatch.setattr(f"platform.{whose}", lambda: "other")
    else:
        version = toolchain.version
        monkeypatch.setattr(toolchain, "version", lambda asked: "0.1" if asked == name else version(asked))
    with pytest.raises(UsageError, match=rf"mix with this one: {name} was "):
        serial(Sweep(decay(), {"k": [1, 2]}), tmp_path, resume=True)
