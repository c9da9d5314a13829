"""Two coupled blocks on a moving belt: stick-slip with two surfaces.

    x1' = v1, m1 v1' in -k1 x1 - kc (x1 - x2) - F(v1 - vb)
    x2' = v2, m2 v2' in -k2 x2 - kc (x2 - x1) - ratio F(v2 - vb)

While both blocks stick, d = x1 - x2 keeps its value, and d alone says when that ends and with which state: so
d is the coordinate of an event map from one stick of both to the next.

Source: Galvanetto & Knudsen 1997, Nonlinear Dynamics 13, 99-115.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from filippov import ModelError, Parameter, Stop, System, parameters, states
from filippov.base.arrays import Array
from filippov.base.given import NonNegative, Positive
from filippov.base.keywords import keywords
from filippov.models.friction import SMALLEST, FrictionLaw, declare
from filippov.models.laws import Hyperbolic
from filippov.models.registry import Model, SectionData, register
from filippov.solving.uncut import solve_many

LAW = Hyperbolic(Fs=1, gamma=3)
ENTRIES = (Stop("block 1", "sliding entry"), Stop("block 2", "sliding entry"))
# Entries of one block that may come before both stick; a turn has two to six.
MOST_ENTRIES = 60
# x1 in the middle of the stick of both that has x1 - x2 = d (see `both_stick`), as a formula.
MIDDLE = (
    "(Max((-Fs - kc*d)/k1, d + (-ratio*Fs + kc*d)/k2) + Min((Fs - kc*d)/k1, d + (ratio*Fs + kc*d)/k2))/2"
)


@keywords("keyword", error=ModelError)
def two_blocks(
    friction: FrictionLaw = LAW,
    m1: float = 1.0,
    m2: float = 1.0,
    k1: float = 1.0,
    k2: float = 1.0,
    kc: float = 1.2,
    ratio: float = 1.3,
    vb: float = 0.2,
) -> System:
    """Return the two blocks; the surfaces "block 1" and "block 2" are v1 = vb and v2 = vb.

    friction   the law under block 1, 1/(1 + 3 |v|) by default; under block 2 it is `ratio` times that
    """
    p = parameters(
        **declare("m1", m1, "kg", "mass of block 1", SMALLEST),
        **declare("m2", m2, "kg", "mass of block 2", SMALLEST),
        **declare("k1", k1, "N/m", "spring of block 1"),
        **declare("k2", k2, "N/m", "spring of block 2"),
        **declare("kc", kc, "N/m", "coupling spring"),
        **declare("ratio", ratio, "", "friction under block 2 relative to block 1"),
        vb=Parameter(vb, "m/s", description="speed of the belt"),
        **friction.parameters(),
    )
    x1, v1, x2, v2 = states("x1 v1 x2 v2")
    slip1, slip2 = v1 - p.vb, v2 - p.vb
    return System(
        {
            x1: v1,
            v1: (-p.k1 * x1 - p.kc * (x1 - x2) - friction.force(slip1, p)) / p.m1,
            x2: v2,
            v2: (-p.k2 * x2 - p.kc * (x2 - x1) - p.ratio * friction.force(slip2, p)) / p.m2,
        },
        surfaces=[*friction.surfaces(slip1, p, "block 1"), *friction.surfaces(slip2, p, "block 2")],
        parameters=p,
        labels={
            "t": "time [s]", "x1": "position 1 [m]", "v1": "velocity 1 [m/s]",
            "x2": "position 2 [m]", "v2": "velocity 2 [m/s]",
        },
    )


@keywords("keyword", error=ModelError)
def both_stick(system: System, d: Any, parameters: Mapping[str, Any] | None = None) -> Array:
    """Return states (k, 4) in the middle of the stick of both blocks that has x1 - x2 = d.

    d, parameters   numbers or k of them; NaN where the forces are never both within their levels. The belt
                    carries both blocks until one of the forces reaches its level, Fs or ratio Fs
    """
    p = _values(system, parameters)
    d = np.atleast_1d(np.asarray(d, dtype=float))
    level = np.array([-1.0, 1.0])[:, None] * p["Fs"]
    first = (level - p["kc"] * d) / p["k1"]
    second = d + (p["ratio"] * level + p["kc"] * d) / p["k2"]
    low, high = np.maximum(first[0], second[0]), np.minimum(first[1], second[1])
    x1 = np.where(low <= high, 0.5 * (low + high), np.nan)
    v = np.broadcast_to(p["vb"], x1.shape)
    return np.column_stack([x1, v, x1 - d, v])


@keywords("keyword", error=ModelError)
def stick_map(
    system: System, d: Any, parameters: Mapping[str, Any] | None = None, *, t_max: Positive = 200.0,
    rtol: Positive = 1e-10, atol: NonNegative = 1e-12,
) -> Array:  # fmt: skip
    """Return R(d): x1 - x2 in the next stick of both blocks after the one with d; shape (k,).

    d, parameters   numbers or k of them, side by side; NaN where both do not stick again
    """
    d = np.atleast_1d(np.asarray(d, dtype=float))
    columns = {name: np.broadcast_to(v, d.shape) for name, v in (parameters or {}).items()}
    states = both_stick(system, d, columns)
    out = np.full(d.size, np.nan)
    open_rows = np.flatnonzero(np.isfinite(states[:, 0]))
    t = np.zeros(d.size)
    for _ in range(MOST_ENTRIES):
        if not open_rows.size:
            break
        ends = solve_many(
            system, states[open_rows], (0.0, t_max), stop=ENTRIES, rtol=rtol, atol=atol,
            parameters={name: v[open_rows] for name, v in columns.items()},
        )  # fmt: skip
        stopped = np.array([status == "stopped" for status in ends.status])
        t[open_rows] += ends.t
        both = stopped & np.all(ends.mode[:, :2] == 0, axis=1)
        out[open_rows[both]] = ends.x[both, 0] - ends.x[both, 2]
        states[open_rows] = ends.x
        open_rows = open_rows[stopped & ~both & (t[open_rows] < t_max)]
    return out


def _values(system: System, parameters: Mapping[str, Any] | None) -> dict[str, Any]:
    given = dict(parameters or {})
    single = {name: float(np.ravel(v)[0]) for name, v in given.items()}
    names = system.parameters.names
    return dict(zip(names, system.parameters.resolve(single).tolist(), strict=True)) | given


MODEL = register(
    Model(
        "two_blocks",
        two_blocks,
        (0.0, 0.0, 0.5, 0.0),
        (0.0, 40.0),
        "Two coupled blocks on a moving belt: stick-slip of one or both.",
        "Galvanetto & Knudsen 1997; numbers chosen here",
        section=SectionData(
            "block 1, block 2",
            "sliding entry",
            "x1 - x2",
            {"x1": MIDDLE, "v1": "vb", "x2": f"{MIDDLE} - d", "v2": "vb"},
            (-0.676, 0.676),
            200.0,
            "00",
        ),
    )
)
