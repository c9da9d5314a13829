"""Newton's cradle: three equal pendulums side by side that touch at rest."""

from __future__ import annotations

from filippov import Parameter, Surface, System, parameters
from filippov.model.symbols import Expr, states
from filippov.models.registry import Model, register


def cradle(omega: float = 1.0, e: float = 1.0) -> System:
    """a'' = -omega^2 a, likewise b and c, on a <= b <= c, with impacts of restitution e between neighbours.

    omega   frequency of each pendulum [rad/s]; e   restitution, 1 for elastic
    """
    p = parameters(
        omega=Parameter(omega, "rad/s", 0, description="frequency of a pendulum"),
        e=Parameter(e, "", 0, 1, description="restitution"),
    )
    a, b, c, va, vb, vc = states("a b c va vb vc")

    def impact(low: Expr, high: Expr) -> dict[Expr, Expr]:
        mean, half = (low + high) / 2, p.e * (high - low) / 2
        return {low: mean + half, high: mean - half}

    pull = {v: -(p.omega**2) * x for x, v in ((a, va), (b, vb), (c, vc))}
    return System(
        {a: va, b: vb, c: vc, **pull},
        surfaces=[Surface("ab", b - a, reset=impact(va, vb)), Surface("bc", c - b, reset=impact(vb, vc))],
        parameters=p,
        labels={
            "t": "time [s]", "a": "angle a [rad]", "b": "angle b [rad]", "c": "angle c [rad]",
            "va": "speed a [rad/s]", "vb": "speed b [rad/s]", "vc": "speed c [rad/s]",
        },
    )


MODEL = register(
    Model(
        "newton_cradle",
        cradle,
        (-1.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        (0.0, 12.0),
        "Newton's cradle of three balls: what comes in on the left goes out on the right.",
        "Brogliato 2016, Nonsmooth Mechanics; numbers chosen here",
    )
)
