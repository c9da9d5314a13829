"""Files that are read: spoilt ones of every kind for every reader, refused by name, none waited for."""

from __future__ import annotations

import json
import os
import random
import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from given_analysis import continued, orbit
from given_calls import DRIVEN, run, tree

from filippov import Input, ModelError, Solution, SolutionTree, UsageError
from filippov import analysis as an
from filippov.app.bank.case import read_bank
from filippov.app.bank.compare import read_solvers
from filippov.app.cli.configuration import read_file
from filippov.app.cli.simulate import tuned_values
from filippov.app.cli.tune import identified
from filippov.base.read_whole import json_data, read_bytes
from filippov.graphs import load_graph, observed_graph, save_graph

SIGNAL = "t,r\n0,1\n1,2\n"
RECORD = "t,x,u\n" + "".join(f"{0.1 * k:.1f},{np.cos(0.1 * k)},0\n" for k in range(40))
BANK = '{"cases": [{"id": "A", "states": ["x"], "smooth_field": ["-x"], "x0": [1], "t_span": [0, 1]}]}'
TUNED = '{"best": {"P": 1.0}, "reason": "", "parameters": {"m": 1.0}}'
FOUND = '{"fixed": {}, "values": {"P": 1.0}, "covariance": [[1.0]], "level": 0.95}'
# Each reader with the suffix of its files and what makes a good one.
READERS: dict[str, tuple[Callable[[Path], Any], str, Callable[[Path], Any]]] = {
    "Solution": (lambda path: Solution.load(path, DRIVEN), ".npz", lambda path: run().save(path)),
    "SolutionTree": (SolutionTree.load, ".npz", lambda path: tree().save(path)),
    "Orbit": (lambda path: an.Orbit.load(path, DRIVEN), ".json", lambda path: orbit().save(path)),
    "Branch": (an.Branch.load, ".json", lambda path: continued().branch.save(path)),  # noqa: PLW0108
    "graph": (load_graph, ".json", lambda path: save_graph(observed_graph(run()), path)),
    "record": (an.read_record, ".csv", lambda path: path.write_text(RECORD)),
    "input": (lambda path: Input.from_csv("r", path), ".csv", lambda path: path.write_text(SIGNAL)),
    "bank": (read_bank, ".json", lambda path: path.write_text(BANK)),
    "tuned": (lambda path: tuned_values(str(path)), ".json", lambda path: path.write_text(TUNED)),
    "identified": (lambda path: identified(str(path), ("P",)), ".json", lambda path: path.write_text(FOUND)),
    "configuration": (read_file, ".toml", lambda path: path.write_text("[simulate]\nrtol = 1e-9\n")),
}
OWN = (UsageError, ModelError, OSError)


@pytest.fixture(autouse=True)
def alarm() -> Iterator[None]:
    """A reader that waits is ended."""
    signal.alarm(120)
    yield
    signal.alarm(0)


def refused(name: str, path: Path) -> str:
    with pytest.raises(OWN) as caught:
        READERS[name][0](path)
    message = str(caught.value)
    assert path.name in message
    assert len(message) < 1000
    return message


@pytest.fixture(params=READERS)
def reader(request: pytest.FixtureRequest, tmp_path: Path) -> tuple[str, Path, bytes]:
    """A reader, the path of a good file of its own, and what is in it."""
    name: str = request.param
    path = tmp_path / f"good{READERS[name][1]}"
    READERS[name][2](path)
    return name, path, path.read_bytes()


def test_18_2_what_is_no_file_is_refused(reader: tuple[str, Path, bytes], tmp_path: Path) -> None:
    name, good, _ = reader
    suffix = good.suffix
    refused(name, tmp_path / f"missing{suffix}")
    folder = tmp_path / f"folder{suffix}"
    folder.mkdir()
    refused(name, folder)
    pipe = tmp_path / f"pipe{suffix}"
    os.mkfifo(pipe)
    refused(name, pipe)
    loop = tmp_path / f"loop{suffix}"
    loop.symlink_to(loop)
    refused(name, loop)
    link = tmp_path / f"link{suffix}"
    link.symlink_to(good)
    READERS[name][0](link)
    if os.geteuid():
        good.chmod(0)
        refused(name, good)


def test_18_2_spoilt_files_are_refused(reader: tuple[str, Path, bytes], tmp_path: Path) -> None:
    name, good, content = reader
    draw = random.Random(7)  # noqa: S311
    text = good.suffix in (".csv", ".toml")
    spoilt = {
        "empty": b"", "noise": draw.randbytes(500), "picture": b"\x89PNG\r\n\x1a\n" + draw.randbytes(99),
        "zeros": bytes(1000), "utf-16": "t,x\n1,2\n".encode("utf-16"),
        "latin-1": "é,ü\n1,2\n".encode("latin-1"),
        "pickle": b"\x80\x04\x95\x10\x00\x00\x00", "list": b"[]", "number": b"5", "null": b"null",
        "deep": b"[" * 200_000, "objects": b'{"a":' * 100_000, "other": b'{"format": "another"}',
        **({} if text else {f"cut {k}": content[: len(content) * k // 7] for k in range(1, 7)}),
    }  # fmt: skip
    # A configuration of nothing, and a bank of no cases, are ones.
    spoilt.pop({"configuration": "empty", "bank": "list"}.get(name, ""), None)
    for kind, data in spoilt.items():
        path = tmp_path / f"{kind}{good.suffix}"
        path.write_bytes(data)
        refused(name, path)


def test_18_2_huge_files_are_refused_before_they_are_read(
    reader: tuple[str, Path, bytes], tmp_path: Path
) -> None:
    name, good, content = reader
    path = tmp_path / f"huge{good.suffix}"
    with path.open("wb") as file:
        file.write(content)
        file.truncate(1 << 34)  # sparse: no room on the disk
    refused(name, path)


@pytest.mark.parametrize("name", [name for name, row in READERS.items() if row[1] == ".json"])
def test_18_2_json_that_says_something_twice_or_nan_is_refused(name: str, tmp_path: Path) -> None:
    good = tmp_path / "good.json"
    READERS[name][2](good)
    text = good.read_text(encoding="utf-8")
    data = json.loads(text)
    key = next(iter(data))
    twice = tmp_path / "twice.json"
    twice.write_text(f'{{"{key}": {json.dumps(data[key])}, {text.strip()[1:]}', encoding="utf-8")
    assert repr(key) in refused(name, twice)
    for word in ("NaN", "Infinity", "-Infinity", "1e999"):
        path = tmp_path / "word.json"
        path.write_text(f'{{"more": [{word}], {text.strip()[1:]}', encoding="utf-8")
        assert word in refused(name, path)
    marked = tmp_path / "marked.json"
    marked.write_bytes(b"\xef\xbb\xbf" + text.encode())
    READERS[name][0](marked)


def test_18_2_a_column_that_is_there_twice_is_not_chosen_from(tmp_path: Path) -> None:
    path = tmp_path / "twice.csv"
    path.write_text("t,r,r\n0,1,5\n1,2,6\n")
    with pytest.raises(ModelError, match="'r' is there twice"):
        Input.from_csv("r", path)
    assert Input.from_csv("r", path, value=2).samples.values.tolist() == [5, 6]
    with pytest.raises(ModelError, match="no column -1"):
        Input.from_csv("r", path, value=-1)


def test_18_2_files_without_a_size_are_read(tmp_path: Path) -> None:
    assert read_bytes("/proc/self/stat", 10_000)
    with pytest.raises(UsageError, match="over 5 bytes"):
        read_bytes("/proc/self/stat", 5)
    assert json_data('{"a": {"b": 1}, "c": {"b": 2}}') == {"a": {"b": 1}, "c": {"b": 2}}


def test_18_2_solvers_of_a_bank(tmp_path: Path) -> None:
    path = tmp_path / "solvers.json"
    for text in ("", "[]", '{"rows": 5}', '{"rows": [{"no": 1}]}'):
        path.write_text(text)
        with pytest.raises(UsageError, match="solvers"):
            read_solvers(path)
