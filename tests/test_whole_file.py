"""Files are written whole, through no link, and leave the process as it was."""

import errno
import json
import os
import stat
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import pytest

from filippov import System, sign, solve, states
from filippov.analysis.orbits.orbit_file import write_json as write_orbit
from filippov.app.cli.console import Console
from filippov.app.cli.folder import Folder
from filippov.app.report.files import write as write_report
from filippov.base import whole_file
from filippov.base.whole_file import write_whole
from filippov.graphs.graph import possible_graph
from filippov.graphs.graph_io import save_graph
from filippov.io.archive import write_arrays
from filippov.sweep.store import write_json as write_manifest

POSIX = pytest.mark.skipif(os.name != "posix", reason="links and permissions of POSIX")


def _brake() -> System:
    x, v = states("x v")
    return System({x: v, v: -sign(v)})


def _in_folder(path: Path) -> Folder:
    return Folder(str(path.parent), Console(quiet=True))


def _picture(path: Path) -> None:
    from matplotlib import pyplot as plt

    _in_folder(path).picture(path.name, lambda: plt.figure(figsize=(1, 1)))


def _solution(path: Path) -> None:
    solve(_brake(), (0.0, 1.0), (0.0, 0.5)).save(path)


# Every way in which the package writes a file that stays.
WRITERS: dict[str, Callable[[Path], object]] = {
    "text.json": lambda path: write_whole(path, "{}"),
    "response.png": _picture,
    "summary.json": lambda path: _in_folder(path).json(path.name, {}),
    "events.csv": lambda path: _in_folder(path).csv(path.name, ("t",), [[0.5]]),
    "ends.npz": lambda path: _in_folder(path).content(path.name, lambda file: np.savez(file, t=np.ones(2))),
    "arrays.npz": lambda path: write_arrays(path, {"t": np.ones(2)}),
    "orbit.json": lambda path: write_orbit(path, {"period": 1.0}),
    "graph.dot": lambda path: save_graph(possible_graph(_brake()), path),
    "report.html": lambda path: write_report(path, "<p>"),
    "manifest.json": lambda path: write_manifest(path, {}),
    "solution.npz": _solution,
}  # fmt: skip
EVERY_WRITER = pytest.mark.parametrize("name", sorted(WRITERS))


@POSIX
@EVERY_WRITER
def test_11_23_links_are_not_written_through(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    victim, folder = tmp_path / "victim", tmp_path / "run"
    victim.write_text("precious", encoding="utf-8")
    folder.mkdir()
    # At the path itself, and at every name that a temporary file could be guessed to have.
    for planted in (name, f".{name}.tmp", f"{name}.tmp", f".{name}.{os.getpid()}.tmp"):
        (folder / planted).symlink_to(victim)
    # Even a name that comes true is refused: the file must be new.
    tokens = iter(["guessed", *(f"{k:016x}" for k in range(100))])
    monkeypatch.setattr(whole_file.secrets, "token_hex", lambda size: next(tokens))
    (folder / f".{name}.guessed.tmp").symlink_to(victim)
    with pytest.raises(FileExistsError):
        WRITERS[name](folder / name)
    WRITERS[name](folder / name)
    assert victim.read_text(encoding="utf-8") == "precious"
    assert stat.S_ISREG((folder / name).lstat().st_mode)
    assert (folder / name).stat().st_size > 0
    planted = {p.name for p in folder.iterdir() if p.is_symlink()}
    assert {p.name for p in folder.iterdir()} == planted | {name}


@POSIX
@EVERY_WRITER
def test_11_23_permissions_are_those_of_a_new_file_and_the_umask_is_left_alone(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "umask", _refuse)
    plain = tmp_path / "plain"
    plain.touch()
    WRITERS[name](tmp_path / name)
    assert (tmp_path / name).stat().st_mode == plain.stat().st_mode


def _refuse(*_: object) -> Any:
    raise AssertionError("the umask belongs to all threads of the process")


def test_what_fails_leaves_the_file_that_was_there(tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    write_whole(path, "old")

    def broken(file: BinaryIO) -> None:
        file.write(b"half")
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_whole(path, broken)
    assert path.read_bytes() == b"old"
    assert [p.name for p in tmp_path.iterdir()] == ["table.csv"]


def test_many_writers_of_one_file_leave_one_of_their_contents(tmp_path: Path) -> None:
    path = tmp_path / "summary.json"
    contents = [str(k) * 10_000 for k in range(8)]
    threads = [threading.Thread(target=write_whole, args=(path, text)) for text in contents]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert path.read_text(encoding="utf-8") in contents
    assert [p.name for p in tmp_path.iterdir()] == ["summary.json"]


@pytest.mark.parametrize("name", ["a" * 255, "ü" * 127, "-o", "a b\nc.csv"])
def test_any_name_that_the_system_takes_is_taken(name: str, tmp_path: Path) -> None:
    path = tmp_path / name
    write_whole(path, "text \ud800 é")
    assert path.read_bytes() == "text \\ud800 é".encode()


@POSIX
def test_a_pipe_is_written_to_and_not_replaced(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    got: list[bytes] = []
    reader = threading.Thread(target=lambda: got.append(pipe.read_bytes()))
    reader.start()
    write_whole(pipe, "through")
    reader.join()
    assert got == [b"through"]
    assert stat.S_ISFIFO(pipe.lstat().st_mode)
    write_whole("/dev/null", "nothing")
    assert stat.S_ISCHR(Path("/dev/null").lstat().st_mode)


WATCHED = """
import os, sys
from filippov.app.cli.main import main

out, seen = sys.argv[1], []
write, new = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND, os.O_EXCL | os.O_NOFOLLOW

def watch(event, arguments):
    if event == "open" and isinstance(arguments[0], str) and arguments[0].startswith(out):
        path, _, flags = arguments
        if flags & write and not flags & new and not os.path.isdir(path):
            seen.append(path)

sys.addaudithook(watch)
for words in (
    "simulate relay --t-span 0 1", "graph relay", "ensemble relay --over x0.x1=0:1:3 --t-span 0 1",
    "sweep relay --over x0.x1=0:1:3 --t-span 0 1 --measure end(x1) -j 1", "bank run BANK",
):
    name, *rest = words.replace("BANK", f"{out}/../bank.json").split()
    for again in (1, 2) if name == "simulate" else (1,):
        code = main([name, *rest, "-o", f"{out}/{name}"])
        assert code == 0, (words, code)
assert not seen, seen
"""


def test_11_23_every_file_that_a_command_opens_to_write_is_new_or_no_link(tmp_path: Path) -> None:
    case = {
        "id": "relay", "states": ["x"], "h": ["x"], "fields": {"+": ["-2"], "-": ["2"]}, "x0": ["1"],
        "t_span": ["0", "1"],
        "expected": [{"name": "final_state", "t": "0.25", "value": ["1/2"], "tol": "1e-9"}],
    }  # fmt: skip
    (tmp_path / "bank.json").write_text(json.dumps([case]), encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-c", WATCHED, str(tmp_path / "out")], cwd=Path(__file__).resolve().parent.parent,
        capture_output=True, text=True, timeout=250, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-3000:]


def test_a_full_disk_is_said_with_the_name_of_the_file(tmp_path: Path) -> None:
    def full(file: BinaryIO) -> None:
        file.write(b"some of it")
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    path = tmp_path / "table.csv"
    with pytest.raises(OSError, match=r"No space left.*table\.csv") as caught:
        write_whole(path, full)
    assert (caught.value.errno, caught.value.filename) == (errno.ENOSPC, str(path))
    assert not list(tmp_path.iterdir())
