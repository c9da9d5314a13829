"""The lock of a sweep's folder: who is at work is not overtaken, who is gone does not stand in the way."""

import json
import os
import random
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from filippov.base.errors import UsageError
from filippov.sweep import lock as locks
from filippov.sweep.lock import Lock

ROOT = Path(__file__).resolve().parent.parent
HOLD = """
import sys
from pathlib import Path
from filippov.sweep.lock import Lock
with Lock(Path(sys.argv[1])):
    print("held", flush=True)
    sys.stdin.read()
"""
POSIX = pytest.mark.skipif(os.name != "posix", reason="locks of POSIX")


def holder(folder: Path) -> subprocess.Popen[str]:
    process = subprocess.Popen(
        [sys.executable, "-c", HOLD, str(folder)], cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE,
        text=True,
    )  # fmt: skip
    assert process.stdout is not None
    assert process.stdout.readline() == "held\n"
    return process


def end(process: subprocess.Popen[str], kill: bool = True) -> None:
    if kill:
        process.kill()
    process.communicate()


def rewrite(folder: Path, **changes: Any) -> None:
    """Say in the lock, in place, what its owner would have said somewhere else."""
    path = folder / locks.NAME
    path.write_text(json.dumps(json.loads(path.read_text(encoding="utf-8")) | changes), encoding="utf-8")


@POSIX
@pytest.mark.parametrize(
    "seen",
    [
        {"pid": 4_000_000, "started": "1"},  # a number that means nothing here: another container
        {"pid": 4_000_000, "started": "1", "space": "pid:[1]"},
        {"pid": 4_000_000, "started": "1", "space": "pid:[1]", "host": "other"},
        {"pid": 1, "started": "17", "host": "other", "boot": "other"},
    ],
)
def test_11_23_a_lock_that_is_held_is_not_taken_whatever_its_number_means_here(
    seen: dict[str, Any], tmp_path: Path
) -> None:
    process = holder(tmp_path)
    try:
        rewrite(tmp_path, **seen)
        said = f"in use by process {seen['pid']} .*Wait for it"
        with pytest.raises(UsageError, match=said), Lock(tmp_path):
            pass
    finally:
        end(process)


@POSIX
def test_11_23_one_that_died_in_another_container_of_this_system_is_taken_over(tmp_path: Path) -> None:
    process = holder(tmp_path)
    # Its number here belongs to a process that lives.
    rewrite(tmp_path, pid=os.getpid(), started=None, space="pid:[1]", host="other")
    end(process)
    with Lock(tmp_path):
        assert json.loads((tmp_path / locks.NAME).read_text(encoding="utf-8"))["pid"] == os.getpid()
    assert not list(tmp_path.iterdir())


@POSIX
def test_one_process_has_the_folder_once(tmp_path: Path) -> None:
    with Lock(tmp_path):
        with pytest.raises(UsageError, match=f"process {os.getpid()} on this host"), Lock(tmp_path):
            pass
        assert (tmp_path / locks.NAME).exists()
    with Lock(tmp_path):
        pass


@POSIX
@pytest.mark.parametrize("content", ["", "{", '{"pid": 12, "ho', '{"pid": 99999999999999}', "\x00" * 40])
def test_a_lock_that_was_cut_off_is_taken_over(content: str, tmp_path: Path) -> None:
    (tmp_path / locks.NAME).write_text(content, encoding="utf-8")
    if content.endswith("}"):
        rewrite(tmp_path, host=Lock(tmp_path).owner["host"])
    with Lock(tmp_path):
        pass
    assert not list(tmp_path.iterdir())


@POSIX
@pytest.mark.parametrize("content", ["[]", "mine", '{"name": "mine"}', '{"pid": 1}', '{"pidgin": 1', "7"])
def test_11_18_a_file_that_is_no_lock_is_left_alone(content: str, tmp_path: Path) -> None:
    (tmp_path / locks.NAME).write_text(content, encoding="utf-8")
    with pytest.raises(UsageError, match=r"is no lock of a sweep.*move it away"), Lock(tmp_path):
        pass
    assert (tmp_path / locks.NAME).read_text(encoding="utf-8") == content


@POSIX
def test_11_23_a_link_is_no_lock(tmp_path: Path) -> None:
    victim = tmp_path / "victim"
    victim.write_text("precious", encoding="utf-8")
    (tmp_path / locks.NAME).symlink_to(victim)
    with pytest.raises(UsageError, match="cannot be used as a lock"), Lock(tmp_path):
        pass
    assert victim.read_text(encoding="utf-8") == "precious"


def gone(owner: dict[str, Any], mine: dict[str, Any], alive: bool) -> bool:
    """Whether an owner is certainly gone, by what the file says alone (no locks): the rule in words.

    Of another host nothing is known. On this host: after a new start of the system everybody is gone; within
    another container nothing is known; else the process table tells.
    """
    if owner["boot"] != mine["boot"]:
        return bool(owner["host"] == mine["host"])
    return owner["space"] == mine["space"] and not alive


@pytest.mark.parametrize("seed", range(40))
def test_11_23_without_locks_only_who_is_certainly_gone_is_taken_over(
    seed: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    draw = random.Random(seed)  # noqa: S311
    monkeypatch.setattr(locks, "_hold", lambda handle: None)
    monkeypatch.setattr(locks, "_boot", lambda: "this start")
    monkeypatch.setattr(locks, "_space", lambda: "this container")
    mine = Lock(tmp_path).owner
    owner = mine | {
        "host": draw.choice([mine["host"], "other"]), "boot": draw.choice(["this start", "other"]),
        "space": draw.choice(["this container", "other"]), "locked": draw.random() < 0.5,
    }  # fmt: skip
    alive = draw.random() < 0.5
    if not alive:
        owner |= draw.choice([{"pid": 4_000_000}, {"started": "0"}])
        alive = owner["pid"] == mine["pid"] and mine["started"] is None
    (tmp_path / locks.NAME).write_text(json.dumps(owner), encoding="utf-8")
    if gone(owner, mine, alive):
        with Lock(tmp_path):
            pass
        assert not list(tmp_path.iterdir())
    else:
        with pytest.raises(UsageError, match="in use by process"), Lock(tmp_path):
            pass
        assert json.loads((tmp_path / locks.NAME).read_text(encoding="utf-8")) == owner


def test_11_24_no_process_is_asked_where_asking_would_end_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def ended(pid: int, number: int) -> None:
        raise AssertionError(f"os.kill({pid}, {number}) ends the process on Windows")

    monkeypatch.setattr(locks.os, "kill", ended)
    monkeypatch.setattr(locks, "_MAY_ASK", False)
    monkeypatch.setattr(locks, "_hold", lambda handle: None)
    with Lock(tmp_path), pytest.raises(UsageError, match="Wait for it, or name"), Lock(tmp_path):
        pass
    assert not (tmp_path / locks.NAME).exists()
