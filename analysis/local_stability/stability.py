"""Stability of every equilibrium and equilibrium set of a system, each verdict with its argument."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import sympy
from sympy import Expr, Symbol

from filippov import ModelError, System
from filippov.analysis.algebra.budget import Clock, OutOfBudgetError, counted
from filippov.analysis.algebra.exact_form import exact_form, with_signs
from filippov.analysis.algebra.number_text import has_decimals
from filippov.analysis.algebra.polynomial import exact, in_exponents
from filippov.analysis.local_stability import stability_text
from filippov.analysis.local_stability.certificates.certificate import Certificate
from filippov.analysis.local_stability.certificates.decide import decided, first
from filippov.analysis.local_stability.contact_stability import contact_stability, in_contact
from filippov.analysis.local_stability.periodic_stability import with_time
from filippov.analysis.local_stability.set_parts import parts, sliding_parts
from filippov.analysis.local_stability.set_stability import set_stability
from filippov.analysis.local_stability.sliding_stability import sliding_stability
from filippov.analysis.local_stability.smooth_stability import smooth_stability
from filippov.analysis.local_stability.stability_context import Context
from filippov.analysis.local_stability.stability_result import (
    EquilibriumStability,
    SetStability,
    StabilityResult,
    Statement,
)
from filippov.analysis.local_stability.stick_parts import Beside, Judged, beside_others, joined
from filippov.analysis.steady.edges import side
from filippov.analysis.steady.equilibria import MOST_MODES, equilibria, mode_options, mode_signs
from filippov.analysis.steady.equilibrium import EquilibriumPoint, EquilibriumSet, Stopped
from filippov.analysis.steady.forcing import depends_on_time
from filippov.analysis.steady.mode_order import existing_modes
from filippov.analysis.steady.time_signs import (
    modes_without,
    with_time_surfaces,
    without_time_surfaces,
)
from filippov.base.given import Positive
from filippov.base.keywords import keywords
from filippov.base.shown import Shown
from filippov.model.symbolic import SymbolicForm

# Modes beside one equilibrium that are searched although they were not asked for.
MOST_BESIDE = 81


class StabilityReport(StabilityResult, Shown):
    """The result as text, Markdown, LaTeX, JSON."""

    def __str__(self) -> str:
        return self.to_text().rstrip()

    def to_text(self) -> str:
        """Plain text, one section per equilibrium."""
        return stability_text.render(self, stability_text.text_style(self.decimals))

    def to_markdown(self) -> str:
        """Markdown with the formulas in $...$."""
        return stability_text.render(self, stability_text.markdown_style(self.decimals))

    def to_latex(self, document: bool = False) -> str:
        """LaTeX sections, for a document with amsmath; with `document` one that compiles as it is."""
        sections = stability_text.render(self, stability_text.latex_style(self.decimals))
        return stability_text.latex_document(sections) if document else sections

    def to_dict(self) -> dict[str, Any]:
        """Strings, numbers, lists and dicts only."""
        return stability_text.as_dict(self)

    def to_json(self) -> str:
        """`to_dict` as JSON."""
        return stability_text.as_json(self)


@keywords()
@counted
def stability_report(
    system: System,
    parameters: Mapping[Any, float] | None = None,
    *,
    solve_for: str | Symbol | None = None,
    modes: Sequence[str] | None = None,
    t: float | None = None,
    assume: Iterable[Any] | None = None,
    hook: SetStability | None = None,
    budget: Positive = 60.0,
    progress: Callable[[float, float], object] | None = None,
) -> StabilityReport:
    """Return the stability of all equilibria of a system of expressions.

    parameters  values at which existence and verdicts are decided, the defaults where not given
    solve_for   a parameter for which the Routh-Hurwitz conditions are solved, in formulas and in numbers
    modes, t    as in `equilibria`
    assume      inequalities taken to hold in the formulas; by default each parameter but
                the one that is solved for keeps the sign of its value
    hook        gives the slope of an event map's second iterate at a set, which decides if nothing else does
    budget      work, in millions of calls of Python functions (about 0.3 s each)
    progress    called with the work that is done, and the budget

    Raises ModelError for a system of plain functions or an unknown parameter.
    """
    if t is None:
        for mode in modes or ():
            mode_signs(system, mode)
        system, modes = without_time_surfaces(system), modes_without(system, modes)
    form = _expressions(system)
    clock = Clock(budget, progress)
    p = system.parameters.resolve(parameters)
    numbers = {q: exact(v) for q, v in zip(form.p, p.tolist(), strict=True)}
    values = in_exponents(form.expressions(), numbers)
    symbol = None if solve_for is None else form.p[system.parameters.index(solve_for)]
    told = tuple(_signs({q: v for q, v in values.items() if q != symbol}) if assume is None else assume)
    system, form = _branches(system, told)
    found = equilibria(system, parameters, modes=modes, t=t, budget=max(budget / 2, 1e-3))
    notes = list(found.notes)
    items = []
    outer = joined(found)
    for equilibrium in found:
        try:
            clock.check()
            context = Context(system, form, values, told, symbol, hook, clock)
            items += _items(context, equilibrium, t, outer.get(id(equilibrium)))
        except OutOfBudgetError as error:
            text = f"stopped after {len(items)} of {len(found)} equilibria: {error}. Give a larger budget."
            notes.append(Stopped(text))
            break
    asked = [Judged(item.equilibrium, item.answer, item.drift) for item in items]
    near = _unsearched(system, form, values, modes, asked)
    if near:
        # What rests beside these may lie in modes that were not asked for.
        left = max(min(budget / 2, clock.budget / 4), 1e-3)
        found_near = equilibria(system, parameters, modes=near, t=t, budget=left)
        others: list[EquilibriumPoint | EquilibriumSet] = [*found, *found_near]
    else:
        others = [*found]
    beside = beside_others(others, asked, values)
    items = [item if b is None else _with_others(item, b) for item, b in zip(items, beside, strict=True)]
    names = tuple(zip(system.parameters.names, p.tolist(), strict=True))
    surfaces = tuple(s.name for s in system.surfaces)
    written = system.symbolic
    decimals = written is not None and has_decimals(written.expressions())
    return StabilityReport(system.states, surfaces, names, told, tuple(items), tuple(notes), decimals)


def _with_others(item: EquilibriumStability, beside: Beside) -> EquilibriumStability:
    said = (Statement(beside.text), *item.statements)
    return replace(item, answer=beside.answer, together=beside.together, statements=said)


def _unsearched(
    system: System,
    form: SymbolicForm,
    values: Mapping[Symbol, Expr],
    modes: Sequence[str] | None,
    judged: Sequence[Judged],
) -> list[str]:
    """Modes that were not searched, beside what is called asymptotically stable."""
    options = mode_options(system)
    every = itertools.islice(existing_modes(system, options), MOST_MODES + 1)
    if modes is None and len(list(every)) <= MOST_MODES:
        return []
    out: set[str] = set()
    for one in judged:
        e = one.equilibrium
        if one.answer != "asymptotically stable":
            continue
        places = [e.x] if isinstance(e, EquilibriumPoint) else [end.x for end in e.ends]
        signs = []
        for mark, h, option in zip(e.mode, form.plain_h(), options, strict=True):
            on = mark == "0" or any(side(h, dict(zip(form.x, x, strict=True)), values) == 0 for x in places)
            signs.append(option if on else mark)
        if math.prod(map(len, signs)) <= MOST_BESIDE:
            out |= {"".join(mode) for mode in itertools.product(*signs)}
    return sorted(out - set(modes or ()))


def _expressions(system: System) -> SymbolicForm:
    form = exact_form(system)
    if form is None:
        raise ModelError(
            "a stability report needs the field as expressions, for it is expanded at the surfaces. Write "
            "System({x: ..., v: ...}), or use equilibria(system), which works for plain functions too."
        )
    return form


def _branches(system: System, told: Iterable[Any]) -> tuple[System, SymbolicForm]:
    """The system, and its form, on the branches that the assumed signs of parameters leave."""
    strict = [r for r in told if isinstance(r, sympy.StrictGreaterThan | sympy.StrictLessThan)]
    signs = {r.gts: 1 for r in strict if r.lts == 0} | {r.lts: -1 for r in strict if r.gts == 0}
    system = with_signs(system, {q: side for q, side in signs.items() if q.is_Symbol})
    return system, _expressions(system)


def _signs(values: Mapping[Symbol, Expr]) -> list[Any]:
    """q > 0 or q < 0, as the value is; sympy.true where the symbol knows it already."""
    return [r for q, v in values.items() if v != 0 and (r := q > 0 if v > 0 else q < 0) != sympy.true]


def _items(
    context: Context,
    equilibrium: EquilibriumPoint | EquilibriumSet,
    t: float | None,
    ends: tuple[EquilibriumPoint, ...] | None,
) -> list[EquilibriumStability]:
    """The analysis of a point, or of a set in parts of one verdict each."""
    context.clock.check()
    context = context.put_degenerate(equilibrium.degenerate, t)
    if "0" not in equilibrium.mode and isinstance(equilibrium, EquilibriumSet):
        pieces = parts(context, equilibrium)
        return [_whole(context, smooth_stability(context, part), t) for part in pieces]
    if isinstance(equilibrium, EquilibriumSet):
        pieces = sliding_parts(context, equilibrium)
        if len(pieces) > 1:
            return [_whole(context, _item(context, part, None), t) for part in pieces]
    return [_whole(context, _item(context, equilibrium, ends), t)]


@keywords()
def certify(
    system: System, parameters: Mapping[Any, float] | None = None, *, budget: Positive = 60.0
) -> tuple[tuple[EquilibriumPoint | EquilibriumSet, Certificate | None], ...]:
    """Return every equilibrium and set with the first certificate of its stability or instability, or None.

    parameters  values at which it is asked, the defaults where not given
    budget      work, in millions of calls of Python functions (about 0.3 s each)

    Unlike `stability_report` it does not stop where the linear part decides. A certificate names theorem,
    source and the hypotheses that were checked. Raises ModelError for a system of plain functions or an
    unknown parameter, OutOfBudgetError.
    """
    asked, system = system, without_time_surfaces(system)
    form = _expressions(system)
    p = system.parameters.resolve(parameters)
    numbers = {q: exact(v) for q, v in zip(form.p, p.tolist(), strict=True)}
    values = in_exponents(form.expressions(), numbers)
    told = tuple(_signs(values))
    system, form = _branches(system, told)
    found = equilibria(system, parameters, budget=max(budget / 2, 1e-3))
    outer = joined(found)
    certificates: list[Certificate | None] = []
    judged: list[Judged] = []
    for equilibrium in found:
        context = Context(system, form, values, told, None, None, Clock(budget))
        context = context.put_degenerate(equilibrium.degenerate, None)
        smooth = "0" not in equilibrium.mode
        item = (
            smooth_stability(context, equilibrium)
            if smooth
            else _item(context, equilibrium, outer.get(id(equilibrium)))
        )
        certificates.append(first(context, item, wide=True))
        judged.append(Judged(equilibrium, getattr(certificates[-1], "answer", "undecided"), item.drift))
    beside = beside_others(found, judged, values)
    return tuple(
        (
            equilibrium if asked is system else with_time_surfaces(asked, equilibrium, values),
            certificate if certificate is None or b is None else certificate.beside(b),
        )
        for equilibrium, certificate, b in zip(found, certificates, beside, strict=True)
    )


def _whole(context: Context, item: EquilibriumStability, t: float | None) -> EquilibriumStability:
    """The analysis with time and clocks, and with a certificate where these leave it undecided."""
    moved = with_time(context, item, t)
    frozen = t is not None and depends_on_time(context.system)
    found = moved if frozen else decided(context, item, moved)
    if context.symbol is None or found.solved is not None or any(c.solved is not None for c in found.cases):
        return found
    return replace(found, statements=(*found.statements, Statement(_unsolved(context, found))))


def _unsolved(context: Context, item: EquilibriumStability) -> str:
    """Why the conditions of an equilibrium are not solved for the parameter that was asked for."""
    symbol, where = context.symbol, [r for r in (item.routh, *(c.routh for c in item.cases)) if r is not None]
    if symbol in context.put:
        why = f"the equilibrium exists at {symbol} = {context.put[symbol]} only"
    elif not where:
        why = "there are no Routh-Hurwitz conditions here"
    elif not any(symbol in r.symbols for r in where):
        why = f"{symbol} does not occur in the characteristic polynomial"
    else:
        why = next((r.message for r in where if r.message), "the budget ended before the conditions")
    return f"not solved for {symbol}: {why}"


def _item(
    context: Context,
    equilibrium: EquilibriumPoint | EquilibriumSet,
    ends: tuple[EquilibriumPoint, ...] | None,
) -> EquilibriumStability:
    if "0" not in equilibrium.mode:
        return smooth_stability(context, equilibrium)
    if isinstance(equilibrium, EquilibriumSet):
        return set_stability(context, equilibrium, ends)
    if in_contact(context, equilibrium.mode):
        return contact_stability(context, equilibrium)
    return sliding_stability(context, equilibrium)
