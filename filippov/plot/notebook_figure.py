"""A figure that a notebook shows once, also where it is the value of a cell."""

from __future__ import annotations

import io
import sys
from typing import Any

import matplotlib as mpl
from matplotlib import pyplot as plt
from matplotlib.figure import Figure
from matplotlib.ticker import ScalarFormatter


class NotebookFigure(Figure):
    """A figure of pyplot that a notebook's cell shows once.

    The inline backend shows the figures that are open at the end of a cell, and the cell shows its value. A
    figure that was shown is no longer open, so that the one leaves it to the other.
    """

    def add_subplot(self, *args: Any, **options: Any) -> Any:
        """Axes with short numbers below, a power of 10 being taken out, that do not run into each other."""
        axes = super().add_subplot(*args, **options)
        formatter = axes.xaxis.get_major_formatter()
        if isinstance(formatter, ScalarFormatter):
            formatter.set_powerlimits((-3, 5))
        return axes

    def _ipython_display_(self) -> None:
        picture = io.BytesIO()
        self.savefig(picture, format="png")
        display: Any = sys.modules["IPython.display"].display
        display({"image/png": picture.getvalue(), "text/plain": repr(self)}, raw=True)
        if "inline" in mpl.get_backend():
            plt.close(self)
