"""A search for attractors on file, so that one that was ended goes on where it was last written.

The file is written every EVERY iterates and once all are done, whole or not at all, and never in the middle
of an iterate: what goes on from it does what the search would have done.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from filippov.analysis.invariant_sets.attractor import Attractor
from filippov.analysis.orbits.orbit_file import LARGEST_FILE, finite, number
from filippov.base.errors import UsageError
from filippov.base.read_whole import json_data
from filippov.io.archive import Archive, write_arrays

EVERY = 10
FORMAT, VERSION = "filippov search of attractors", 1
_BY_SOLUTION = ("x", "label", "still", "close", "waited", "tried")


class SearchFile:
    """The file at a path; settings: all that decides the search, as plain data.

    The search that is written and read is a `filippov.analysis.invariant_sets.attractor_search.Search`.
    """

    def __init__(self, path: str | Path, settings: Mapping[str, Any]) -> None:
        self.path, self.settings = Path(path), json.loads(json.dumps(finite(dict(settings))))

    def write(self, search: Any) -> None:
        """Write the state of a search, which is between two iterates."""
        left = np.flatnonzero(search.label == -1)
        plain = {
            "format": FORMAT, "version": VERSION, "settings": self.settings,
            "attractors": [_data(one) for one in search.attractors],
            "unstable": [_data(one) for one in search.unstable],
            "failures": search.failures, "rests": search.rests, "vain": search.vain,
            "looked": search.looked.tolist(), "iterates": search.iterates,
        }  # fmt: skip
        arrays: dict[str, npt.NDArray[Any]] = {name: getattr(search, name) for name in _BY_SOLUTION}
        arrays["streak"] = search.past.streak
        # Only solutions on their way are asked again where they have been.
        arrays["cells"] = search.past.cells[left, : search.past.length].view(np.int64)
        arrays["plain"] = np.frombuffer(json.dumps(finite(plain)).encode(), dtype=np.uint8)
        write_arrays(self.path, arrays)

    def read(self, search: Any) -> None:
        """Bring a search to the state in the file; nothing where there is none. Raises UsageError."""
        if not self.path.exists():
            return
        with Archive(self.path, LARGEST_FILE) as archive:
            try:
                plain = number(json_data(archive.read("plain").tobytes()))
                if plain["format"] != FORMAT or plain["version"] != VERSION:
                    raise self._refuse(f"is no file of version {VERSION} of a {FORMAT}")
                self._compare(number(self.settings), plain["settings"])
                system = search.flow.system
                for name in ("attractors", "unstable"):
                    setattr(search, name, [_attractor(one, system) for one in plain[name]])
                search.failures, search.rests = dict(plain["failures"]), [int(k) for k in plain["rests"]]
                search.vain, search.iterates = int(plain["vain"]), int(plain["iterates"])
                search.looked = np.array(plain["looked"], dtype=np.uint64)
                for name in _BY_SOLUTION:
                    array = archive.read(name)
                    if len(array) != len(search.begin):
                        raise ValueError(f"{name} has {len(array)} rows, expected {len(search.begin)}")
                    setattr(search, name, array)
                search.past.streak = archive.read("streak")
                cells = archive.read("cells").view(np.uint64)
                search.past.length = cells.shape[1]
                search.past.cells = np.zeros((len(search.begin), max(64, cells.shape[1])), dtype=np.uint64)
                search.past.cells[np.flatnonzero(search.label == -1), : cells.shape[1]] = cells
            except (ValueError, KeyError, TypeError, IndexError, AttributeError, RecursionError) as error:
                if isinstance(error, UsageError):
                    raise
                raise self._refuse(f"is damaged ({type(error).__name__}: {error})") from None

    def _compare(self, wanted: Mapping[str, Any], found: Mapping[str, Any]) -> None:
        names = [name for name in wanted if name not in found or found[name] != wanted[name]]
        if names:
            raise self._refuse(f"keeps a search with another {', '.join(names)}")

    def _refuse(self, why: str) -> UsageError:
        return UsageError(f"{str(self.path)!r} {why}. Name another file, or move it away.")


def _data(one: Attractor) -> dict[str, Any]:
    """An attractor with what its own file leaves out: how the search tells solutions that are at it."""
    return one.to_dict() | {
        "curve": None if one.curve is None else one.curve.tolist(),
        "cells": None if one.cells is None else one.cells.tolist(),
    }


def _attractor(data: Mapping[str, Any], system: Any) -> Attractor:
    curve, cells = data["curve"], data["cells"]
    return replace(
        Attractor.from_dict(data, system),
        curve=None if curve is None else np.array(curve, dtype=float),
        cells=None if cells is None else np.array(cells, dtype=np.uint64),
    )
