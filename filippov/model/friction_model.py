"""A friction model of the literature in place of one surface of a system, mapped from its own law."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import sympy
from sympy import Abs, Dummy, Expr, Symbol, sign

from filippov.base.errors import ModelError
from filippov.base.keywords import keywords
from filippov.base.names import unknown
from filippov.base.symbolic_value import is_expression
from filippov.model.bristles import DAMPED, MODELS, Part
from filippov.model.parameter import as_number
from filippov.model.parameter_symbol import ParameterNamespace, ParameterSymbol
from filippov.model.symbolic import Select, convex, lie_derivative
from filippov.model.symbols import states, t
from filippov.model.system import System

NO_SWITCHING = (
    "the system has no switching surface, so nothing can stand for one. Write what jumps with sign: "
    "System({x: v, v: -x - mu*sign(v)})."
)


@keywords("keyword", error=ModelError)
def with_friction_model(
    system: System, model: str, width: Any, *, surface: str | None = None, tau: Any = None,
    lag: Any = None, dwell: Any = None,
) -> System:  # fmt: skip
    """Return the system with a friction model of the literature in place of one surface, its states last.

    model     a name of MODELS, see `filippov.model.bristles`
    width     w there: a number, or a parameter with a lower bound above 0
    surface   by default the only switching one
    tau       sigma1/sigma0, the damping of the deflection over its stiffness, and the lag of a slipping
              element of maxwell-slip; default: as in the published LuGre model, sqrt(width/(rate of h by the
              static level at h = 0))
    lag, dwell  times of seven-parameter: the lag of the velocity, and the dwell time after which half of the
                static level lost in slip is regained; default: tau

    Raises ModelError for a set wider than the hull (a jump of the static level: take a Stribeck law), for
    plain functions, and where the model has a tau and its default depends on the state or is 0.
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
    f1 = tuple(_of_speed(f.xreplace(plain), h, a, form.x) for f in slopes)
    rest = [_at_rest(q, h, a, form.x) for q in f1]
    j = next(k for k, q in enumerate(f1) if q != 0)
    w = _positive(width, "width")
    if tau is not None:
        tau = _positive(tau, "tau")
    elif model in DAMPED:
        tau = _tau(name, h, rest, form.x, w)
    if model != "seven-parameter" and not (lag is None and dwell is None):
        raise ModelError(f"lag and dwell are times of seven-parameter, which {model} does not have.")
    if model == "memory" and any(q.free_symbols & h.free_symbols & set(form.x) for q in f1):
        raise ModelError(
            f"surface {name!r}: the level of friction holds a state of h = {h} that is not in its size, and "
            "memory lags the sliding speed. Write the curve in abs(h)."
        )
    times = [tau if q is None else _positive(q, what) for q, what in ((lag, "lag"), (dwell, "dwell"))]
    if model in DAMPED:
        _one_curve(name, f1, rest, j)
    part = Part(
        name, h, f0, lambda speed: tuple(q.xreplace({a: speed}) for q in f1), tuple(rest),
        lambda speed: (f1[j] / rest[j]).xreplace({a: speed}), w, tau, *times,
    )  # fmt: skip
    make, count = MODELS[model]
    z = states(" ".join(f"{_word(name)}_{model[0]}{k}" for k in range(1, count + 1))) if count else ()
    made = make(part, tuple(z))
    kept = [q for k, q in enumerate(system.surfaces) if k != i and q.kind != "kink"]
    if model == "memory":
        kept.insert(min(i, len(kept)), system.surfaces[i])
    used = {q for f in (*made.field, *made.rates) for q in f.free_symbols if isinstance(q, ParameterSymbol)}
    extra = sorted(used - set(form.p), key=lambda q: q.name)
    namespace = ParameterNamespace({q.name: q for q in (*form.p, *extra)})
    # What an output's own sign becomes is another question than what the force becomes.
    signs = (sign, sympy.Heaviside, sympy.Piecewise)
    outputs = {name: e for name, e in system.outputs.items() if not e.has(*signs)}
    gone = system.outputs.keys() - outputs.keys()
    return System(
        dict(zip((*form.x, *z), (*made.field, *made.rates), strict=True)), surfaces=[*kept, *made.surfaces],
        parameters=namespace, time_events=system.time_events,
        labels={name: text for name, text in system.labels.items() if name not in gone}, outputs=outputs,
    )  # fmt: skip


def _one_curve(name: str, f1: Sequence[Expr], rest: Sequence[Expr], j: int) -> None:
    """Raise ModelError where equations have their friction from different curves."""
    if any(sympy.simplify(q * rest[j] - f1[j] * level) != 0 for q, level in zip(f1, rest, strict=True)):
        raise ModelError(
            f"surface {name!r}: the friction has another curve in one equation than in another, and these "
            "models have one. Take dahl or bengisu-akay."
        )


def _of_speed(f: Expr, h: Expr, a: Symbol, x: Sequence[Symbol]) -> Expr:
    """f with even powers of h, which sympy writes as those of a state, as powers of |h| = a."""
    H = Dummy("h", real=True)
    for put in _with_h(f, h, H, x):
        if put.has(H) and put == put.xreplace({H: -H}):
            return put.xreplace({H: a})
    return f


def _at_rest(f: Expr, h: Expr, a: Symbol, x: Sequence[Symbol]) -> Expr:
    """f where h is 0, without states where that can be."""
    f = f.xreplace({a: sympy.S.Zero})
    return next((put for put in _with_h(f, h, sympy.S.Zero, x) if not put.free_symbols & set(x)), f)


def _with_h(f: Expr, h: Expr, value: Expr, x: Sequence[Symbol]) -> Iterator[Expr]:
    """f with the value of h in place of each state that h is linear in."""
    for v in x:
        slope = h.diff(v)
        if slope != 0 and not slope.free_symbols & {*x, t}:
            rest = h.xreplace({v: sympy.S.Zero})
            yield f.xreplace({v: sympy.expand((value - rest) / slope)})


def _tau(name: str, h: Expr, rest: Sequence[Expr], x: Sequence[Symbol], w: Expr) -> Expr:
    """sqrt(w/level), level the rate of h by the static level."""
    level = lie_derivative(h, rest, x)
    if level == 0 or level.free_symbols & set(x):
        raise ModelError(f"surface {name!r}: dh/dt by its sign is {level}; give tau, a time.")
    return sympy.sqrt(w / Abs(level))


def _place(system: System, surface: str | None) -> int:
    able = [k for k, q in enumerate(system.surfaces) if q.kind == "switching"]
    if surface is not None:
        place = system.surface_index(surface)
        if place in able:
            return place
        told = ", ".join(system.surfaces[k].name for k in able) or "(none)"
        raise ModelError(
            f"surface {surface!r} does not switch the field: no friction stands on it. Those that do: "
            f"{told}."
        )
    if not able:
        raise ModelError(NO_SWITCHING)
    if len(able) > 1:
        names = ", ".join(system.surfaces[k].name for k in able)
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
    word = "".join(c if c.isalnum() else "_" for c in name).strip("_")
    return word if word.isidentifier() else f"z_{word}".rstrip("_")
