"""A figure that a notebook shows once, also where it is the value of a cell."""

from __future__ import annotations

import io
import sys
from typing import Any

import matplotlib as mpl
from matplotlib import pyplot as plt
from matplotlib.figure import Figure


class NotebookFigure(Figure):
    """A figure of pyplot: the inline backend shows those that are open at the end of a cell.

    The value of the cell would be shown a second time; what is closed, of an earlier cell, is shown as its
    picture.
    """

    def _ipython_display_(self) -> None:
        number = getattr(self, "number", None)
        if "inline" in mpl.get_backend() and number is not None and plt.fignum_exists(number):
            return
        picture = io.BytesIO()
        self.savefig(picture, format="png")
        display: Any = sys.modules["IPython.display"].display
        display({"image/png": picture.getvalue(), "text/plain": repr(self)}, raw=True)
