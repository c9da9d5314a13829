"""The woodpecker toy: a sleeve with play on a rod and a bird on a spring climb down, jamming and knocking."""

from __future__ import annotations

from collections.abc import Sequence

from filippov import Parameter, Surface, System, parameters
from filippov.model.symbols import Expr, Max, Min, sign, states
from filippov.models.registry import Model, register

Vector = Sequence[Expr]


def woodpecker(
    mM: float = 3e-4, JM: float = 5e-9, mS: float = 4.5e-3, JS: float = 7e-7, c: float = 5.6e-3,
    g: float = 9.81, mu: float = 0.3, e: float = 0.5,
) -> System:  # fmt: skip
    """M q'' = k(q) + contact forces, q = (y, a, b): height, angle of the sleeve M and of the bird S.

    mM, JM, mS, JS   masses [kg] and inertias [kg m^2] of sleeve and bird; c spring [N m/rad]; g [m/s^2]
    mu, e            friction at every contact; restitution of the beak (the sleeve does not bounce)

    M = diag(mM, JM, JS) + mS r r', r = (1, lM, lG), k = -g (mM + mS, mS lM, mS lG) + c (b - a) (0, 1, -1).
    The sleeve jams at a = -/+ (rM - r0)/hM, there jam = -1/+1, until its normal force is 0. While it is
    jammed a'' = 0 gives the moment on it, F = F0 - B T, with T = (mu/hM) F0 (jam s - k jam^2)/(1 - k^2), its
    friction, k = mu B/hM, s in Sgn(y'): at s = +-1 that is |T| = mu |F|/hM, between them the hull. The beak
    knocks at b = (lM + lG - lS - r0)/hS. An impact has the normal impulse of Newton's law and the friction
    impulse that stops the slip, or as much as mu allows; impacts are taken one contact at a time.
    """
    p = parameters(
        c=Parameter(c, "N m/rad", 0, description="stiffness of the spring"),
        g=Parameter(g, "m/s^2", 0, description="gravity"),
        mu=Parameter(mu, "", 0, 0.5, description="friction coefficient"),
        e=Parameter(e, "", 0, 1, description="restitution of the beak"),
    )
    r0, rM, hM, lM, lG, hS, lS = 2.5e-3, 3.1e-3, 5.8e-3, 0.010, 0.015, 0.02, 0.0201  # [m]
    y, a, b, vy, va, vb, jam = states("y a b vy va vb jam")
    v, arm, own = (vy, va, vb), (1.0, lM, lG), (mM, JM, JS)
    play, reach = (rM - r0) / hM, (lM + lG - lS - r0) / hS

    def dot(u: Vector, w: Vector) -> Expr:
        return sum((ui * wi for ui, wi in zip(u, w, strict=True)), 0 * y)

    def inverse(w: Vector) -> list[Expr]:
        """M^-1 w (Sherman and Morrison)."""
        light = [wi / d for wi, d in zip(w, own, strict=True)]
        share = mS * dot(arm, light) / (1 + mS * dot(arm, [ri / d for ri, d in zip(arm, own, strict=True)]))
        return [li - share * ri / d for li, ri, d in zip(light, arm, own, strict=True)]

    def impact(normal: Vector, tangent: Vector, restitution: Expr) -> dict[Expr, Expr]:
        """v+ = v + M^-1 (normal N + tangent T), N = (N0 - C T) >= 0, |T| <= mu N."""
        n, q = inverse(normal), inverse(tangent)
        N0, C = -(1 + restitution) * dot(normal, v) / dot(normal, n), dot(normal, q) / dot(normal, n)
        stop = -(dot(tangent, v) + dot(tangent, n) * N0) / (dot(tangent, q) - dot(tangent, n) * C)
        T = Min(Max(stop, -p.mu * N0 / (1 - p.mu * C)), p.mu * N0 / (1 + p.mu * C))
        return {vi: vi + ni * (N0 - C * T) + qi * T for vi, ni, qi in zip(v, n, q, strict=True)}

    spring = p.c * (b - a)
    pull = [-p.g * (mM + mS), spring - p.g * mS * lM, -spring - p.g * mS * lG]
    free, turn, rub = inverse(pull), inverse((0, 1, 0)), inverse((1, rM, 0))
    F0, B = -free[1] / turn[1], rub[1] / turn[1]
    k = p.mu * B / hM
    T = p.mu / hM * F0 * (jam * sign(vy) - k * jam**2) / (1 - k**2)
    F = jam**2 * F0 - B * T
    bend = [fi + ti * F + qi * T for fi, ti, qi in zip(free, turn, rub, strict=True)]
    lower, upper = impact((0, hM, 0), (1, rM, 0), 0 * y), impact((0, -hM, 0), (1, rM, 0), 0 * y)
    return System(
        {y: vy, a: va, b: vb, vy: bend[0], va: (1 - jam**2) * free[1], vb: bend[2], jam: 0 * jam},
        surfaces=[
            Surface("slip", vy),
            Surface("lower", a + play + jam**2, reset={**lower, va: 0, a: -play, jam: -1}, contact=False),
            Surface("upper", play - a + jam**2, reset={**upper, va: 0, a: play, jam: 1}, contact=False),
            Surface("release", 1 - jam**2 - jam * F0 / hM, reset={jam: 0}),
            Surface("beak", reach - b, reset=impact((0, 0, -hS), (1, lM, lG - lS), p.e), contact=False),
        ],
        parameters=p,
        labels={"t": "time [s]", "y": "height [m]", "a": "sleeve [rad]", "b": "bird [rad]",
                "vy": "speed [m/s]", "va": "speed of the sleeve [rad/s]", "vb": "speed of the bird [rad/s]",
                "jam": "jammed edge"},
    )  # fmt: skip


MODEL = register(
    Model(
        "woodpecker",
        woodpecker,
        (0.0, -0.0006 / 0.0058, -0.2788, -0.3411, 0.0, -7.4583, -1.0),
        (0.0, 0.5),
        "The woodpecker toy climbs down a rod: its sleeve slips, jams, turns free, and the beak knocks.",
        "Leine, Van Campen, Glocker 2003, J. Vib. Control 9, 25; Glocker 1995 for the numbers",
    )
)
