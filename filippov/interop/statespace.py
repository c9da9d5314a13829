"""Lur'e systems: a linear plant with what is not linear in its loop."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import sympy
from sympy import Expr, Symbol

from filippov.base.errors import ModelError
from filippov.base.keywords import keywords
from filippov.base.names import state_names
from filippov.base.signature import check_signature
from filippov.interop.wiring import Block, wired
from filippov.model.check import as_expression
from filippov.model.surface import Surface, no_surface
from filippov.model.symbols import states as state_symbols
from filippov.model.system import System


@keywords("keyword", error=ModelError)
def from_statespace(
    A: Any, B: Any, C: Any, D: Any = 0, *, nonlinearity: Callable[..., Any], states: Any = None,
    outputs: Sequence[str] | None = None, surfaces: Sequence[Surface] = (),
) -> System:  # fmt: skip
    """x' = A x + B u, y = C x + D u, u = nonlinearity(y).

    A, B, C, D    numbers or expressions in parameters, shapes (n, n), (n, k), (m, n), (m, k); vectors for one
                  input or output; D = 0 for none
    nonlinearity  function of the m outputs, expressions, that returns the k inputs (one, or a list): of
                  negative feedback lambda y: -sign(y)
    states        their names; default x1, x2, ...; outputs: default y, or y1, y2, ...: outputs of the system
    surfaces      declared surfaces, in the symbols of the outputs: Surface("relay", y, width=0.1) with
                  y = sympy.Symbol("y", real=True); names for what the nonlinearity switches on

    Raises ModelError: for shapes that do not fit, and where outputs with feed-through act on themselves.
    """
    a, b, c, d = _matrices(A, B, C, D)
    n, k, m = a.shape[0], b.shape[1], c.shape[0]
    names = [f"x{i + 1}" for i in range(n)] if states is None else list(state_names(states))
    if len(names) != n:
        raise ModelError(f"{len(names)} states are named ({', '.join(names)}), expected {n}, as A has rows.")
    called = ["y"] if m == 1 else [f"y{i + 1}" for i in range(m)]
    called = called if outputs is None else [str(q) for q in outputs]
    if len(called) != m:
        raise ModelError(f"{len(called)} outputs are named, expected {m}, as C has rows.")
    x, y = state_symbols(names), tuple(Symbol(name, real=True) for name in called)
    if clash := set(names) & set(called):
        raise ModelError(f"{min(clash)!r} is both a state and an output. Rename one: outputs=['z'].")
    u = tuple(sympy.Dummy(f"u{j + 1}", real=True) for j in range(k))
    for surface in surfaces:
        if not isinstance(surface, Surface):
            raise ModelError(no_surface(surface))
    plant = Block(
        "plant", u, tuple(c * sympy.Matrix(x) + d * sympy.Matrix(u)), tuple(x),
        tuple(a * sympy.Matrix(x) + b * sympy.Matrix(u)), tuple(surfaces),
    )  # fmt: skip
    check_signature(nonlinearity, called, "nonlinearity", "[...], one number an input")
    values = _inputs(nonlinearity(*y), k)
    return wired(
        [plant], dict(zip(u, values, strict=True)), dict(zip(y, plant.outputs, strict=True)),
        dict(zip(called, y, strict=True)),
    )  # fmt: skip


def _inputs(given: Any, k: int) -> list[Expr]:
    row = list(given) if isinstance(given, list | tuple | np.ndarray | sympy.MatrixBase) else [given]
    if len(row) != k:
        raise ModelError(f"nonlinearity returned {len(row)} values, expected {k}, as B has columns.")
    return [as_expression(value, f"input {j + 1} of the plant") for j, value in enumerate(row)]


def _matrices(A: Any, B: Any, C: Any, D: Any) -> tuple[sympy.Matrix, ...]:
    """The four matrices of a plant, of numbers or expressions. Raises ModelError."""
    a = _matrix(A, "A", None)
    n = a.shape[0]
    if a.shape != (n, n) or n == 0:
        raise ModelError(f"A has shape {a.shape}, expected a square one.")
    b, c = _matrix(B, "B", (n, -1)), _matrix(C, "C", (-1, n))
    for name, matrix, place in (("B", b, 0), ("C", c, 1)):
        if matrix.shape[place] != n:
            wanted = f"({n}, k)" if place == 0 else f"(m, {n})"
            raise ModelError(f"{name} has shape {matrix.shape}, expected {wanted}, as A has {n} rows.")
    shape = (c.shape[0], b.shape[1])
    empty = isinstance(D, int | float) and D == 0
    d = sympy.zeros(*shape) if empty else _matrix(D, "D", shape)
    if d.shape != shape:
        raise ModelError(f"D has shape {d.shape}, expected {shape}, outputs by inputs.")
    return a, b, c, d


def _matrix(given: Any, name: str, shape: tuple[int, int] | None) -> sympy.Matrix:
    rows: Any = given.tolist() if isinstance(given, np.ndarray | sympy.MatrixBase) else given
    if isinstance(rows, Mapping | str):
        raise ModelError(f"{name} is {given!r}, expected a matrix of numbers: [[0, 1], [-4, -0.3]].")
    rows = list(rows) if isinstance(rows, list | tuple) else [[rows]]
    flat = not any(isinstance(row, list | tuple) for row in rows)
    if flat:
        # One input is a column of B, one output a row of C.
        rows = [[q] for q in rows] if shape is not None and shape[1] == -1 else [rows]
    if len({len(row) for row in rows}) > 1 or not rows:
        raise ModelError(f"{name} has rows of lengths {[len(row) for row in rows]}, expected one length.")
    return sympy.Matrix([[_entry(q, name) for q in row] for row in rows])


def _entry(value: Any, name: str) -> Expr:
    e = as_expression(value, f"an entry of {name}")
    if e.is_number and not e.is_finite:
        raise ModelError(f"{name} holds {e}, expected finite numbers.")
    return e
