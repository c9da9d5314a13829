"""Draw the figures that the README shows: python docs/figures.py. The SVG files are committed."""

from __future__ import annotations

import sys
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


if __name__ == "__main__":
    hunting()
    friction_curve()
