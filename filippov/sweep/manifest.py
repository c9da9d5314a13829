"""What decides the numbers of a sweep and what they are called, in one text whose sha256 is the sweep's key.

The text stands in the manifest of the folder and in every chunk, so that one can be made from the other.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from filippov.base.errors import UsageError
from filippov.base.read_whole import read_json
from filippov.solving.state.options import OPTIONS, Options
from filippov.sweep.points import digest_of
from filippov.sweep.rows import Work

NAME = "manifest.json"
FORMAT, VERSION = "filippov sweep", 2
LARGEST = 1 << 24
_OLD = (
    "has format version {}, this filippov reads version {} only. In version 1 nothing holds the names of the "
    "columns: read it with the version that wrote it, or begin afresh in another folder"
)


@dataclass(frozen=True)
class Manifest:
    """fields: what decides the results, by name; names of the coordinates and columns; units of both.

    size    number of the points; points: their sha256 (see `filippov.sweep.points.digest_of`)
    unseen  what decides the results as well, and cannot be seen from here
    """

    fields: Mapping[str, str]
    names: tuple[str, ...]
    columns: tuple[str, ...]
    units: Mapping[str, str]
    size: int
    points: str
    unseen: tuple[str, ...] = ()

    @classmethod
    def of(cls, work: Work) -> Manifest:
        """The manifest of a work."""
        return cls(
            dict(work.fields), tuple(work.names), tuple(work.columns), dict(work.units), len(work.points),
            digest_of(work.points), tuple(work.unseen),
        )  # fmt: skip

    @cached_property
    def text(self) -> str:
        """All of it, in one way only."""
        return json.dumps(asdict(self), sort_keys=True, separators=(",", ":"))

    @cached_property
    def key(self) -> str:
        """The digest of the text."""
        return key_of(self.text)

    def data(self) -> dict[str, Any]:
        """What the file holds, for JSON."""
        return {"format": FORMAT, "version": VERSION, "key": self.key, **json.loads(self.text)}

    def changes(self, wanted: Manifest) -> str:
        """What another manifest has differently: "rtol was 1e-09, is 1e-08; ..."; "" for nothing."""
        before, after = self._parts(), wanted._parts()
        names = [name for name in sorted({*before, *after}) if before.get(name) != after.get(name)]
        # An option that was not given has its default.
        before, after = ({n: getattr(Options, n, None) for n in OPTIONS} | part for part in (before, after))
        return "; ".join(f"{n} was {_short(before.get(n))}, is {_short(after.get(n))}" for n in names)

    def _parts(self) -> dict[str, object]:
        rest = {
            "names": ", ".join(self.names), "columns": ", ".join(self.columns), "units": dict(self.units),
            "points": f"{self.size} with sha256 {self.points}", "unseen": "; ".join(self.unseen),
        }  # fmt: skip
        return {**{k: v for k, v in rest.items() if v}, **self.fields}


def key_of(text: str) -> str:
    """The key of a manifest's text."""
    return hashlib.sha256(text.encode()).hexdigest()


def of_text(text: str) -> Manifest:
    """The manifest of a text. Raises ValueError, TypeError, KeyError."""
    found = json.loads(text)
    made = Manifest(
        dict(found["fields"]), tuple(found["names"]), tuple(found["columns"]), dict(found["units"]),
        int(found["size"]), str(found["points"]), tuple(found["unseen"]),
    )  # fmt: skip
    if made.text != text:
        raise ValueError("its content was changed")
    return made


def read_manifest(folder: Path) -> Manifest:
    """What the folder says it holds, checked. Raises UsageError."""
    path = folder / NAME
    cure = "Move it away; with resume=True (--resume) it is made again from the chunks"
    try:
        found = read_json(path, LARGEST)
        if not isinstance(found, dict) or found["format"] != FORMAT:
            raise UsageError(f"{str(path)!r} is no manifest of a sweep. Name another folder.")
        if found["version"] != VERSION:
            raise UsageError(f"{str(path)!r} {_OLD.format(repr(found['version']), VERSION)}.")
        head = {name: value for name, value in found.items() if name not in ("format", "version", "key")}
        made = of_text(json.dumps(head, sort_keys=True, separators=(",", ":")))
        if made.key != found["key"]:
            raise UsageError(f"{str(path)!r} was changed: its content does not fit its key. {cure}.")
    except OSError as error:
        raise UsageError(f"cannot read {str(path)!r}: {error.strerror or error}. {cure}.") from None
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        if isinstance(error, UsageError):
            raise
        raise UsageError(f"{str(path)!r} is damaged ({type(error).__name__}: {error}). {cure}.") from None
    return made


def _short(value: object) -> str:
    text = "absent" if value is None else str(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
