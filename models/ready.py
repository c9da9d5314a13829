"""Registered models as problems, without their expressions until these are needed."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from filippov.base.errors import ModelError
from filippov.base.keywords import keywords
from filippov.models import registry

if TYPE_CHECKING:
    from filippov.solving.state.problem import Problem


@keywords(error=ModelError)
def problem(name: str) -> Problem:
    """The system of a registered model with its initial state and time span: solve(problem("hunting")).

    A model of this package is kept in the cache of compiled code: the next process solves it without sympy,
    and creates its expressions when they are needed. Raises UsageError for an unknown name, with a
    suggestion, ModelError for a plug-in that is broken.
    """
    from filippov.solving.state.kept import keep, kept, place_of
    from filippov.solving.state.problem import Problem

    place = None
    if name in registry.BUILT_IN:
        files = sorted(path for path in Path(__file__).parent.rglob("*") if path.suffix in (".py", ".csv"))
        place = place_of(f"model {name}", files)
        found = place and kept(place, lambda: registry.get(name).build())
        if found:
            return found
    model = registry.get(name)
    made = Problem(
        model.build(), model.x0, model.t_span, model.parameters, backward=model.t_span[1] < model.t_span[0]
    )
    if place is not None:
        keep(place, made)
    return made
