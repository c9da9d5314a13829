"""Studies by name: what is computed and shown for a model, as plain data (see `filippov.app.report`).

A study has cases and requests analyses; each of them is a section of the report.
"""

from __future__ import annotations

import csv
import importlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import resources
from typing import TYPE_CHECKING, Any

from filippov.base.errors import ModelError, UsageError
from filippov.base.keywords import keywords
from filippov.base.names import unknown

if TYPE_CHECKING:
    from filippov.model.system import System

# Name -> module that registers it when it is imported.
BUILT_IN: dict[str, str] = {"hunting": "study.hunting", "belt": "study.belt"}

Values = Mapping[str, float]
Range = tuple[float, float]
Texts = Mapping[str, tuple[tuple[str, str], ...]]


@dataclass(frozen=True)
class StudyCase:
    """One set of parameter values; `key` names it in the summary, and `small` ends the magnified interval."""

    key: str
    parameters: Values
    label: str
    regime: str = ""
    small: float | None = None

    @property
    def slug(self) -> str:
        """The key for file names and places in texts."""
        return self.key.replace(".", "_")


@dataclass(frozen=True)
class StatedPoint:
    """A fixed point as the source states it: digits as printed, and the further digits of a reference."""

    d: str
    kind: str
    stable: bool
    reference: str = ""


@dataclass(frozen=True)
class Stated:
    """What the source states: values by parameter; fixed points, (fold, change of stability of the set) and
    analytic bound by case; the words of the classification by regime."""

    parameters: Mapping[str, str] = field(default_factory=dict)
    points: Mapping[str, tuple[StatedPoint, ...]] = field(default_factory=dict)
    places: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    bounds: Mapping[str, str] = field(default_factory=dict)
    classification: Mapping[str, Mapping[str, str]] = field(default_factory=dict)


@dataclass(frozen=True)
class ConstitutiveCurve:
    """A constitutive curve y(x) with the set (x0, low, high) that it is at one place."""

    x: Any
    y: Any
    at: tuple[float, float, float]


@dataclass(frozen=True)
class Variant:
    """A model in which a band of some width replaces the surface: build(width, **option) -> System.

    stick    its mode of stick, by its own surfaces; options: further arguments with the values to try
    """

    name: str
    build: Callable[..., System]
    stick: Mapping[str, str]
    options: Mapping[str, tuple[float, ...]]


@dataclass(frozen=True)
class Law:
    """A law for which settings without cycles are sought, or that is put to harmonic balance and to algebra.

    model           a registered model, with values of its parameters
    ratio, cycles   functions of the parameter values, None for none: the ratio of successive stick positions
                    by algebra (None where there is none), the coordinates of all cycles
    """

    label: str
    model: str
    parameters: Values = field(default_factory=dict)
    ratio: Callable[[Values], float | None] | None = None
    cycles: Callable[[Values], Sequence[float]] | None = None


@dataclass(frozen=True)
class Experiment:
    """A record made by the exact model with noise, and what is estimated from it.

    t_end, samples   evenly from 0; noise: standard deviation of the first state; seed: of the noise
    force            states (n, k) and parameter values -> the force applied to the plant
    plant            builds the driven plant; guess: starts of the free parameters; fixed: others; windows
    curve            (x, values) -> the constitutive curve, for the figure
    """

    t_end: float
    samples: int
    noise: float
    seed: int
    force: Callable[[Any, Values], Any]
    plant: Callable[[], System]
    guess: Values
    fixed: Values
    windows: int
    curve: Callable[[Any, Values], Any]


@dataclass(frozen=True)
class Relative:
    """A smoother model of the same system, whose cycles are compared with the exact ones.

    build      the system; x0: a start that goes to its cycle; transient: time until it is near; method
    beyond     (value, x0) from which a case without a fold in the study's range is followed on
    small      starts (first state) near rest that are followed for `settle` time: does rest attract?
    threshold  largest |second state| of what counts as at rest
    """

    name: str
    build: Callable[[], System]
    x0: Sequence[float]
    transient: float
    method: str
    beyond: tuple[float, Sequence[float]]
    small: tuple[float, ...]
    settle: float
    threshold: float


@dataclass(frozen=True)
class Study:
    """What is computed and shown; what is None or empty is omitted.

    model              registered name of the model, which has a section; `unit`: of the section's coordinate
    cases              sets of parameter values; the first is shown in most detail
    parameter, values  of the bifurcation diagrams; `beyond`: further values, for the classification only
    texts              (title, paragraph) by section, before its figures and tables: "summary", "differences"
                       and the anchors of the report; "figure NAME": a caption. {fold_2:.9f} and the like
                       stand for computed values (see `filippov.app.report.facts.Facts`), [[regions]] for the
                       number of a figure (its file), a table (its label) or a section (its anchor)
    symbols            (symbol, what it is, unit) of everything in the texts except parameters
    letter             of the event map in words and labels, where R means something else
    x0, t_span         of the time response, those of the model by default
    order              the iterate of the model's event map whose fixed points are studied
    symmetry           of the cycles, as in `find_orbit`
    labels             axis labels with units, by name of state, "t", "d", "image" and "iterate" (of d, under
                       the map and its iterate), "fixed points", "parameter", "curve x", "curve y",
                       "multiplier", "plane", "ending"
                       (the second parameters), "fold", "amplitude", "input", "width"
    mode_names         words for modes
    curve              parameter values -> the constitutive curve; curve_title: file name, title of the figure
    goal               the question whether some value has a stable set and no stable cycle, in words
    stated             what the source states, in columns of their own
    variants           models to compare with, over `widths`
    ending             (parameter, bounds): the curve of the first fold over a second parameter
    plane              (parameter, range of the study's parameter, its own range): cells with exact borders
    ranges, tuned      settings by name, and the laws for which those without cycles are sought
    laws, experiment, relative   as their classes say
    approximated       rows of `filippov.app.approximations`, kept in a file since they take minutes
    """

    name: str
    title: str
    source: str
    model: str
    cases: tuple[StudyCase, ...]
    parameter: str
    values: tuple[float, ...]
    texts: Texts = field(default_factory=dict)
    symbols: tuple[tuple[str, str, str], ...] = ()
    letter: str = "R"
    x0: tuple[float, ...] = ()
    t_span: tuple[float, ...] = ()
    order: int = 1
    symmetry: Any = None
    beyond: tuple[float, ...] = ()
    unit: str = "m"
    labels: Mapping[str, str] = field(default_factory=dict)
    mode_names: Mapping[str, str] = field(default_factory=dict)
    curve: Callable[[Values], ConstitutiveCurve] | None = None
    curve_title: tuple[str, str] = ("curve", "Constitutive curves")
    goal: str = ""
    stated: Stated | None = None
    variants: tuple[Variant, ...] = ()
    widths: tuple[float, ...] = ()
    ending: tuple[str, Range] | None = None
    plane: tuple[str, Range, Range] | None = None
    ranges: Mapping[str, Range] = field(default_factory=dict)
    tuned: tuple[Law, ...] = ()
    laws: tuple[Law, ...] = ()
    experiment: Experiment | None = None
    relative: Relative | None = None
    approximated: tuple[Mapping[str, str], ...] = ()


def read_rows(file: str) -> tuple[dict[str, str], ...]:
    """The rows of a CSV file of this package, by column."""
    source = resources.files("filippov.models").joinpath(file).read_text(encoding="utf-8")
    return tuple(csv.DictReader(source.splitlines()))


def read_texts(file: str) -> Texts:
    """The texts of a study from a Markdown file of this package: `# section`, `## title`, paragraphs."""
    out: dict[str, tuple[tuple[str, str], ...]] = {}
    section = title = ""
    source = resources.files("filippov.models").joinpath(file).read_text(encoding="utf-8")
    for block in source.split("\n\n"):
        text = " ".join(block.split())
        if text.startswith("# "):
            section, title = text[2:], ""
        elif text.startswith("## "):
            title = text[3:]
        elif text:
            out[section] = (*out.get(section, ()), (title, text))
    return out


_studies: dict[str, Study] = {}


@keywords(error=ModelError)
def register_study(study: Study) -> Study:
    """Enter a study under its name and return it; ModelError if another one has the name."""
    if _studies.setdefault(study.name, study) != study:
        raise ModelError(f"a study named {study.name!r} is registered already. Give this one another name.")
    return study


def study_names() -> tuple[str, ...]:
    """Return every name; no study is imported for it."""
    return tuple(dict.fromkeys([*BUILT_IN, *_studies]))


@keywords(error=ModelError)
def get_study(name: str) -> Study:
    """Return a study; UsageError with a suggestion for an unknown name."""
    if name not in _studies and name in BUILT_IN:
        importlib.import_module(f"filippov.models.{BUILT_IN[name]}")
    if name in _studies:
        return _studies[name]
    raise UsageError(unknown("study", name, study_names()))
