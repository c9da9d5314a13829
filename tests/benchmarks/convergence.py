"""Draw error against step for every method and situation: python tests/benchmarks/convergence.py [PNG]."""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib as mpl
import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tests")]
mpl.use("agg")

from matplotlib import pyplot as plt  # noqa: E402
from test_convergence import CASES, LARGEST, LEAST, ORDERS, errors  # noqa: E402


def main(path: Path) -> None:
    """One panel a method: the error at the end of the run over the step, with the fitted order."""
    figure, panels = plt.subplots(1, len(ORDERS), figsize=(10.5, 5.2), sharey=True, layout="constrained")
    for panel, (method, order) in zip(panels, ORDERS.items(), strict=True):
        for name, marker in zip(CASES, "osD^v", strict=False):
            steps, error = errors(method, name)
            fit = (error < LARGEST) & (error > LEAST)
            slope = -np.polyfit(np.log(steps[fit]), np.log(error[fit]), 1)[0]
            width = CASES[name][2] / steps
            panel.loglog(width, error, marker, ms=4, mfc="none", label=f"{name}: {slope:.2f}")
        line = np.array([0.1, 0.5])
        panel.loglog(line, 30 * LEAST * (line / line[0]) ** order, "k--", lw=1, label=f"order {order}")
        panel.set_title(method)
        panel.set_xlabel("step, in the time of the equations")
        panel.set_ylim(1e-15, 1e-2)
        panel.grid(alpha=0.3)
        below = {"loc": "upper center", "bbox_to_anchor": (0.5, -0.14), "ncols": 2}
        panel.legend(fontsize=8, title="fitted order", **below)
    panels[0].set_ylabel("error at the end of the run")
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "docs" / "_static" / "convergence.png")
