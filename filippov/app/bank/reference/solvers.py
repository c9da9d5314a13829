"""The solvers put to the cases of a bank: scipy, heyoka, diffrax, without events; and this package."""

from __future__ import annotations

import importlib
import itertools
import warnings
from functools import partial
from typing import Any

import numpy as np
import sympy
from scipy.integrate import solve_ivp
from sympy import Abs, Dummy, Expr, Float, Rational

from filippov import Status, solve
from filippov import t as time_symbol
from filippov.app.bank.reference.solver import (
    CannotError,
    Given,
    HangError,
    Limits,
    ReferenceSolver,
    SaidError,
    numeric_field,
)
from filippov.base.arrays import Array

STEPS = 200  # between two looks at what is allowed; a step of order n counts as n field calls
STAGES = {"Tsit5": 6, "Dopri8": 13}


def run_scipy(method: str, case: Given, limits: Limits) -> tuple[Array, bool]:
    """States at the times asked for, by solve_ivp."""
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        found = solve_ivp(
            numeric_field(case, limits), (case.built.t_span[0], case.times[-1]), case.built.x0, method=method,
            t_eval=case.times, rtol=limits.rtol, atol=limits.atol,
        )  # fmt: skip
    return _states(case, found), bool(found.success)


def _states(case: Given, found: Any) -> Array:
    states = np.full((len(case.times), len(case.built.x0)), np.nan)
    if found.success:
        states[: found.y.shape[1]] = found.y.T
    return states


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
    return _states(case, found), found.success


def run_heyoka(case: Given, limits: Limits) -> tuple[Array, bool]:
    """States at the times asked for."""
    hy = importlib.import_module("heyoka")
    names = {symbol: hy.expression(symbol.name) for symbol in case.built.states} | {time_symbol: hy.time}

    def read(expression: Expr) -> Any:
        for size in sorted(expression.atoms(Abs), key=Expr.count_ops):
            inner, symbol = read(size.args[0]), Dummy()
            names[symbol] = hy.select(hy.gt(inner, hy.expression(0.0)), inner, -inner)
            expression = expression.xreplace({size: symbol})
        numbers = {r: Float(r, 17) for r in expression.atoms(Rational) if not r.is_Integer}
        try:
            found = hy.from_sympy(expression.xreplace(numbers), names)
        except (TypeError, ValueError, NotImplementedError, AttributeError, KeyError) as error:
            raise CannotError(str(error)) from None
        return found if isinstance(found, hy.expression) else hy.expression(float(found))

    signs = [hy.gt(read(h), hy.expression(0.0)) for h in case.h]

    def chosen(i: int, known: tuple[int, ...]) -> Any:
        if len(known) == len(signs):
            return read(case.rows[known][i])
        plus, minus = (chosen(i, (*known, side)) for side in (1, -1))
        return hy.select(signs[len(known)], plus, minus)

    equations = [(names[x], chosen(i, ())) for i, x in enumerate(case.built.states)]
    start, _ = case.built.t_span
    integrator = hy.taylor_adaptive(equations, list(case.built.x0), time=start, tol=max(limits.rtol, 1e-16))
    states = np.full((len(case.times), len(case.built.x0)), np.nan)
    steps = 0
    for place, t in enumerate(case.times):
        while True:
            limits.check(steps * integrator.order)
            outcome = integrator.propagate_until(t, max_steps=STEPS)[0]
            steps += STEPS
            if outcome != hy.taylor_outcome.step_limit:
                break
        if outcome != hy.taylor_outcome.time_limit:
            return states, False
        states[place] = integrator.state
    return states, True


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

    solver, steps = getattr(diffrax, method)(), limits.calls // STAGES[method]
    found = diffrax.diffeqsolve(
        diffrax.ODETerm(field), solver, case.built.t_span[0], case.times[-1], None, jnp.array(case.built.x0),
        saveat=diffrax.SaveAt(ts=jnp.array(case.times)), max_steps=steps, throw=False,
        stepsize_controller=diffrax.PIDController(rtol=limits.rtol, atol=limits.atol),
    )  # fmt: skip
    if bool(found.result == diffrax.RESULTS.max_steps_reached):
        raise HangError
    return np.asarray(found.ys), bool(found.result == diffrax.RESULTS.successful)


FILIPPOV = tuple(
    ReferenceSolver(name, "filippov", partial(run_filippov, method))
    for name, method in (("filippov", "DOP853"), ("filippov Radau", "Radau"))
)
FAMILIES: dict[str, tuple[ReferenceSolver, ...]] = {
    "scipy": tuple(
        ReferenceSolver(f"scipy {m}", "scipy", partial(run_scipy, m)) for m in ("RK45", "LSODA", "Radau")
    ),
    "heyoka": (ReferenceSolver("heyoka", "heyoka", run_heyoka),),
    "diffrax": tuple(ReferenceSolver(f"diffrax {m}", "diffrax", partial(run_diffrax, m)) for m in STAGES),
}
SOLVERS = {solver.name: solver for family in (FILIPPOV, *FAMILIES.values()) for solver in family}
