"""A table as xarray.Dataset, netCDF and CSV; a table read back from the folder of a sweep."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

import numpy as np

from filippov.base.arrays import Whole
from filippov.base.csv_text import csv_text
from filippov.base.errors import UsageError
from filippov.base.escape import printable
from filippov.base.keywords import keywords
from filippov.base.whole_file import write_whole
from filippov.sweep.chunk import no_room
from filippov.sweep.manifest import Manifest
from filippov.sweep.points import digest_of, shape_of
from filippov.sweep.rows import Limits, Rows
from filippov.sweep.store import CHUNKS, POINTS, away, fill, held_by, read_points
from filippov.sweep.table import SweepTable


@keywords()
def to_xarray(table: SweepTable) -> Any:
    """Results over the axes of the grid, else over `point`; units and what decided them as attributes.

    The coordinates of points that form no grid are given along `point`. `status` and `message` report
    failures; a missing value is NaN, with a status that says why. Raises ImportError without xarray.
    """
    try:
        xarray: Any = importlib.import_module("xarray")
    except ImportError:
        raise ImportError("xarray is not installed: pip install filippov[tables]") from None
    shape = table.shape or (len(table),)
    grid = len(shape) == len(table.names) and (len(shape) > 1 or shape == (len(np.unique(table.points)),))
    dims = table.names if grid else ("point",)
    sizes = shape if grid else (len(table),)
    units = dict(table.units)

    def attributes(name: str) -> dict[str, str]:
        return {"units": printable(units[name])} if name in units else {}

    coordinates: dict[str, Any] = {}
    for k, name in enumerate(table.names):
        values = table.coordinates[:, k]
        if grid:
            values = np.moveaxis(values.reshape(sizes), k, 0).reshape(sizes[k], -1)[:, 0]
        coordinates[name] = ((name,) if grid else dims, values, attributes(name))
    variables: dict[str, Any] = {
        name: (dims, table.values[:, k].reshape(sizes), attributes(name))
        for k, name in enumerate(table.columns)
    }
    message = [printable(table.message.get(point, "")) for point in range(len(table))]
    variables["status"] = (dims, np.array(table.status, dtype=np.str_).reshape(sizes))
    variables["message"] = (dims, np.array(message, dtype=np.str_).reshape(sizes))
    about = {"content_hash": table.content_hash, **{f"sweep_{k}": v for k, v in table.fields.items()}}
    return xarray.Dataset(variables, coords=coordinates, attrs=about)


@keywords()
def write_netcdf(table: SweepTable, path: str | Path) -> Path:
    """Write a netCDF file (by h5netcdf), whole or not at all. Raises ImportError without it, OSError."""
    data = to_xarray(table)
    # HDF5 takes a slash for a path within the file.
    data = data.rename({name: name.replace("/", "_") for name in data.variables if "/" in str(name)})
    # On a full disk HDF5 can end the process; the bytes are made in memory and written by us.
    return _whole(Path(path), bytes(data.to_netcdf(engine="h5netcdf")))


@keywords()
def write_csv(table: SweepTable, path: str | Path) -> Path:
    """Write one row per point: coordinates, results, status, message; whole or not at all."""
    rows = (
        [*point, *values, status, table.message.get(number, "")]
        for number, (point, values, status) in enumerate(
            zip(table.points.tolist(), table.values.tolist(), table.status, strict=True)
        )
    )
    return _whole(Path(path), csv_text([*table.names, *table.columns, "status", "message"], rows).encode())


@keywords()
def load_table(folder: str | Path) -> SweepTable:
    """The table of a folder as it stands, without the model; nothing in the folder is changed.

    Chunks that cannot be trusted are left out; their names are in `damaged`. Without a manifest the chunks
    say what they are. Raises UsageError.
    """
    place = Path(folder)
    found = held_by(place)
    if found is None:
        raise UsageError(
            f"{str(place)!r} holds no sweep: neither a manifest.json nor chunks that are sound. Name the "
            "folder of one."
        )
    path = place / POINTS
    points = read_points(path)
    if points.shape != (found.size, len(found.names)) or digest_of(points) != found.points:
        raise UsageError(f"{str(path)!r} does not hold the points of this sweep. {away(path)}")
    table = SweepTable.empty(_Stored(found, points))
    table.shape = shape_of(points)
    table.damaged = tuple(fill(table, place / CHUNKS, found, remove=False))
    return table


class _Stored:
    """The work of a folder, whose model is not at hand."""

    first = grain = 1

    def __init__(self, manifest: Manifest, points: Any) -> None:
        self.fields, self.units, self.unseen = manifest.fields, manifest.units, manifest.unseen
        self.names, self.columns = manifest.names, manifest.columns
        self.points = points

    def compute(self, index: Whole, limits: Limits) -> Rows:
        """Raise UsageError."""
        raise UsageError("a sweep read from its folder has no model; make the Sweep again to go on.")


def _whole(path: Path, content: bytes) -> Path:
    try:
        return write_whole(path, content)
    except OSError as error:
        raise no_room(path, len(content), error) from None
