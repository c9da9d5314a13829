"""Solutions as files: an uncompressed npz with a header in JSON, read back to an equal solution.

The entry `header` holds JSON text as bytes: format and its version, version of the package that wrote it,
digest and description of the system (see `filippov.io.stored_system`), parameter values, options, status,
message and counts, and the sha256 of all this and of the arrays. The other entries are arrays of float64 and
int64: t, y, x0, t_span, x_end, end_multipliers; event_* with a row per event; and with dense output
sol_start, sol_step, sol_coef, sol_span. A system of plain functions is not stored, only its names.
"""

from __future__ import annotations

import hashlib
import json
import math
from dataclasses import asdict, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from filippov.base.errors import UsageError
from filippov.base.given import Count
from filippov.base.keywords import keywords
from filippov.base.read_whole import content_of, json_data
from filippov.base.status import EventKind, Status
from filippov.base.version import package_version
from filippov.io.archive import Archive, refuse_other_ending, write_arrays
from filippov.model.system import System
from filippov.solving.resets.zeno import Accumulation
from filippov.solving.selection.ambiguity import Ambiguity
from filippov.solving.selection.modes import Successor
from filippov.solving.solution import Solution
from filippov.solving.state.events import Event, Events, Mode, Stop
from filippov.solving.state.interpolant import Interpolant
from filippov.solving.state.options import Options, falls
from filippov.solving.state.problem import Problem

FORMAT, VERSION = "filippov solution", 1
MAX_BYTES = 4 << 30
_KINDS = tuple(EventKind)
_ARRAYS = (
    "t", "y", "x0", "t_span", "x_end", "end_multipliers", "event_t", "event_x", "event_numbers",
    "event_before", "event_after", "event_values", "event_jumps", "event_x_after",
)  # fmt: skip
_DENSE = ("sol_start", "sol_step", "sol_coef", "sol_span")
Array = npt.NDArray[Any]


class ForgottenPolicy:
    """Placeholder for a function given as `nonunique`, which a file does not contain."""

    def __call__(self, candidates: Any) -> Any:
        """Raise UsageError."""
        raise UsageError(
            "the function given as nonunique is not stored with a solution; pass it to solve again."
        )


def save(solution: Solution, path: str | Path) -> Path:
    """Write a solution; the file appears complete or not at all. Returns the path, used as it is."""
    if not isinstance(solution, Solution):
        raise UsageError(f"save was given {type(solution).__name__}, expected a Solution.")
    if solution.options.save_events == "count":
        raise UsageError("the events were only counted; solve with save_events='all' to save them.")
    refuse_other_ending(path, "solution")
    return write_sealed(path, solution_header(solution), solution_arrays(solution))


@keywords()
def load(path: str | Path, system: System | None = None, *, max_bytes: Count = MAX_BYTES) -> Solution:
    """Read a solution written by `save`.

    system     what was solved; needed where it has plain functions, else it is rebuilt from the file. A
               symbolic one is compared with the file by its digest, one of functions by the names of states,
               surfaces and parameters
    max_bytes  larger files are refused

    Nothing in a file is run or unpickled. Raises UsageError for a file that is damaged, of another format
    version or not written by `save`, and for a system that does not fit; FileNotFoundError.
    """
    check_system(system)
    with Archive(path, max_bytes) as archive:
        header = read_header(archive, FORMAT, VERSION)
        dense = header.get("dense") is True
        wanted = {"header", *_ARRAYS, *(_DENSE if dense else ())}
        if archive.names != wanted:
            different = ", ".join(sorted(archive.names ^ wanted))
            raise archive.refuse(f"does not hold the entries of format version {VERSION}: {different} differ")
        data = {name: archive.read(name) for name in wanted if name != "header"}
        check_seal(header, data, archive)
        with content_of(archive.path):
            return solution_of(header, data, stored_system_of(header, system, archive))


def write_sealed(path: str | Path, header: dict[str, Any], arrays: dict[str, Array]) -> Path:
    """Write a header and arrays with the sha256 of both."""
    text = json.dumps(header | {"sha256": _digest(header, arrays)}, allow_nan=False)
    return write_arrays(path, {"header": np.frombuffer(text.encode(), dtype=np.uint8)} | arrays)


def check_seal(header: dict[str, Any], arrays: dict[str, Array], archive: Archive) -> None:
    """Refuse a file that was altered. Those written earlier have no sha256, and a name like it was one."""
    told = header.pop("sha256", None)
    if (told is not None and told != _digest(header, arrays)) or any(k.startswith("sha") for k in header):
        raise archive.refuse(
            "was altered since it was written: its content has another sha256 than the one it notes. Write "
            "it again with what made it"
        )


def _digest(header: dict[str, Any], arrays: dict[str, Array]) -> str:
    total = hashlib.sha256(json.dumps(header, sort_keys=True, separators=(",", ":")).encode())
    for name, array in sorted(arrays.items()):
        total.update(f"{name} {array.shape}".encode())
        total.update(np.ascontiguousarray(array, dtype=array.dtype.newbyteorder("<")).tobytes())
    return total.hexdigest()


# -- writing ---------------------------------------------------------------------------------------------


def solution_header(solution: Solution) -> dict[str, Any]:
    """All of a solution but its arrays, for JSON."""
    from filippov.io.stored_system import system_data

    system: System = solution.system
    return {
        "format": FORMAT,
        "version": VERSION,
        "filippov": package_version(),
        "digest": system.digest,
        "system": system_data(system),
        "states": list(system.states),
        "user_events": list(solution.user_events),
        "surfaces": list(system.surface_names),
        "parameters": dict(solution.problem.parameters),
        "options": _option_data(solution.options),
        "status": solution.status.value,
        "message": solution.message,
        "nfev": int(solution.nfev),
        "njev": int(solution.njev),
        "nlu": int(solution.nlu),
        "steps": int(solution.steps),
        "rejected": int(solution.rejected),
        "start_mode": list(solution.start_mode),
        "end_mode": list(solution.end_mode),
        "t_end": float(solution.t_end),
        "dense": solution.sol is not None,
        "notes": [[i, event.note] for i, event in enumerate(solution.events) if event.note],
        # What a way there bends by stands in the dense output.
        "accumulations": [
            asdict(replace(limit, bend=0.0)) | {"x": limit.x.tolist()} for limit in solution.accumulations
        ],
        "ambiguity": None if solution.ambiguity is None else ambiguity_data(solution.ambiguity),
    }


def _option_data(options: Options) -> dict[str, Any]:
    out: dict[str, Any] = {}
    for item in fields(options):
        value = getattr(options, item.name)
        if isinstance(value, np.ndarray):
            value = value.tolist()
        elif isinstance(value, float) and math.isinf(value):
            value = "inf"
        elif item.name == "stop":
            value = [[stop.surface, stop.kind, stop.count] for stop in value]
        elif callable(value):
            value = "function"
        out[item.name] = value.item() if isinstance(value, np.generic) else value
    return out


def solution_arrays(solution: Solution) -> dict[str, Array]:
    """The arrays of a solution, by name."""
    events, problem = list(solution.events), solution.problem
    n, m, k = problem.system.dimension, len(problem.system.surfaces), len(events)
    jumps = [i for i, event in enumerate(events) if event.x_after is not None]
    out: dict[str, Array] = {
        "t": solution.t,
        "y": solution.y,
        "x0": problem.x0,
        "t_span": np.array(problem.t_span),
        "x_end": solution.x_end,
        "end_multipliers": solution.end_multipliers,
        "event_t": np.array([e.t for e in events], dtype=float),
        "event_x": np.array([e.x for e in events], dtype=float).reshape(k, n),
        "event_numbers": np.array(
            [(e.index, _KINDS.index(e.kind), e.group, e.sense) for e in events], dtype=np.int64
        ).reshape(k, 4),
        "event_before": np.array([e.before for e in events], dtype=np.int64).reshape(k, m),
        "event_after": np.array([e.after for e in events], dtype=np.int64).reshape(k, m),
        "event_values": np.array([(e.multiplier, e.residual) for e in events], dtype=float).reshape(k, 2),
        "event_jumps": np.array(jumps, dtype=np.int64),
        "event_x_after": np.array([events[i].x_after for i in jumps], dtype=float).reshape(len(jumps), n),
    }
    if solution.sol is not None:
        parts = (solution.sol.start, solution.sol.step, solution.sol.coef, np.array(solution.sol.span))
        out |= dict(zip(_DENSE, parts, strict=True))
    return out


def ambiguity_data(ambiguity: Ambiguity) -> dict[str, Any]:
    """What can follow at a point, for JSON."""
    data = asdict(ambiguity)
    for candidate in data["candidates"]:
        candidate["margin"] = candidate["margin"] if math.isfinite(candidate["margin"]) else None
    return data


def ambiguity_of(data: dict[str, Any]) -> Ambiguity:
    """What `ambiguity_data` describes."""
    candidates = tuple(
        Successor(
            _mode(row["mode"]),
            _numbers(row["order"]),
            tuple(map(float, row["multipliers"])),
            tuple(map(float, row["field"])),
            math.inf if row["margin"] is None else float(row["margin"]),
            **{name: _numbers(row.get(name, ())) for name in ("undetermined", "faint", "along")},
        )
        for row in data["candidates"]
    )
    # Files written earlier call them "hit".
    before, triggered = _mode(data["before"]), _numbers(data.get("triggered", data.get("hit")))
    return Ambiguity(float(data["t"]), str(data["name"]), candidates, before, triggered, bool(data["start"]))


# -- reading ---------------------------------------------------------------------------------------------


def read_header(archive: Archive, kind: str, version: int) -> dict[str, Any]:
    """The header of a file of this format and version; UsageError for another."""
    content = archive.read("header").tobytes()
    try:
        header = json_data(content)
    except ValueError as error:
        raise archive.refuse(f"has a header that is not JSON ({error})") from None
    if not isinstance(header, dict) or header.get("format") != kind:
        raise archive.refuse(f"is no {kind.removeprefix('filippov ')} written by save(path)")
    if header.get("version") != version:
        raise archive.refuse(
            f"has format version {header.get('version')!r}, written by filippov "
            f"{header.get('filippov')!r}; this is "
            f"filippov {package_version()!r}, which reads format version {version}. Read it with the "
            f"version that wrote it"
        )
    return header


def check_system(given: object) -> None:
    """Raise UsageError for what is no system."""
    if given is not None and not isinstance(given, System):
        raise UsageError(f"system is {type(given).__name__}, expected a System.")


def stored_system_of(header: dict[str, Any], given: System | None, archive: Archive) -> System:
    """The system of a file: the one given, if it is the same, else rebuilt from the header."""
    if given is None:
        if header["system"] is None:
            what = (
                "plain functions" if header["digest"] is None else "expressions that cannot be stored exactly"
            )
            raise archive.refuse(f"holds a solution of a system with {what}. Give it: load(path, system=...)")
        from filippov.io.stored_system import system_of

        given = system_of(header["system"])
    if given.digest != header["digest"]:
        raise archive.refuse(
            f"holds a solution of another system: its digest is {_short(header['digest'])}, the given "
            f"system's is "
            f"{_short(given.digest)}. Give the system that was solved, or none"
        )
    own = {"surfaces": list(given.surface_names), "states": list(given.states)}
    for what, names in {**own, "parameters": list(given.parameters.names)}.items():
        if names != list(header[what]):
            raise archive.refuse(
                f"holds a solution with {what} {', '.join(header[what]) or '(none)'}; the given system has "
                f"{', '.join(names) or '(none)'}"
            )
    return given


def _short(digest: Any) -> str:
    return "that of plain functions" if digest is None else str(digest)[:12]


def _options(data: dict[str, Any]) -> Options:
    values: dict[str, Any] = {k: math.inf if v == "inf" else v for k, v in data.items()}
    values["stop"] = tuple(Stop(*item) for item in values["stop"])
    if isinstance(values["nonunique"], list):
        values["nonunique"] = tuple(values["nonunique"])
    if values["nonunique"] == "function":
        values["nonunique"] = ForgottenPolicy()
    if isinstance(values["atol"], list):
        values["atol"] = np.array(values["atol"], dtype=float)
    return Options(**values)


def _events(header: dict[str, Any], data: dict[str, Array], system: System) -> Events:
    notes = {int(i): str(text) for i, text in header["notes"]}
    rows = {int(i): x for i, x in zip(data["event_jumps"], data["event_x_after"], strict=True)}
    names = [*system.surface_names, *(q.name for q in system.time_events)]
    names += map(str, header["user_events"])
    _check_range("event_numbers[:, 0]", data["event_numbers"][:, 0], 0, len(names) - 1)
    _check_range("event_numbers[:, 1]", data["event_numbers"][:, 1], 0, len(_KINDS) - 1)
    _check_range("event_jumps", data["event_jumps"], 0, len(data["event_t"]) - 1)
    items = []
    for i, t in enumerate(data["event_t"].tolist()):
        index, kind, group, sense = data["event_numbers"][i].tolist()
        x = data["event_x"][i]
        x.flags.writeable = False
        multiplier, residual = data["event_values"][i].tolist()
        before, after = (_mode(data[name][i]) for name in ("event_before", "event_after"))
        items.append(
            Event(
                t, names[index], index, _KINDS[kind], before, after, x, multiplier, residual,
                group, notes.get(i, ""), rows.get(i), sense,
            )
        )  # fmt: skip
    events = Events(items)
    events.place_of, events.names, events.states = system.surface_place, tuple(names), system.states
    return events


def _mode(row: Any) -> Mode:
    mode = _numbers(row)
    if any(v not in (-1, 0, 1) for v in mode):
        raise ValueError(f"a mode is {list(mode)[:9]}, expected -1, 0 or 1 for each surface")
    return mode


def _numbers(row: Any) -> tuple[int, ...]:
    return tuple(int(v) for v in row)


def _check_range(name: str, numbers: Array, low: int, high: int) -> None:
    if numbers.size and not low <= int(numbers.min()) <= int(numbers.max()) <= high:
        raise ValueError(f"{name} has numbers outside {low} ... {high}")


def solution_of(header: dict[str, Any], data: dict[str, Array], system: System) -> Solution:
    """The solution that `solution_header` and `solution_arrays` describe; ValueError where shapes differ."""
    dense = header["dense"] is True
    n, m, k = system.dimension, len(system.surfaces), len(data["event_t"])
    steps = len(data["sol_start"]) if dense else 0
    shapes = {
        "t": (data["y"].shape[-1],), "y": (n, len(data["t"])), "x0": (n,), "t_span": (2,), "x_end": (n,),
        "end_multipliers": (m,), "event_x": (k, n), "event_numbers": (k, 4), "event_before": (k, m),
        "event_after": (k, m), "event_values": (k, 2), "event_x_after": (len(data["event_jumps"]), n),
    }  # fmt: skip
    if dense:
        shapes |= {"sol_start": (steps,), "sol_step": (steps,), "sol_span": (2,)}
        shapes["sol_coef"] = (steps, data["sol_coef"].shape[1], n)
    for name, shape in shapes.items():
        if data[name].shape != shape:
            raise ValueError(f"{name} has shape {data[name].shape}, expected {shape}")
    span = tuple(data["t_span"].tolist())
    start_mode, end_mode = _mode(header["start_mode"]), _mode(header["end_mode"])
    if not len(start_mode) == len(end_mode) == m:
        raise ValueError(f"start_mode or end_mode has no sign for each of {m} surfaces")
    t_end = float(header["t_end"])
    if not min(span) <= t_end <= max(span):
        raise ValueError(f"t_end is {t_end}, not a time of t_span")
    sol = None
    if dense:
        low, high = data["sol_span"].tolist()
        forwards = np.diff(data["sol_start"]) * (1.0 if high >= low else -1.0) >= 0
        if not (forwards.all() and np.isfinite(data["sol_step"]).all() and data["sol_step"].all()):
            raise ValueError("sol_start and sol_step are not those of steps one after the other")
        sol = Interpolant(data["sol_start"], data["sol_step"], data["sol_coef"], (low, high))
    stored = header.get("ambiguity")
    counts = {name: int(header.get(name, 0)) for name in ("njev", "nlu")}
    counts |= {name: int(header[name]) for name in ("nfev", "steps", "rejected")}
    return Solution(
        problem=Problem(system, data["x0"], span, header["parameters"], falls(span)),
        options=_options(header["options"]), status=Status(header["status"]), message=str(header["message"]),
        t=data["t"], y=data["y"], sol=sol, events=_events(header, data, system),
        user_events=tuple(str(name) for name in header["user_events"]),
        start_mode=start_mode, end_mode=end_mode, t_end=t_end, x_end=data["x_end"],
        end_multipliers=data["end_multipliers"],
        ambiguity=None if stored is None else ambiguity_of(stored),
        accumulations=tuple(
            Accumulation(**{**row, "x": np.array(row["x"], dtype=float), "surfaces": tuple(row["surfaces"])})
            for row in header.get("accumulations", ())
        ),
        **counts,
    )  # fmt: skip
