"""A system without the effect of one surface: for the solution beyond a tangency."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import Any

import sympy

from filippov import System, UsageError


@lru_cache(maxsize=32)
def without_surface(system: System, i: int, side: int) -> System:
    """The system with the sign of surface i held at `side`: the surface then only gives events."""
    form = system.symbolic
    if form is None:
        raise UsageError("a curve of grazing needs a system of expressions, whose sign can be held.")
    held: dict[Any, Any] = {form.s[i]: sympy.Integer(side)}
    held[form.a[i]] = side * form.h[i]
    surfaces = list(system.surfaces)
    surfaces[i] = replace(surfaces[i], kind="observer", radius=1.0, reset=None, side="+", contact=None)
    radius = list(form.radius)
    radius[i] = (sympy.Integer(-1), sympy.Integer(1))
    changed = replace(
        form, field=tuple(f.xreplace(held) for f in form.field), radius=tuple(radius),
        h=tuple(h if k == i else h.xreplace({form.a[i]: held[form.a[i]]}) for k, h in enumerate(form.h)),
        reset=tuple(None if k == i else after for k, after in enumerate(form.reset)),
        contact=tuple(None if k == i else after for k, after in enumerate(form.contact)),
    )  # fmt: skip
    return System._of_form(changed, tuple(surfaces), system.time_events)
