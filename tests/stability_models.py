"""Models with known verdicts: what the stability report is measured by, written for it and for nothing else.

Each case names an equilibrium, or a point of a set of equilibria, the truth about it and why it is true. The
truth of a set is that of the set: "asymptotically stable" where motions beside it come to rest at its points,
"stable" where they stay beside it. A case does not say how the report should find out.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from sympy import Expr

from filippov import (
    Abs,
    Max,
    Min,
    Piecewise,
    Surface,
    System,
    TimeEvent,
    cos,
    exp,
    sign,
    sin,
    sqrt,
    states,
    t,
)

x, v, y, w, z, u = states("x v y w z u")
AS, ST, UN = "asymptotically stable", "stable", "unstable"


@dataclass(frozen=True)
class Case:
    """One equilibrium, and what is true of it.

    at        the equilibrium, or a point of the set
    distance  of a state from the equilibrium or set where it is not that from `at`
    radius    of the starts of a simulation around it; length: of the simulation
    start     where the starts lie around, if not `at`: an end of the set
    decays    what an asymptotically stable one comes down to within `length`, of `radius`
    """

    name: str
    system: System
    at: tuple[float, ...]
    truth: str
    reason: str
    distance: Callable[[Sequence[float]], float] | None = None
    radius: float = 1e-2
    length: float = 40.0
    decays: float = 0.1
    start: tuple[float, ...] | None = None


def outside(value: float, low: float, high: float) -> float:
    return max(low - value, 0.0, value - high)


def speed(*k: int) -> Callable[[Sequence[float]], float]:
    """The distance from a set on which these states are 0 and the others are anything."""
    return lambda q: max(abs(q[i]) for i in k)


def held(low: float, high: float) -> Callable[[Sequence[float]], float]:
    """The distance from low <= x <= high, all other states 0."""
    return lambda q: max(outside(q[0], low, high), *(abs(e) for e in q[1:]))


def second_order(force: Expr, **options: object) -> System:
    return System({x: v, v: force}, **options)  # type: ignore[arg-type]


def relay_loop(a: Sequence[float], b: Sequence[float]) -> System:
    """Y = -(b1 s^2 + b2 s + b3)/(s^3 + a1 s^2 + a2 s + a3) sign(y), observable form, y = x."""
    return System(
        {x: -a[0] * x + v - b[0] * sign(x), v: -a[1] * x + z - b[1] * sign(x), z: -a[2] * x - b[2] * sign(x)}
    )


def relays() -> list[Case]:
    return [
        Case("relay", System({x: -sign(x)}), (0,), AS, "reached at unit speed"),
        Case("relay away", System({x: sign(x)}), (0,), UN, "left at unit speed"),
        Case("relay with offset", System({x: 0.5 - sign(x)}), (0,), AS, "both fields point to it"),
        Case("unstable plant, relay", System({x: x - sign(x)}), (0,), AS, "|x| < 1 is drawn in"),
        Case("edge of the relay's reach", System({x: x - sign(x)}), (1,), UN, "slope 1"),
        Case("relay, double integrator", second_order(-sign(x)), (0, 0), ST, "|x| + v^2/2 is kept",
             radius=1.0),
        Case("relay, damped", second_order(-sign(x) - v), (0, 0), AS, "|x| + v^2/2, LaSalle"),
        Case("relay, negative damping", second_order(-sign(x) + 0.1 * v), (0, 0), UN, "|x| + v^2/2 grows"),
        Case("relay on x + v", second_order(-sign(x + v)), (0, 0), AS, "sliding x' = -x"),
        Case("relay on x - v", second_order(-sign(x - v)), (0, 0), UN, "the surface repels"),
        Case("relay and spring", second_order(-x - v - sign(x)), (0, 0), AS, "energy, LaSalle"),
        Case("relay, repelling spring", second_order(x - v - 2 * sign(x)), (0, 0), AS,
             "2|x| - x^2/2 + v^2/2"),
        Case("the same, gains energy", second_order(x + 0.2 * v - 2 * sign(x)), (0, 0), UN, "energy grows"),
        Case("relay on x + 0.5 v, spring", second_order(-x - sign(x + 0.5 * v)), (0, 0), AS,
             "sliding x' = -2 x"),
        Case("relay, triple integrator", System({x: v, v: z, z: -sign(x)}), (0, 0, 0), UN, "Anosov 1959"),
        Case("relay, 1/(s+1)^3", System({x: -x + v, v: -v + z, z: -z - sign(x)}), (0, 0, 0), UN,
             "Anosov 1959"),
        Case("relay, zero at -1", System({x: -2 * x + v - sign(x), v: -sign(x)}), (0, 0), AS,
             "sliding root -1"),
        Case("relay, zero at 1", System({x: -2 * x + v - sign(x), v: sign(x)}), (0, 0), UN, "sliding root 1"),
        Case("degree 2, damped", relay_loop((3, 3, 1), (0, 1, 0.5)), (0, 0, 0), AS,
             "Anosov 1959: 3 > 0.5, zero at -0.5", length=60),
        Case("degree 2, driven", relay_loop((1, 2, 1), (0, 1, 3)), (0, 0, 0), UN, "Anosov 1959: 1 < 3"),
        Case("degree 2, zero on the right", relay_loop((3, 3, 1), (0, 1, -0.5)), (0, 0, 0), UN,
             "the zero dynamics have the root 0.5"),
        Case("sliding s^2 + 2s + 1", System({x: v, v: z, z: -sign(x + 2 * v + z)}), (0, 0, 0), AS,
             "roots -1, -1"),
        Case("sliding s^2 + s - 1", System({x: v, v: z, z: -sign(z + v - x)}), (0, 0, 0), UN, "a root 0.62"),
        Case("twisting", second_order(-sign(x) - 0.5 * sign(v)), (0, 0), AS, "Levant 1993: 1 > 0.5 > 0"),
        Case("twisting backwards", second_order(-sign(x) + 0.5 * sign(v)), (0, 0), UN,
             "half turns by (3/1)^(1/2)"),
        Case("twisting that rests", second_order(-0.5 * sign(x) - sign(v)), (0.3, 0), AS,
             "v' = -sign v at least 1/2: every v = 0 is at rest", speed(1)),
        Case("super-twisting", System({x: -1.5 * sqrt(Abs(x)) * sign(x) + y, y: -1.1 * sign(x)}), (0, 0), AS,
             "Moreno & Osorio 2012"),
        Case("super-twisting, overdamped", System({x: -4 * sqrt(Abs(x)) * sign(x) + y, y: -1.1 * sign(x)}),
             (0, 0),
             AS, "Moreno & Osorio 2012"),
        Case("super-twisting backwards", System({x: 0.5 * sqrt(Abs(x)) * sign(x) + y, y: -1.1 * sign(x)}), (0,
             0),
             UN, "1.1 |x| + y^2/2 grows"),
        Case("super-twisting, wrong sign", System({x: -1.5 * sqrt(Abs(x)) * sign(x) + y, y: 1.1 * sign(x)}),
             (0, 0),
             UN, "y' = 1.1 and x > 0 go on forever"),
        Case("relay with a lag", System({x: -x + v, v: -v - sign(x + v)}), (0, 0), AS, "sliding x' = -2 x"),
        Case("nonlinear damping beside a relay", second_order(-sign(x) - v**3), (0, 0), AS,
             "|x| + v^2/2, LaSalle",
             radius=1.0, decays=0.5),
        Case("a relay that weakens", System({x: -(1 + y**2) * sign(x), y: -y - x}), (0, 0), AS,
             "sliding y' = -y"),
    ]  # fmt: skip


def dry() -> list[Case]:
    dead = Piecewise((x - 1, x > 1), (x + 1, x < -1), (0, True))
    falling = (0.5 + 0.5 * exp(-Abs(v) / 0.1)) * sign(v)
    gentle = (0.5 + 0.5 * exp(-Abs(v))) * sign(v)
    pid = -10 * (x + v + 10 * z) - v
    hunting = Surface("velocity", v, radius=2)
    held_pid = lambda q: max(abs(q[0]), abs(q[1]), outside(q[2], -0.02, 0.02))  # noqa: E731

    def two(first: Expr, second: Expr) -> System:
        return System({x: v, v: first, y: w, w: second})

    apart, moving = x - y, (1, 3)
    return [
        Case("Coulomb oscillator", second_order(-x - 0.5 * sign(v)), (0, 0), AS, "half turns lose 1",
             held(-0.5, 0.5)),
        Case("Coulomb, little gain", second_order(-x + 0.2 * v - 0.5 * sign(v)), (0, 0), AS,
             "half a turn from the end ends inside", held(-0.5, 0.5)),
        Case("Coulomb, large gain", second_order(-x + 3 * v - 0.5 * sign(v)), (0, 0), UN, "real roots > 0",
             held(-0.5, 0.5), start=(0.5, 0)),
        Case("Coulomb without a spring", second_order(-sign(v)), (0.2, 0), AS, "v' = -sign v", speed(1)),
        Case("Coulomb on a slope", second_order(-0.3 - sign(v)), (0.2, 0), AS, "|v| falls at 0.7 at least",
             speed(1)),
        Case("Coulomb, repelling spring", second_order(x - 0.5 * sign(v)), (0, 0), UN,
             "beyond the ends it leaves",
             held(-0.5, 0.5), start=(0.5, 0)),
        Case("PID, Coulomb", System({x: v, v: pid - 2 * sign(v), z: x}), (0, 0, 0), AS,
             "Armstrong-Helouvry & Amin 1996", held_pid, length=400, decays=0.6),
        Case("PID, static friction", System({x: v, v: pid - 2 * sign(v), z: x}, surfaces=[hunting]), (0, 0,
             0), UN,
             "Armstrong-Helouvry & Amin 1996: every one hunts"),
        Case("two masses, two frictions", two(-2 * x + y - sign(v), x - 2 * y - sign(w)), (0, 0, 0, 0), AS,
             "energy, LaSalle", speed(*moving)),
        Case("two masses, unequal", two((-3 * x + y) / 2 - 0.3 * sign(v),
             x - 4 * y - 0.7 * sign(w) - 0.1 * w),
             (0, 0, 0, 0), AS, "energy, LaSalle", speed(*moving)),
        Case("friction on one, damping on the other", two(-2 * x + y - sign(v), apart - 0.3 * w), (0, 0, 0,
             0), AS,
             "energy, LaSalle", speed(*moving), length=60),
        Case("friction on one alone", two(-2 * x + y - sign(v), apart), (0, 0, 0, 0), ST,
             "energy; the other swings forever while the first sticks",
             lambda q: max(abs(q[1]), abs(q[3]), abs(q[0] - q[2]))),
        Case("friction between two masses", two(-x - sign(v - w), -y + sign(v - w)), (0, 0, 0, 0), ST,
             "energy; together they swing forever",
             lambda q: max(abs(q[1]), abs(q[3]), outside(q[0], -1, 1), abs(q[0] + q[2]))),
        Case("friction between, one damped", two(-x - 0.4 * v - sign(v - w), -y + sign(v - w)), (0, 0, 0, 0),
             AS,
             "energy, LaSalle: together they are damped", speed(*moving), length=80),
        Case("two oscillators apart", two(-x - sign(v), -4 * y - sign(w)), (0, 0, 0, 0), AS,
             "each comes to rest",
             speed(*moving)),
        Case("three masses", System({x: v, v: -2 * x + y - sign(v), y: w, w: x - 2 * y + z - sign(w),
                                     z: u, u: y - 2 * z - sign(u)}), (0,) * 6, AS, "energy, LaSalle", speed(1,
             3, 5)),
        Case("two masses, a negative damper", two(-2 * x + y - sign(v), apart + 0.3 * w), (0, 0, 0, 0), UN,
             "the second swings up while the first sticks", lambda q: max(abs(q[1]), abs(q[3]),
             abs(q[0] - q[2]))),
        Case("buckled pair", two(x - 2 * y - sign(v), -2 * x + y - sign(w)), (0, 0, 0, 0), UN,
             "the stiffness has the root -3 along (1, -1): it runs off from (1/3, -1/3)",
             lambda q: max(abs(q[1]), abs(q[3]), outside(q[0] - 2 * q[2], -1, 1), outside(-2 * q[0] + q[2],
             -1, 1)),
             start=(1 / 3, 0, -1 / 3, 0)),
        Case("steep Stribeck curve", second_order(-x - falling), (0, 0), UN, "slip has the roots 4.8, 0.2",
             held(-1, 1), start=(1, 0)),
        Case("gentle Stribeck curve", second_order(-x - gentle), (0, 0), AS, "slip from the end returns",
             held(-1, 1)),
        Case("belt", second_order(-x - 0.5 * sign(v - 1)), (0.5, 0), ST,
             "constant friction: x'' = -(x - 0.5)"),
        Case("belt with damping", second_order(-x - 0.2 * v - 0.5 * sign(v - 1)), (0.5, 0), AS,
             "roots on the left",
             length=80),
        Case("belt, falling friction", second_order(-x - sign(v - 1) / (1 + Abs(v - 1))), (0.5, 0), UN,
             "negative damping 1/4"),
        Case("pendulum hangs", second_order(-9.81 * sin(x) - 0.5 * sign(v)), (0, 0), AS, "energy",
             held(-0.051, 0.051)),
        Case("pendulum stands", second_order(9.81 * sin(x) - 0.5 * sign(v)), (0, 0), UN,
             "falls from the ends",
             held(-0.051, 0.051), start=(0.051, 0)),
        Case("dead zone", second_order(-dead - v), (0.2, 0), AS, "beyond the ends it comes back", held(-1,
             1)),
        Case("dead zone, repelling", second_order(dead - v), (0.2, 0), UN, "beyond the ends it leaves",
             held(-1, 1),
             start=(1, 0)),
        Case("dead zone, no damping", second_order(-dead), (0.2, 0), ST,
             "energy: v is kept, x is turned back",
             held(-1, 1)),
        Case("motor with friction", System({x: v, v: -x + z - sign(v), z: -z - v}), (0, 0, 0), AS,
             "x^2 + v^2 + z^2, LaSalle", lambda q: max(abs(q[1]), abs(q[2]), outside(q[0], -1, 1))),
        Case("motor, unstable coil", System({x: v, v: -x + z - sign(v), z: z - v}), (0, 0, 0), UN,
             "root 1 while it sticks", lambda q: max(abs(q[1]), abs(q[2]), outside(q[0], -1, 1))),
        Case("SIR, few", System({x: -0.5 * x * y, y: 0.5 * x * y - y}), (0.5, 0), AS, "b x < g", speed(1)),
        Case("SIR, many", System({x: -0.5 * x * y, y: 0.5 * x * y - y}), (3, 0), UN, "b x > g", speed(1)),
        Case("consensus", System({x: y - x, y: x - y}), (0, 0), AS, "root -2", lambda q: abs(q[0] - q[1])),
        Case("dissent", System({x: x - y, y: y - x}), (0, 0), UN, "root 2", lambda q: abs(q[0] - q[1])),
        Case("a slider that rests anywhere", second_order(-v), (0.2, 0), AS, "v' = -v", speed(1)),
        Case("quadratic drag and Coulomb", second_order(-x - Abs(v) * v - 0.5 * sign(v)), (0, 0), AS,
             "energy",
             held(-0.5, 0.5)),
        Case("Duffing spring and Coulomb", second_order(-x**3 - 0.5 * sign(v)), (0, 0), AS, "energy",
             held(-0.7937, 0.7937)),
        Case("a wall of friction only", System({x: -sign(x) - x, y: -sign(y)}), (0, 0), AS, "each falls"),
        Case("one axis is held", System({x: -sign(x), y: y}), (0, 0), UN, "y' = y"),
        Case("one sided brake", second_order(-x - v * (1 + sign(v)) / 2 - 0.2 * sign(v)), (0, 0), AS,
             "energy",
             held(-0.2, 0.2)),
    ]  # fmt: skip


def kinks() -> list[Case]:
    plus, minus = Max(x, 0), Max(-x, 0)

    def ring(gain: float) -> System:
        return System({x: -x + gain * Abs(y), y: -y + gain * Abs(z), z: -z + gain * Abs(x)})

    return [
        Case("two slopes", System({x: Piecewise((-2 * x, x > 0), (-x, True))}), (0,), AS, "both lead back"),
        Case("one slope leads away", System({x: Abs(x)}), (0,), UN, "x > 0 grows"),
        Case("|x| beside x", System({x: -x + 0.5 * Abs(x)}), (0,), AS, "slopes -0.5, -1.5"),
        Case("|x| beats x", System({x: -x + 1.5 * Abs(x)}), (0,), UN, "slope 0.5"),
        Case("half line at rest", System({x: Abs(x) - x}), (1,), AS, "x < 0 comes back",
             lambda q: max(-q[0], 0.0)),
        Case("focus, one side unstable", System({x: -0.4 * x + 0.6 * Abs(x) + v, v: -x}), (0, 0), AS,
             "half turns"),
        Case("focus, the other wins", System({x: 0.1 * x + 0.6 * Abs(x) + v, v: -x}), (0, 0), UN,
             "half turns"),
        Case("two springs", second_order(-2 * plus + minus), (0, 0), ST, "energy is kept"),
        Case("two springs, damped", second_order(-2 * plus + minus - 0.3 * v), (0, 0), AS, "energy, LaSalle"),
        Case("two springs, driven", second_order(-2 * plus + minus + 0.1 * v), (0, 0), UN, "energy grows",
             length=80),
        Case("damped one way, driven the other", second_order(-x - 0.3 * Abs(v)), (0, 0), ST, "reversible"),
        Case("more damped than driven", second_order(-x - 0.1 * v - 0.3 * Abs(v)), (0, 0), AS, "half turns",
             length=80),
        Case("more driven than damped", second_order(-x + 0.1 * v - 0.3 * Abs(v)), (0, 0), UN, "half turns",
             length=80),
        Case("ring of three", ring(0.3), (0, 0, 0), AS, "max |x_i| falls: 0.3 < 1"),
        Case("ring of three, strong", ring(2), (0, 0, 0), UN, "along (1, 1, 1) with 1"),
        Case("ring of four", System({x: -x + 0.4 * Abs(y), y: -y + 0.4 * Abs(z), z: -z + 0.4 * Abs(u),
                                     u: -u + 0.4 * Abs(x)}), (0,) * 4, AS, "max |x_i| falls: 0.4 < 1"),
        Case("half spring, third order", System({x: v, v: z, z: -3 * z - 3 * v - plus + minus}), (0, 0, 0),
             AS,
             "(s + 1)^3"),
        Case("unequal springs, third order", System({x: v, v: z, z: -3 * z - 3 * v - 2 * plus + minus}), (0,
             0, 0),
             AS, "circle criterion: slopes 1 to 2, Hurwitz to 9"),
        Case("unequal springs, too stiff", System({x: v, v: z, z: -z - v - 4 * plus + 3 * minus}), (0, 0, 0),
             UN, "simulation; both sides have complex roots on the right"),
        Case("x |x|", System({x: -x * Abs(x)}), (0,), AS, "d|x|/dt = -x^2", radius=1.0),
        Case("x |x| away", System({x: x * Abs(x)}), (0,), UN, "d|x|/dt = x^2", radius=0.5),
        Case("square root", System({x: -sqrt(Abs(x)) * sign(x)}), (0,), AS, "reached in 2 sqrt |x|"),
        Case("square root away", System({x: sqrt(Abs(x)) * sign(x)}), (0,), UN, "leaves as t^2/4"),
        Case("saturated feedback", second_order(-Max(-1, Min(1, x + v))), (0, 0), AS,
             "(s^2 + s + 1) beside 0"),
        Case("saturated, within reach", System({x: x - 2 * Max(-1, Min(1, x))}), (0,), AS, "slope -1"),
        Case("saturated, out of reach", System({x: x - 2 * Max(-1, Min(1, x))}), (2,), UN, "slope 1"),
        Case("rectified pair", System({x: -x + 0.5 * Max(0, y), y: -y + 0.5 * Max(0, x)}), (0, 0), AS,
             "0.5 < 1"),
        Case("rectified pair, strong", System({x: -x + 2 * Max(0, y), y: -y + 2 * Max(0, x)}), (0, 0), UN,
             "along (1, 1) with 1"),
        Case("quadratic kink in damping", second_order(-x - v * Abs(v)), (0, 0), AS, "energy, LaSalle",
             radius=1.0,
             length=80),
        Case("cubic spring with kinks", second_order(-x * Abs(x) - v), (0, 0), AS, "|x|^3/3 + v^2/2, LaSalle",
             radius=1.0, length=80),
    ]  # fmt: skip


def corners() -> list[Case]:
    def pair(a: float, b: float, c: float, d: float) -> System:
        return System({x: a * sign(x) + b * sign(y), y: c * sign(x) + d * sign(y)})

    def quadrants(odd: dict, even: dict) -> System:
        fields = {"++": odd, "--": odd, "+-": even, "-+": even}
        return System.from_modes([Surface("a", x), Surface("b", y)], fields, [x, y])

    flat, tall = {x: -0.1 * x + 10 * y, y: -x - 0.1 * y}, {x: -0.1 * x + y, y: -10 * x - 0.1 * y}
    return [
        Case("two relays apart", pair(-1, 0, 0, -1), (0, 0), AS, "|x| + |y| falls"),
        Case("spiral of relays", pair(-1, 2, -2, -1), (0, 0), AS, "|x| + |y| falls at 2"),
        Case("spiral outwards", pair(0.2, 2, -2, 0.2), (0, 0), UN, "|x| + |y| grows at 0.4"),
        Case("relays that turn", pair(0, 2, -2, 0), (0, 0), ST, "|x| + |y| is kept"),
        Case("relays against each other", pair(-1, -2, -2, -1), (0, 0), UN, "x = -y leaves at 1"),
        Case("weakly coupled relays", pair(-1, 0.5, 0.5, -1), (0, 0), AS, "|x| + |y| falls"),
        Case("skew spiral", pair(-1, 3, -0.5, -0.2), (0, 0), AS, "half turn 3/14"),
        Case("skew spiral outwards", pair(1, 3, -3, 1), (0, 0), UN, "half turn 4"),
        Case("a spiral driven on one axis", pair(0.5, 3, -2, -1), (0, 0), AS,
             "half turn (3.5/3)(1/2.5) = 7/15: ++ (3.5, -3), +- (-2.5, -1)"),
        Case("three relays in a ring", System({x: -2 * sign(x) + sign(y) - sign(z),
             y: -2 * sign(y) + sign(z) - sign(x),
                                               z: -2 * sign(z) + sign(x) - sign(y)}), (0, 0, 0), AS,
             "|x| + |y| + |z| falls at 6"),
        Case("three relays, turning", System({x: -0.2 * sign(x) + sign(y) - sign(z),
                                              y: -0.2 * sign(y) + sign(z) - sign(x),
                                              z: -0.2 * sign(z) + sign(x) - sign(y)}), (0, 0, 0), AS,
             "|x| + |y| + |z| falls at 0.2 at least"),
        Case("three relays outwards", System({x: 0.2 * sign(x) + sign(y) - sign(z),
             y: 0.2 * sign(y) + sign(z) - sign(x),
                                              z: 0.2 * sign(z) + sign(x) - sign(y)}), (0, 0, 0), UN,
             "|x| + |y| + |z| grows off the surfaces"),
        Case("switched foci inwards", quadrants(tall, flat), (0, 0), AS, "quarter turns by 10^(-1/2)"),
        Case("switched foci outwards", quadrants(flat, tall), (0, 0), UN, "quarter turns by 10^(1/2)"),
        Case("sliding on a line to rest", System({x: -x - sign(x) * Abs(y), y: -y}), (0, 0), AS, "both fall"),
        Case("sliding on a line away", System({x: -sign(x) * Abs(y), y: 0.5 * y}), (0, 0), UN, "y' = y/2"),
        Case("switched damping", second_order(-x - 0.5 * v * sign(x * v)), (0, 0), ST,
             "quarter turns by exp(-q) and exp(q)", radius=1e-2),
        Case("variable structure", second_order(-(2.5 + 1.5 * sign(x * v)) * x), (0, 0), AS,
             "quarter turns by 1/2: x'' = -4 x while it leaves, -x while it returns"),
        Case("relay pair and linear terms", System({x: -sign(x) + 2 * sign(y) + y,
             y: -2 * sign(x) - sign(y) - x}),
             (0, 0), AS, "|x| + |y| falls beside 0"),
        Case("three axes held", System({x: -sign(x), y: -sign(y) + 0.3 * sign(x),
             z: -sign(z) + 0.3 * sign(y)}),
             (0, 0, 0), AS, "every field points to all"),
    ]  # fmt: skip


def smooth() -> list[Case]:
    r = x**2 + v**2
    slow = {"radius": 1.0, "length": 200.0, "decays": 0.3}
    return [
        Case("-x^3", System({x: -(x**3)}), (0,), AS, "x^2 falls", **slow),
        Case("x^3", System({x: x**3}), (0,), UN, "x^2 grows", radius=0.5),
        Case("x^2", System({x: x**2}), (0,), UN, "x > 0 grows", radius=0.3),
        Case("-x^5", System({x: -(x**5)}), (0,), AS, "x^2 falls", radius=1.0, length=400, decays=0.5),
        Case("cubic spring, damped", second_order(-(x**3) - v), (0, 0), AS, "energy, LaSalle", **slow),
        Case("cubic spring", second_order(-(x**3)), (0, 0), ST, "energy is kept", radius=1.0),
        Case("cubic damping", second_order(-x - v**3), (0, 0), AS, "energy, LaSalle", **slow),
        Case("cubic driving", second_order(-x + v**3), (0, 0), UN, "energy grows", radius=0.5),
        Case("centre manifold inwards", System({x: x * y, y: -y - x**2}), (0, 0), AS, "Carr 1981: x' = -x^3",
             **slow),
        Case("centre manifold outwards", System({x: x * y, y: -y + x**2}), (0, 0), UN, "Carr 1981: x' = x^3",
             radius=0.3),
        Case("slow beside fast", System({x: -(x**3) + x * y, y: -2 * y + x**2 / 4}), (0, 0), AS,
             "Carr 1981: x' = -7 x^3/8", **slow),
        Case("weak focus inwards", System({x: v - x * r, v: -x - v * r}), (0, 0), AS, "r' = -r^3", **slow),
        Case("weak focus outwards", System({x: v + x * r, v: -x + v * r}), (0, 0), UN, "r' = r^3",
             radius=0.5),
        Case("van der Pol at its border", second_order(-x - x**2 * v), (0, 0), AS, "Hopf: l1 < 0", **slow),
        Case("van der Pol", second_order(-x + (1 - x**2) * v), (0, 0), UN, "roots on the right"),
        Case("Hopf in three", System({x: v, v: -x + x * z, z: -z - v**2 + x * v}), (0, 0, 0), AS,
             "l1 by simulation and averaging", **slow),
        Case("zero root, two others", System({x: -(x**3), y: -y + z + x**2, z: -z}), (0, 0, 0), AS, "cascade",
             **slow),
        Case("oscillator", second_order(-x), (0, 0), ST, "energy is kept"),
        Case("pendulum without friction", second_order(-sin(x)), (0, 0), ST, "energy is kept"),
        Case("rigid body, long axis", System({x: y * z / 2, y: -x * z, z: x * y / 2}), (1, 0, 0), ST,
             "x^2 + y^2/2... two integrals are kept", lambda q: max(abs(q[1]), abs(q[2]))),
    ]  # fmt: skip


def impacts() -> list[Case]:
    def ball(e: float) -> System:
        return System({y: v, v: -1}, surfaces=[Surface("floor", y, reset={v: -e * v})])

    def wall(e: float, gain: float = 0.0, load: float = 0.0) -> System:
        return second_order(-x + gain * v - load, surfaces=[Surface("wall", x, reset={v: -e * v})])

    def kick(q: float) -> System:
        return second_order(-x - 0.2 * v, surfaces=[Surface("kick", x, reset={v: q * v}, side="both")])

    def slider(c: float, e: float) -> System:
        return System({x: w, w: -x - c * w, y: v, v: -1}, surfaces=[Surface("floor", y, reset={v: -e * v})])

    lower = Surface("lower", y, reset={v: -0.5 * v})
    upper = Surface("upper", x - y, reset={w: (w + v - 0.5 * (w - v)) / 2, v: (w + v + 0.5 * (w - v)) / 2})
    return [
        Case("ball", ball(0.5), (0, 0), AS, "bounces end in finite time", length=10),
        Case("plastic ball", ball(0), (0, 0), AS, "rests at the first impact", length=10),
        Case("elastic ball", ball(1), (0, 0), ST, "energy is kept", radius=1.0),
        Case("ball that gains", ball(1.1), (0, 0), UN, "energy grows by 1.21"),
        Case("wall at rest length", wall(0.5), (0, 0), AS, "half turns by 1/2"),
        Case("elastic wall at rest length", wall(1), (0, 0), ST, "energy is kept"),
        Case("wall, driven, weak impact", wall(0.8, 0.1), (0, 0), AS,
             "half turns by 0.8 exp(0.05 pi) = 0.936",
             length=150),
        Case("wall, driven, strong impact", wall(0.9, 0.1), (0, 0), UN, "half turns by 1.053", length=300),
        Case("loaded wall", wall(0.5, 0, 1), (0, 0), AS, "pressed on", length=15),
        Case("kicks that damping outlives", kick(1.2), (0, 0), AS, "half turns by 0.875", length=150),
        Case("kicks that win", kick(1.5), (0, 0), UN, "half turns by 1.094", length=150),
        Case("reset oscillator", second_order(-x, surfaces=[Surface("zero", x, reset={v: 0}, side="both")]),
             (0, 0),
             AS, "Clegg 1958: at rest after half a turn"),
        Case("body on a floor, damped", slider(0.4, 0.5), (0, 0, 0, 0), AS, "slides to rest"),
        Case("body on a floor, driven", slider(-0.4, 0.5), (0, 0, 0, 0), UN, "slides away"),
        Case("body on a floor, swings", slider(0, 0.5), (0, 0, 0, 0), ST, "energy along the floor is kept",
             radius=1.0),
        Case("two bodies stacked", System({y: v, v: -1, x: w, w: -1}, surfaces=[lower, upper]), (0, 0, 0, 0),
             AS,
             "energy falls at each impact, gravity presses both on", length=15),
    ]  # fmt: skip


def timed() -> list[Case]:
    def turning(a: float) -> System:
        return System({x: (-1 + a * cos(t)**2) * x + (1 - a * sin(t) * cos(t)) * v,
                       v: (-1 - a * sin(t) * cos(t)) * x + (-1 + a * sin(t)**2) * v})  # fmt: skip

    return [
        Case("rate -(1 + sin/2)", System({x: -(1 + 0.5 * sin(t)) * x}), (0,), AS, "mean -1"),
        Case("rate 0.1 + sin", System({x: (0.1 + sin(t)) * x}), (0,), UN, "mean 0.1", length=80),
        Case("rate sin", System({x: sin(t) * x}), (0,), ST, "mean 0: exp(1 - cos t) is bounded"),
        Case("Markus & Yamabe, 1.5", turning(1.5), (0, 0), UN, "multiplier exp(pi)"),
        Case("Markus & Yamabe, 0.9", turning(0.9), (0, 0), AS, "multiplier exp(-0.2 pi)", length=80),
        Case("relay of changing strength", System({x: -(2 + sin(t)) * sign(x)}), (0,), AS, "|x| falls at 1"),
        Case("relay against a wave", System({x: -sign(x) + 0.5 * sin(t)}), (0,), AS, "|x| falls at 1/2"),
        Case("Mathieu, resonant", second_order(-(1 + 0.4 * cos(2 * t)) * x), (0, 0), UN, "rate about 0.1",
             length=80),
        Case("Mathieu, damped", second_order(-(1 + 0.4 * cos(2 * t)) * x - 0.3 * v), (0, 0), AS, "0.1 < 0.15",
             length=150),
        Case("two frequencies", System({x: -(1 + 0.3 * sin(t) + 0.3 * sin(sqrt(2) * t)) * x}), (0,), AS,
             "rate below -0.4"),
        Case("rate that settles", System({x: -x * (1 + 1 / (1 + t**2))}), (0,), AS, "rate below -1"),
        Case("kink in time", System({x: -x + 0.5 * sin(t) * Abs(x)}), (0,), AS, "rate below -1/2"),
        Case("friction holds a small wave", second_order(-x - 2 * sign(v) + 0.5 * sin(t)), (0, 0), AS,
             "|x| <= 1.5 sticks at all times", held(-1.5, 1.5)),
    ]  # fmt: skip


def clocked() -> list[Case]:
    def multiplied(rate: float, q: float, period: float = 1.0) -> System:
        return System({x: rate * x}, time_events=[TimeEvent("clock", period=period, reset={x: q * x})])

    def hold(period: float) -> System:
        return System({x: -u, u: 0}, time_events=[TimeEvent("sample", period=period, reset={u: x})])

    brake = TimeEvent("brake", period=1, reset={v: 0.8 * v})
    return [
        Case("doubled, decays", multiplied(-1, 2), (0,), AS, "2/e"),
        Case("doubled, too slow", multiplied(-0.5, 2), (0,), UN, "2/exp(1/2)"),
        Case("halved, grows", multiplied(1, 0.5, 0.5), (0,), AS, "exp(1/2)/2"),
        Case("braked oscillator", second_order(-x, time_events=[brake]), (0, 0), AS, "energy falls"),
        Case("doubled beside a relay", System({x: -sign(x)}, time_events=[TimeEvent("double", period=1,
             reset={x: 2 * x})]),
             (0,), AS, "reached before the clock"),
        Case("braked friction", second_order(-x - 0.5 * sign(v), time_events=[brake]), (0, 0), AS,
             "energy falls",
             held(-0.5, 0.5)),
        Case("sample and hold", hold(0.5), (0, 0), AS, "1 - T = 1/2"),
        Case("sample and hold, too slow", hold(2.5), (0, 0), UN, "1 - T = -3/2"),
        Case("clock on a kink", System({x: -x + 0.5 * Abs(x)}, time_events=[TimeEvent("c", period=1,
             reset={x: -1.2 * x})]),
             (0,), AS, "two turns 1.44 exp(-2)"),
    ]  # fmt: skip


KINDS: dict[str, Callable[[], list[Case]]] = {
    "relays": relays, "dry friction and sets": dry, "kinks": kinks, "corners": corners, "smooth": smooth,
    "impacts and resets": impacts, "forced": timed, "clocked": clocked,
}  # fmt: skip


def cases() -> list[Case]:
    return [case for make in KINDS.values() for case in make()]
