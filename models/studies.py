"""Studies by name: what is computed for a model and shown, as plain data (see `filippov.app.report`)."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from filippov.base.errors import ModelError, UsageError
from filippov.base.names import closest
from filippov.model.system import System
from filippov.models.questions import Questions

# Name -> module that registers it when it is imported.
BUILT_IN: dict[str, str] = {"hunting": "hunting_study"}


@dataclass(frozen=True)
class StudyCase:
    """One set of parameter values; `key` names it in the summary, and `small` ends the magnified interval."""

    key: str
    parameters: Mapping[str, float]
    label: str
    regime: str
    small: float

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
class Curve:
    """A constitutive curve y(x) with the set (x0, low, high) that it is at one place."""

    x: Any
    y: Any
    at: tuple[float, float, float]


@dataclass(frozen=True)
class Variant:
    """A model in which a band of some width stands for the surface: build(width, **option) -> System.

    stick    its mode of stick, by its own surfaces; options: further arguments with the values to try
    """

    name: str
    build: Callable[..., System]
    stick: Mapping[str, str]
    options: Mapping[str, tuple[float, ...]]


@dataclass(frozen=True)
class Study:
    """What is computed and shown.

    model              registered name of the model, which has a section
    cases              sets of parameter values; the first is shown in most detail
    x0, t_span         of the time response
    order              the iterate of the model's event map whose fixed points are studied
    parameter, values  of the bifurcation diagrams; `beyond`: further values, for the classification only
    curve              parameter values -> the constitutive curve; curve_title: file name and title
                       of its figure
    goal               the question whether some value has a stable set and no stable cycle, in words
    variants           models to compare with, over `widths`
    labels             axis labels with units, by name of state, "t", "d", "P" (the map), the parameter,
                       "curve x", "curve y", "multiplier"; for the questions "plane", "ending" (the second
                       parameters), "fold", "amplitude", "input"
    mode_names         words for modes
    stated_*           what the source states: parameters, fixed points by case, places and bounds by case,
                       classification
    summary            paragraphs at the head of the report
    differences        (title, text): what differs from the source, and why. In all texts {fold_2:.8f} and
                       the like stand for computed values (see filippov.app.report.facts)
    questions          what is asked beyond the cases
    """

    name: str
    title: str
    source: str
    model: str
    cases: tuple[StudyCase, ...]
    x0: tuple[float, ...]
    t_span: tuple[float, float]
    order: int
    parameter: str
    values: tuple[float, ...]
    beyond: tuple[float, ...]
    curve: Callable[[Mapping[str, float]], Curve]
    curve_title: tuple[str, str]
    goal: str
    variants: tuple[Variant, ...]
    widths: tuple[float, ...]
    labels: Mapping[str, str]
    mode_names: Mapping[str, str]
    stated_parameters: Mapping[str, str]
    stated_points: Mapping[str, tuple[StatedPoint, ...]]
    stated_places: Mapping[str, Mapping[str, str]]
    stated_bounds: Mapping[str, str]
    stated_classification: Mapping[str, Mapping[str, str]]
    summary: tuple[str, ...] = ()
    differences: tuple[tuple[str, str], ...] = ()
    captions: Mapping[str, str] = field(default_factory=dict)
    questions: Questions = field(default_factory=Questions)

    def case(self, key: str) -> StudyCase:
        """The case of a key."""
        return next(case for case in self.cases if case.key == key)


_studies: dict[str, Study] = {}


def register_study(study: Study) -> Study:
    """Enter a study under its name and return it; ModelError if another one has the name."""
    if _studies.setdefault(study.name, study) != study:
        raise ModelError(f"a study named {study.name!r} is registered already. Give this one another name.")
    return study


def study_names() -> tuple[str, ...]:
    """Return every name; no study is imported for it."""
    return tuple(dict.fromkeys([*BUILT_IN, *_studies]))


def get_study(name: str) -> Study:
    """Return a study; UsageError with a suggestion for an unknown name."""
    if name not in _studies and name in BUILT_IN:
        importlib.import_module(f"filippov.models.{BUILT_IN[name]}")
    if name in _studies:
        return _studies[name]
    hint = closest(str(name), study_names())
    raise UsageError(f"unknown study {name!r}; {hint + ' ' if hint else ''}known: {', '.join(study_names())}")
