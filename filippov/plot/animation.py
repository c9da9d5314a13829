"""The solution as a film: states and outputs over time, with the present marked, and the phase portrait."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from filippov.base.errors import UsageError
from filippov.base.given import Count, Positive
from filippov.base.keywords import keywords
from filippov.plot.solution import plot_phase, plot_solution
from filippov.plot.style import INK, new_figure, style
from filippov.solving.reading import evaluate
from filippov.solving.solution import Solution

MOST_FRAMES = 2000


@keywords()
def animate(
    solution: Solution,
    path: str | Path,
    states: Sequence[str] | str | None = None,
    *,
    seconds: Positive = 6.0,
    frames: Count = 90,
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
        try:
            left: Any = figure
            right: Any = None
            if wide:
                parts: Any = figure.subfigures(1, 2, width_ratios=[1.4, 1])
                left, right = parts
            plot_solution(solution, states, labels=labels, title=title, figure=left)
            times = np.linspace(solution.problem.t_span[0], solution.t_end, frames)
            now = [ax.axvline(times[0], color=INK, linewidth=1.2) for ax in left.axes]
            point = None
            if right is not None:
                names = solution.system.states[:2]
                own = {name: text for name, text in (labels or {}).items() if name in names}
                plot_phase(solution, figure=right, labels=own)
                ring = {"markersize": 9, "markerfacecolor": "white", "markeredgewidth": 2, "zorder": 6}
                point = right.axes[0].plot([], [], "o", color=INK, **ring)[0]
                path_x, path_y = (np.asarray(evaluate(solution, n, times)) for n in names)

            def draw(k: int) -> None:
                for line in now:
                    line.set_xdata([times[k], times[k]])
                if point is not None:
                    point.set_data([path_x[k]], [path_y[k]])

            # Laid out once: nothing moves but the marks.
            figure.draw_without_rendering()
            figure.set_layout_engine("none")
            rate = max(1, round(frames / seconds))
            film = animation.FuncAnimation(figure, draw, frames=frames, blit=False)
            writer = "pillow" if target.suffix.lower() == ".gif" else "ffmpeg"
            with tempfile.TemporaryDirectory(dir=target.parent) as folder:
                film.save(Path(folder) / target.name, writer=writer, fps=rate, dpi=100)
                (Path(folder) / target.name).replace(target)
        finally:
            plt.close(figure)
    return target
