"""A table as xarray.Dataset, netCDF and CSV; a table read back from the folder of a sweep."""

from __future__ import annotations

import csv
import importlib
import io
import os
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from filippov.errors import UsageError
from filippov.sweep.chunk import no_room, read_chunk
from filippov.sweep.rows import Limits, Rows, Whole
from filippov.sweep.store import CHUNKS, read_manifest, read_points
from filippov.sweep.table import Table


def to_xarray(table: Table) -> Any:
    """Results over the axes of the grid, else over `point`; units and what decided them as attributes.

    A coordinate of points that are no grid stands beside them along `point`. `status` and `message` tell of
    failures; a value that is not there is NaN with a status that says why. Raises ImportError without xarray.
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
        return {"units": units[name]} if name in units else {}

    coordinates: dict[str, Any] = {}
    for k, name in enumerate(table.names):
        values = table.points[:, k]
        if grid:
            values = np.moveaxis(values.reshape(sizes), k, 0).reshape(sizes[k], -1)[:, 0]
        coordinates[name] = ((name,) if grid else dims, values, attributes(name))
    variables: dict[str, Any] = {
        name: (dims, table.values[:, k].reshape(sizes), attributes(name))
        for k, name in enumerate(table.columns)
    }
    message = [table.message.get(point, "") for point in range(len(table))]
    variables["status"] = (dims, np.array(table.status, dtype=np.str_).reshape(sizes))
    variables["message"] = (dims, np.array(message, dtype=np.str_).reshape(sizes))
    about = {"content_hash": table.content_hash, **{f"sweep_{k}": v for k, v in table.fields.items()}}
    return xarray.Dataset(variables, coords=coordinates, attrs=about)


def write_netcdf(table: Table, path: str | Path) -> Path:
    """Write a netCDF file (by h5netcdf), whole or not at all. Raises ImportError without it, OSError."""
    data = to_xarray(table)
    # HDF5 takes a slash for a path within the file.
    data = data.rename({name: name.replace("/", "_") for name in data.variables if "/" in str(name)})
    # On a full disk HDF5 can end the process; the bytes are made in memory and written by us.
    return _whole(Path(path), bytes(data.to_netcdf(engine="h5netcdf")))


def write_csv(table: Table, path: str | Path) -> Path:
    """Write one row a point: coordinates, results, status, message; whole or not at all."""

    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([*table.names, *table.columns, "status", "message"])
    for point in range(len(table)):
        numbers = [*table.points[point].tolist(), *table.values[point].tolist()]
        writer.writerow([*map(repr, numbers), table.status[point], table.message.get(point, "")])
    return _whole(Path(path), text.getvalue().encode())


def load_table(folder: str | Path) -> Table:
    """The table of a folder as it stands, without the model; nothing in the folder is changed.

    Chunks that cannot be trusted are left out; their names are in `damaged`. Raises UsageError.
    """
    place = Path(folder)
    found = read_manifest(place)
    points = read_points(place)
    if points.shape != (found["size"], len(found["names"])):
        raise UsageError(f"{str(place)!r}: the points do not fit the manifest.")
    table = Table.empty(_Stored(found, points))
    bad = []
    for path in sorted((place / CHUNKS).glob("*.npz")):
        try:
            table.add(read_chunk(path, found["key"], found["size"], len(found["columns"])))
        except UsageError:
            bad.append(path.name)
    table.damaged = tuple(bad)
    return table


class _Stored:
    """The work of a folder, whose model is not at hand."""

    first = grain = 1

    def __init__(self, manifest: dict[str, Any], points: Any) -> None:
        self.fields, self.units = dict(manifest["fields"]), dict(manifest["units"])
        self.names, self.columns = tuple(manifest["names"]), tuple(manifest["columns"])
        self.points = points

    def compute(self, index: Whole, limits: Limits) -> Rows:
        """Raise UsageError."""
        raise UsageError("a sweep read from its folder has no model; make the Sweep again to go on.")


def _whole(path: Path, content: bytes) -> Path:
    handle, name = tempfile.mkstemp(prefix=f".{path.name}.", suffix=".tmp", dir=path.parent)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        Path(name).chmod(0o644)
        Path(name).replace(path)
    except OSError as error:
        raise no_room(path, len(content), error) from None
    finally:
        Path(name).unlink(missing_ok=True)
    return path
