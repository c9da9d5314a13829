"""Exported automata where resets accumulate at a surface without resting contact: the run ends there."""

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from exported import load

from filippov import Surface, System, export_system, states

COMPILER = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
x, y, z = states("x y z")


@pytest.mark.parametrize("seed", range(10))
def test_flights_that_shrink_end_as_zeno(tmp_path: Path, seed: int) -> None:
    """The gap x - d y - b falls at the rate c and is set to z, z to q z: flights z0 q**k / c."""
    rng = np.random.default_rng(seed)
    q, c, d, b, z0 = rng.uniform([0.2, 0.3, -1, -1, 0.1], [0.9, 3, 1, 1, 1]).tolist()
    surface = Surface("gap", x - d * y - b, reset={x: d * y + b + z, z: q * z})
    system = System({x: d - c + 0 * x, y: 1 + 0 * y, z: 0 * z}, surfaces=[surface])
    start, end = (b + z0, 0.0, q * z0), z0 / c / (1 - q)
    module = load(export_system(system, tmp_path / "gap.py", x0=start, t_span=(0, 2 * end + 1)))
    run = module.run()
    assert run.status == "zeno"
    assert abs(run.t[-1] - end) < 1e-9
    first = np.array([event.t for event in run.events])[:10]
    assert np.allclose(first, z0 / c * (1 - q ** np.arange(1, 11)) / (1 - q), rtol=0, atol=1e-9)
    if COMPILER is not None and seed < 4:
        text = export_system(system, tmp_path / "gap.c", x0=start, t_span=(0, 2 * end + 1))
        subprocess.run([COMPILER, "-O1", text, "-o", tmp_path / "gap", "-lm"], check=True)
        out = subprocess.run([tmp_path / "gap"], capture_output=True, text=True, check=False)
        assert out.returncode == 1
        assert out.stdout.strip().splitlines()[-1].split(",")[2] == "zeno"
