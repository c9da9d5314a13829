"""Rows of one form as loops: random networks against their formulas, evaluated one by one with numpy."""

from __future__ import annotations

import numpy as np
import pytest
import sympy

from filippov import Surface, System, parameters, sign, solve, states
from filippov.kernel.codegen import repeated as module
from filippov.kernel.codegen.generate import generate
from filippov.model.symbols import t
from filippov.solving.state.machine import Machine

# The rate of a cell from its states, those of two neighbours, the time and its own parameter.
CELLS = (
    lambda x, v, u, w, q: -x - q * sign(v) + 0.3 * (u - x),
    lambda x, v, u, w, q: q * (u - 2 * x + w) - sympy.sin(v) * sympy.exp(-(x**2)),
    lambda x, v, u, w, q: -q * sign(v) / (1 + 3 * abs(v)) + u * w - 0.1 * v,
    lambda x, v, u, w, q: sympy.cos(t) * x - sign(v - q) * (1 + abs(v - q)) ** 1.5 - abs(u),
    lambda x, v, u, w, q: sympy.Max(u, x) - q * x - 0.2 * sign(v) * abs(x + abs(v)),
    lambda x, v, u, w, q: -q - x,
)


def network(rng: np.random.Generator) -> System:
    """Cells in runs of one kind, with neighbours at a fixed distance and some exceptions."""
    count = int(rng.integers(12, 40))
    x, v = states([f"x{i}" for i in range(count)]), states([f"v{i}" for i in range(count)])
    each = bool(rng.integers(2))
    p = parameters(**{f"q{i}": 0.5 + 0.1 * i for i in range(count if each else 2)})
    own = [getattr(p, f"q{i if each else 0}") for i in range(count)]
    kind, apart, further = int(rng.integers(len(CELLS))), int(rng.integers(1, 4)), int(rng.integers(1, 4))
    rates = {}
    for i in range(count):
        if rng.uniform() < 0.1:
            kind = int(rng.integers(len(CELLS)))
        q = p.q1 if rng.uniform() < 0.05 else own[i]
        u, w = x[(i + apart) % count], x[(i - further) % count]
        rates[v[i]] = CELLS[kind](x[i], v[i], u, w, q)
    slopes = dict(zip(x, v, strict=True))
    if rng.integers(2):
        return System(slopes | rates)
    together = [pair for a, b in zip(slopes.items(), rates.items(), strict=True) for pair in (a, b)]
    return System(dict(together))


@pytest.mark.parametrize("seed", range(12))
def test_14_5_loops_evaluate_to_the_formulas(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Field, guards, gradients and sets of the compiled unit against the symbolic form."""
    monkeypatch.setattr(module, "FEWEST", 3)
    rng = np.random.default_rng(seed)
    system = network(rng)
    form, machine = system.symbolic, Machine(system, "DOP853", system.parameters.defaults)
    assert " for b in range(" in generate(form, system.surfaces).source
    symbols = [t, *form.x, *form.p, *form.s, *form.a]
    field, guards = (sympy.lambdify(symbols, list(e), "numpy") for e in (form.field, form.h))
    for _ in range(3):
        x, now = rng.normal(size=len(form.x)), float(rng.uniform(0, 3))
        mode = machine.signs_at(now, x)[1] * rng.integers(2, size=len(form.h))
        signs = rng.uniform(-1.0, 1.0, size=len(form.h))
        values = [now, *x, *machine.p[: len(form.p)], *signs]
        sizes: list[float] = []
        for i, h in enumerate(form.h):
            known = dict(zip(symbols, [*values, *sizes], strict=False))
            sizes.append(float(mode[i] * sympy.N(h.xreplace(known))))
        np.testing.assert_allclose(
            machine.rhs(now, x, signs, mode), field(*values, *sizes), rtol=1e-12, atol=1e-12
        )
        np.testing.assert_allclose(
            machine.guards(now, x, mode), guards(*values, *sizes), rtol=1e-12, atol=1e-12
        )
        g, gt = machine.gradients(now, x, mode)
        known = dict(zip(symbols, [*values, *sizes], strict=True))
        for i in rng.choice(len(form.h), size=3 if form.h else 0):
            step = 1e-6
            for j in rng.choice(len(form.x), size=3):
                moved = [x + side * step * np.eye(len(x))[j] for side in (1, -1)]
                h = [machine.guards(now, at, mode)[i] for at in moved]
                np.testing.assert_allclose(g[i, j], (h[0] - h[1]) / (2 * step), atol=1e-7)
            h = [machine.guards(at, x, mode)[i] for at in (now + step, now - step)]
            np.testing.assert_allclose(gt[i], (h[0] - h[1]) / (2 * step), atol=1e-7)
        np.testing.assert_array_equal(machine.radii(now, x), np.tile([-1.0, 1.0], (len(form.h), 1)))


def test_14_5_blocks_that_differ_in_a_place_only_stop_at_their_times() -> None:
    """v_i' = -g_i sign(v_i) with a set [-2, 2] at rest: |v_i(0)| / g_i, in compiled code and in Python."""
    n = 64
    v = states([f"v{i}" for i in range(n)])
    p = parameters(**{f"g{i}": 1.0 + i for i in range(n)})
    rates = {q: -getattr(p, f"g{i}") * sign(q) for i, q in enumerate(v)}
    system = System(rates, surfaces=[Surface(f"stop{i}", q, radius=2) for i, q in enumerate(v)])
    assert generate(system.symbolic, system.surfaces).source.count("for b in range(64)") == 6
    start = np.array([(-1.0) ** i * (1 + i) ** 1.5 for i in range(n)])
    for backend in ("compiled", "python"):
        solution = solve(system, start, (0.0, 9.0), backend=backend)
        assert solution.success
        times = {event.surface: event.t for event in solution.events}
        np.testing.assert_allclose(
            [times[f"stop{i}"] for i in range(n)], np.sqrt(np.arange(1, n + 1)), rtol=1e-9
        )
        np.testing.assert_allclose(solution.y[:, -1], 0.0, atol=1e-9)
