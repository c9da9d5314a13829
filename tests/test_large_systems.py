"""Systems of many equations: kernels in pieces give what one kernel gives, contacts know their own states."""

from __future__ import annotations

import gc

import numpy as np
import pytest
import scipy.sparse
import sympy
from scipy.sparse.linalg import expm_multiply

from filippov import System, parameters, sign, solve, states, t
from filippov.kernel.codegen import pieces as module
from filippov.kernel.codegen.generate import filled, generate, total_gradients
from filippov.kernel.codegen.pieces import pieces
from filippov.model.extract import Extractor
from filippov.model.kinds import Kinds
from filippov.model.surface import Surface
from filippov.model.symbolic import SymbolicForm


def test_14_5_a_long_line_moves_as_its_matrix_says() -> None:
    """x' = D L x - k e_0 with the relay's sign held: x = exp(A t) x(0) with a constant state added."""
    n = 400
    x = states([f"x{i}" for i in range(n)])
    p = parameters(D=2.0, k=1.5)
    near = [0, *x, 0]
    equations = {x[i]: p.D * (near[i] - 2 * near[i + 1] + near[i + 2]) for i in range(n)}
    equations[x[0]] -= p.k * sign(x[n - 1] + 3)
    system = System(equations)
    assert "def rhs1(" in generate(system.symbolic, system.surfaces).source
    start = np.sin(np.arange(n))
    solution = solve(system, start, (0.0, 0.7), rtol=1e-11, atol=1e-13)
    line = 2.0 * scipy.sparse.diags([1.0, -2.0, 1.0], [-1, 0, 1], shape=(n, n))
    push = scipy.sparse.csr_matrix(([-1.5], ([0], [0])), shape=(n, 1))
    whole = scipy.sparse.bmat([[line, push], [None, scipy.sparse.csr_matrix((1, 1))]]).tocsr()
    expected = expm_multiply(0.7 * whole, np.append(start, 1.0))[:n]
    assert solution.success
    assert not len(solution.events)
    np.testing.assert_allclose(solution.y[:, -1], expected, rtol=0, atol=1e-10)
    assert gc.isenabled()


def test_14_5_kernels_in_pieces_stop_each_block_at_its_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """v_i' = -mu g_i sign(v_i): each stops at |v_i(0)| / (mu g_i), and stays."""
    monkeypatch.setattr(module, "LENGTH", 12)
    n = 12
    v = states([f"v{i}" for i in range(n)])
    p = parameters(mu=0.5)
    system = System({q: -p.mu * (i + 1) * sign(q) for i, q in enumerate(v)})
    source = generate(system.symbolic, system.surfaces).source
    assert all(f"def {name}1(" in source for name in ("rhs", "guards", "gradients", "radii"))
    start = np.array([(-1.0) ** i * (1 + i) ** 1.5 for i in range(n)])
    for backend in ("compiled", "python"):
        solution = solve(system, start, (0.0, 8.0), backend=backend)
        assert solution.success
        np.testing.assert_allclose(solution.y[:, -1], 0.0, atol=1e-9)
        times = {event.surface: event.t for event in solution.events}
        stops = np.abs(start) / (0.5 * np.arange(1, n + 1))
        np.testing.assert_allclose([times[f"v{i}"] for i in range(n)], stops, rtol=1e-9)


@pytest.mark.parametrize(("count", "shared"), [(40, False), (1000, False), (1000, True)])
def test_14_5_pieces_hold_every_statement_once_and_in_order(count: int, shared: bool) -> None:
    x = sympy.symbols(f"x:{count}")
    mean = sympy.sin(sympy.Add(*x)) if shared else sympy.S.One
    results = [(f"out[{i}]", q**2 + 3 * q + mean) for i, q in enumerate(x)]
    parts = pieces(results)
    assert [item for part in parts for item in part] == results
    assert (len(parts) > 1) == (count > 40 and not shared)


@pytest.mark.parametrize("count", [1, 40])
def test_14_5_a_contact_is_the_same_among_many_others(count: int) -> None:
    """y'' = -g with y'+ = -e y': L = y', and the surface pushes along y' alone."""
    y = states([f"y{i}" for i in range(count)])
    w = states([f"w{i}" for i in range(count)])
    p = parameters(g=9.81, e=0.7)
    equations = {y[i]: w[i] for i in range(count)} | dict.fromkeys(w, -p.g)
    floors = [Surface(f"floor{i}", y[i], reset={w[i]: -p.e * w[i]}) for i in range(count)]
    form = System(equations, surfaces=floors).symbolic
    for i, contact in enumerate(form.contact):
        assert (contact.side, contact.rate) == (1, w[i])
        pushed = dict(zip(form.x, contact.direction, strict=True))
        assert {q: e for q, e in pushed.items() if e != 0} == {w[i]: 1}


# A block by its states, its neighbour and the parameters: whether it jumps and slides straight is its own.
BLOCKS = (
    lambda x, v, u, p: -x - p.mu * sign(v),
    lambda x, v, u, p: -x - p.mu * sign(v) * (1 + v**2),
    lambda x, v, u, p: -x - p.mu * abs(v) * (1 + u),
    lambda x, v, u, p: sympy.sin(x) - p.mu * sign(v - p.mu) / (1 + abs(v - p.mu)),
    lambda x, v, u, p: u * x - p.mu * sign(v + x**2),
    lambda x, v, u, p: -p.k * v * sign(v) + x * u - x,
    lambda x, v, u, p: -p.mu * sign(v + 2 * x) - p.k * sign(u) * abs(v + 2 * x),
    lambda x, v, u, p: (x - v) * sign(x - v) - sign(v) * (v**2 + v),
)


@pytest.mark.parametrize("seed", range(2))
def test_14_5_what_is_found_of_one_block_holds_for_those_alike(seed: int) -> None:
    """Kinds of surfaces and straight rates of a chain, against each block asked for itself."""
    rng, n = np.random.default_rng(seed), 12
    x, v = states([f"x{i}" for i in range(n)]), states([f"v{i}" for i in range(n)])
    p = parameters(mu=0.5, k=1.0)
    equations = {}
    for i, kind in enumerate(rng.integers(len(BLOCKS), size=n)):
        equations |= {x[i]: v[i], v[i]: BLOCKS[kind](x[i], v[i], v[rng.integers(n)], p)}
    read = Extractor()
    read.note(equations.values())
    system = System(equations)
    form = system.symbolic
    unexpanded = [f.xreplace(_signs(read, form, f)) for f in map(read.unexpanded, equations.values())]
    kinds = Kinds(form, unexpanded)
    for i, surface in enumerate(system.surfaces):
        assert kinds.kind(i, surface) == surface.kind == ("switching" if kinds._jumps(i) else "kink")
    made = generate(form, system.surfaces).constants
    modes = tuple(sympy.Symbol(f"m{i}") for i in range(len(form.h)))
    varying = {t, *form.x, *form.a}
    rows = filled(total_gradients(form, modes))
    linear = [not any(e.free_symbols & varying for e in row.values()) for row in rows]
    alone = []
    for i, row in enumerate(rows):
        rate = sum((e * form.field[j] for j, e in row.items() if j < 2 * n), row.get(2 * n, 0 * t))
        rate = rate.subs(form.a[i], 0)
        sizes = [straight for a, straight in zip(form.a, linear, strict=True) if a in rate.free_symbols]
        inside = varying & rate.free_symbols
        second = [rate.diff(q, r) for q in inside for r in inside]
        alone.append(linear[i] and all(sizes) and not any(sympy.expand(e) != 0 for e in second))
    assert [bool(flag) for flag in made["STRAIGHT"]] == alone
    assert len(set(alone)) == 2


def _signs(read: Extractor, form: SymbolicForm, f: sympy.Expr) -> dict[sympy.Symbol, sympy.Expr]:
    """The signs of an extractor of its own, by those of the form."""
    place = dict(zip(form.plain_h(), form.s, strict=True))
    return {s: place[read.table.plain(read.table.entry(s).h)] for s in read.table.signs_in(f)}
