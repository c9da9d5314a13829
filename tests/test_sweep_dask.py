"""The same sweeps on dask: workers killed at random, and the same content as the own pool."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from sweep_case import ROOT, check, serial, sweep_of, write_case

from filippov import Problem, SolveError, Sweep
from filippov.models import registry
from filippov.sweep.dataset import load_table

distributed = pytest.importorskip("distributed")
dask = pytest.importorskip("dask")
ROUNDS = 30 if os.environ.get("FILIPPOV_PROFILE") == "nightly" else 5


@pytest.fixture(scope="module")
def client() -> Iterator[Any]:
    # A cluster gives up workers that are not back in time; on a busy machine that may be after a while.
    with dask.config.set({"distributed.deploy.lost-worker-timeout": "600s"}):
        cluster = distributed.LocalCluster(
            n_workers=4, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs=50
        )
        with distributed.Client(cluster) as found:
            yield found
        with suppress(KeyError):  # its books may miss a worker that was killed; it has closed by then
            cluster.close()


@pytest.mark.timeout(3600)  # for the nightly profile
def test_dask_workers_killed_at_random_lose_nothing(client: Any, tmp_path: Path) -> None:
    harm = write_case(tmp_path, "slow", 120)
    plain = serial(sweep_of(harm, "plain", 120))
    check(plain)
    generator = np.random.default_rng(2)
    for turn in range(ROUNDS):
        client.wait_for_workers(4, timeout=300)
        pids = list(client.run(os.getpid).values())
        out = tmp_path / f"out{turn}"

        def kill(out: Path = out, pids: list[int] = pids) -> None:
            while not list((out / "chunks").glob("*.npz")):
                time.sleep(0.01)
            time.sleep(generator.uniform(0, 0.3))
            for pid in generator.choice(pids, 2, replace=False):
                with suppress(ProcessLookupError):
                    os.kill(int(pid), signal.SIGKILL)

        killer = threading.Thread(target=kill)
        killer.start()
        table = sweep_of(harm, "slow", 120).run(out, executor="dask", scheduler=client, jobs=4, chunk=3)
        killer.join()
        check(table)
        assert table.content_hash == plain.content_hash
        assert load_table(out).content_hash == plain.content_hash


def test_a_worker_that_is_lost_while_its_result_is_read_costs_nothing(client: Any, tmp_path: Path) -> None:
    """distributed reads the status of a future after its result: one that changed looks like an error."""
    cascade, spoiled = distributed.cfexecutor._cascade_future, []

    class Late:
        """A future whose status changes once its result has been read."""

        def __init__(self, future: Any) -> None:
            self.future, self.read = future, False

        @property
        def status(self) -> str:
            return "pending" if self.read else self.future.status

        async def _result(self, raiseit: bool) -> Any:
            result = await self.future._result(raiseit=raiseit)
            self.read = len(spoiled) < 3
            spoiled.append(self.read)
            return result

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(distributed.cfexecutor, "_cascade_future", lambda f, to: cascade(Late(f), to))
        sweep = sweep_of(write_case(tmp_path, "plain", 40), "plain", 40)
        table = sweep.run(tmp_path / "out", executor="dask", scheduler=client, chunk=5)
    assert sum(spoiled) == 3
    check(table)
    assert table.content_hash == serial(sweep).content_hash


def test_dask_and_the_own_pool_give_the_same_content(client: Any, tmp_path: Path) -> None:
    model = registry.get("hunting")
    vary = {"P": np.linspace(10, 30, 15), "x0.x": np.linspace(-0.3, 0.3, 10)}
    sweep = Sweep(Problem(model.build(), model.x0, (0, 4)), vary, measure=["end", "events", "nfev"])
    address = client.scheduler.address
    pool = sweep.run(tmp_path / "pool", jobs=2, chunk=70)
    dask = sweep.run(tmp_path / "dask", executor="dask", scheduler=address, jobs=4, chunk=20)
    assert dask.complete
    assert dask.content_hash == pool.content_hash == serial(sweep).content_hash
    # What one engine left, the other goes on with.
    for path in sorted((tmp_path / "dask/chunks").glob("*.npz"))[::2]:
        path.unlink()
    assert sweep.run(tmp_path / "dask", jobs=1, resume=True).content_hash == pool.content_hash


CLUSTER = """
import time
import distributed
if __name__ == "__main__":
    cluster = distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs=50
    )
    print(cluster.scheduler_address, flush=True)
    time.sleep(600)
"""


def test_11_20_a_lost_scheduler_is_named_and_what_is_done_is_kept(tmp_path: Path) -> None:
    (tmp_path / "cluster.py").write_text(CLUSTER)
    path = os.pathsep.join((str(ROOT), os.environ.get("PYTHONPATH", "")))
    cluster = subprocess.Popen(
        [sys.executable, "cluster.py"], cwd=tmp_path, text=True, start_new_session=True,
        stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, env={**os.environ, "PYTHONPATH": path},
    )  # fmt: skip
    assert cluster.stdout is not None
    address, out = cluster.stdout.readline().strip(), tmp_path / "out"
    sweep = sweep_of(write_case(tmp_path, "slow", 200), "slow", 200)
    done: list[int] = []

    def look(points: int, _: int) -> None:
        done.append(points)
        if len(done) == 4:
            os.killpg(cluster.pid, signal.SIGKILL)

    with dask.config.set({"distributed.comm.timeouts.connect": "2s"}):
        with pytest.raises(SolveError, match=r"dask's scheduler is lost.*are kept.*resume=True \(--resume\)"):
            sweep.run(out, executor="dask", scheduler=address, chunk=4, progress=look)
        cluster.communicate()
        with pytest.raises(SolveError, match=r"scheduler at .* does not answer"):
            sweep.run(out, executor="dask", scheduler=address, resume=True)
    kept = load_table(out)
    assert kept.known.sum() >= done[3] > 0
    table = serial(sweep, out, resume=True)
    check(table)
