"""The cache of compiled units: private, bound to names by a secret, not trusted where it is not sound."""

import hashlib
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from filippov.kernel.codegen import cache

PROGRAM = """
import sys
from filippov import System, solve, states
x, = states("x")
print(float(solve(System({x: -float(sys.argv[1])*x}), (1,), (0, 1)).x_end[0]).hex())
"""


def environment(folder: Path, **more: str) -> dict[str, str]:
    path = str(Path(__file__).resolve().parent.parent)
    return {
        **os.environ, "FILIPPOV_CACHE": str(folder), "XDG_STATE_HOME": str(folder.parent / "state"),
        "PYTHONPATH": path, **more,
    }  # fmt: skip


def start(env: dict[str, str], rate: int = 1) -> "subprocess.Popen[str]":
    command = [sys.executable, "-c", PROGRAM, str(rate)]
    return subprocess.Popen(command, env=env, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def run(env: dict[str, str], rate: int = 1) -> float:
    process = start(env, rate)
    out, err = process.communicate()
    assert process.returncode == 0, err
    assert not err
    return float.fromhex(out.strip())


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A cache of this test alone, in this process."""
    monkeypatch.setenv("FILIPPOV_CACHE", str(tmp_path / "cache"))
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setattr(cache, "_keys", {})
    return tmp_path / "cache"


def rights(path: Path) -> int:
    return path.stat().st_mode & 0o777


def test_11_21_a_unit_over_the_name_of_another_is_not_run(tmp_path: Path) -> None:
    env = environment(tmp_path / "a folder" / "cache")
    ends = [run(env, 1)]
    folder = Path(env["FILIPPOV_CACHE"])
    # The unit of the loop, which both have, is the larger one.
    first, loop = sorted(folder.glob("*.unit"), key=lambda unit: unit.stat().st_size)
    ends.append(run(env, 2))
    (second,) = set(folder.glob("*.unit")) - {first, loop}
    second.write_bytes(first.read_bytes())
    ends.append(run(env, 2))
    np.testing.assert_allclose(ends, np.exp([-1, -2, -2]), rtol=1e-8)
    assert not list(folder.glob("*.tmp"))
    assert [rights(q) for q in (folder, first, second)] == [0o700, 0o600, 0o600]


def test_11_21_first_compilations_at_once(tmp_path: Path) -> None:
    env = environment(tmp_path / "cache")
    together = [start(env) for _ in range(3)]
    for process in together:
        out, err = process.communicate()
        assert (process.returncode, err) == (0, "")
        assert float.fromhex(out.strip()) == pytest.approx(np.exp(-1), rel=1e-8)
    assert len(list((tmp_path / "cache").glob("*.unit"))) == 2
    assert not list(tmp_path.rglob("*.tmp"))


def test_11_21_without_a_folder_that_can_be_used(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    inside = str(tmp_path / "file" / "x")
    env = environment(tmp_path / "file", HOME=inside, TMPDIR=inside, XDG_STATE_HOME=inside)
    assert run(env) == pytest.approx(np.exp(-1), rel=1e-8)
    del env["FILIPPOV_CACHE"], env["HOME"]
    env["XDG_CACHE_HOME"] = inside
    assert run(env) == pytest.approx(np.exp(-1), rel=1e-8)


def test_11_21_what_is_written_is_read(place: Path) -> None:
    old = os.umask(0)
    try:
        cache.write("a", b"content")
    finally:
        os.umask(old)
    assert cache.read("a") == b"content"
    assert cache.read("b") is None
    made = [place, place / "a.unit", place.parent / "state" / "filippov" / "unit.key"]
    assert [rights(path) for path in made] == [0o700, 0o600, 0o600]


@given(st.data())
def test_11_21_no_damaged_file_is_trusted(data: st.DataObject) -> None:
    with tempfile.TemporaryDirectory() as folder, pytest.MonkeyPatch.context() as patch:
        place = Path(folder)
        patch.setenv("FILIPPOV_CACHE", str(place / "cache"))
        patch.setenv("XDG_STATE_HOME", str(place / "state"))
        patch.setattr(tempfile, "tempdir", folder)
        patch.setattr(cache, "_keys", {})
        content = data.draw(st.binary(max_size=300))
        cache.write("a", content)
        path = place / "cache" / "a.unit"
        whole = path.read_bytes()
        at = data.draw(st.integers(0, len(whole) - 1))
        flipped = whole[:at] + bytes([whole[at] ^ data.draw(st.integers(1, 255))]) + whole[at + 1 :]
        damaged = data.draw(st.sampled_from([flipped, whole[:at], whole + b"x", b"", os.urandom(400)]))
        path.write_bytes(damaged)
        assert cache.read("a") is None
        path.write_bytes(whole)
        assert cache.read("a") == content
        cache.write("a", b"new")
        assert cache.read("a") == b"new"


def test_11_21_a_unit_that_someone_else_has_made(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    cache.write("a", b"theirs")
    # The folder is handed over, whole: the secret is not in it.
    monkeypatch.setenv("XDG_STATE_HOME", str(place.parent / "another state"))
    monkeypatch.setattr(cache, "_keys", {})
    assert cache.read("a") is None
    # A sum of the content says nothing of who made it.
    (place / "b.unit").write_bytes(b"filippov unit 1\n" + hashlib.sha256(b"x").digest() + b"x")
    (place / "c.unit").write_bytes(b"filippov unit 2\n" + hashlib.sha256(b"x").digest() + b"x")
    assert cache.read("b") is None
    assert cache.read("c") is None


def test_11_21_what_others_may_write_to_is_left_alone(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    cache.write("a", b"content")
    (place / "a.unit").chmod(0o666)
    assert cache.read("a") is None
    (place / "a.unit").chmod(0o600)
    assert cache.read("a") == b"content"
    (place / "notes.txt").write_text("the folder holds other things: its rights are not ours to set")
    place.chmod(0o777)
    found = cache.place()
    assert "chmod go-w" in found.reason
    assert found.folder == place.parent / f"filippov-{os.geteuid()}"
    assert cache.read("a") is None
    cache.write("a", b"private")
    assert cache.read("a") == b"private"
    assert rights(found.folder) == 0o700
    monkeypatch.setattr(os, "geteuid", lambda: os.getuid() + 1)
    assert "another user" in cache.place().reason
    assert cache.read("a") is None


def test_11_21_an_open_folder_of_units_alone_is_closed(place: Path) -> None:
    place.mkdir(0o755)
    place.chmod(0o775)
    cache.write("a", b"content")
    assert rights(place) == 0o700
    assert cache.place() == cache.Place(place, place)


@pytest.mark.parametrize("strange", ["fifo", "folder", "link"])
def test_11_21_what_is_no_plain_file_is_not_read(place: Path, strange: str) -> None:
    cache.write("b", b"content")
    path = place / "a.unit"
    if strange == "fifo":
        os.mkfifo(path)
    elif strange == "folder":
        path.mkdir()
    else:
        path.symlink_to(place / "b.unit")
    assert cache.read("a") is None
    cache.write("a", b"content")
    assert cache.read("a") == (None if strange == "folder" else b"content")


@pytest.mark.parametrize("spoilt", [b"", b"short", b"x" * 33, None])
def test_11_21_a_secret_that_is_damaged_or_open_is_made_anew(
    place: Path, monkeypatch: pytest.MonkeyPatch, spoilt: bytes | None
) -> None:
    cache.write("a", b"content")
    key = place.parent / "state" / "filippov" / "unit.key"
    before = key.read_bytes()
    key.chmod(0o600 if spoilt is not None else 0o644)
    if spoilt is not None:
        key.write_bytes(spoilt)
    monkeypatch.setattr(cache, "_keys", {})
    assert cache.read("a") is None
    cache.write("a", b"content")
    assert cache.read("a") == b"content"
    assert len(key.read_bytes()) == 32
    assert key.read_bytes() != before
    assert rights(key) == 0o600


def test_11_21_no_home_is_no_error(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def homeless(_: Any) -> Path:
        raise RuntimeError("Could not determine home directory.")

    for name in ("FILIPPOV_CACHE", "XDG_CACHE_HOME", "XDG_STATE_HOME", "HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(Path, "home", classmethod(homeless))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setattr(cache, "_keys", {})
    found = cache.place()
    assert "no home folder" in found.reason
    assert found.folder == tmp_path / f"filippov-{os.geteuid()}"
    cache.write("a", b"content")
    assert cache.read("a") == b"content"
    monkeypatch.setenv("XDG_CACHE_HOME", "relative")  # to be ignored, by the specification
    assert cache.cache_folder() is None


def test_11_21_doctor_says_which_cache_is_used(place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from filippov.app.cli.main import main

    place.mkdir()
    (place / "notes.txt").write_text("other things")
    place.chmod(0o777)
    assert main(["doctor"]) == 0
    said = capsys.readouterr().err
    assert str(place.parent / f"filippov-{os.geteuid()}") in said
    assert "others may write to" in said
