"""The same sweeps on dask: workers killed at random, and the same content as the own pool."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from sweep_case import check, serial, sweep_of, write_case

from filippov import Problem, Sweep
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
