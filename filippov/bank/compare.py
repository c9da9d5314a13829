"""A bank run through other solvers: who gets which case right, and who says so when not."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from filippov.bank import peer_diffrax, peer_heyoka, peer_scipy
from filippov.bank.build import build
from filippov.bank.case import chosen, read_bank
from filippov.bank.peer import CannotError, Given, HangError, Limits, Peer, given, worst
from filippov.bank.peer_scipy import FILIPPOV
from filippov.errors import ModelError, UsageError
from filippov.names import unknown

FAMILIES: dict[str, tuple[Peer, ...]] = {
    "scipy": peer_scipy.PEERS, "heyoka": peer_heyoka.PEERS, "diffrax": peer_diffrax.PEERS,
}  # fmt: skip
OUTCOMES = ("right", "wrong", "hang", "error", "cannot")
_MARKS = {"right": "yes", "wrong": "WRONG", "hang": "hang", "error": "error", "cannot": "-"}


@dataclass(frozen=True)
class PeerRow:
    """What one solver made of one case.

    outcome   "right", "wrong", "hang" (not done within the field calls or the time allowed), "error" (raised,
              or ended early), "cannot" (the case cannot be written for it)
    reported  whether the solver said that it succeeded
    error     largest difference of the states compared
    """

    id: str
    peer: str
    outcome: str
    reported: bool
    error: float | None
    message: str = ""


@dataclass(frozen=True)
class PeerTable:
    """All rows, with the versions of the solvers and what counted as right."""

    rows: tuple[PeerRow, ...]
    versions: Mapping[str, str]
    rtol: float
    tolerance: float
    max_calls: int

    def count(self, peer: str, outcome: str, reported: bool | None = None) -> int:
        """How often a solver had an outcome."""
        return sum(
            row.peer == peer and row.outcome == outcome and reported in (None, row.reported)
            for row in self.rows
        )

    @property
    def peers(self) -> tuple[str, ...]:
        """Names of the solvers."""
        return tuple(dict.fromkeys(row.peer for row in self.rows))

    @property
    def cases(self) -> tuple[str, ...]:
        """Ids of the cases."""
        return tuple(dict.fromkeys(row.id for row in self.rows))


def compare_bank(
    bank: str | Path | Sequence[Any] | Mapping[str, Any],
    *,
    only: Sequence[str] | None = None,
    peers: Sequence[str] | None = None,
    rtol: float = 1e-8,
    tolerance: float = 1e-6,
    max_calls: int = 50_000,
    max_time: float = 60.0,
    progress: Callable[..., None] | None = None,
) -> PeerTable:
    """Every case with states at given times, through every solver naively.

    peers      "scipy", "heyoka", "diffrax"; default: those that are installed
    rtol       of every solver; the absolute tolerance is rtol / 100
    tolerance  right means: all states within tolerance (1 + |x|), far above rtol
    max_calls  field calls for each case and solver, max_time: seconds

    Raises UsageError for a solver that is unknown or not installed.
    """
    solvers = (FILIPPOV, *_solvers(peers))
    rows: list[PeerRow] = []
    cases = chosen(read_bank(bank), only)
    for place, case in enumerate(cases):
        try:
            item = given(case, build(case.raw))
        except ModelError:
            continue
        for solver in solvers if item is not None else ():
            if progress is not None:
                progress(place, len(cases), f"{case.id}, {solver.name}")
            assert item is not None
            rows.append(_row(case.id, solver, item, Limits(rtol, rtol / 100, max_calls, max_time), tolerance))
    versions = {solver.module: solver.version for solver in solvers if solver is not FILIPPOV}
    return PeerTable(tuple(rows), versions, rtol, tolerance, max_calls)


def _solvers(names: Sequence[str] | None) -> list[Peer]:
    if names is None:
        return [peer for family in FAMILIES.values() for peer in family if peer.installed]
    out: list[Peer] = []
    for name in names:
        if name not in FAMILIES:
            raise UsageError(unknown("peer", name, FAMILIES))
        if not FAMILIES[name][0].installed:
            raise UsageError(f"the peer {name!r} is not installed.")
        out += FAMILIES[name]
    return out


def _row(name: str, solver: Peer, case: Given, limits: Limits, tolerance: float) -> PeerRow:
    limits.started = time.monotonic()
    try:
        states, reported = solver.solve(case, limits)
    except HangError:
        return PeerRow(name, solver.name, "hang", False, None)
    except CannotError as error:
        return PeerRow(name, solver.name, "cannot", False, None, str(error)[:200])
    except Exception as error:  # noqa: BLE001 (a solver may raise anything; it is its outcome)
        return PeerRow(name, solver.name, "error", False, None, f"{type(error).__name__}: {error}"[:200])
    if not reported:
        return PeerRow(name, solver.name, "error", False, None, "ended early")
    gap, ratio = worst(case, states, tolerance)
    shown = float(gap) if np.isfinite(gap) else None
    return PeerRow(name, solver.name, "right" if ratio <= 1 else "wrong", reported, shown)


# -- texts ---------------------------------------------------------------------------------------------


def peers_text(table: PeerTable) -> str:
    """Who gets which case right, and how many each."""
    width = max([len(name) for name in table.cases], default=4)
    by = {(row.id, row.peer): row for row in table.rows}
    lines = [f"{'case':<{width}}  " + "  ".join(f"{peer:>14}" for peer in table.peers)]
    for name in table.cases:
        marks = [_MARKS[by[name, peer].outcome] if (name, peer) in by else "" for peer in table.peers]
        lines.append(f"{name:<{width}}  " + "  ".join(f"{mark:>14}" for mark in marks))
    for outcome in OUTCOMES:
        counts = [table.count(peer, outcome) for peer in table.peers]
        lines.append(f"{outcome:<{width}}  " + "  ".join(f"{count:>14}" for count in counts))
    versions = ", ".join(f"{name} {version}" for name, version in table.versions.items())
    lines.append(
        f"{len(table.cases)} cases at rtol {table.rtol:g}; right: within {table.tolerance:g} (1 + |x|); "
        f"at most {table.max_calls} field calls; {versions}"
    )
    return "\n".join(lines)


def peers_json(table: PeerTable) -> str:
    """The table as one JSON object."""
    data = {**asdict(table), "rows": [asdict(row) for row in table.rows], "versions": dict(table.versions)}
    return json.dumps(data, ensure_ascii=False, indent=1, allow_nan=False) + "\n"


def read_peers(path: str | Path) -> PeerTable:
    """The table from what `peers_json` wrote."""
    data = json.loads(Path(path).read_text(encoding="utf-8"))
    return PeerTable(**{**data, "rows": tuple(PeerRow(**row) for row in data["rows"])})
