"""diffrax's explicit methods put to the cases of a bank: jnp.sign, a PID controller, no events."""

from __future__ import annotations

import importlib
import itertools
from functools import partial
from typing import Any

import numpy as np
import sympy

from filippov.app.bank.peers.peer import CannotError, Given, HangError, Limits, Peer
from filippov.app.bank.target import Array

STAGES = {"Tsit5": 6, "Dopri8": 13}


def run_diffrax(method: str, case: Given, limits: Limits) -> tuple[Array, bool]:
    """States at the times asked for."""
    jax, jnp = importlib.import_module("jax"), importlib.import_module("jax.numpy")
    diffrax = importlib.import_module("diffrax")
    jax.config.update("jax_enable_x64", True)
    try:
        h = sympy.lambdify(case.symbols, list(case.h), "jax")
        rows = {signs: sympy.lambdify(case.symbols, list(row), "jax") for signs, row in case.rows.items()}
    except (TypeError, ValueError, NotImplementedError) as error:
        raise CannotError(str(error)) from None

    def field(t: Any, x: Any, _: Any) -> Any:
        values = [x[i] for i in range(len(case.built.x0))]
        s = [jnp.sign(v) for v in h(t, *values)]
        total = jnp.zeros(len(case.built.x0))
        for corner in itertools.product((1, -1), repeat=len(s)):
            weight = 1.0
            for sign, value in zip(corner, s, strict=True):
                weight = weight * (1 + sign * value) / 2
            row = jnp.array([jnp.asarray(v, dtype=float) for v in rows[corner](t, *values)])
            # A field that is not finite on a side where the state is not must not count there.
            total = total + jnp.where(weight > 0, weight * row, 0.0)
        return total

    start, _ = case.built.t_span
    solver, steps = getattr(diffrax, method)(), limits.calls // STAGES[method]
    found = diffrax.diffeqsolve(
        diffrax.ODETerm(field), solver, start, case.times[-1], None, jnp.array(case.built.x0),
        saveat=diffrax.SaveAt(ts=jnp.array(case.times)), max_steps=steps, throw=False,
        stepsize_controller=diffrax.PIDController(rtol=limits.rtol, atol=limits.atol),
    )  # fmt: skip
    if bool(found.result == diffrax.RESULTS.max_steps_reached):
        raise HangError
    return np.asarray(found.ys), bool(found.result == diffrax.RESULTS.successful)


PEERS = tuple(Peer(f"diffrax {name}", "diffrax", partial(run_diffrax, name)) for name in STAGES)
