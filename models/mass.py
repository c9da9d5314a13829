"""A controlled mass under dry friction: m v' in -u - F(v), x' = v, z' = x.

The reference system, `hunting()`, has Stribeck friction and a PID controller.
Source: Hensen & van de Molengraft 2002, equations 2 and 3, table 1.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple

import sympy
from sympy import Expr, Symbol

from filippov import Karnopp, ModelError, Parameter, Switch, System, states
from filippov.base.keywords import keywords
from filippov.model.parameter_symbol import ParameterNamespace, parameters
from filippov.models.controllers import PID, Controller
from filippov.models.friction import AXIS_LABELS, SMALLEST, FrictionLaw, declare
from filippov.models.laws import Coulomb, StaticCoulomb, Stribeck
from filippov.models.registry import Invariant, Model, SectionData, register

SOURCE = "Hensen & van de Molengraft, American Control Conference 2002"

# Table 1.
REFERENCE_LAW = Stribeck(Fs=4, Fc=2, vs=0.1, beta=2, b=1)
REFERENCE_CONTROLLER = PID(P=10, D=1, I=10)


class Parts(NamedTuple):
    """The symbols of a controlled mass; `tail` is the equation of the integral z where there is one."""

    x: Symbol
    v: Symbol
    z: Expr
    p: ParameterNamespace
    tail: dict[Symbol, Expr]

    @property
    def labels(self) -> dict[str, str]:
        """Labels of axes for its states."""
        return {**AXIS_LABELS, **{z.name: "integral [m s]" for z in self.tail}}


@dataclass(frozen=True)
class ControlledMass:
    """The plant that the exact inclusion and the band models share: a mass, a controller, a friction law."""

    friction: FrictionLaw = REFERENCE_LAW
    controller: Controller = REFERENCE_CONTROLLER
    m: float = 1.0

    def parts(self, **more: Parameter) -> Parts:
        """Return the symbols; `more` declares parameters after those of the plant."""
        mine = declare("m", self.m, "kg", "mass", SMALLEST)
        p = parameters(**mine, **self.controller.parameters(), **self.friction.parameters(), **more)
        x, v = states("x v")
        if not self.controller.integral:
            return Parts(x, v, sympy.S.Zero, p, {})
        (z,) = states("z")
        return Parts(x, v, z, p, {z: x})

    def check_dry(self, model: str) -> None:
        """Raise ModelError if the law has no dry friction, for which `model` stands in."""
        if not self.friction.dry:
            raise ModelError(
                f"the law {self.friction} has no dry friction, which the {model} model stands in for. "
                "Use controlled_mass(...), or a law with a dry part."
            )

    def system(self) -> System:
        """Return the inclusion x' = v, m v' in -u - F(v), z' = x (z with a PID controller only)."""
        parts = self.parts()
        x, v, z, p, tail = parts
        u = self.controller.effort(x, v, z, p)
        return System(
            {x: v, v: (-u - self.friction.force(v, p)) / p.m, **tail},
            surfaces=self.friction.surfaces(v, p),
            parameters=p,
            labels=parts.labels,
        )

    def band_system(self, comparator: Switch | Karnopp, **width: Parameter) -> System:
        """Return the plant under a comparator with a stick band, whose own parameters are `width`.

        Within the band the friction is the set at rest, without a viscous part. The surfaces are "band
        upper", "band lower", "effort upper" and "effort lower". Raises ModelError for a law without
        dry friction.
        """
        self.check_dry(type(comparator).__name__)
        parts = self.parts(**width)
        x, v, z, p, tail = parts
        u = self.controller.effort(x, v, z, p)
        force = self.friction.wholly_signed(v, p)
        (surface,) = self.friction.surfaces(v, p)
        equations = {x: v, v: (-u - force) / p.m, **tail}
        made = System(equations, surfaces=[surface], parameters=p, labels=parts.labels)
        band = made.with_comparator(replace(comparator, **{name: p[name] for name in width}))
        assert band.symbolic is not None
        named = zip(band.surfaces, BAND_SURFACES, strict=True)
        return band.with_form(band.symbolic, tuple(replace(q, name=name) for q, name in named))


BAND_SURFACES = ("band upper", "band lower", "effort upper", "effort lower")
REFERENCE = ControlledMass()


@keywords("keyword", error=ModelError)
def controlled_mass(
    friction: FrictionLaw = REFERENCE_LAW, controller: Controller = REFERENCE_CONTROLLER, m: float = 1.0
) -> System:
    """Return m v' in -u - F(v), x' = v, and z' = x with a PID controller.

    friction    a law, that of table 1 by default; its surface is named "velocity"
    controller  P, PD or PID, that of table 1 by default
    m           mass [kg] > 0

    P = 0 and I = 0 are allowed and degenerate: `degeneracies` names them.
    """
    return ControlledMass(friction, controller, m).system()


def hunting() -> System:
    """Return the reference system: parameters m, P, D, I, Fs, Fc, vs, beta, b with the values of table 1."""
    return REFERENCE.system()


@keywords("keyword", error=ModelError)
def degeneracies(
    system: System | Mapping[str, float], values: Mapping[str, float] | None = None
) -> tuple[str, ...]:
    """Return one sentence for each degenerate condition of a controlled mass, () for none.

    system   a System (whose defaults `values` replaces), or the parameter values by name

    "P = 0"            the controller is off
    "I = 0"            a PID controller without integral action
    "no dry friction"  every friction level is 0
    """
    if isinstance(system, System):
        q = dict(zip(system.parameters.names, system.parameters.resolve(values), strict=True))
    else:
        q = {**system, **(values or {})}
    found = []
    if q.get("P") == 0:
        found.append(
            "P = 0: the controller is off (u = 0 whatever D and I are), so x is not regulated and every x "
            "with v = 0 is an equilibrium."
        )
    if q.get("I") == 0:
        found.append(
            "I = 0: there is no integral action. The integral z is not fed back and drifts while x is not 0; "
            "a stick at |P x| <= Fs never ends, so all of these x are at rest. controller=PD(...) is the "
            "same loop without z."
        )
    levels = [q[n + side] for n in ("Fs", "Fc") for side in ("", "_plus", "_minus") if n + side in q]
    if not any(levels):
        found.append(
            "no dry friction: every friction level is 0, so the field does not jump at v = 0 and nothing "
            "sticks."
        )
    return tuple(found)


def _position(t: float, x: Any, p: Any) -> float:
    return float(x[0])


# A solution starts where stick ends: v = 0 and u = Fs (u = -Fs for d < 0).
BREAK_AWAY = "(sign(d)*{level}/P - d)/I"


def _section(level: str) -> SectionData:
    parametrisation = {"x": "d", "v": "0", "z": BREAK_AWAY.format(level=level)}
    return SectionData("velocity", "sliding entry", "x", parametrisation, (0.0, 0.5))


STICK = (Invariant("position in stick", _position, "0"),)


def _model(name: str, law: FrictionLaw | None, description: str, source: str = SOURCE) -> Model:
    build = hunting if law is None else partial(controlled_mass, law)
    section = _section("Fc" if isinstance(law, Coulomb) else "Fs")
    return register(
        Model(name, build, (0.1, 0.0, 0.0), (0.0, 20.0), description, source, STICK, section)
    )


HUNTING = _model("hunting", None, "PID-controlled mass with Stribeck friction: hunting limit cycles.")
COULOMB = _model(
    "hunting_coulomb",
    Coulomb(Fc=4, b=1),
    "PID-controlled mass with Coulomb friction alone: no hunting.",
    "Armstrong-Helouvry & Amin 1996",
)
STATIC = _model(
    "hunting_static",
    StaticCoulomb(Fs=4, Fc=2, b=1),
    "PID-controlled mass, static friction above Coulomb with its jump: always hunting.",
    "Armstrong-Helouvry & Amin 1996",
)
