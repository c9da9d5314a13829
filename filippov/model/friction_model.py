"""Friction models of the literature in the place of one surface of a system, mapped from its own law.

A system with the surface h (a sliding velocity) has dx/dt = f0 + f1(|h|) s, s in Sgn(h): f1(|h|)/f1(0) is g
below, the curve of the law over its static level. With w the width and tau a time,

    dahl          z' = h - |h| z/w           f0 + f1(|h|) z/w               w: deflection at the static level
    lugre         z' = h - |h| z/(w g)       f0 + f1(0) (z + tau z')/w      w: the same
    memory        z' = (h - z)/w             f0 + f1(|z|) s                 w: a time
    bengisu-akay  no state                   f0 + f1(max(|h| - w, 0)) q(h/w)   w: a velocity

Sliding steadily each gives f0 + f1(|h|) sgn(h) (bengisu-akay: with the curve moved by w), and at h = 0 the
first two have the stiffness f1(0)/w. q(u) = u (2 - |u|) within |u| <= 1, then sgn(u). memory is the lag of
the seven-parameter model as an element of the first order, as a delay is not to be had in an ordinary
differential equation; its rising static friction and its stiffness in stick are left out.

Sources: Dahl 1968; Canudas de Wit, Olsson, Astrom, Lischinsky 1995; Armstrong-Helouvry, Dupont, Canudas de
Wit 1994; Bengisu & Akay 1994.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import sympy
from sympy import Abs, Expr, Piecewise, Symbol, sign

from filippov.base.errors import ModelError
from filippov.base.names import unknown
from filippov.base.symbolic_value import is_expression
from filippov.model.parameter import as_number
from filippov.model.parameter_symbol import ParameterNamespace, ParameterSymbol
from filippov.model.symbolic import Select, convex
from filippov.model.symbols import states
from filippov.model.system import System


@dataclass(frozen=True)
class Part:
    """What a model is made of: the sliding velocity, the law's f0, f1 and g, and its numbers.

    f0, f1   one expression a state; f1 as a function of |h|
    """

    h: Expr
    f0: tuple[Expr, ...]
    f1: Callable[[Expr], tuple[Expr, ...]]
    g: Expr
    width: Expr
    tau: Expr

    def with_force(self, s: Expr, speed: Expr) -> tuple[Expr, ...]:
        """f0 + f1(speed) s."""
        return tuple(a + b * s for a, b in zip(self.f0, self.f1(speed), strict=True))


Made = tuple[tuple[Expr, ...], tuple[Expr, ...]]


def dahl(part: Part, z: tuple[Symbol, ...]) -> Made:
    """Dahl 1968, with the level of the law."""
    rate = part.h - Abs(part.h) * z[0] / part.width
    return part.with_force(z[0] / part.width, Abs(part.h)), (rate,)


def lugre(part: Part, z: tuple[Symbol, ...]) -> Made:
    """Canudas de Wit et al. 1995, equations 1 to 3."""
    rate = part.h - Abs(part.h) * z[0] / (part.width * part.g)
    return part.with_force((z[0] + part.tau * rate) / part.width, sympy.S.Zero), (rate,)


def memory(part: Part, z: tuple[Symbol, ...]) -> Made:
    """The frictional memory of Armstrong-Helouvry et al. 1994 as a lag of the first order."""
    return part.with_force(sign(part.h), Abs(z[0])), ((part.h - z[0]) / part.width,)


def bengisu_akay(part: Part, z: tuple[Symbol, ...]) -> Made:
    """Bengisu & Akay 1994: a parabola up to the static level, then the law from there on."""
    u = part.h / part.width
    s = Piecewise((u * (2 - Abs(u)), Abs(part.h) < part.width), (sign(part.h), True))
    beyond = Piecewise((0, Abs(part.h) < part.width), (Abs(part.h) - part.width, True))
    return part.with_force(s, beyond), ()


MODELS: dict[str, tuple[Callable[[Part, tuple[Symbol, ...]], Made], int]] = {
    "dahl": (dahl, 1), "lugre": (lugre, 1), "memory": (memory, 1),
    "bengisu-akay": (bengisu_akay, 0),
}  # fmt: skip


def with_friction_model(
    system: System, model: str, width: Any, *, surface: str | None = None, tau: Any = None
) -> System:
    """Return the system with a friction model of the literature in the place of one surface, its states last.

    model     a name of MODELS
    width     w above: a number, or a parameter with a lower bound above 0
    surface   by default the only switching one
    tau       sigma1/sigma0, the damping of the deflection over its stiffness; default: as in the published
              LuGre model, sqrt(width/(rate of h by the static level))

    Raises ModelError for a set wider than the hull (a jump of the static level: take a Stribeck law), for
    plain functions, and where the default of tau depends on the state.
    """
    if model not in MODELS:
        raise ModelError(unknown("friction model", model, MODELS))
    form = system.exact.symbolic
    if form is None:
        raise ModelError("friction models need a system of expressions; its field is a plain function.")
    system = system.exact
    i = _place(system, surface)
    name = system.surfaces[i].name
    s, a, h = form.s[i], form.a[i], form.plain_h()[i]
    if system.surfaces[i].wide or system.surfaces[i].reset is not None or system.surfaces[i].width != 0:
        raise ModelError(
            f"surface {name!r}: its set is wider than the hull, or it has a reset or a width; these models "
            "need a law whose curve begins at the static level, such as Stribeck's."
        )
    field = tuple(convex(f, {s}) for f in form.field)
    slopes = tuple(f.diff(s) for f in field)
    if any(q.has(s) for q in slopes):
        raise ModelError(f"surface {name!r}: the field is not affine in its sign.")
    plain = _plain(system, skip=i)
    f0 = tuple(f.xreplace({s: sympy.S.Zero}).xreplace({a: Abs(h)}).xreplace(plain) for f in field)
    f1 = tuple(f.xreplace(plain) for f in slopes)
    rest = [q.xreplace({a: sympy.S.Zero}) for q in f1]
    j = next(k for k, q in enumerate(f1) if q != 0)
    w = _positive(width, "width")
    level = sum((h.diff(x) * q for x, q in zip(form.x, rest, strict=True)), sympy.S.Zero)
    if tau is None:
        if level == 0 or level.free_symbols & set(form.x):
            raise ModelError(f"surface {name!r}: dh/dt by its sign is {level}; give tau, a time.")
        tau = sympy.sqrt(w / Abs(level))
    else:
        tau = _positive(tau, "tau")
    part = Part(
        h, f0, lambda speed: tuple(q.xreplace({a: speed}) for q in f1),
        (f1[j] / rest[j]).xreplace({a: Abs(h)}) if model != "memory" else sympy.S.One,
        w, tau,
    )  # fmt: skip
    make, count = MODELS[model]
    z = states(" ".join(f"{_word(name)}_{model[0]}{k}" for k in range(1, count + 1))) if count else ()
    equations, rates = make(part, tuple(z))
    kept = [q for k, q in enumerate(system.surfaces) if k != i and q.kind != "kink"]
    if model == "memory":
        kept.insert(min(i, len(kept)), system.surfaces[i])
    extra = sorted(
        {q for e in (w, part.tau) for q in e.free_symbols if isinstance(q, ParameterSymbol)} - set(form.p),
        key=lambda q: q.name,
    )
    namespace = ParameterNamespace({q.name: q for q in (*form.p, *extra)})
    return System(
        dict(zip((*form.x, *z), (*equations, *rates), strict=True)), surfaces=kept, parameters=namespace,
        time_events=system.time_events,
    )  # fmt: skip


def _place(system: System, surface: str | None) -> int:
    able = [k for k, q in enumerate(system.surfaces) if q.kind == "switching"]
    if surface is not None:
        place = system.surface_index(surface)
        if place in able:
            return place
        raise ModelError(f"surface {surface!r} does not switch the field: no friction stands on it.")
    if len(able) != 1:
        names = ", ".join(system.surfaces[k].name for k in able) or "none"
        raise ModelError(f"the system has the switching surfaces {names}; say surface=... for one of them.")
    return able[0]


def _plain(system: System, skip: int) -> Mapping[Any, Any]:
    """The signs and sizes of the other surfaces as sign and Abs; a Select on them stays one of its sign."""
    form = system.symbolic
    assert form is not None
    if any(f.has(Select) for f in form.field):
        raise ModelError("the field has branches (Piecewise, Max, Min); write it with sign and abs for this.")
    found: dict[Any, Any] = {}
    for k, h in enumerate(form.plain_h()):
        if k != skip:
            found |= {form.s[k]: sign(h), form.a[k]: Abs(h)}
    return found


def _positive(value: Any, what: str) -> Expr:
    if is_expression(value) and not value.is_number:
        if not value.is_positive and not value.is_nonnegative:
            raise ModelError(
                f"{what} is {value}, expected a number > 0 or a parameter with a lower bound > 0."
            )
        return value
    number = as_number(value, what)
    if number <= 0:
        raise ModelError(f"{what} is {number}, expected a number > 0.")
    return sympy.Float(number)


def _word(name: str) -> str:
    return "".join(c if c.isalnum() else "_" for c in name).strip("_") or "z"
