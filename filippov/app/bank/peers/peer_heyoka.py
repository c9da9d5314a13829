"""heyoka's Taylor integrator put to the cases of a bank: select() for the sign, no events."""

from __future__ import annotations

import importlib
from typing import Any

import numpy as np
from sympy import Abs, Dummy, Expr, Float, Rational

from filippov.app.bank.peers.peer import CannotError, Given, Limits, Peer
from filippov.app.bank.target import Array
from filippov.model.symbols import t as time_symbol

STEPS = 200  # between two looks at what is allowed; a step of order n counts as n field calls


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


PEERS = (Peer("heyoka", "heyoka", run_heyoka),)
