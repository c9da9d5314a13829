"""Models by name: those of this package, and registered ones.

External models are entry points of the group `filippov.models`, each a Model, a System, a Problem, or a
function that returns one. One that cannot be loaded does not hide the others: `broken()` has its traceback.
Names are known without importing any model.
"""

from __future__ import annotations

import importlib
import inspect
import sys
import traceback
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from typing import TYPE_CHECKING, Any

from filippov.base.errors import ModelError, UsageError
from filippov.base.keywords import constructor, keywords
from filippov.base.names import unknown

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

    from filippov.model.system import System

GROUP = "filippov.models"

# Name -> module that registers it when it is imported.
BUILT_IN: dict[str, str] = {
    "hunting": "mass",
    "hunting_coulomb": "mass",
    "hunting_static": "mass",
    "hunting_switch": "switch",
    "hunting_karnopp": "karnopp",
    "hunting_lugre": "lugre",
    "pendulum": "pendulum",
    "belt": "belt",
    "belt_static": "belt",
    "belt_stribeck": "belt",
    "two_blocks": "two_blocks",
    "chain": "chain",
    "oscillator": "oscillator",
    "oscillator_forced": "oscillator",
    "relay": "relay",
    "relay_aperiodic": "relay",
    "relay_two_slides": "relay",
    "sliding_mode": "sliding_mode",
    "twisting": "sliding_mode",
    "thermostat": "thermostat",
    "switching_predator": "ecology",
    "threshold_harvest": "ecology",
    "buck": "buck",
    "buck_hysteresis": "buck",
    "buck_pwm": "buck",
    "bouncing_ball": "impact",
    "impact_oscillator": "impact",
    "reset_control": "clegg",
    "two_gene": "gene",
    "anti_windup": "gallery.anti_windup",
    "ball_on_table": "gallery.mechanics.table_ball",
    "boost_pwm": "gallery.boost",
    "boost_sliding": "gallery.boost",
    "brake": "gallery.mechanics.brake",
    "buck_dead_time": "gallery.dead_time",
    "capture": "gallery.mechanics.capture",
    "chua": "gallery.chua",
    "clutch": "gallery.mechanics.clutch",
    "newton_cradle": "gallery.mechanics.cradle",
    "differentiator": "gallery.differentiator",
    "drill_string": "gallery.mechanics.drill_string",
    "escapement": "gallery.mechanics.escapement",
    "visible_fold": "gallery.folds",
    "teixeira": "gallery.folds",
    "fuller": "gallery.fuller",
    "impact_pair": "gallery.mechanics.impact_pair",
    "neuron": "gallery.neuron",
    "sliding_observer": "gallery.observer",
    "planar_friction": "gallery.mechanics.planar_friction",
    "pll": "gallery.pll",
    "quantised_pi": "gallery.quantised",
    "rectifier": "gallery.rectifier",
    "rimless_wheel": "gallery.mechanics.rimless",
    "rocking_block": "gallery.mechanics.rocking",
    "sampled_pid": "gallery.sampled",
    "stommel": "gallery.stommel",
    "unit_vector": "gallery.unit_vector",
    "violin": "gallery.mechanics.violin",
    "welander": "gallery.welander",
    "woodpecker": "gallery.mechanics.woodpecker",
    "wiper": "gallery.mechanics.wiper",
}


@constructor(error=ModelError)
@dataclass(frozen=True)
class Invariant:
    """A quantity function(t, x, p) -> float that keeps its value along a solution.

    mode   the mode in which it does, as text such as "0" or "+-"; None for every mode
    """

    name: str
    function: Callable[[float, Any, Any], float]
    mode: str | None = None


@constructor(same={"lift": "parametrisation"}, error=ModelError)
@dataclass(frozen=True)
class SectionData:
    """The event map a model proposes, as plain data (see `filippov.analysis.maps.section.Section`).

    surface, kind  the event that is a return; coordinate: the state, or a formula in states, read there
    parametrisation
                   where a solution starts: an expression per state, as text in d and the parameters; `lift`
                   is taken as well
    interval       of the coordinate that is considered; t_max: longest return; after: mode after the event
    """

    surface: str
    kind: str
    coordinate: str
    parametrisation: Mapping[str, str]
    interval: tuple[float, float]
    t_max: float = 100.0
    after: str = ""


@dataclass(frozen=True)
class Build:
    """What makes the system of a model; keywords that it does not take are answered with UsageError."""

    name: str
    function: Callable[..., System]

    def __call__(self, *args: Any, **given: Any) -> System:
        """Return the System."""
        form = inspect.signature(self.function)
        try:
            form.bind(*args, **given)
        except TypeError as error:
            known = ", ".join(form.parameters) or "no values"
            raise UsageError(
                f"build of the model {self.name!r}: {error}; it takes {known}. Values of the system's "
                "parameters go to the run: solve(system, x0, t_span, parameters={'m': 2.0})."
            ) from None
        return self.function(*args, **given)


@constructor(error=ModelError)
@dataclass(frozen=True)
class Model:
    """A named system with an initial state and a time span to start from.

    build        keyword arguments -> System
    x0           default initial state, shape (n,)
    t_span       default (t0, t1)
    description  one sentence
    source       where the equations and numbers are from
    invariants   quantities that solutions conserve
    section      the event map it proposes, None for none
    parameters   values by name that differ from the defaults of the system
    """

    name: str
    build: Callable[..., System]
    x0: tuple[float, ...]
    t_span: tuple[float, float]
    description: str
    source: str
    invariants: tuple[Invariant, ...] = ()
    section: SectionData | None = None
    parameters: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not isinstance(self.build, Build):
            object.__setattr__(self, "build", Build(self.name, self.build))


_models: dict[str, Model] = {}
_broken: dict[str, str] = {}


@keywords(error=ModelError)
def register(model: Model) -> Model:
    """Enter a model under its name and return it; ModelError if another one has the name."""
    owner = f"{GROUP}.{BUILT_IN[model.name]}" if model.name in BUILT_IN else None
    if owner is not None and owner not in sys.modules:
        importlib.import_module(owner)
    if _models.get(model.name, model) != model:
        raise ModelError(f"a model named {model.name!r} is registered already. Give this one another name.")
    return _models.setdefault(model.name, model)


def names() -> tuple[str, ...]:
    """Return every name: this package's, registered ones, then plug-ins not known to be broken."""
    return tuple(dict.fromkeys([*BUILT_IN, *_models, *(n for n in _plug_ins() if n not in _broken)]))


@keywords(error=ModelError)
def get(name: str) -> Model:
    """Return a model; UsageError with a suggestion for an unknown name, ModelError for a broken plug-in."""
    if name in _models:
        return _models[name]
    if name in BUILT_IN:
        importlib.import_module(f"{GROUP}.{BUILT_IN[name]}")
        return _models[name]
    if name in _plug_ins():
        return _load(name)
    raise UsageError(unknown("model", name, names()))


def broken() -> dict[str, str]:
    """Load every plug-in; return the name and the traceback of each that could not be loaded."""
    for name in _plug_ins():
        if name not in _models and name not in _broken:
            try:
                _load(name)
            except ModelError:
                continue
    return dict(_broken)


@cache
def _plug_ins() -> dict[str, EntryPoint]:
    from importlib.metadata import entry_points

    found: dict[str, EntryPoint] = {}
    for point in entry_points(group=GROUP):
        if point.name in BUILT_IN or point.name in found:
            other = found[point.name].value if point.name in found else "this package"
            _broken[f"{point.name} ({point.value})"] = (
                f"the name {point.name!r} is taken by {other}; rename one of the entry points."
            )
        else:
            found[point.name] = point
    return found


def _load(name: str) -> Model:
    """Import a plug-in; ModelError, with the cause, if that fails in any way."""
    point = _plug_ins()[name]
    try:
        model = register(_as_model(name, point.load(), point.value))
    except (Exception, SystemExit) as error:
        _broken[name] = "".join(traceback.format_exception(error))
        raise ModelError(
            f"the plug-in {name!r} ({point.value}) could not be loaded: {type(error).__name__}: {error}. "
            "Repair or remove it; filippov.models.broken() has the traceback."
        ) from error
    _broken.pop(name, None)
    return model


def _as_model(name: str, loaded: Any, source: str) -> Model:
    """What an entry point names as a Model under the name of the entry point."""
    from filippov.base.given import shown
    from filippov.model.system import System
    from filippov.solving.state.problem import Problem

    kinds = (Model, System, Problem)
    made = loaded if isinstance(loaded, kinds) or not callable(loaded) else loaded()
    if isinstance(made, Model):
        return replace(made, name=name)
    if not isinstance(made, kinds):
        what = "is" if made is loaded else "returned"
        raise ModelError(
            f"it {what} {shown(made)}, expected a Model, a System, a Problem, or a function that returns one."
        )
    summary: list[str] = []
    if made is not loaded:  # the text of an object is that of its class
        summary = (loaded.__doc__ or "").strip().splitlines()
        source = getattr(loaded, "__module__", "") or source
    x0: tuple[float, ...] = (0.0,) * len(made.states) if isinstance(made, System) else ()
    t_span, values = (0.0, 10.0), {}
    if isinstance(made, Problem):
        x0, t_span = tuple(made.x0.tolist()), made.t_span
        own = made.system.parameters
        values = {q: v for q, v in made.parameters.items() if v != own[q].default}
    return Model(
        name=name,
        build=_Built(loaded, name),
        x0=x0,
        t_span=t_span,
        description=summary[0] if summary else f"the plug-in {name}",
        source=source,
        parameters=values,
    )


@dataclass(frozen=True)
class _Built:
    """The system of an entry point: keyword arguments go to its function, and an object takes none."""

    loaded: Any
    name: str

    def __call__(self, **options: Any) -> System:
        from filippov.model.system import System
        from filippov.solving.state.problem import Problem

        made = self.loaded
        if not isinstance(made, System | Problem):
            made = made(**options)
        elif options:
            raise ModelError(
                f"{self.name} takes no keywords, but {', '.join(options)} was given: it is one system, no "
                "function that makes some. Give values to the run: solve(..., parameters={...})."
            )
        return made if isinstance(made, System) else made.system
