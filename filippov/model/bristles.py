"""Friction models of the literature as equations in the place of Sgn(h), h a sliding velocity.

The system is dx/dt = f0 + f1(|h|) s, s in Sgn(h): f1(|h|)/f1(0) is g below, the curve of the law over its
static level. With w the width, tau a time and r = z/(w g) the deflection z over its level,

    dahl            z' = h - |h| z/w     f0 + f1(|h|) z/w              w: deflection at the static level
    lugre           z' = h - |h| r       f0 + f1(0) (z + tau z')/w     w: the same
    elasto-plastic  z' = h - |h| r alpha as lugre; alpha = A(|r|) where h and z have one sign, else 0
    maxwell-slip    three, below         f0 + f1(0) (z1 + z2 + z3)     w: the same
    memory          z' = (h - z)/w       f0 + f1(|z|) s                w: a time
    bengisu-akay    no state             f0 + f1(max(|h| - w, 0)) q(h/w)   w: a velocity

A rises from 0 at |r| = 0.7, below which the deflection is elastic and nothing creeps, to 1 at |r| = 1. It is
an error function that has both values to rounding, in the place of the published half period of a sine: no
kinks there, which would be surfaces. Element i of N = 3 carries 1/N of the level; z its force over the static
level, c its memory, 0 stuck, +-1 slipping:

    z' = (1 - c^2) h/(i w) + (c/N - c^2 z/g)/tau,   |z| = g/N: c = sgn z,   h = 0: c = 0

q(u) = u (2 - |u|) within |u| <= 1, then sgn u. Sliding steadily each gives f0 + f1(|h|) sgn(h) (bengisu-akay:
with the curve moved by w); at h = 0 the stiffness of dahl, lugre and elasto-plastic is f1(0)/w, that of
maxwell-slip 11/6 of it. Of Armstrong's seven parameters the law has four (Coulomb, static and viscous level,
Stribeck velocity); memory has a fifth, the lag, as an element of the first order, since a delay is not to be
had in an ordinary differential equation. The other two are left out: the static level does not rise with
the time of a stick, and in stick there is no stiffness.

Sources: Dahl 1968; Canudas de Wit, Olsson, Astrom, Lischinsky 1995; Dupont, Hayward, Armstrong, Altpeter
2002; Lampaert, Al-Bender, Swevers 2003; Armstrong-Helouvry, Dupont, Canudas de Wit 1994; Bengisu & Akay 1994.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import sympy
from sympy import Abs, Expr, Piecewise, Rational, Symbol, erf, sign, tanh

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

    f0, f1   one expression a state; f1 and g as functions of |h|
    """

    name: str
    h: Expr
    f0: tuple[Expr, ...]
    f1: Callable[[Expr], tuple[Expr, ...]]
    g: Callable[[Expr], Expr]
    width: Expr
    tau: Expr | None

    def with_force(self, s: Expr, speed: Expr) -> tuple[Expr, ...]:
        """f0 + f1(speed) s."""
        return tuple(a + b * s for a, b in zip(self.f0, self.f1(speed), strict=True))

    def held(self, z: Expr, rate: Expr) -> tuple[Expr, ...]:
        """The field with a deflection and its damping."""
        return self.with_force((z + self.tau * rate) / self.width, sympy.S.Zero)


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
    turns = dict.fromkeys(memories, sympy.S.Zero)
    surfaces = [Surface(part.name, part.h, reset=turns, side="both", contact=False)]
    for i, (force, c) in enumerate(zip(forces, memories, strict=True), 1):
        over = force / (share * level)
        # What slips has no level to reach; tanh(20) is 1 to rounding.
        reached = over**2 - 1 - SLIPS * c**2
        slips = {c: tanh(20 * over)}
        surfaces.append(
            Surface(f"{part.name}:slips{i}", reached, reset=slips, side="-", contact=False)
        )
    field = part.with_force(sum(forces, sympy.S.Zero), sympy.S.Zero)
    return Made(field, (*rates, *(sympy.S.Zero for _ in memories)), tuple(surfaces))


def memory(part: Part, z: tuple[Symbol, ...]) -> Made:
    """The frictional memory of Armstrong-Helouvry et al. 1994 as a lag of the first order."""
    return Made(part.with_force(sign(part.h), Abs(z[0])), ((part.h - z[0]) / part.width,))


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
}  # fmt: skip
# Those with a time tau, and those whose deflection swings to rest, so that stays in stick cannot be told.
DAMPED = ("lugre", "elasto-plastic", "maxwell-slip")
BRISTLES = ("dahl", *DAMPED)
