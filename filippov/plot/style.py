"""One look for all figures: colours that colour-blind readers tell apart (Okabe & Ito 2008), thin frames."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING, Any

from filippov.base.escape import figure_text
from filippov.base.label import unit_of
from filippov.base.status import EventKind

if TYPE_CHECKING:
    from matplotlib.figure import Figure

INK, GREY, PALE = "#222222", "#6b6b6b", "#d9d9d9"
BLUE, ORANGE, GREEN, RED = "#0072b2", "#e69f00", "#009e73", "#d55e00"
PURPLE, SKY = "#cc79a7", "#56b4e9"
SERIES = (BLUE, RED, GREEN, PURPLE, ORANGE, SKY)
SLIDING = (ORANGE, SKY, GREEN, PURPLE)
MARKS = {
    EventKind.CROSSING: ("o", INK), EventKind.ENTRY: ("v", RED), EventKind.EXIT: ("^", GREEN),
    EventKind.GRAZING: ("x", PURPLE), EventKind.RESET: ("D", INK),
}  # fmt: skip
LONG = 18
_RC: dict[str, Any] = {
    "axes.axisbelow": True, "axes.edgecolor": GREY, "axes.grid": False, "axes.labelcolor": INK,
    "axes.linewidth": 0.7, "axes.spines.right": False, "axes.spines.top": False, "figure.dpi": 110,
    "font.size": 9.5, "hatch.color": "#9a9a9a", "hatch.linewidth": 0.6,
    "legend.fontsize": 8.5, "legend.frameon": False, "lines.linewidth": 1.3,
    "savefig.bbox": "tight", "savefig.dpi": 160, "svg.fonttype": "none", "svg.hashsalt": "filippov",
    "xtick.color": GREY, "xtick.labelcolor": INK, "ytick.color": GREY, "ytick.labelcolor": INK,
}  # fmt: skip


def style() -> AbstractContextManager[None]:
    """A context in which figures get this look."""
    mpl = _matplotlib()
    from matplotlib import pyplot as plt

    # The backend is loaded first: what it sets of matplotlib would be undone at the end of the context.
    load: Any = plt.draw_if_interactive
    load()
    return mpl.rc_context(_RC)  # type: ignore[no-any-return]


def new_figure(width: float, height: float) -> Figure:
    """An empty figure (inches) that plt.show() shows, once in a cell of a notebook."""
    _matplotlib()
    from matplotlib import pyplot as plt

    from filippov.plot.notebook_figure import NotebookFigure

    return plt.figure(figsize=(width, height), layout="constrained", FigureClass=NotebookFigure)


def axis_label(system: Any, name: str) -> str:
    """The label of an axis: what the system says of a state, output or time; a parameter with its unit."""
    if name in system.labels:
        return str(system.labels[name])
    if name in system.parameters:
        unit = system.parameters[name].unit
        return figure_text(f"{name} [{unit}]" if unit else name)
    word, _, state = name.partition(" ")
    if word in ("max", "min", "amplitude") and state in system.labels:
        return f"{word} of {system.labels[state]}"
    if name == "period" and "[" in (time := str(system.labels.get("t", ""))):
        return f"period {time[time.index('[') :]}"
    return figure_text(name)


def axis_labels(system: Any, *names: str) -> dict[str, str]:
    """The labels of axes by name, see `axis_label`; none without a system."""
    return {name: axis_label(system, name) for name in names} if system is not None else {}


def coordinate_labels(system: Any, section: Any, order: int = 1) -> dict[str, str]:
    """Labels of a map's axes: of the coordinate "d", and of its "image" `order` returns later."""
    if not hasattr(section, "coordinate"):
        return {}
    read = axis_label(system, str(section.coordinate))
    here, later = where_read(section, order)
    return {"d": f"{read} {here}", "image": f"{read} {later}"}


def where_read(section: Any, order: int = 1) -> tuple[str, str]:
    """Where a coordinate is read and where the one that is set against it, in words: labels of axes."""
    if getattr(section, "kind", "") == "reset":
        return "after the reset", f"after reset {order} from it"
    if hasattr(section, "kind"):
        return "at the event", f"at event {order} after it"
    return str(section), f"{order} period{'s' if order > 1 else ''} later"


def time_unit(system: Any, power: str = "") -> str:
    """A system's unit of time in brackets, " [s]", with power="1/" that of a rate, " [1/s]"; else ""."""
    unit = unit_of(str(system.labels.get("t", "")))
    return f" [{power}{unit}]" if unit else ""


def panel_label(label: str) -> str:
    """A label beside a low panel: a long one has its unit, or its last words, on a line of their own."""
    name, bracket, unit = label.rpartition(" [")
    if bracket and len(label) > LONG:
        return f"{name}\n[{unit}"
    if len(label) <= LONG or " " not in label:
        return label
    gaps = [place for place, letter in enumerate(label) if letter == " "]
    middle = min(gaps, key=lambda place: abs(place - len(label) / 2))
    return f"{label[:middle]}\n{label[middle + 1 :]}"


def log_ticks(axis: Any) -> None:
    """Number 2 and 5 times a power of ten on a logarithmic axis that shows one power only.

    Over less than a decade matplotlib numbers ticks in between by itself.
    """
    from matplotlib.ticker import FuncFormatter, LogLocator

    low, high = sorted(math.log10(value) for value in axis.get_view_interval())
    if high - low >= 1.0 and math.floor(high) - math.ceil(low) < 1:
        plain = FuncFormatter(lambda value, _: f"{value:g}")
        axis.set_minor_locator(LogLocator(subs=(2.0, 5.0)))
        axis.set_minor_formatter(plain)
        axis.set_major_formatter(plain)


def column(figure: Figure, rows: int, heights: Sequence[float] | None = None) -> Sequence[Any]:
    """Axes above each other with one time axis, of these relative heights."""
    axes = figure.subplots(rows, 1, sharex=True, squeeze=False, height_ratios=heights)[:, 0]
    figure.align_ylabels(list(axes))
    for ax in axes:  # a power of ten stands left of the axis: above it is the legend
        ax.yaxis.get_offset_text().set_horizontalalignment("right")
    return list(axes)


def _matplotlib() -> Any:
    try:
        import matplotlib as mpl
    except ImportError:
        raise ImportError(
            "plots need matplotlib, which is not installed: pip install filippov[plots]"
        ) from None
    return mpl
