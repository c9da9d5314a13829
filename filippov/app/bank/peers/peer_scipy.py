"""scipy's solve_ivp, and this package, put to the cases of a bank."""

from __future__ import annotations

import warnings
from functools import partial

import numpy as np
from scipy.integrate import solve_ivp

from filippov.app.bank.peers.peer import Given, HangError, Limits, Peer, SaidError, numeric_field
from filippov.app.bank.target import Array
from filippov.base.status import Status
from filippov.solving.solver import solve


def run_scipy(method: str, case: Given, limits: Limits) -> tuple[Array, bool]:
    """States at the times asked for, by solve_ivp."""
    start, _ = case.built.t_span
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        found = solve_ivp(
            numeric_field(case, limits), (start, case.times[-1]), case.built.x0, method=method,
            t_eval=case.times, rtol=limits.rtol, atol=limits.atol,
        )  # fmt: skip
    states = np.full((len(case.times), len(case.built.x0)), np.nan)
    if found.success:
        states[: found.y.shape[1]] = found.y.T
    return states, bool(found.success)


def run_filippov(method: str, case: Given, limits: Limits) -> tuple[Array, bool]:
    """The same by this package."""
    start, _ = case.built.t_span
    found = solve(
        case.built.system, case.built.x0, (start, case.times[-1]), method=method, rtol=limits.rtol,
        atol=limits.atol, max_steps=limits.calls, max_time=limits.seconds, t_eval=case.times, zeno="continue",
    )  # fmt: skip
    if found.nfev > limits.calls or found.status in (Status.MAX_STEPS, Status.TIMEOUT):
        raise HangError
    if found.status is Status.NON_UNIQUE:
        raise SaidError(found.message)
    states = np.full((len(case.times), len(case.built.x0)), np.nan)
    if found.success:
        states[: found.y.shape[1]] = found.y.T
    return states, found.success


FILIPPOV = tuple(
    Peer(name, "filippov", partial(run_filippov, method))
    for name, method in (("filippov", "DOP853"), ("filippov Radau", "Radau"))
)
PEERS = tuple(
    Peer(f"scipy {method}", "scipy", partial(run_scipy, method)) for method in ("RK45", "LSODA", "Radau")
)
