"""An approximation in a comparison of solutions: name, width, equations, integrator."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any, NamedTuple

from filippov import ModelError, Parameter, System, UsageError, parameters
from filippov.analysis.comparisons.band_model import SMOOTH_REACH, BandModel
from filippov.base.keywords import constructor
from filippov.base.names import unknown
from filippov.model.bristles import BRISTLES, DAMPED
from filippov.model.bristles import MODELS as FRICTION
from filippov.model.comparator import Band, Comparator, Hysteresis, Karnopp, Smooth, Switch
from filippov.model.comparators.stick_levels import modes_of_stick
from filippov.model.friction_model import NO_SWITCHING, with_friction_model
from filippov.solving.state.options import STEPPING
from filippov.solving.stepping.plan import check_fits

Built = System | tuple[System, Mapping[str, float]]
ALPHA = 100.0
SMALLEST = 1e-300
# Name -> the comparator of a width and a rate alpha, and whether it is stiff as the width goes to 0.
KINDS: dict[str, tuple[Callable[[Any, Any], Comparator], bool]] = {
    "switch": (Switch, False),
    "karnopp": (Karnopp, False),
    "band": (lambda width, _: Band(width), True),
    "tanh": (lambda width, _: Smooth(width), True),
    "arctan": (lambda width, _: Smooth(width, "arctan"), True),
    "sqrt": (lambda width, _: Smooth(width, "sqrt"), True),
    "hysteresis": (lambda width, _: Hysteresis(width), False),
}
# Time stepping of the exact system: its width is the step.
STEPS = "moreau"
NAMES = (*KINDS, *FRICTION, STEPS)
UNFIT = "does not apply"


@constructor()
@dataclass(frozen=True)
class Approximation:
    """A family of systems that converges to the exact one as its width goes to 0.

    name     as it is to appear in the tables
    build    width -> System, or (System, parameter values), which saves making the same system for each
             width; its states are those of the exact system, then perhaps others
    stiff    whether it gets stiff as the width goes to 0: it is then integrated by the implicit method
    method   the integrator; None: by `stiff`
    start    values at the start of the states that the exact system does not have, 0 by default
    stick    how its stays in stick on a surface are read; by default the layer |h| <= width
    sticks   whether it has stays in stick at all: bristles only oscillate to rest
    without  surfaces that it leaves exact, each with the reason
    timed    whether its width is a step of time
    """

    name: str
    build: Callable[[float], Built]
    stiff: bool = False
    method: str | None = None
    start: Sequence[float] = ()
    stick: Callable[[str], BandModel] | None = field(default=None, hash=False)
    sticks: bool = True
    without: Mapping[str, str] = field(default_factory=dict, hash=False)
    timed: bool = False

    def band_model(self, surface: str) -> BandModel:
        """How its stays in stick on a surface are read."""
        return BandModel(self.name, self.build) if self.stick is None else self.stick(surface)


class Unfit(NamedTuple):
    """An approximation by name that does not apply to the system, and why."""

    name: str
    why: str


def approximations(
    exact: System, against: Any, alpha: float = ALPHA, tau: float | None = None
) -> list[Approximation | Unfit]:
    """The requested approximations: names of KINDS ("smooth" is "tanh") and of friction models, "moreau", a
    mapping from names to builds, Approximations, or several of these.

    tau     the time of friction models that have one, see `with_friction_model`

    Raises UsageError: for unknown names, and where not one of them applies.
    """
    items = [against] if isinstance(against, str | Approximation) else against
    if isinstance(items, Mapping):
        return [Approximation(str(name), build) for name, build in items.items()]
    out = [approximation(exact, item, alpha, tau) for item in items]
    names = [item.name for item in out]
    if not out or len(set(names)) < len(names):
        raise UsageError(f"against is {against!r}, expected at least one approximation, each once.")
    unfit = [item for item in out if isinstance(item, Unfit)]
    if len(unfit) == len(out):
        said = [
            f"{', '.join(item.name for item in unfit if item.why == why)}: {why}"
            for why in dict.fromkeys(item.why for item in unfit)
        ]
        raise UsageError(f"no approximation applies to this system. {' '.join(said)}")
    return out


def approximation(
    exact: System, item: Any, alpha: float = ALPHA, tau: float | None = None
) -> Approximation | Unfit:
    """One of the requested approximations: a name, or as it is. Raises UsageError for an unknown name."""
    if isinstance(item, Approximation):
        return item
    if not isinstance(item, str):
        known = ", ".join(NAMES)
        raise UsageError(f"against holds {item!r}, expected a name of {known} or an Approximation.")
    name = "tanh" if item == "smooth" else item
    if name not in NAMES:
        raise UsageError(unknown("approximation", item, NAMES))
    try:
        if name in FRICTION:
            return with_friction(exact, name, tau)
        if name in KINDS:
            return under(exact, name, alpha)
        check_fits(exact)
    except (ModelError, UsageError) as error:
        return Unfit(name, str(error))
    return Approximation(name, lambda _: exact, method=STEPPING, timed=True)


def with_friction(exact: System, name: str, tau: float | None = None) -> Approximation:
    """The system with a friction model of the literature on every switching surface to which it applies.

    tau     its time, where it has one; default: from the level at rest

    Raises ModelError where there is none.
    """
    word = _fresh("width", exact)
    width = parameters(**{word: Parameter(1e-3, lower=SMALLEST, description=f"width of {name}")})[word]
    made, without, own = exact, {}, tau if name in DAMPED else None
    surfaces = _switching(exact)
    for surface in surfaces:
        try:
            made = with_friction_model(made, name, width, surface=surface, tau=own)
        except ModelError as error:
            without[surface] = str(error)
    if len(without) == len(surfaces):
        raise ModelError(without[surfaces[0]])
    method = None if name == "maxwell-slip" else "Radau"
    return Approximation(
        name, lambda value: (made, {word: value}), method=method, sticks=name not in BRISTLES, without=without
    )


def under(exact: System, name: str, alpha: float = ALPHA) -> Approximation:
    """The system under a comparator on every switching surface to which it applies.

    Raises ModelError where there is none.
    """
    make, stiff = KINDS[name]
    surfaces = _switching(exact)
    without: dict[str, str] = {}
    try:  # surfaces that share a rate have one only together
        exact.with_comparator(dict.fromkeys(surfaces, make(1.0, alpha)))
    except ModelError as together:
        for surface in surfaces:
            try:
                exact.with_comparator({surface: make(1.0, alpha)})
            except ModelError as error:
                without[surface] = str(error)
        if len(without) == len(surfaces):
            raise together from None
    able = [surface for surface in surfaces if surface not in without]
    if exact.symbolic is None:
        def build(width: float) -> Built:
            return exact.with_comparator(dict.fromkeys(able, make(width, alpha)))

        return Approximation(name, build, stiff, stick=partial(_stick, name, frozenset()), without=without)
    own = [_fresh(word, exact) for word in ("width", "alpha")]
    p = parameters(**{
        own[0]: Parameter(1e-3, lower=SMALLEST, description=f"half-width of {name}"),
        own[1]: Parameter(alpha, lower=0, description="rate towards the surface"),
    })  # fmt: skip
    made = exact.with_comparator(dict.fromkeys(able, make(p[own[0]], p[own[1]])))
    stick = partial(_stick, name, frozenset(q.name for q in made.surfaces))
    return Approximation(name, lambda width: (made, {own[0]: width}), stiff, stick=stick, without=without)


def _switching(system: System) -> list[str]:
    """The names of its switching surfaces. Raises ModelError where there is none."""
    surfaces = [q.name for q in system.surfaces if q.kind == "switching"]
    if not surfaces:
        raise ModelError(NO_SWITCHING)
    return surfaces


def _fresh(word: str, system: System) -> str:
    while word in system.parameters or word in system.states:
        word += "_"
    return word


def _stick(name: str, surfaces: frozenset[str], surface: str) -> BandModel:
    """How stays in stick under a comparator with these surfaces are read."""
    def unused(width: float) -> System:
        raise NotImplementedError

    edges = {f"{surface}:upper": "-", f"{surface}:lower": "+"}
    if name in ("switch", "karnopp"):
        return BandModel(name, unused, modes_of_stick(surface, surfaces))
    if name == "band":
        return BandModel(name, unused, edges, attracted=True)
    return BandModel(name, unused, reach=SMOOTH_REACH if name in ("tanh", "arctan", "sqrt") else 1.0)
