"""The files of a report: each is written completely or not at all."""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING

from filippov.base.whole_file import write_whole
from filippov.plot.style import style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DPI = 160
MARGIN = 0.08  # inches


def write(path: Path, content: str | bytes) -> None:
    """Write a file, completely or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    write_whole(path, content)


def rendered(figure: Figure) -> tuple[str, bytes]:
    """A figure as SVG text and as PNG; it is closed."""
    from matplotlib import pyplot as plt

    vector, raster = io.StringIO(), io.BytesIO()
    try:
        with style():
            # Layout and extent are found once for both files.
            figure.draw_without_rendering()
            figure.set_layout_engine("none")
            box = figure.get_tightbbox().padded(MARGIN)
            figure.savefig(vector, format="svg", bbox_inches=box, metadata={"Date": None, "Creator": None})
            figure.savefig(raster, format="png", dpi=DPI, bbox_inches=box, metadata={"Software": None})
    finally:
        plt.close(figure)
    return vector.getvalue(), raster.getvalue()
