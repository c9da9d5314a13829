"""Friction models of the literature as equations in place of Sgn(h), h a sliding velocity.

The system is dx/dt = f0 + f1(|h|) s, s in Sgn(h): f1(|h|)/f1(0) is g below, the curve of the law over its
static level. With w the width, tau a time and r = z/(w g) the deflection z over its level,

    dahl            z' = h - |h| z/w     f0 + f1(|h|) z/w              w: deflection at the static level
    lugre           z' = h - |h| r       f0 + f1(0) (z + tau z')/w     w: the same
    elasto-plastic  z' = h - |h| r alpha as lugre; alpha = A(|r|) where h and z have one sign, else 0
    maxwell-slip    three, below         f0 + f1(0) (z1 + z2 + z3)     w: the same
    memory          z' = (h - z)/w       f0 + f1(|z|) s                w: a time
    bengisu-akay    no state             f0 + f1(max(|h| - w, 0)) q(h/w)   w: a velocity

A rises from 0 at |r| = 0.7, below which the deflection is elastic and nothing creeps, to 1 at |r| = 1. It is
an error function that has both values to rounding, in place of the published half period of a sine: no
kinks there, which would be surfaces. Element i of N = 3 carries 1/N of the level; z its force over the static
level, c its memory, 0 stuck, +-1 slipping:

    z' = (1 - c^2) h/(i w) + (c/N - c^2 z/g)/tau,   |z| = 1/N: c = sgn z,   h = 0: z = c/N if c != 0, c = 0

q(u) = u (2 - |u|) within |u| <= 1, then sgn u. Sliding steadily each gives f0 + f1(|h|) sgn(h) (bengisu-akay:
with the curve moved by w); at h = 0 the stiffness of dahl, lugre and elasto-plastic is f1(0)/w, that of
maxwell-slip 11/6 of it.

seven-parameter is the model of Armstrong-Helouvry. The law has four of its parameters: Coulomb, static and
viscous level, Stribeck velocity; the others are the stiffness f1(0)/w in stick, the lag, and the dwell time
at which half of the static level is back. c is 0 in stick, sgn h in slip; z is the force of the spring over
the static level; l the lagged velocity, an element of the first order, since an ordinary differential
equation has no delays; T the time since the stop. With G the share of g that does not fall with the velocity,
and k = (g - G)/(1 - G), S the static level over G,

    z' = (1 - c^2) h/w    l' = c^2 (h - l)/lag    T' = 1 - c^2    S = 1 - G - m dwell/(T + dwell)
    f0 + f1(0) (c (G + S k(|l|)) + (1 - c^2) (z + tau h/w))
    |z| = G + S: c = sgn z      h = 0 in slip: c = l = T = 0, z = +-(G + S k), m = 1 - G - S k

m, what S lacks at the stop, is such that S begins at the force of the stop: Fs,a of the source, 0 at first
(a long time at rest). The damping tau of the spring is that of lugre; the published one has none.

Sources: Dahl 1968; Canudas de Wit, Olsson, Astrom, Lischinsky 1995; Dupont, Hayward, Armstrong, Altpeter
2002; Lampaert, Al-Bender, Swevers 2003; Armstrong-Helouvry, Dupont, Canudas de Wit 1994; Bengisu & Akay 1994.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import sympy
from sympy import Abs, Dummy, Expr, Piecewise, Rational, Symbol, erf, sign, tanh

from filippov.base.errors import ModelError
from filippov.model.surface import Surface

# Where a deflection ceases to be elastic, over its level (z_ba/z_max), and the arguments at which erf is +-1.
ELASTIC, ERF_ENDS = Rational(7, 10), 6
ELEMENTS = 3
# More than the square of a slipping element's force over its level, which lags behind a falling curve.
SLIPS = 1000
SMALL = sympy.Float(1e-9)


@dataclass(frozen=True)
class Part:
    """What a model is made of: the surface's name, the sliding velocity, the law's f0, f1, g, its numbers.

    f0, f1      one expression per state; f1 and g as functions of |h|
    rest        f1 at h = 0
    lag, dwell  of seven-parameter
    """

    name: str
    h: Expr
    f0: tuple[Expr, ...]
    f1: Callable[[Expr], tuple[Expr, ...]]
    rest: tuple[Expr, ...]
    g: Callable[[Expr], Expr]
    width: Expr
    tau: Expr | None
    lag: Expr | None = None
    dwell: Expr | None = None

    def with_force(self, s: Expr, speed: Expr) -> tuple[Expr, ...]:
        """f0 + f1(speed) s."""
        return tuple(a + b * s for a, b in zip(self.f0, self.f1(speed), strict=True))

    def with_static(self, s: Expr) -> tuple[Expr, ...]:
        """f0 + f1(0) s."""
        return tuple(a + b * s for a, b in zip(self.f0, self.rest, strict=True))

    def held(self, z: Expr, rate: Expr) -> tuple[Expr, ...]:
        """The field with a deflection and its damping."""
        return self.with_static((z + self.tau * rate) / self.width)


class Made(NamedTuple):
    """The field, the rates of the states of the model, and the surfaces on which these are reset."""

    field: tuple[Expr, ...]
    rates: tuple[Expr, ...] = ()
    surfaces: tuple[Surface, ...] = ()


def dahl(part: Part, z: tuple[Symbol, ...]) -> Made:
    """Dahl 1968, with the level of the law."""
    rate = part.h - Abs(part.h) * z[0] / part.width
    return Made(part.with_force(z[0] / part.width, Abs(part.h)), (rate,))


def lugre(part: Part, z: tuple[Symbol, ...]) -> Made:
    """Canudas de Wit et al. 1995, equations 1 to 3."""
    rate = part.h - Abs(part.h) * z[0] / (part.width * part.g(Abs(part.h)))
    return Made(part.held(z[0], rate), (rate,))


def elasto_plastic(part: Part, z: tuple[Symbol, ...]) -> Made:
    """Dupont et al. 2002: plastic only where the deflection grows, near its level."""
    r = z[0] / (part.width * part.g(Abs(part.h)))
    forwards, backwards = (Abs(part.h) + part.h) / 2, (Abs(part.h) - part.h) / 2
    rate = part.h - r * (forwards * plastic(r) + backwards * plastic(-r))
    return Made(part.held(z[0], rate), (rate,))


def plastic(r: Expr) -> Expr:
    """A(r): 0 up to ELASTIC, 1 from 1 on, to rounding."""
    middle, half = (1 + ELASTIC) / 2, (1 - ELASTIC) / 2
    return (1 + erf(ERF_ENDS * (r - middle) / half)) / 2


def maxwell_slip(part: Part, z: tuple[Symbol, ...]) -> Made:
    """Lampaert, Al-Bender, Swevers 2003: elements that stick or slip, each for itself."""
    share = Rational(1, ELEMENTS)
    forces, memories = z[:ELEMENTS], z[ELEMENTS:]
    # A level that is a surface needs a slope at h = 0, which |h|^beta with beta < 1 has not.
    level = part.g(sympy.sqrt(part.h**2 + (SMALL * part.width / part.tau) ** 2))
    rates = [
        (1 - c**2) * part.h / (i * part.width) + (share * c - c**2 * force / level) / part.tau
        for i, (force, c) in enumerate(zip(forces, memories, strict=True), 1)
    ]
    # What slips lags behind its level, and is above it at a stop where the level falls with the speed. It
    # stands at the static level from there on: a level that falls as h leaves 0 would be passed at once.
    turns = dict.fromkeys(memories, sympy.S.Zero) | {
        force: (1 - c**2) * force + share * c for force, c in zip(forces, memories, strict=True)
    }
    surfaces = [Surface(part.name, part.h, reset=turns, side="both", contact=False)]
    for i, (force, c) in enumerate(zip(forces, memories, strict=True), 1):
        over = force / share
        # What slips has no level to reach; tanh(20) is 1 to rounding.
        reached = over**2 - 1 - SMALL - SLIPS * c**2
        slips = {c: tanh(20 * over)}
        surfaces.append(
            Surface(f"{part.name}:slips{i}", reached, reset=slips, side="-", contact=False)
        )
    field = part.with_static(sum(forces, sympy.S.Zero))
    return Made(field, (*rates, *(sympy.S.Zero for _ in memories)), tuple(surfaces))


def memory(part: Part, z: tuple[Symbol, ...]) -> Made:
    """The frictional memory of Armstrong-Helouvry et al. 1994 as a lag of the first order."""
    return Made(part.with_force(sign(part.h), Abs(z[0])), ((part.h - z[0]) / part.width,))


def seven_parameter(part: Part, z: tuple[Symbol, ...]) -> Made:
    """Armstrong-Helouvry et al. 1994: a spring in stick, a static level that rises with its time, a lag."""
    spring, c, lagged, missing, since = z
    fallen, share, rising = falling(part)
    now = 1 - fallen - missing * part.dwell / (since + part.dwell)
    level = fallen + now
    # In slip the lagged velocity has the sign of the slip or is 0, where |l|^beta has no slope for beta < 1.
    left = now * share(sympy.sqrt(lagged**2 + (SMALL * part.width / part.tau) ** 2))
    slip = fallen + left
    stuck = 1 - c**2
    held = stuck * (spring + part.tau * part.h / part.width)
    field = part.with_static(c * (slip + rising(Abs(part.h))) + held)
    follows = c**2 * (part.h - lagged) / part.lag
    rates = (stuck * part.h / part.width, sympy.S.Zero, follows, sympy.S.Zero, stuck)
    stop = {
        spring: c * slip, c: sympy.S.Zero, lagged: sympy.S.Zero, since: sympy.S.Zero,
        missing: 1 - fallen - left,
    }  # fmt: skip
    over = spring / level
    breaks = {c: tanh(20 * over)}
    # In stick h swings to 0 to stay there, and there is no stop to come: away from 0 then. At a stop the
    # spring is at its level but for rounding, and not to break away at once.
    slips = c * part.h + stuck * part.width / part.tau
    reached = over**2 - 1 - SMALL - SLIPS * c**2
    return Made(field, rates, (
        Surface(part.name, slips, reset=stop, side="+", contact=False),
        Surface(f"{part.name}:breaks", reached, reset=breaks, side="-", contact=False),
    ))  # fmt: skip


def falling(part: Part) -> tuple[Expr, Callable[[Expr], Expr], Callable[[Expr], Expr]]:
    """G, k and the rest of g = G + (1 - G) k + rest: k falls from 1 to 0, the rest rises from 0 forever.

    Raises ModelError where g has no such parts.
    """
    speed = Symbol("_speed", positive=True)
    g = sympy.expand(part.g(speed))
    known = {q: Dummy(q.name, positive=True) for q in g.free_symbols - {speed}}
    far = {q: q.xreplace(known).subs(speed, sympy.oo) for q in sympy.Add.make_args(g)}
    rest = sum((q for q, end in far.items() if end.is_infinite), sympy.S.Zero)
    kept = sum((end for end in far.values() if not end.is_infinite), sympy.S.Zero)
    fallen = kept.xreplace({dummy: q for q, dummy in known.items()})
    if fallen.has(sympy.nan, sympy.oo, speed) or rest.subs(speed, 0) != 0:
        raise ModelError(
            f"surface {part.name!r}: its friction over the static level is {g} at the speed {speed}. What "
            "falls to the Coulomb level cannot be told from what rises there: no seven-parameter model."
        )
    drop = sympy.simplify(1 - fallen)
    share = sympy.S.One if drop == 0 else sympy.simplify((g - rest - fallen) / drop)
    return fallen, lambda a: share.xreplace({speed: a}), lambda a: rest.xreplace({speed: a})


def bengisu_akay(part: Part, z: tuple[Symbol, ...]) -> Made:
    """Bengisu & Akay 1994: a parabola up to the static level, then the law from there on."""
    u = part.h / part.width
    s = Piecewise((u * (2 - Abs(u)), Abs(part.h) < part.width), (sign(part.h), True))
    beyond = Piecewise((0, Abs(part.h) < part.width), (Abs(part.h) - part.width, True))
    return Made(part.with_force(s, beyond))


# Name -> the equations and the number of states.
MODELS: dict[str, tuple[Callable[[Part, tuple[Symbol, ...]], Made], int]] = {
    "dahl": (dahl, 1), "lugre": (lugre, 1), "elasto-plastic": (elasto_plastic, 1),
    "maxwell-slip": (maxwell_slip, 2 * ELEMENTS), "memory": (memory, 1), "bengisu-akay": (bengisu_akay, 0),
    "seven-parameter": (seven_parameter, 5),
}  # fmt: skip
# Those with a time tau, and those whose deflection swings to rest, so that stays in stick cannot be told.
DAMPED = ("lugre", "elasto-plastic", "maxwell-slip", "seven-parameter")
BRISTLES = ("dahl", *DAMPED)
