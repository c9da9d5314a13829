"""Orbits and branches as JSON files: written in one piece or not at all, read with a limit and checked.

A file has the sha256 of its content in it, so that one that was altered is refused.
"""

from __future__ import annotations

import hashlib
import json
import math
from pathlib import Path
from typing import Any

from filippov.base.errors import UsageError
from filippov.base.json_text import json_text
from filippov.base.read_whole import read_json as whole_json
from filippov.base.whole_file import write_whole

LARGEST_FILE = 256 << 20


def write_json(path: str | Path, data: Any) -> Path:
    """Write plain data with their sha256; infinities and NaN as text. Returns the path."""
    kept = finite(data)
    return write_whole(path, json_text(kept | {"sha256": _digest(kept)}))


def read_json(path: str | Path, form: str, version: int) -> dict[str, Any]:
    """Read a file of this form and version. Raises UsageError for any other content; FileNotFoundError."""
    try:
        data = whole_json(path, LARGEST_FILE)
    except UsageError:
        raise
    except ValueError as error:
        raise UsageError(f"{str(path)!r} is damaged or no JSON file: {error}.") from None
    if not isinstance(data, dict) or data.get("format") != form:
        raise UsageError(f"{str(path)!r} is no {form} file.")
    if data.get("version") != version:
        raise UsageError(
            f"{str(path)!r} has version {data.get('version')!r} of the {form} format, expected {version}; "
            "read it with the release that wrote it."
        )
    # Files written earlier have none; a name like it was one.
    told = data.pop("sha256", None)
    if (told is not None and told != _digest(data)) or any(key.startswith("sha") for key in data):
        raise UsageError(
            f"{str(path)!r} was altered since it was written: its content has another sha256 than the one it "
            "notes. Write it again; a file that is changed on purpose goes without its line 'sha256'."
        )
    result: dict[str, Any] = number(data)
    return result


def _digest(data: Any) -> str:
    """sha256 of plain data, of which the order of keys and the spacing are no part."""
    text = json.dumps(data, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


_WORDS = {"inf": math.inf, "-inf": -math.inf, "nan": math.nan}


def finite(data: Any) -> Any:
    """Plain data with infinities and NaN as text, which JSON has no numbers for."""
    if isinstance(data, float) and not math.isfinite(data):
        return {"number": str(data)}
    if isinstance(data, dict):
        return {str(k): finite(v) for k, v in data.items()}
    if isinstance(data, list | tuple):
        return [finite(v) for v in data]
    return data


def number(data: Any) -> Any:
    """What `finite` made, with its numbers again."""
    if isinstance(data, dict):
        if set(data) == {"number"} and str(data["number"]) in _WORDS:
            return _WORDS[str(data["number"])]
        return {k: number(v) for k, v in data.items()}
    if isinstance(data, list):
        return [number(v) for v in data]
    return data
