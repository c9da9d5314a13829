"""Processes, files and interrupts of a sweep: one test for each row of group D, with real faults.

The oracle is the closed form of x' = -k x, and the hash of a run that nothing disturbed.
"""

from __future__ import annotations

import json
import multiprocessing
import os
import pickle
import resource
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from sweep_case import ROOT, check, decay, serial, start, sweep_of, write_case

from filippov import Problem, Sweep, System, UsageError, parameters, solve, states
from filippov.models import registry
from filippov.sweep.dataset import load_table
from filippov.sweep.processes import Processes

ROUNDS = 30 if os.environ.get("FILIPPOV_PROFILE") == "nightly" else 5


def chunks(folder: Path) -> list[Path]:
    return sorted((folder / "chunks").glob("*.npz"))


def wait_for(found: Callable[[], Any], process: subprocess.Popen[str] | None = None) -> None:
    """Until something is there, or the process has ended."""
    for _ in range(3000):
        if found() or (process is not None and process.poll() is not None):
            return
        time.sleep(0.02)
    raise AssertionError("waited a minute in vain")


def test_d01_a_point_that_kills_its_worker_is_set_aside_and_no_other_is_lost(tmp_path: Path) -> None:
    harm = write_case(tmp_path)
    table = sweep_of(harm, "kills", 12).run(tmp_path / "out", jobs=2, chunk=6)
    check(table, bad=(3,))
    assert (tmp_path / "seven").exists()  # killed once, computed again
    assert table.status[2] == "quarantined"
    assert "SIGKILL" in table.message[2]
    (row,) = json.loads((tmp_path / "out/quarantine.json").read_text())["points"]
    assert row["point"] == 2
    assert row["values"] == {"k": 3.0}
    with pytest.raises(UsageError, match=r"cannot be told: 'kills' reads pathlib.*trust=True, --trust"):
        sweep_of(harm, "kills", 12).run(tmp_path / "out", jobs=1, resume=True)
    # Nothing is left to do.
    again = sweep_of(harm, "kills", 12).run(tmp_path / "out", jobs=1, resume=True, trust=True)
    assert again.content_hash == table.content_hash


@pytest.mark.timeout(3600)  # for the nightly profile
def test_d02_runs_killed_at_any_moment_and_resumed_lose_nothing(tmp_path: Path) -> None:
    harm = write_case(tmp_path, "slow", 240)
    plain = serial(sweep_of(harm, "plain", 240))
    check(plain)
    generator = np.random.default_rng(20)
    for turn in range(ROUNDS):
        out = tmp_path / "out"
        if turn % 5 == 0:
            shutil.rmtree(out, ignore_errors=True)
        before = len(chunks(out))
        process = start(tmp_path, "--resume", "-j", "2", "--chunk", "3")
        wait_for(lambda: len(chunks(out)) > before, process)  # noqa: B023
        time.sleep(generator.uniform(0, 0.3))
        process.kill()
        process.communicate()
        kept = load_table(out)
        known = kept.known
        assert known.sum() > 0
        assert np.array_equal(kept.values[known], plain.values[known])
    process = start(tmp_path, "--resume", "-j", "2")
    _, said = process.communicate(timeout=120)
    assert process.returncode == 0, said
    assert load_table(tmp_path / "out").content_hash == plain.content_hash


def test_d03_ctrl_c_in_solve_keeps_what_there_is() -> None:
    model = registry.get("hunting")
    timer = threading.Timer(0.5, signal.raise_signal, (signal.SIGINT,))
    solve(model.build(), model.x0, (0, 1))  # compiled before the clock runs
    timer.start()
    solution = solve(model.build(), model.x0, (0, 1e9), dense_output=False, max_events=10**9)
    assert solution.status.value == "interrupted"
    assert 0 < solution.t_end < 1e9


def test_d04_ctrl_c_comes_back_at_once_with_what_is_done(tmp_path: Path) -> None:
    harm = write_case(tmp_path, "sleeps", 12)  # five points are quick, the others sleep for ten minutes
    process = start(tmp_path, "-j", "2", "--chunk", "1")
    wait_for(lambda: len(chunks(tmp_path / "out")) == 5, process)
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does
    _, said = process.communicate(timeout=20)
    assert process.returncode == 130, said
    assert "filippov sweep --config sweep.toml -o out -j 2 --chunk 1 --resume" in said
    assert "Traceback" not in said
    kept = load_table(tmp_path / "out")
    assert kept.known.tolist() == [True] * 5 + [False] * 7
    assert (tmp_path / "out/results.csv").exists()
    assert harm.exists()


def limit_files() -> None:
    resource.setrlimit(resource.RLIMIT_FSIZE, (4500, 4500))


def test_d05_d06_a_full_disk_is_named_and_leaves_no_half_file(tmp_path: Path) -> None:
    harm = write_case(tmp_path, "plain", 300)
    # Chunks grow from 4 points on; at some size the file no longer fits.
    process = start(tmp_path, "-j", "1", preexec_fn=limit_files)
    _, said = process.communicate(timeout=120)
    assert process.returncode == 1, said
    assert "no room for" in said
    assert str(tmp_path / "out/chunks") in said
    assert "bytes needed" in said
    assert "free" in said
    kept = load_table(tmp_path / "out")
    assert 0 < kept.known.sum() < 300
    assert not kept.damaged  # d06: nothing there reads as data but what is whole
    assert all(path.suffix == ".npz" for path in (tmp_path / "out/chunks").iterdir())
    process = start(tmp_path, "-j", "1", "--resume")
    _, said = process.communicate(timeout=120)
    assert process.returncode == 0, said
    assert load_table(tmp_path / "out").content_hash == serial(sweep_of(harm, "plain", 300)).content_hash


def test_d07_a_flipped_bit_is_noticed_and_the_chunk_computed_again(tmp_path: Path) -> None:
    sweep = sweep_of(write_case(tmp_path), count=20)
    plain = serial(sweep, tmp_path / "out", chunk=5)
    target = chunks(tmp_path / "out")[1]
    sound = target.read_bytes()
    noticed = 0
    for place in range(0, len(sound), 17):
        content = bytearray(sound)
        content[place] ^= 1 << (place % 8)
        target.write_bytes(content)
        kept = load_table(tmp_path / "out")
        # A bit in a date of the zip archive changes nothing; every other one is noticed.
        assert kept.damaged == (target.name,) or kept.content_hash == plain.content_hash
        noticed += bool(kept.damaged)
    assert noticed > 0.7 * len(sound) / 17
    content = bytearray(sound)
    held = [value for value in plain["twice"] if np.float64(value).tobytes() in sound]
    content[sound.index(np.float64(held[0]).tobytes()) + 6] ^= 1
    target.write_bytes(content)
    table = serial(sweep, tmp_path / "out", resume=True)
    assert table.damaged == (target.name,)
    assert table.content_hash == plain.content_hash
    check(table)


@pytest.mark.parametrize("damage", ["truncated", "empty", "missing", "swapped", "foreign"])
def test_d08_a_chunk_cut_off_emptied_or_gone_is_computed_again(tmp_path: Path, damage: str) -> None:
    sweep = sweep_of(write_case(tmp_path), count=20)
    plain = serial(sweep, tmp_path / "out", chunk=5)
    first, second = chunks(tmp_path / "out")[:2]
    if damage == "truncated":
        os.truncate(first, first.stat().st_size // 2)
    elif damage == "empty":
        os.truncate(first, 0)
    elif damage == "missing":
        first.unlink()
    elif damage == "swapped":
        shutil.copy(second, first)
    else:
        np.savez(first, index=np.arange(5), values=np.zeros((5, 2)))
    kept = load_table(tmp_path / "out")
    assert kept.known.sum() == 15
    assert kept.status.count("") == 5  # missing is not NaN with a status of success
    table = serial(sweep, tmp_path / "out", resume=True)
    assert table.content_hash == plain.content_hash
    assert table.damaged == (() if damage == "missing" else (first.name,))


def test_d09_one_run_a_folder_and_the_lock_of_a_dead_one_is_taken_over(tmp_path: Path) -> None:
    harm = write_case(tmp_path, "sleeps", 8)
    process = start(tmp_path, "-j", "1", "--chunk", "1")
    wait_for(lambda: chunks(tmp_path / "out"), process)
    with pytest.raises(UsageError, match=f"in use by process {process.pid} on this host"):
        serial(sweep_of(harm, "plain"), tmp_path / "out", fresh=True)
    process.kill()
    process.communicate()
    assert (tmp_path / "out/lock.json").exists()
    check(serial(sweep_of(harm, "plain"), tmp_path / "out", fresh=True))
    assert not (tmp_path / "out/lock.json").exists()


def test_d09_the_lock_of_another_host_is_not_taken(tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.mkdir()
    (out / "lock.json").write_text('{"pid": 1, "host": "elsewhere"}')
    with pytest.raises(UsageError, match="'elsewhere', which cannot be asked from here"):
        serial(sweep_of(write_case(tmp_path)), out)


def test_d10_a_changed_sweep_is_not_mixed_and_the_change_is_named(tmp_path: Path) -> None:
    harm, out = write_case(tmp_path), tmp_path / "out"
    serial(sweep_of(harm, rtol=1e-9), out)
    with pytest.raises(UsageError, match="holds this sweep already"):
        serial(sweep_of(harm, rtol=1e-9), out)
    with pytest.raises(UsageError, match=r"rtol was 1e-09, is 1e-08\. Name"):
        serial(sweep_of(harm, rtol=1e-8), out, resume=True)
    with pytest.raises(UsageError, match="points was"):
        serial(sweep_of(harm, count=9, rtol=1e-9), out, resume=True)
    (x,) = states("x")
    p = parameters(k=1.0)
    other = Problem(System({x: -2 * p.k * x}), x0=(1.0,), t_span=(0, 2))
    given: dict[str, Any] = {"measure": ["end(x)", f"{harm}:plain"], "rtol": 1e-9}
    with pytest.raises(UsageError, match=r"mix with this one: model was [0-9a-f]{57}\.\.\., is [0-9a-f]{57}"):
        serial(Sweep(other, {"k": range(1, 9)}, **given), out, resume=True)
    harm.write_text(harm.read_text() + "\n# another\n")
    with pytest.raises(UsageError, match="measure was"):
        serial(sweep_of(harm, rtol=1e-9), out, resume=True)


def test_d10_a_version_of_the_package_is_not_mixed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    harm, out = write_case(tmp_path), tmp_path / "out"
    serial(sweep_of(harm), out)
    monkeypatch.setattr("filippov.sweep.plan.package_version", lambda: "99.0")
    with pytest.raises(UsageError, match=r"filippov was .*, is 99\.0"):
        serial(sweep_of(harm), out, resume=True)


def test_d11_a_folder_that_cannot_be_written_is_refused_before_the_first_point(tmp_path: Path) -> None:
    sweep = sweep_of(write_case(tmp_path))
    with pytest.raises(UsageError, match="cannot be written"):
        serial(sweep, Path("/proc/sweep"))
    (tmp_path / "file").touch()
    with pytest.raises(UsageError, match="is a file, expected a folder"):
        serial(sweep, tmp_path / "file")
    check(serial(sweep, tmp_path / "made/on/the/way"))


def test_d11_too_little_room_is_known_before_the_first_point(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    usage = shutil.disk_usage(tmp_path)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: usage._replace(free=10_000))
    with pytest.raises(UsageError, match="has 10000 bytes free, about 66"):
        serial(sweep_of(write_case(tmp_path)), tmp_path / "out")


def test_d12_what_cannot_be_sent_to_a_process_is_said_before_it_is_tried() -> None:
    sweep = Sweep(decay(), {"k": [1, 2]}, measure=lambda solution: {"n": float(solution.nfev)})
    with pytest.raises(UsageError, match=r"cannot be sent to a worker process.*in a module.*dask.*threads"):
        sweep.run(jobs=1)
    assert serial(sweep).complete
    system = System(field=lambda t, x, p, s: [-x[0]], surfaces=[], states="x", parameters={"k": 1.0})
    with pytest.raises(UsageError, match="cannot be sent to a worker process"):
        Sweep(Problem(system, (1.0,), (0, 1)), {"k": [1, 2]}).run(jobs=1)


def run_script(folder: Path, text: str, *words: str) -> subprocess.CompletedProcess[str]:
    path = os.pathsep.join(filter(None, (str(ROOT), os.environ.get("PYTHONPATH"))))
    (folder / "script.py").write_text(text, encoding="utf-8")
    return subprocess.run(
        [sys.executable, *(words or ("script.py",))], cwd=folder, text=True, capture_output=True, timeout=100,
        env={**os.environ, "PYTHONPATH": path}, check=False,
    )  # fmt: skip


BARE = """
from decay import decay
from filippov import Sweep
table = Sweep(decay, {"k": [1, 2, 3]}, measure=MEASURE).run(jobs=1)
print(table.counts)
"""


def test_d12_a_function_of_the_prompt_is_told_from_one_of_a_module(tmp_path: Path) -> None:
    write_case(tmp_path)
    text = "def own(solution):\n    return {'n': 1.0}\n" + BARE.replace("MEASURE", "own")
    done = run_script(tmp_path, text, "-c", text)
    assert done.returncode == 1
    assert "defined in a notebook or at the prompt" in done.stderr


def test_d13_a_script_without_guard_is_told_so(tmp_path: Path) -> None:
    write_case(tmp_path)
    done = run_script(tmp_path, BARE.replace("MEASURE", "'end'"))
    assert done.returncode == 1
    assert 'if __name__ == "__main__":' in done.stderr.splitlines()[-1]


def test_d14_problems_systems_and_sweeps_survive_pickle() -> None:
    model = registry.get("hunting")
    problem = Problem(model.build(), model.x0, (0, 2), {"P": 20.0})
    again = pickle.loads(pickle.dumps(problem))  # noqa: S301
    assert again.system == problem.system
    assert (again.x0.tolist(), again.t_span, again.parameters) == (
        problem.x0.tolist(), problem.t_span, problem.parameters,
    )  # fmt: skip
    sweep = Sweep(problem, {"P": [10, 20]})
    copy = pickle.loads(pickle.dumps(sweep))  # noqa: S301
    assert serial(copy).content_hash == serial(sweep).content_hash


def test_d15_eight_threads_with_one_model_give_what_one_gives() -> None:
    model = registry.get("hunting")
    system = model.build()
    p = np.linspace(10, 30, 24)

    def end(value: float) -> list[float]:
        return [float(v) for v in solve(system, model.x0, (0, 5), parameters={"P": value}).x_end]

    one = [end(value) for value in p]
    with ThreadPoolExecutor(8) as pool:
        assert list(pool.map(end, p)) == one


def test_d16_a_damaged_cache_of_compiled_code_is_made_again(tmp_path: Path) -> None:
    write_case(tmp_path)
    cache = tmp_path / "cache"
    for damage in (None, 0.5):
        for path in (path for path in cache.rglob("*") if path.is_file()):
            os.truncate(path, int((damage or 0) * path.stat().st_size))
        # Two processes that compile the same unit at the same time.
        script = "from decay import decay; import filippov; print(filippov.solve(decay).x_end[0])"
        path = os.pathsep.join((str(ROOT), os.environ.get("PYTHONPATH", "")))
        both = [
            subprocess.Popen(
                [sys.executable, "-c", script], cwd=tmp_path, text=True, stdout=subprocess.PIPE,
                env={**os.environ, "PYTHONPATH": path, "FILIPPOV_CACHE": str(cache)},
            ) for _ in range(2)
        ]  # fmt: skip
        for process in both:
            said, _ = process.communicate(timeout=100)
            assert process.returncode == 0
            assert abs(float(said) - np.exp(-2)) < 1e-8
    assert any(path.stat().st_size for path in cache.rglob("*") if path.is_file())


class Unruly(Executor):
    """Runs everything twice, answers in reverse order, and once more when it is long over."""

    def __init__(self) -> None:
        self.calls: list[tuple[Future[Any], Callable[..., Any], tuple[Any, ...]]] = []
        self.late: list[Callable[[], Any]] = []

    def submit(self, fn: Callable[..., Any], /, *arguments: Any, **_: Any) -> Future[Any]:
        future: Future[Any] = Future()
        self.calls.append((future, fn, arguments))
        if len(self.calls) > 1:
            threading.Thread(target=self._answer, args=(self.calls,)).start()
            self.calls = []
        else:
            threading.Timer(0.2, self._answer, (self.calls,)).start()
        return future

    def _answer(self, calls: list[Any]) -> None:
        while calls:
            future, fn, arguments = calls.pop()
            fn(*arguments)
            self.late.append(lambda: fn(*arguments))  # noqa: B023
            future.set_result(fn(*arguments))


def test_d17_points_twice_out_of_order_and_late_are_kept_once_in_order(tmp_path: Path) -> None:
    sweep = sweep_of(write_case(tmp_path), count=20)
    unruly = Unruly()
    table = sweep.run(tmp_path / "out", executor=unruly, jobs=1, chunk=3)
    check(table)
    for again in unruly.late:
        again()
    assert load_table(tmp_path / "out").content_hash == table.content_hash
    assert table.content_hash == serial(sweep).content_hash


def test_d18_a_point_that_runs_for_ever_is_ended_and_the_others_go_on(tmp_path: Path) -> None:
    table = sweep_of(write_case(tmp_path), "stuck", 8).run(jobs=1, chunk=4, max_time=0.5)
    check(table, bad=(3,))
    assert table.status[2] == "timeout"
    assert "did not come back within max_time" in table.message[2]


def test_d18_a_limit_longer_than_a_thread_can_wait_is_none(tmp_path: Path) -> None:
    harm = write_case(tmp_path)
    for measure in ("plain", "slow"):
        check(sweep_of(harm, measure, 3).run(jobs=1, max_time=1e30))


def test_d18_a_batch_with_a_point_that_runs_for_ever_is_taken_apart() -> None:
    # x'' = -w^2 x turns 1e9 times in the third row.
    x, v = states("x v")
    p = parameters(w=1.0)
    problem = Problem(System({x: v, v: -(p.w**2) * x}), (1.0, 0.0), (0, 6))
    table = serial(Sweep(problem, {"w": [1, 2, 1e9, 3]}, max_steps=10**12), max_time=0.5)
    assert table.status == ["success", "success", "timeout", "success"]
    good = [0, 1, 3]
    assert np.allclose(table["end(x)"][good], np.cos(6 * table["w"][good]), atol=1e-7)


def test_d19_a_point_that_takes_all_memory_is_set_aside(tmp_path: Path) -> None:
    table = sweep_of(write_case(tmp_path), "hungry", 6).run(jobs=1, chunk=3, max_memory=6 << 30)
    check(table, bad=(3,))
    assert table.status[2] == "quarantined"
    assert "running out of memory" in table.message[2]
    assert "fewer jobs" in table.message[2]


def test_d20_spaces_bytes_locale_and_a_full_tmpdir_change_nothing(tmp_path: Path) -> None:
    folder = tmp_path / os.fsdecode(b"with space \xff")
    folder.mkdir()
    harm = write_case(folder)
    environment = {"TMPDIR": "/proc/full", "LC_ALL": "de_DE.UTF-8", "LANG": "de_DE.UTF-8"}
    process = start(folder, "-j", "1", env=environment)
    _, said = process.communicate(timeout=100)
    assert process.returncode == 0, said
    assert load_table(folder / "out").content_hash == serial(sweep_of(harm)).content_hash


def test_d20_a_clock_that_jumps_changes_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    clock = iter(range(10**9, 0, -1000))
    monkeypatch.setattr(time, "time", lambda: float(next(clock)))
    check(serial(sweep_of(write_case(tmp_path)), max_time=50.0))


def test_d04_an_interrupt_while_a_chunk_is_handed_over_leaves_no_worker(tmp_path: Path) -> None:
    class Interrupted(dict[Any, Any]):
        def __setitem__(self, key: Any, value: Any) -> None:
            raise KeyboardInterrupt

    engine = Processes(sweep_of(write_case(tmp_path, "sleeps", 12), "sleeps", 12), 1)
    engine.busy = Interrupted()
    with pytest.raises(KeyboardInterrupt):
        engine.submit(np.arange(6, 8), str(tmp_path), "k", None, False)
    (process,) = multiprocessing.active_children()
    engine.close(at_once=True)
    end = time.monotonic() + 10
    while Path(f"/proc/{process.pid}").exists():  # the executor's own thread waits for it, too
        assert time.monotonic() < end
        time.sleep(0.01)
