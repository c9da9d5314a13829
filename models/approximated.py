"""Plants of the table of approximations: solutions with friction, a relay, impacts, and widths to try."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from sympy import cos

from filippov import Parameter, System, parameters, states, t
from filippov.models.belt import belt
from filippov.models.chain import chain
from filippov.models.friction import FrictionLaw
from filippov.models.laws import Stribeck
from filippov.models.registry import get

LAW = Stribeck(Fs=1, Fc=0.5, vs=0.1, beta=1, b=0.05)


@dataclass(frozen=True)
class Plant:
    """One solution of the table: a system, where it starts, its span, and the widths that are tried.

    widths   of bands, in the units of h; deflections: of bristles, in those of its integral; steps: of time
    """

    title: str
    build: Callable[[], System]
    x0: Sequence[float]
    t_span: tuple[float, float]
    widths: Sequence[float] = (1e-3, 1e-4, 1e-5)
    deflections: Sequence[float] = (1e-3, 1e-4, 1e-5)
    steps: Sequence[float] = (1e-2, 1e-3, 1e-4)


def drive(law: FrictionLaw = LAW) -> System:
    """Two masses on a spring with friction on both, the first pushed back and forth."""
    p = parameters(
        **law.parameters(), k=Parameter(4, "N/m"), d=Parameter(0.1, "N s/m"), F=Parameter(2.2, "N")
    )
    x1, v1, x2, v2 = states("x1 v1 x2 v2")
    pull = p.k * (x1 - x2) + p.d * (v1 - v2)
    return System(
        {x1: v1, v1: p.F * cos(t) - pull - law.force(v1, p), x2: v2, v2: pull - law.force(v2, p)},
        surfaces=[*law.surfaces(v1, p, "motor"), *law.surfaces(v2, p, "load")], parameters=p,
    )  # fmt: skip


PLANTS: dict[str, Plant] = {
    "hunting": Plant("The hunting loop", lambda: get("hunting").build(), (0.1, 0, 0), (0, 10)),
    "belt": Plant("A block on a belt", lambda: belt(LAW), (0, 0), (0, 20)),
    "relay": Plant("A relay loop that slides", lambda: get("relay").build(), (0, 0.5, 0), (0, 15)),
    "drive": Plant("Two masses, friction on both", drive, (0, 0, 0, 0), (0, 20)),
    "chain": Plant(
        "A chain of ten blocks", lambda: chain(10, LAW),
        [q for i in range(10) for q in (0.1 * (3 * i % 7 - 3), 0.0)], (0, 10),
    ),
    "ball": Plant(
        "A bouncing ball", lambda: get("bouncing_ball").build(), (1, 0), (0, 4), steps=(1e-3, 1e-4, 1e-5),
    ),
}  # fmt: skip
