"""A branch of a continuation: its points, the special ones among them, as a file."""

from __future__ import annotations

import ast
import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from filippov.analysis.algebra.growth import Growth, by_eigenvalues, by_multipliers
from filippov.analysis.orbits.orbit_file import read_json, write_json
from filippov.base.arrays import Array
from filippov.base.errors import UsageError
from filippov.base.given import as_float, shown, text
from filippov.base.keywords import keywords
from filippov.base.names import Answering, unknown
from filippov.base.read_whole import content_of
from filippov.base.shown import Shown
from filippov.base.status import mode_text

FORMAT, VERSION = "filippov branch", 1
# How many multipliers a special point has on the border by its definition, and the error of the others.
CRITICAL = {
    "fold": 1, "branch point": 1, "period doubling": 1, "symmetry breaking": 1,
    "Neimark-Sacker": 2, "Hopf": 2, "pseudo-Hopf": 0,
}  # fmt: skip
LOCATED = 1e-8
# Two solutions at one value of the parameter whose coordinates differ by no more than this are one.
_ONE = 1e-7
BOUNDARY = ("boundary ", "upper ", "lower ")


@dataclass(frozen=True)
class BranchPoint(Shown, Answering):
    """One solution on a branch.

    value         of the parameter; u: the unknowns of the equations
    coordinates   what describes it, by name: d of a map; period, and "max x", "min x", "amplitude x" of an
                  orbit; the states and multipliers of an equilibrium
    multipliers   Floquet multipliers or slope of the map; eigenvalues of an equilibrium
    verdict       by them: "stable", "unstable", or "undecided" where one is on the border, within its error
                  or by what is special here; stable: the verdict is "stable"
    word          mode word; modes: the modes in order
    tests         test functions, whose changes of sign are special points
    special       what is special here, "" for an ordinary point; note: more about it
    residual      of the equations; tangent: direction of the branch in (u, value), scaled
    surface       that is passed otherwise by the orbits beyond
    test          that vanishes at a boundary equilibrium; onto: modes of the branches that leave it
    phase         of the state u of an orbit, in periods (not forced: from the first state of the branch); it
                  changes where an event comes near
    coefficients  of the normal form of a special point, by name (see
                  `filippov.analysis.bifurcations.normal_form`)
    predicts      what they predict, or why they are not known
    """

    value: float
    u: tuple[float, ...]
    coordinates: Mapping[str, float]
    multipliers: tuple[complex, ...]
    verdict: Growth
    word: str = ""
    modes: tuple[str, ...] = ()
    period: float = 0.0
    tests: Mapping[str, float] = field(default_factory=dict)
    residual: float = 0.0
    tangent: tuple[float, ...] = ()
    special: str = ""
    note: str = ""
    phase: float = 0.0
    coefficients: Mapping[str, float] = field(default_factory=dict)
    predicts: str = ""
    surface: str = ""
    test: str = ""
    onto: tuple[str, ...] = ()

    def named(self, special: str, kind: str) -> BranchPoint:
        """The special point with its name: at one where multipliers are on the border by definition, they
        decide nothing, nor do those of one side of a surface. kind: of the branch."""
        verdict: Growth = "undecided" if special.startswith(BOUNDARY) else self.verdict
        if special in CRITICAL:
            count, on_axis = CRITICAL[special], kind in ("equilibrium", "function")
            verdict = (by_eigenvalues(self.multipliers, count) if on_axis
                       else by_multipliers(self.multipliers, LOCATED, critical=count))  # fmt: skip
            verdict = "unstable" if verdict == "unstable" else "undecided"
        return replace(self, special=special, verdict=verdict)

    @property
    def stable(self) -> bool:
        """Whether all multipliers lie inside the border, by more than their errors."""
        return self.verdict == "stable"

    def is_solution_of(self, other: BranchPoint) -> bool:
        """Whether two points at one value of the parameter are one solution, in any phase."""
        shared = self.coordinates.keys() & other.coordinates.keys()
        pairs = ((self.coordinates[name], other.coordinates[name]) for name in shared)
        return self.word == other.word and all(abs(v - w) < _ONE * (1.0 + abs(v)) for v, w in pairs)

    def __str__(self) -> str:
        where = ", ".join(f"{name} = {v:.12g}" for name, v in list(self.coordinates.items())[:3])
        kind = f"{self.special}: " if self.special else ""
        note = f" ({self.note})" if self.note else ""
        says = f"; {self.predicts}" if self.predicts else ""
        return f"{kind}value {self.value:.12g}, {where}, {self.verdict}{note}{says}"


_FLOATS = ("value", "period", "residual", "phase")
_WORDS = ("verdict", "word", "special", "note", "predicts", "surface", "test")


@dataclass
class Branch(Shown, Answering):
    """Points in the order along the branch, special points among them.

    parameter  what is varied; parameters: the other values; kind: "map", "orbit", "equilibrium", "function"
    message    how it ended, at each end that was reached; interrupted: by Ctrl-C
    state      what a continuation needs to go on: direction done, next step
    labels     of the parameter and the coordinates with units, for figures
    """

    parameter: str
    kind: str
    parameters: dict[str, float]
    points: list[BranchPoint] = field(default_factory=list)
    message: str = ""
    state: dict[str, Any] = field(default_factory=dict)
    labels: dict[str, str] = field(default_factory=dict)
    interrupted: bool = False

    @property
    def values(self) -> Array:
        """Values of the parameter along the branch."""
        return np.array([point.value for point in self.points])

    @property
    def stable(self) -> npt.NDArray[np.bool_]:
        """Where the verdict is "stable", along the branch."""
        return np.array([point.stable for point in self.points])

    @property
    def special(self) -> list[BranchPoint]:
        """The special points."""
        return [point for point in self.points if point.special]

    @property
    def folds(self) -> list[BranchPoint]:
        """The folds."""
        return [point for point in self.points if point.special == "fold"]

    @property
    def d(self) -> Array:
        """The first coordinate along the branch."""
        return self.coordinate(next(iter(self.points[0].coordinates))) if self.points else np.zeros(0)

    @keywords()
    def coordinate(self, name: str) -> Array:
        """One coordinate along the branch; NaN where a point has none of that name, as a multiplier."""
        known = list(self.points[0].coordinates) if self.points else []
        if name not in known:
            raise UsageError(unknown("coordinate", name, known))
        return np.array([point.coordinates.get(name, np.nan) for point in self.points])

    def __str__(self) -> str:
        return "\n".join([f"{len(self.points)} points; {self.message}", *map(str, self.special)])

    def to_dict(self) -> dict[str, Any]:
        """Plain data. A point has its coordinates under "coordinates" and, where its other columns leave the
        name free, also as columns."""
        return {
            "parameter": self.parameter, "parameters": dict(self.parameters), "kind": self.kind,
            "message": self.message, "special": [_told(point) for point in self.special],
            "points": [_told(point) for point in self.points],
        }  # fmt: skip

    def plot(self, *given: Any, **options: Any) -> Any:
        """The branch over the parameter (see `filippov.plot.branch.plot_branches`)."""
        from filippov.plot.branch import plot_branches

        return plot_branches([self], *given, **options)

    @keywords()
    def save(self, path: str | Path) -> Path:
        """Write the branch as JSON; the file appears complete or not at all."""
        data = {
            "format": FORMAT, "version": VERSION, "parameter": self.parameter, "kind": self.kind,
            "parameters": self.parameters, "message": self.message, "state": self.state,
            "labels": self.labels,
            "points": [_out(point) for point in self.points],
        }  # fmt: skip
        return write_json(path, data)

    @classmethod
    @keywords()
    def load(cls, path: str | Path) -> Branch:
        """Read what `save` wrote. Raises UsageError for any other content; FileNotFoundError."""
        data = read_json(path, FORMAT, VERSION)
        with content_of(path):
            points = [_in(row) for row in data["points"]]
            # A branch that leaves a surface has no multiplier of it from there on.
            for k, point in enumerate(points):
                if not point.coordinates:
                    raise ValueError(f"point {k} has no coordinates")
            others = {str(k): _float(f"parameter {k!r}", v) for k, v in data["parameters"].items()}
            return cls(
                str(data["parameter"]), str(data["kind"]), others, points, str(data["message"]),
                dict(data["state"]), {str(k): str(v) for k, v in data.get("labels", {}).items()},
            )  # fmt: skip

    def __repr__(self) -> str:
        span = f"{self.values.min():.6g} ... {self.values.max():.6g}" if self.points else "empty"
        named = ", ".join(f"{q.special} at {q.value:.9g}" for q in self.special)
        return f"Branch({self.parameter} = {span}, {len(self.points)} points{'; ' + named if named else ''})"


def _told(point: BranchPoint) -> dict[str, Any]:
    coordinates = dict(point.coordinates)
    return coordinates | {
        "special": point.special, "value": point.value, "stable": point.stable, "verdict": point.verdict,
        "word": point.word, "period": point.period, "note": point.note, "predicts": point.predicts,
        "coefficients": dict(point.coefficients), "coordinates": coordinates,
    }  # fmt: skip


def _out(point: BranchPoint) -> dict[str, Any]:
    data = asdict(point)
    data["multipliers"] = [[v.real, v.imag] for v in map(complex, point.multipliers)]
    return data


def _in(row: Mapping[str, Any]) -> BranchPoint:
    data = dict(row)
    data["multipliers"] = tuple(complex(*pair) for pair in data["multipliers"])
    data |= {name: _float(name, v) for name, v in data.items() if name in _FLOATS}
    for name in ("coordinates", "tests", "coefficients"):
        data[name] = {str(k): _float(f"{name}: {k}", v) for k, v in dict(data.get(name, {})).items()}
    data |= {name: tuple(_float(name, v) for v in data[name]) for name in ("u", "tangent")}
    data |= {name: text(name, v) for name, v in data.items() if name in _WORDS}
    # Files written earlier have no third verdict.
    before = "stable" if data.pop("stable", False) else "unstable"
    data.setdefault("verdict", before)
    if "surface" not in data:
        data |= _from_note(str(data["special"]), str(data["note"]))
    data |= {name: tuple(text(name, v) for v in data[name]) for name in ("modes", "onto")}
    return BranchPoint(**data)


def _float(name: str, value: object) -> float:
    found = as_float(value)
    if found is None:
        raise ValueError(f"{name} is {shown(value)}, expected a number")
    return found


def _from_note(special: str, note: str) -> dict[str, Any]:
    """Surface, test and modes of a special point in a file written earlier, which has them in its note."""
    surface = re.search(r"surface (['\"])(.+?)\1", note)
    found: dict[str, Any] = {"surface": surface[2] if surface else "", "test": note.rpartition("; ")[2]}
    crossed = re.search(r"; (.+?): \(.*?\) -> (\(.*?\))", note) if special == "boundary equilibrium" else None
    if crossed is not None:
        first = mode_text(ast.literal_eval(crossed[2]))
        found |= {"test": crossed[1], "onto": (first, *re.findall("leaves in mode ([-+0]+)", note))}
    return {"onto": (), **found}
