"""Draw the committed figures of the README and the pages: python docs/figures.py [NAME ...].

Without names all but chain.png, which is a measurement (some minutes, on a machine with nothing else to do);
those of the page Explorer are taken by docs/screenshots.py.
"""

from __future__ import annotations

import shlex
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import matplotlib as mpl
import numpy as np

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent))
mpl.use("svg")

from matplotlib import pyplot as plt  # noqa: E402

from filippov import solve  # noqa: E402
from filippov.analysis.maps.event_map import EventMap  # noqa: E402
from filippov.analysis.maps.section import Section  # noqa: E402
from filippov.app.cli.main import main  # noqa: E402
from filippov.base.whole_file import write_whole  # noqa: E402
from filippov.models import get  # noqa: E402
from filippov.plot.maps import plot_event_map  # noqa: E402
from filippov.plot.solution import plot_solution  # noqa: E402


def hunting() -> None:
    """Response of the reference system and the second iterate of its event map, side by side."""
    model = get("hunting")
    system = model.build()
    response = solve(system, model.x0, (0.0, 12.0))
    turns = EventMap(system, Section.from_model(model), order=2)
    whole = plt.figure(figsize=(11.4, 4.0), layout="constrained")
    left, right = whole.subfigures(1, 2, width_ratios=(1.35, 1.0))
    names = {"t": "time [s]", "x": "position [m]", "v": "velocity [m/s]"}
    plot_solution(response, ["x", "v"], figure=left, labels=names)
    plot_event_map(
        turns, 0.0, 0.5, fixed=turns.fixed_points(0.0, 0.5), figure=right,
        labels={"d": "stick position [m]", "image": "two sticks later [m]"},
    )  # fmt: skip
    # No date and no random ids: the same figure is the same file.
    with mpl.rc_context({"svg.hashsalt": "filippov", "svg.fonttype": "none"}):
        whole.savefig(HERE / "_static" / "hunting.svg", metadata={"Date": None, "Creator": None})
    plt.close(whole)


def friction_curve() -> None:
    """Points of a Stribeck curve with noise of 0.02 N, seed 3: the measurements of the README's example."""
    rng = np.random.default_rng(3)
    v = np.concatenate((-np.geomspace(0.8, 1e-3, 90), np.geomspace(1e-3, 0.8, 90)))
    force = np.sign(v) * (2 + 2 * np.exp(-((np.abs(v) / 0.1) ** 2))) + v + 0.02 * rng.standard_normal(v.size)
    rows = ["velocity [m/s],friction [N]", *(f"{a:.6g},{b:.6g}" for a, b in zip(v, force, strict=True))]
    write_whole(HERE / "_static" / "friction.csv", "\n".join(rows) + "\n")


def basin() -> None:
    """basin.png, by the command on the page on regions."""
    lines = (HERE / "regions.md").read_text(encoding="utf-8").splitlines()
    (command,) = (line for line in lines if "filippov basin" in line and "--cells" in line)
    words = shlex.split(command)[1:]
    with tempfile.TemporaryDirectory() as folder:
        words[words.index("-o") + 1] = folder
        assert main(words) == 0
        shutil.copyfile(Path(folder) / "basin.png", HERE / "_static" / "basin.png")


def measured(benchmark: str, *words: str) -> None:
    """What a benchmark draws of what it measures."""
    script = HERE.parent / "tests" / "benchmarks" / benchmark
    subprocess.run([sys.executable, script, *words], check=True)  # noqa: S603


FIGURES = {
    "hunting.svg": hunting, "friction.csv": friction_curve, "basin.png": basin,
    "convergence.png": lambda: measured("convergence.py", str(HERE / "_static" / "convergence.png")),
    "chain.png": lambda: measured("chain.py", "--plot", str(HERE / "_static" / "chain.png")),
}  # fmt: skip

if __name__ == "__main__":
    for name in sys.argv[1:] or [name for name in FIGURES if name != "chain.png"]:
        FIGURES[name]()
