"""Sweeps without faults: points, measures against closed forms, tables and exports, the command."""

from __future__ import annotations

import json
import math
import pickle
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command import strict, table
from sweep_case import check, decay, serial, sweep_of, write_case

from filippov import Parameter, Problem, Surface, Sweep, System, UsageError, parameters, sign, states
from filippov.app.cli.main import main
from filippov.models import get
from filippov.solving.state.events import Stop
from filippov.sweep.dataset import load_table, to_xarray, write_csv, write_netcdf
from filippov.sweep.rows import Limits
from filippov.sweep.store import read_manifest


def oscillator() -> Problem:
    """x'' = -w^2 x with an observer at x = 0: x = a cos(w t)."""
    x, v = states("x v")
    p = parameters(w=Parameter(2.0, unit="rad/s"))
    system = System({x: v, v: -(p.w**2) * x}, surfaces=[Surface("middle", x, kind="observer")])
    return Problem(system, x0=(1.0, 0.0), t_span=(0, 10))


def brake() -> Problem:
    """v' = -mu sign(v): at rest from v0/mu on."""
    (v,) = states("v")
    p = parameters(mu=1.0)
    return Problem(System({v: -p.mu * sign(v)}, surfaces=[Surface("rest", v)]), x0=(1.0,), t_span=(0, 10))


def test_a_grid_is_every_combination_with_the_last_name_fastest() -> None:
    sweep = Sweep(decay(), {"k": [1, 2], "x0.x": [3, 4, 5]})
    assert sweep.points.tolist() == [[1, 3], [1, 4], [1, 5], [2, 3], [2, 4], [2, 5]]
    found = serial(sweep)
    assert np.allclose(found["end(x)"], found["x0.x"] * np.exp(-2 * found["k"]), rtol=1e-8)
    assert np.all(found["t_end"] == 2)


def test_a_worker_computes_without_sympy(tmp_path: Path) -> None:
    # Its import is half the start of a process; a worker needs expressions only where `solve` takes over.
    sweep = Sweep(decay(), {"k": np.linspace(1, 2, 64)}, measure=["end", "events"])
    assert sweep.lanes > 1
    parcel = tmp_path / "work"
    parcel.write_bytes(pickle.dumps(sweep))
    code = """
import pickle, sys
import numpy as np
from pathlib import Path
from filippov.sweep.rows import Limits
work = pickle.loads(Path(sys.argv[1]).read_bytes())
rows = work.compute(np.arange(64), Limits())
assert "sympy" not in sys.modules and set(rows.status) == {"success"}
assert [surface.name for surface in work.system.surfaces] == list(work.system.surface_names)
assert work.system.symbolic is not None and "sympy" in sys.modules
np.save(sys.argv[1] + ".npy", rows.values)
"""
    subprocess.run([sys.executable, "-c", code, str(parcel)], check=True)
    assert np.array_equal(np.load(f"{parcel}.npy"), sweep.compute(np.arange(64), Limits()).values)


def test_a_list_pairs_values_and_drawn_points_fill_their_box() -> None:
    assert Sweep(decay(), {"k": [1, 2], "x0.x": [3, 4]}, "list").points.tolist() == [[1, 3], [2, 4]]
    box: dict[str, Any] = {"k": (1, 3), "x0.x": (-1, 0)}
    hyper = Sweep(decay(), box, "latin_hypercube", n=50, seed=3).points
    # One point in each of the 50 slices of every axis.
    assert sorted(np.floor((hyper[:, 0] - 1) * 25).tolist()) == list(range(50))
    assert sorted(np.floor((hyper[:, 1] + 1) * 50).tolist()) == list(range(50))
    sobol = Sweep(decay(), box, "sobol", n=64, seed=3).points
    # A net: as many points in each half, quarter, eighth.
    assert np.all(np.bincount(np.floor((sobol[:, 0] - 1) * 4).astype(int)) == 8)
    assert np.array_equal(sobol, Sweep(decay(), box, "sobol", n=64, seed=3).points)
    assert not np.array_equal(sobol, Sweep(decay(), box, "sobol", n=64, seed=4).points)
    assert len(Sweep(decay(), box, "sobol", n=7).points) == 7


def test_measures_of_an_oscillation_have_their_closed_forms() -> None:
    measures = [
        "amplitude(x)", "max(v)", "min(v)", "mean(x)", "period(middle, crossing up)", "period(middle)",
        "events(middle)", "end",
    ]  # fmt: skip
    found = serial(Sweep(oscillator(), {"w": [2, 3.5], "x0.x": [0.5, 1]}, measure=measures, rtol=1e-10))
    w, a = found["w"], found["x0.x"]
    assert np.allclose(found["amplitude(x)"], a, atol=1e-8)
    assert np.allclose(found["max(v)"], a * w, atol=1e-7)
    assert np.allclose(found["min(v)"], -a * w, atol=1e-7)
    assert np.allclose(found["mean(x)"], a / w * (np.sin(10 * w) - np.sin(5 * w)) / 5, atol=1e-8)
    assert np.allclose(found["period(middle, crossing up)"], 2 * np.pi / w, atol=1e-8)
    assert np.allclose(found["period(middle)"], 2 * np.pi / w, atol=1e-8)
    assert found["events(middle)"].tolist() == np.floor(10 * w / np.pi + 0.5).tolist()
    assert np.allclose(found["end(x)"], a * np.cos(10 * w), atol=1e-7)


def test_measures_of_a_brake_have_their_closed_forms() -> None:
    measures = ["sliding(rest)", "dwell(+)", "dwell(0)", "mode(rest)", "events(rest, sliding entry)", "nfev"]
    found = serial(Sweep(brake(), {"mu": [0.5, 2], "x0.v": [1, 3]}, measure=measures))
    stop = found["x0.v"] / found["mu"]
    assert np.allclose(found["sliding(rest)"], 10 - stop, atol=1e-9)
    assert np.allclose(found["dwell(0)"], 10 - stop, atol=1e-9)
    assert np.allclose(found["dwell(+)"], stop, atol=1e-9)
    assert found["mode(rest)"].tolist() == [0] * 4
    assert found["events(rest, sliding entry)"].tolist() == [1] * 4


def test_points_together_and_one_by_one_agree(tmp_path: Path) -> None:
    vary = {"mu": np.linspace(0.5, 2, 10), "x0.v": np.linspace(0.1, 3, 10)}
    together = Sweep(brake(), vary, measure=["end", "t_end", "events"], stop=Stop("rest", "sliding entry"))
    single = Sweep(brake(), vary, measure=["end", "t_end", "events", "dwell(0)"],
                   stop=Stop("rest", "sliding entry"))  # fmt: skip
    assert together.lanes in (8, 16)
    assert single.lanes == 0
    a, b = serial(together), serial(single)
    assert np.allclose(a["t_end"], a["x0.v"] / a["mu"], atol=1e-9)
    assert np.allclose(a["t_end"], b["t_end"], atol=1e-9)
    assert a.status == b.status == ["stopped"] * 100


def test_chunks_of_any_size_give_the_same_bits(tmp_path: Path) -> None:
    vary = {"P": np.linspace(10, 30, 40), "x0.x": np.linspace(-0.3, 0.3, 30)}
    model = get("hunting")
    sweep = Sweep(Problem(model.build(), model.x0, (0, 3)), vary, measure=["end", "nfev"])
    assert sweep.lanes in (8, 16)
    plain = serial(sweep)
    assert serial(sweep, tmp_path, chunk=100).content_hash == plain.content_hash
    for path in sorted((tmp_path / "chunks").glob("*.npz"))[:2]:
        path.unlink()
    assert serial(sweep, tmp_path, resume=True).content_hash == plain.content_hash
    rows = sweep.compute(np.array([3, 700, 701]), Limits())
    assert np.array_equal(rows.values, plain.values[[3, 700, 701]])


def test_failures_are_rows_with_their_cause(tmp_path: Path) -> None:
    found = serial(sweep_of(write_case(tmp_path), "fails"))
    check(found, bad=(3,))
    assert found.status[2] == "error"
    assert found.message[2] == "ValueError: no three, please (line 40 of harm.py)"
    assert found.failed.tolist() == [2]
    (x,) = states("x")
    p = parameters(k=1.0)
    grows = Problem(System({x: p.k * x**2}), x0=(1.0,), t_span=(0, 2))
    burst = serial(Sweep(grows, {"k": [0.25, 1]}))
    assert burst.status[0] == "success"
    assert abs(burst["end(x)"][0] - 2) < 1e-7
    assert burst.status[1] in ("not_finite", "min_step")
    assert burst.message[1]


def test_reductions_are_those_of_the_points_that_succeeded(tmp_path: Path) -> None:
    found = serial(sweep_of(write_case(tmp_path), "fails", reduce=["mean", "max", "count"]))
    good = np.array([2.0 * k for k in range(1, 9) if k != 3])
    assert found.reduced["twice"] == {"mean": good.mean(), "max": 16, "count": 7}
    assert serial(sweep_of(write_case(tmp_path), reduce=lambda t: t["twice"].sum())).reduced == 72


def test_exports_keep_coordinates_units_and_causes(tmp_path: Path) -> None:
    xarray = pytest.importorskip("xarray")
    found = serial(Sweep(oscillator(), {"w": [2, 3.5], "x0.x": [0.5, 1, 2]}, rtol=1e-8))
    data = to_xarray(found)
    assert dict(data.sizes) == {"w": 2, "x0.x": 3}
    assert data["w"].attrs == {"units": "rad/s"}
    assert float(data["end(x)"].sel({"w": 3.5, "x0.x": 2})) == found["end(x)"][5]
    assert data.attrs["sweep_rtol"] == "1e-08"
    write_netcdf(found, tmp_path / "r.nc")
    with xarray.open_dataset(tmp_path / "r.nc", engine="h5netcdf") as read:
        assert np.array_equal(read["end(v)"].values, data["end(v)"].values)
        assert read.attrs["content_hash"] == found.content_hash
        assert read["w"].attrs["units"] == "rad/s"
    write_csv(found, tmp_path / "r.csv")
    rows = table(tmp_path / "r.csv")
    assert [float(row["end(x)"]) for row in rows] == found["end(x)"].tolist()
    assert {row["status"] for row in rows} == {"success"}
    lines = repr(found).splitlines()
    assert lines[0] == "6 points: 6 success"
    assert lines[1].split()[:2] == ["w", "x0.x"]
    assert len(lines) == 8
    assert float(lines[2].split()[2]) == pytest.approx(found["end(x)"][0], rel=1e-5)
    pytest.importorskip("pandas")
    assert found.to_pandas()["end(x)"].tolist() == found["end(x)"].tolist()
    drawn = to_xarray(serial(Sweep(oscillator(), {"w": (2, 3), "x0.x": (0, 1)}, "sobol", n=4)))
    assert dict(drawn.sizes) == {"point": 4}
    assert drawn["w"].dims == ("point",)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"over": {"kk": [1]}}, "unknown name to vary: 'kk'; did you mean 'k'?"),
        ({"over": {"x0.y": [1]}}, "did you mean 'x0.x'?"),
        ({"over": {}}, "over is empty"),
        ({"over": {"k": [1, math.nan]}}, "expected one or more finite numbers"),
        ({"samples": "sobl"}, "unknown samples 'sobl'; did you mean 'sobol'?"),
        ({"samples": "sobol"}, "expected the number of points"),
        ({"n": 3}, "expected none"),
        ({"samples": "sobol", "n": 3, "over": {"k": [1, 2, 3]}}, r"expected \(low, high\)"),
        ({"measure": "amplitud(x)"}, "unknown measure 'amplitud"),
        ({"measure": "end(y)"}, "unknown state 'y'"),
        ({"measure": "events(wall)"}, "unknown surface 'wall'"),
        ({"measure": "nothing.py:f"}, "there is no file"),
        ({"measure": ["end", "end"]}, "holds 'end' twice"),
        ({"tail": 2}, r"expected a number in \(0, 1\]"),
        ({"rtoll": 1e-3}, "unknown option 'rtoll'; did you mean 'rtol'?"),
        ({"reduce": ["men"]}, "unknown reduction 'men'"),
    ],
)
def test_what_is_wrong_is_said_before_anything_runs(change: dict[str, Any], said: str) -> None:
    given: dict[str, Any] = {"over": {"k": [1, 2]}, **change}
    with pytest.raises(UsageError, match=said):
        Sweep(decay(), **given)


def test_wrong_ways_to_run_are_refused(tmp_path: Path) -> None:
    sweep = Sweep(decay(), {"k": [1, 2]})
    with pytest.raises(UsageError, match="unknown executor 'proceses'; did you mean 'processes'"):
        sweep.run(executor="proceses")
    with pytest.raises(UsageError, match="exclude each other"):
        sweep.run(tmp_path, resume=True, fresh=True)
    with pytest.raises(UsageError, match="scheduler belongs to"):
        sweep.run(scheduler="tcp://nowhere:1")
    with pytest.raises(UsageError, match="jobs is 0"):
        sweep.run(jobs=0)


def test_a_manifest_that_was_tampered_with_is_refused(tmp_path: Path) -> None:
    serial(sweep_of(write_case(tmp_path)), tmp_path / "out")
    path = tmp_path / "out/manifest.json"
    sound = json.loads(path.read_text())
    for change in ({"chunks": "../../elsewhere"}, {"fields": {}}, {"version": 7}, {"format": "tar"}):
        path.write_text(json.dumps(sound | change))
        with pytest.raises(UsageError, match=r"was changed|has format version 7|is no manifest"):
            read_manifest(tmp_path / "out")
    path.write_text("[" * 100_000)
    with pytest.raises(UsageError, match="is damaged"):
        load_table(tmp_path / "out")


def test_the_command_sweeps_goes_on_and_tells_of_failures(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    write_case(tmp_path, "fails", 6)
    monkeypatch.chdir(tmp_path)
    words = ["sweep", "--config", "sweep.toml", "-o", "out", "-j", "1", "--reduce", "max", "--json"]
    assert main(words) == 3
    done = capsys.readouterr()
    data = strict(done.out)
    assert data["counts"] == {"error": 1, "success": 5}
    assert data["reduced"]["twice"] == {"max": 12}
    assert data["failed"][0]["values"] == {"k": 3}
    assert "point 2: error: ValueError: no three, please" in done.err
    rows = table(tmp_path / "out/results.csv")
    assert [row["status"] for row in rows] == ["success", "success", "error", *["success"] * 3]
    assert main([*words, "--quiet"]) == 2
    assert "--resume" in capsys.readouterr().err
    assert main([*words, "--resume"]) == 3
    assert strict(capsys.readouterr().out)["content_hash"] == data["content_hash"]
    (tmp_path / "bad.toml").write_text('model = "hunting"\n[sweep]\nmeasur = ["end"]\n')
    assert main(["sweep", "--config", "bad.toml"]) == 2
    assert "did you mean 'measure'" in capsys.readouterr().err


def test_the_command_ensemble_tells_where_trajectories_end(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    write_case(tmp_path)
    monkeypatch.chdir(tmp_path)
    drawn = "--over k=1:3 --over x0.x=1:2 --samples sobol -n 100"
    words = ["ensemble", "decay.py:decay", *drawn.split(" "), "-o", "out", "--json"]
    assert main(words) == 0
    assert strict(capsys.readouterr().out)["counts"] == {"success": 100}
    for row in table(tmp_path / "out/ends.csv"):
        end = float(row["x0.x"]) * math.exp(-2 * float(row["k"]))
        assert abs(float(row["end(x)"]) - end) < 1e-8
    with np.load(tmp_path / "out/ends.npz") as read:
        k, x0 = read["points"].T
        assert np.allclose(read["x"][:, 0], x0 * np.exp(-2 * k), atol=1e-8)
