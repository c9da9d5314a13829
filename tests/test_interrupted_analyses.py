"""Ctrl-C at any moment of an analysis ends it soon: with KeyboardInterrupt, or with a result that says so."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from filippov import System, cos, parameters, sign, states, t
from filippov.analysis import (
    Stroboscope,
    attractors,
    brute_force,
    compare,
    continuation,
    find_orbit,
    find_section,
    lyapunov,
    returns,
)
from filippov.solving.state import batch, run

X, V = states("x v")
P, Q = parameters(vb=0.2, d=3.0), parameters(A=1.5)
# A block on a belt whose friction falls with the slip, and a block that is pushed to and fro.
BELT = System({X: V, V: -X - sign(V - P.vb) / (1 + P.d * abs(V - P.vb))})
PUSHED = System({X: V, V: -X - 0.1 * V - 0.4 * sign(V) + Q.A * cos(1.2 * t)})
BOX = {"x": (-2, 2), "v": (-1, 1)}
# Chunks of runs that may follow: those that threads have begun.
FEW = 4


class Keyboard:
    """Presses Ctrl-C as the chunk `at` of all runs begins, and counts those that follow."""

    def __init__(self, patch: pytest.MonkeyPatch) -> None:
        self.at, self.count = 0, 0
        alone, rows = run.Run.advance, batch._Chunks.__next__

        def advance(of: Any, steps: int) -> int:
            self.tick()
            return alone(of, steps)

        def following(of: Any) -> None:
            if of.more:
                self.tick()
            rows(of)

        patch.setattr(run.Run, "advance", advance)
        patch.setattr(batch._Chunks, "__next__", following)

    def tick(self) -> None:
        self.count += 1
        if self.count == self.at:
            raise KeyboardInterrupt

    def all_of(self, work: Callable[[], Any]) -> int:
        """The chunks that the work takes."""
        self.at, self.count = 0, 0
        work()
        return self.count

    def cuts(self, work: Callable[[], Any], at: int) -> Any:
        """The result that says that it was interrupted; None for the exception."""
        self.at, self.count = at, 0
        try:
            found = work()
        except KeyboardInterrupt:
            return None
        finally:
            assert self.count <= at + FEW
        assert getattr(found, "interrupted", False) or getattr(found, "complete", True) is False
        return found


@pytest.fixture
def keyboard(monkeypatch: pytest.MonkeyPatch) -> Keyboard:
    return Keyboard(monkeypatch)


WORK: dict[str, Callable[[], Any]] = {
    "orbit": lambda: find_orbit(BELT, (1, 0)),
    "forced orbit": lambda: find_orbit(PUSHED, (1, 0)),
    "section": lambda: find_section(BELT, (1, 0)),
    "stroboscope": lambda: find_section(PUSHED, (1, 0)),
    "attractors": lambda: attractors(BELT, BOX, samples=20),
    "forced attractors": lambda: attractors(PUSHED, BOX, samples=20),
    "returns": lambda: returns(PUSHED, Stroboscope("x"), (1, 0), 20),
    "diagram": lambda: brute_force(PUSHED, Stroboscope("x"), "A", [1.0, 1.5], (1, 0), transient=20),
    "exponents": lambda: lyapunov(PUSHED, (1, 0), 100, interval=5),
    "comparison": lambda: compare(PUSHED, x0=(1, 0), t_span=(0, 10), against=["karnopp"], widths=(1e-2,)),
}


@pytest.mark.parametrize("name", WORK)
def test_an_interrupted_analysis_ends(name: str, keyboard: Keyboard) -> None:
    work = WORK[name]
    last = keyboard.all_of(work)
    for at in {1, last, *np.random.default_rng(7).integers(1, last + 1, 4).tolist()}:
        keyboard.cuts(work, at)


def test_an_interrupted_branch_has_its_points(keyboard: Keyboard) -> None:
    """Those of the whole branch, up to the one at hand; `resume` finds the others."""
    orbit = find_orbit(PUSHED, (1, 0))

    def follow(resume: Any = None) -> Any:
        return continuation(PUSHED, orbit, parameter="A", bounds=(1.4, 1.8), resume=resume).run()

    whole = follow()
    last = keyboard.all_of(follow)
    for at in (last // 2, last - 5):
        part = keyboard.cuts(follow, at)
        assert part.interrupted
        values = [point.value for point in part.points]
        assert set(values) < {point.value for point in whole.points}
        keyboard.at = 0
        assert max(p.value for p in follow(part).points) == pytest.approx(1.8)
