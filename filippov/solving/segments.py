"""The segments of a solution: in each it stays in one mode."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
import numpy.typing as npt

from filippov.base.errors import UsageError
from filippov.base.keywords import keywords
from filippov.base.names import Answering, unknown
from filippov.base.status import mode_text
from filippov.solving.state.events import Mode

# Words for a mode: whether it slides.
WORDS = {"stick": True, "sliding": True, "slip": False, "free": False}


@dataclass(frozen=True)
class Segment(Answering):
    """The part of a solution in one mode, from t0 to t1 in the direction of integration."""

    _elsewhere: ClassVar[Mapping[str, str]] = {
        **dict.fromkeys(("start", "begin", "t_start"), "it begins at t0."),
        **dict.fromkeys(("end", "stop", "t_end"), "it ends at t1."),
        **dict.fromkeys(("duration", "length"), "its length in time is dwell."),
        **dict.fromkeys(("kind", "word", "signs"), "its signs are mode; segments.of('stick') selects."),
    }

    t0: float
    t1: float
    mode: Mode

    @property
    def dwell(self) -> float:
        """Length in time."""
        return abs(self.t1 - self.t0)

    def __str__(self) -> str:
        return f"{mode_text(self.mode)} [{self.t0:.9g}, {self.t1:.9g}]"


class Segments(Answering, tuple[Segment, ...]):  # noqa: SLOT001  # each has the names of its surfaces
    """The segments of a solution in order; surfaces: the names to which the signs of a mode belong."""

    surfaces: tuple[str, ...] = ()

    if not TYPE_CHECKING:  # the type is that of a tuple

        def __getitem__(self, item: Any) -> Any:
            if isinstance(item, str):
                raise UsageError(
                    f"segments go by number, not {item!r}: segments.of('stick') has those of a mode."
                )
            return super().__getitem__(item)

    @classmethod
    def made(cls, items: Iterable[Segment], surfaces: tuple[str, ...]) -> Segments:
        """The segments of a system with these surfaces."""
        out = cls(items)
        out.surfaces = surfaces
        return out

    @property
    def durations(self) -> npt.NDArray[np.float64]:
        """The length of each in time."""
        return np.array([segment.dwell for segment in self], dtype=float)

    @property
    def spans(self) -> npt.NDArray[np.float64]:
        """(from, to) of each stay, those that follow on each other as one, (k, 2): sticks of one of many."""
        joined: list[list[float]] = []
        for segment in self:
            if joined and segment.t0 == joined[-1][1]:
                joined[-1][1] = segment.t1
            else:
                joined.append([segment.t0, segment.t1])
        return np.array(joined, dtype=float).reshape(-1, 2)

    @keywords()
    def of(self, mode: str, surface: str | None = None) -> Segments:
        """Those of one mode.

        mode     "stick" or "sliding" (on a surface), "slip" or "free" (on none), or signs such as "+0", with
                 * for any
        surface  the one to which the word or sign refers; default: any of them, or all signs in their order

        Raises UsageError.
        """
        if surface is not None and surface not in self.surfaces:
            raise UsageError(unknown("surface", surface, self.surfaces))
        at = range(len(self.surfaces)) if surface is None else [self.surfaces.index(surface)]
        if mode in WORDS:
            found = [q for q in self if any(q.mode[i] == 0 for i in at) == WORDS[mode]]
        elif len(str(mode)) == len(at) and not set(str(mode)) - set("+0-*"):
            pairs = list(zip(at, str(mode), strict=True))
            found = [q for q in self if all(c == "*" or mode_text((q.mode[i],)) == c for i, c in pairs)]
        else:
            names = f" ({', '.join(self.surfaces)})" if surface is None else ""
            raise UsageError(
                f"mode is {mode!r}, expected one of {', '.join(WORDS)}, or {len(at)} of + 0 - *{names}."
            )
        return Segments.made(found, self.surfaces)
