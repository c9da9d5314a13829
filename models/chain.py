"""A chain of blocks on a moving belt, each held by a spring and coupled to its neighbours: Burridge-Knopoff.

    x_i' = v_i
    m v_i' in kc (x_{i+1} - 2 x_i + x_{i-1}) + dc (v_{i+1} - 2 v_i + v_{i-1}) - kp x_i - F(v_i - vb)

Both ends of the chain are free. Every block sticks and slips on a surface of its own, so that n of them meet
n surfaces; in Carlson & Langer's frame the belt rests and the springs kp are pulled.

Sources: Burridge & Knopoff 1967, Bull. Seism. Soc. Am. 57; Carlson & Langer 1989, Phys. Rev. A 40, 6470.
"""

from __future__ import annotations

import math

from sympy import Expr, Symbol

from filippov import ModelError, Parameter, Surface, System, parameters, states
from filippov.models.friction import SMALLEST, FrictionLaw, declare
from filippov.models.laws import Hyperbolic
from filippov.models.registry import Model, register

LAW = Hyperbolic(Fs=1, gamma=3)


def chain(
    n: int = 5,
    friction: FrictionLaw = LAW,
    m: float = 1.0,
    kc: float = 1.2,
    kp: float = 1.0,
    dc: float = 0.1,
    vb: float = 0.2,
) -> System:
    """Return n blocks in a row; the surface "block i", i = 1 ... n, is v_i = vb.

    friction  a law of the velocity relative to the belt, under every block; 1/(1 + 3 |v - vb|) by default
    m, kp     mass of a block [kg], stiffness of its spring to the ground [N/m]
    kc, dc    stiffness and damping between neighbours [N/m, N s/m]
    vb        speed of the belt [m/s]
    ModelError where n is not a whole number of at least 1.
    """
    if isinstance(n, bool) or int(n) != n or n < 1:
        raise ModelError(f"n is {n!r}, expected a whole number of blocks, at least 1.")
    n = int(n)
    p = parameters(
        **declare("m", m, "kg", "mass of a block", SMALLEST),
        **declare("kc", kc, "N/m", "stiffness between neighbours"),
        **declare("kp", kp, "N/m", "stiffness between a block and the ground"),
        **declare("dc", dc, "N s/m", "damping between neighbours"),
        vb=Parameter(vb, "m/s", description="speed of the belt"),
        **friction.parameters(),
    )
    x, v = states([f"x{i}" for i in range(1, n + 1)]), states([f"v{i}" for i in range(1, n + 1)])
    equations: dict[Symbol, Expr] = {}
    surfaces: list[Surface] = []
    for i in range(n):
        pull = -p.kp * x[i]
        for j in (i - 1, i + 1):
            if 0 <= j < n:
                pull += p.kc * (x[j] - x[i]) + p.dc * (v[j] - v[i])
        slip = v[i] - p.vb
        equations[x[i]] = v[i]
        equations[v[i]] = (pull - friction.force(slip, p)) / p.m
        surfaces += friction.surfaces(slip, p, f"block {i + 1}")
    labels = {"t": "time [s]"}
    for i in range(n):
        labels |= {x[i].name: f"position {i + 1} [m]", v[i].name: f"velocity {i + 1} [m/s]"}
    return System(equations, surfaces=surfaces, parameters=p, labels=labels)


def start(n: int = 5) -> tuple[float, ...]:
    """Return an initial state without symmetry: x_i = sin(i^2)/2, v_i = 0, in the order x1, v1, x2, ..."""
    return tuple(value for i in range(1, n + 1) for value in (0.5 * math.sin(i * i), 0.0))


MODEL = register(
    Model(
        "chain",
        chain,
        start(5),
        (0.0, 30.0),
        "Chain of coupled blocks on a moving belt: every one sticks and slips.",
        "Burridge & Knopoff 1967; Carlson & Langer 1989; numbers after Galvanetto & Knudsen 1997",
    )
)
