"""The solution as a film: states and outputs over time, with the present marked, and the phase portrait."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from filippov.base.errors import UsageError
from filippov.base.given import Amount, Positive
from filippov.base.keywords import keywords
from filippov.plot.solution import plot_phase, plot_solution
from filippov.plot.style import INK, new_figure, style
from filippov.solving.reading import evaluate
from filippov.solving.solution import Solution

MOST_FRAMES, DPI = 2000, 100


@keywords()
def animate(
    solution: Solution,
    path: str | Path,
    states: Sequence[str] | str | None = None,
    *,
    seconds: Positive = 6.0,
    frames: Amount = 90,
    labels: Mapping[str, str] | None = None,
    title: str = "",
) -> Path:
    """Write the solution as a film and return its path: .gif (with pillow), .mp4 (with the program ffmpeg).

    states   states, outputs and formulas over time, as in `plot`; beside them the phase portrait of the first
             two states, where there are two
    seconds  length of the film; frames: its pictures, equally spaced in time

    Raises UsageError, and ImportError without matplotlib.
    """
    target = Path(path)
    if target.suffix.lower() not in (".gif", ".mp4"):
        raise UsageError(f"animate was given {str(path)!r}, expected a file name that ends in .gif or .mp4.")
    if not 2 <= frames <= MOST_FRAMES:
        raise UsageError(f"frames is {frames!r}, expected 2 to {MOST_FRAMES}.")
    if not seconds > 0:
        raise UsageError(f"seconds is {seconds!r}, expected a number > 0.")
    if solution.sol is None:
        raise UsageError("animate needs the dense output; solve without dense_output=False.")
    if not target.parent.is_dir():
        raise UsageError(f"there is no folder {str(target.parent)!r}; make it first.")
    with style():
        from matplotlib import animation
        from matplotlib import pyplot as plt

        if target.suffix.lower() == ".mp4" and not animation.writers.is_available("ffmpeg"):
            raise UsageError("a film in .mp4 needs the program ffmpeg, which is not there; write a .gif.")
        wide = len(solution.system.states) > 1
        figure = new_figure(10.0 if wide else 6.5, 4.6)
        film: Any = None
        try:
            left: Any = figure
            right: Any = None
            if wide:
                parts: Any = figure.subfigures(1, 2, width_ratios=[1.4, 1])
                left, right = parts
            plot_solution(solution, states, labels=labels, title=title, figure=left)
            times = np.linspace(solution.problem.t_span[0], solution.t_end, frames)
            if right is not None:
                names = solution.system.states[:2]
                own = {name: text for name, text in (labels or {}).items() if name in names}
                plot_phase(solution, figure=right, labels=own)
            # Nothing moves but the marks: the rest is drawn once, and is the ground of every picture.
            film, (wide_px, high_px) = _still(figure)
            bars = []
            for ax in left.axes:
                ends = [(0.0, y) for y in ax.transAxes.transform([(0, 0), (0, 1)])[:, 1] / high_px]
                at = ax.transData.transform(np.column_stack([times, np.zeros(frames)]))[:, 0] / wide_px
                bars.append((_mark(film, *zip(*ends, strict=True), color=INK, linewidth=1.2), at))
            track: Any = None
            if right is not None:
                x, y = (np.asarray(evaluate(solution, n, times)) for n in names)
                track = right.axes[0].transData.transform(np.column_stack([x, y])) / (wide_px, high_px)
                ring = {"markersize": 9, "markerfacecolor": "white", "markeredgewidth": 2}
                point = _mark(film, [0.5], [0.5], color=INK, marker="o", linestyle="none", **ring)
            known: Any = animation.writers
            rate = max(1, round(frames / seconds))
            writer = known["pillow" if target.suffix.lower() == ".gif" else "ffmpeg"](fps=rate)
            with tempfile.TemporaryDirectory(dir=target.parent) as folder:
                with writer.saving(film, str(Path(folder) / target.name), DPI):
                    for k in range(frames):
                        for bar, at in bars:
                            bar.set_xdata([at[k], at[k]])
                        if track is not None:
                            point.set_data([track[k, 0]], [track[k, 1]])
                        writer.grab_frame()
                (Path(folder) / target.name).replace(target)
        finally:
            plt.close(figure)
    return target


def _still(figure: Any) -> tuple[Any, tuple[float, float]]:
    """A figure that shows the picture of another one, and its size in pixels."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure.set_dpi(DPI)
    canvas: Any = FigureCanvasAgg(figure)
    canvas.draw()
    ground = np.asarray(canvas.buffer_rgba())
    out = Figure(figsize=figure.get_size_inches(), dpi=DPI)
    FigureCanvasAgg(out)
    out.figimage(ground, origin="upper")
    return out, (float(ground.shape[1]), float(ground.shape[0]))


def _mark(figure: Any, x: Any, y: Any, **look: Any) -> Any:
    """A line over the picture, in shares of its width and height."""
    from matplotlib.lines import Line2D

    return figure.add_artist(Line2D(list(x), list(y), transform=figure.transFigure, **look))
