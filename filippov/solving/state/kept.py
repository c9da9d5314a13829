"""Problems in the cache of compiled code, with the kernel source of their systems: they run without sympy.

A record is JSON under the seal of the cache (see `filippov.kernel.codegen.cache`), found by a digest of all
that it was made from. Expressions are not in it: a system that is asked for them is made anew.
"""

from __future__ import annotations

import hashlib
import importlib.util
import json
import sys
from collections.abc import Callable, Iterable
from dataclasses import asdict
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from filippov.kernel.codegen import cache as units
from filippov.kernel.codegen.build import generation
from filippov.kernel.codegen.generated import Generated
from filippov.model.comparator import Exact
from filippov.model.parameter import Parameter, ParameterSet
from filippov.model.surface import Role
from filippov.model.system import System
from filippov.solving.state.machine import non_lipschitz_of, unit_of
from filippov.solving.state.problem import Problem

_PLAIN = ("states", "surface_names", "clocked", "variable_widths", "labels")
# Where the numbers and names of expressions come from besides the files of this package.
_LIBRARIES = {"sympy": "release.py", "mpmath": "__init__.py"}


def place_of(name: str, files: Iterable[Path]) -> str | None:
    """The name in the cache of what files make; None where the version of a library cannot be told."""
    made_by = _made_by()
    if made_by is None:
        return None
    parts = [made_by, name.encode(), *(path.read_bytes() for path in files)]
    return hashlib.sha256(b"".join(hashlib.sha256(part).digest() for part in parts)).hexdigest()[:32]


@cache
def _made_by() -> bytes | None:
    parts = [generation(), sys.version.encode(), np.__version__.encode()]
    for library, file in _LIBRARIES.items():
        found = importlib.util.find_spec(library)
        if found is None or found.origin is None:
            return None
        try:
            parts.append(Path(found.origin).with_name(file).read_bytes())
        except OSError:
            return None
    parts.append(Path(__file__).read_bytes())
    rooms = [Path(__file__).parents[2] / name for name in ("base", "model")]
    parts += [path.read_bytes() for room in rooms for path in sorted(room.rglob("*.py"))]
    return b"".join(hashlib.sha256(part).digest() for part in parts)


def keep(place: str, problem: Problem) -> None:
    """Keep a problem with the unit of its system; not one with functions, nor one with clocks or inputs."""
    system = problem.system
    if system.field is not None or system.clocked:
        return
    unit, parameters = unit_of(system), system.parameters
    record = {name: getattr(system, name) for name in _PLAIN} | {
        "parameters": {name: asdict(parameters[name]) for name in parameters},
        "roles": [role._asdict() for role in system.roles], "digest": system.digest, "named": system._named,
        "non_lipschitz": non_lipschitz_of(system) if unit.constants["NON_LIPSCHITZ"] else None,
        "source": unit.source, "constants": unit.constants,
        "exact": system.comparator == Exact(), "x0": problem.x0.tolist(), "t_span": problem.t_span,
    }  # fmt: skip
    units.write(place, json.dumps(record).encode())


def kept(place: str, whole: Callable[[], System]) -> Problem | None:
    """The problem that was kept at a place, None if there is none; whole: makes its system."""
    content = units.read(place)
    if content is None:
        return None
    record = json.loads(content)
    system = _system(record, whole)
    start, end = record["t_span"]
    return Problem(system, record["x0"], (start, end), backward=end < start)


def _system(record: dict[str, Any], whole: Callable[[], System]) -> System:
    content: dict[str, Any] = {name: _fixed(record[name]) for name in _PLAIN}
    content |= {
        "parameters": ParameterSet({name: Parameter(**q) for name, q in record["parameters"].items()}),
        "roles": tuple(Role(**role) for role in record["roles"]), "_named": _fixed(record["named"]),
        "_digest": record["digest"], "_packed": None, "_whole": whole, "runs": {},
        "field": None, "compile": None, "inputs": (), "time_events": (),
    }  # fmt: skip
    if record["exact"]:
        content["comparator"] = Exact()
    unit = Generated(record["source"], record["constants"])
    content["units"] = {(generation(), False): unit, (generation(), "non_lipschitz"): record["non_lipschitz"]}
    system = System.__new__(System)
    system.__setstate__(content)
    return system


def _fixed(value: Any) -> Any:
    """Lists as the tuples that they were, at any depth."""
    return tuple(map(_fixed, value)) if isinstance(value, list) else value
