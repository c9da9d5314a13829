"""A program as its users run it: one of scipy's methods step by step, with a budget of calls."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy import integrate

from filippov.base.arrays import Array
from filippov.base.errors import UsageError
from filippov.base.names import unknown

METHODS = ("RK45", "RK23", "DOP853", "Radau", "BDF", "LSODA")


@dataclass(frozen=True)
class NaiveRun:
    """What a method of scipy makes of a program.

    t, y       ends of its steps (k,) and states there (n, k)
    spent      calls of f before each end (k,)
    calls      times of all calls of f, in order (c,); asked: the states of these calls (n, c)
    ended      "" where it came to the end; "budget" where its calls were used up; else what was raised
    written    time of the first call that changed y, the integrator's own array; None for none
    """

    method: str
    rtol: float
    atol: float
    t: Array
    y: Array
    spent: npt.NDArray[np.int64]
    calls: Array
    asked: Array
    ended: str
    written: float | None = None

    @property
    def nfev(self) -> int:
        """The number of calls of f."""
        return len(self.calls)

    @property
    def steps(self) -> int:
        """The number of steps that were taken."""
        return len(self.t) - 1


class _Spent(Exception):  # noqa: N818
    """The budget of calls is used up."""


def run_naively(
    function: Callable[..., Any], x0: Any, t_span: tuple[float, float], args: Sequence[Any] = (), *,
    method: str, rtol: float, atol: float, max_calls: int,
) -> NaiveRun:  # fmt: skip
    """Integrate f(t, y, *args) by a method of scipy. What f raises ends the run and is kept as text."""
    if method not in METHODS:
        raise UsageError(unknown("method", method, METHODS))
    calls: list[float] = []
    asked: list[Array] = []
    written: list[float] = []

    def counted(t: float, y: Array) -> Any:
        if len(calls) >= max_calls:
            raise _Spent
        calls.append(float(t))
        asked.append(np.array(y, dtype=float))
        out = np.asarray(function(t, y, *args), dtype=float).ravel()
        if not written and not np.array_equal(asked[-1], y, equal_nan=True):
            written.append(float(t))
        return out

    start = np.asarray(x0, dtype=float)
    t, y, spent, ended = [t_span[0]], [start], [0], ""
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        try:
            solver = getattr(integrate, method)(
                counted, t_span[0], start.copy(), t_span[1], rtol=rtol, atol=atol
            )
            while solver.status == "running":
                said = solver.step()
                if solver.status == "failed":
                    ended = str(said or "failed")
                    break
                t.append(float(solver.t))
                y.append(np.array(solver.y, dtype=float))
                spent.append(len(calls))
        except _Spent:
            ended = "budget"
        except Exception as error:  # noqa: BLE001
            # The user's own function may raise anything: it is named in the result.
            ended = f"{type(error).__name__}: {error}"
    states = np.array(asked).reshape(len(calls), len(start)).T
    return NaiveRun(
        method, rtol, atol, np.array(t), np.array(y).T, np.array(spent), np.array(calls), states, ended,
        written[0] if written else None,
    )  # fmt: skip
