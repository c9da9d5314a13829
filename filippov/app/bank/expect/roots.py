"""What is expected of a polynomial: where its roots lie, and for which parameters it is stable."""

from __future__ import annotations

import itertools
import random
import re
from collections.abc import Mapping
from typing import Any

import numpy as np
import sympy
from sympy import Expr, Symbol

from filippov.analysis.algebra.polynomial import Verdict, count_roots
from filippov.app.bank.case import number
from filippov.app.bank.notation import formula
from filippov.app.bank.outcome import Ask, Outcome, reads
from filippov.app.bank.polynomial import Polynomial
from filippov.app.bank.reason import MissingError, NotUnderstoodError
from filippov.base.errors import ModelError, UsageError
from filippov.model.expression import parse_condition

ROOT = "polynomial"
SAMPLES = 96
_NEAR_ZERO = 1e-12


def _counts(polynomial: Polynomial) -> Any:
    if polynomial.routh.counts is not None:
        return polynomial.routh.counts
    raise MissingError(polynomial.routh.message or "the polynomial has parameters that are not given")


@reads(
    r"rhp_axis_lhp|roots_rhp_axis_lhp", "[number of roots right of, on and left of the imaginary axis]", ROOT
)
def _places(ask: Ask, _match: re.Match[str]) -> Any:
    counts = _counts(ask.polynomial)
    return [counts.rhp, counts.axis, counts.lhp]


@reads(
    r"(?:n_?|number_of_)?(?P<what>rhp|axis|lhp)(?:_roots|_poles|_zeros|_count)?|sign_changes"
    r"|(?:n_|number_of_)?(?P<un>un)?(?P<stable>stable)_(?:roots|poles)",
    "number of roots right of, on or left of the axis",
    ROOT,
)
def _one_place(ask: Ask, match: re.Match[str]) -> Any:
    what = "lhp" if match["stable"] and not match["un"] else "rhp"
    return getattr(_counts(ask.polynomial), match["what"] or what)


@reads(r"roots|poles|zeros", "all roots as [real, imaginary], in any order", ROOT)
def _roots(ask: Ask, _match: re.Match[str]) -> Any:
    return _compare_roots(ask, ask.polynomial.roots(), _as_roots(ask, ask.entry.value))


def _as_roots(ask: Ask, value: Any) -> list[complex]:
    if not isinstance(value, list):
        raise NotUnderstoodError("roots are no list")
    out = []
    for item in value:
        pair = item if isinstance(item, list) else [item, "0"]
        if len(pair) != 2:
            raise NotUnderstoodError("a root is [real, imaginary]")
        out.append(complex(ask.number(pair[0]), ask.number(pair[1])))
    return out


def _compare_roots(ask: Ask, got: list[complex], wanted: list[complex]) -> Outcome:
    from scipy.optimize import linear_sum_assignment

    if len(got) != len(wanted):
        return Outcome(float(abs(len(got) - len(wanted))), 0.0, f"{len(got)} roots, expected {len(wanted)}")
    gaps = np.abs(np.array(got)[:, None] - np.array(wanted)[None, :])
    rows, columns = linear_sum_assignment(gaps)
    error = float(np.max(gaps[rows, columns], initial=0.0))
    return Outcome(error, ask.entry.tol, "" if error <= ask.entry.tol else "the roots differ")


@reads(
    r"stable|is_stable|verdict|stability",
    "true or false, or the words stable, marginally stable, unstable",
    ROOT,
)
def _verdict(ask: Ask, _match: re.Match[str]) -> Outcome:
    return judge(_verdict_of(ask.polynomial), str(ask.entry.value))


@reads(r"(?:is_)?(?P<what>unstable|marginally_stable|marginal)", "true or false", ROOT)
def _verdict_is(ask: Ask, match: re.Match[str]) -> Outcome:
    word = str(ask.entry.value).strip().casefold()
    said = {"true": True, "yes": True, "false": False, "no": False}.get(word)
    if said is None:
        raise NotUnderstoodError("it is neither true nor false")
    wanted = Verdict.UNSTABLE if match["what"] == "unstable" else Verdict.MARGINALLY_STABLE
    verdict = _verdict_of(ask.polynomial)
    right = (verdict is wanted) == said
    return Outcome(float(not right), 0.0, "" if right else f"the polynomial is {verdict.value}")


def _verdict_of(polynomial: Polynomial) -> Verdict:
    verdict = polynomial.routh.verdict
    if verdict is None:
        raise MissingError("the polynomial has parameters that are not given")
    return verdict


def judge(verdict: Verdict, text: str) -> Outcome:
    """Whether a verdict is what a text says."""
    word = text.strip().casefold()
    if word in ("true", "stable", "asymptotically stable", "yes"):
        right = verdict is Verdict.ASYMPTOTICALLY_STABLE
    elif word in ("false", "not stable", "no"):
        right = verdict is not Verdict.ASYMPTOTICALLY_STABLE
    elif word.startswith("marginal"):
        right = verdict is Verdict.MARGINALLY_STABLE
    elif word == "unstable":
        right = verdict is Verdict.UNSTABLE
    else:
        raise NotUnderstoodError(f"{text!r} is no verdict")
    return Outcome(0.0 if right else 1.0, 0.0, "" if right else f"{verdict.value}, expected {text}")


# -- parameters ----------------------------------------------------------------------------------------


@reads(
    r"stable_iff|stability_condition|hurwitz_iff|stable_when|stability_range",
    "a condition on the parameters, equivalent to stability",
    ROOT,
)
def _iff(ask: Ask, _match: re.Match[str]) -> Outcome:
    polynomial = ask.polynomial
    try:
        condition = parse_condition(
            str(ask.entry.value).replace("&", " and ").replace("^", "**"), polynomial.names
        )
    except ModelError as error:
        raise NotUnderstoodError(str(error)) from None
    found = polynomial.routh
    if found.status != "complete":
        raise MissingError(found.message)
    wrong, tried = 0, 0
    example = ""
    for point in _points(polynomial, condition):
        try:
            expected = condition.subs(point)
            got = found.stable_when if isinstance(found.stable_when, bool) else found.stable_when.subs(point)
        except (TypeError, ZeroDivisionError):
            continue
        if expected not in (sympy.true, sympy.false) or got not in (sympy.true, sympy.false):
            continue
        tried += 1
        # Exact counts of the roots at the point decide, whatever the conditions say.
        counted = stable_at(polynomial, point)
        if not (expected == got == counted):
            wrong += 1
            example = ", ".join(f"{k} = {v}" for k, v in point.items())
    if tried < 20:
        raise MissingError("the condition could be tried at too few points")
    return Outcome(float(wrong), 0.0, f"the conditions differ at {example}" if wrong else "")


def stable_at(polynomial: Polynomial, point: Mapping[Symbol, Expr]) -> Any:
    """Whether all roots are left of the axis at a point of the parameters; None where all vanish."""
    numbers = [c.subs(point) for c in polynomial.coefficients]
    try:
        return sympy.true if count_roots(numbers).verdict is Verdict.ASYMPTOTICALLY_STABLE else sympy.false
    except UsageError:
        return None


def _points(polynomial: Polynomial, condition: Any) -> list[dict[Symbol, Expr]]:
    """Rational points: at random of several sizes, and just beside the boundaries of the condition."""
    symbols = sorted(polynomial.symbols, key=str)
    draw = random.Random(20)  # noqa: S311
    numbers = {abs(int(n)) for n in condition.atoms(sympy.Integer)} | {1, 10}
    points = []
    for k in range(SAMPLES):
        size = sorted(numbers)[k % len(numbers)] or 1
        point = {x: sympy.Rational(draw.randint(-300, 600), 300) * size for x in symbols}
        points.append(point)
        x = symbols[k % len(symbols)] if symbols else None
        for relation in condition.atoms(sympy.core.relational.Relational) if x is not None and k < 16 else ():
            points += _beside(relation, point, x)
    return points


def _beside(relation: Any, point: dict[Symbol, Expr], x: Symbol) -> list[dict[Symbol, Expr]]:
    """Points 1e-6 to either side of where a relation turns over, along one parameter."""
    rest = {key: value for key, value in point.items() if key != x}
    gap = sympy.together((relation.lhs - relation.rhs).subs(rest))
    if not gap.free_symbols:
        return []
    top = sympy.Poly(sympy.numer(gap), x) if sympy.numer(gap).is_polynomial(x) else None
    if top is None or top.degree() not in (1, 2):
        return []
    out = []
    for root in top.nroots(n=20):
        if root.is_real:
            value = sympy.Rational(str(root))
            out += [
                {**rest, x: value + shift * (1 + abs(value))}
                for shift in (sympy.Rational(1, 10**6), -sympy.Rational(1, 10**6))
            ]
    return out


@reads(
    r"at_(?P<values>\w+=.+)",
    "[real, imaginary] of a root at these values (a pair with its conjugate), or a verdict",
    ROOT,
)
def _at(ask: Ask, match: re.Match[str]) -> Any:
    values = _assigned(ask, match["values"])
    polynomial = ask.polynomial.at(values)
    value = ask.entry.value
    if isinstance(value, str):
        return judge(_verdict_of(polynomial), value)
    wanted = _as_roots(ask, value if value and isinstance(value[0], list) else [value])
    got = polynomial.roots()
    both = wanted if len(wanted) > 1 else [wanted[0], wanted[0].conjugate()]
    error = max(min(abs(root - w) for root in got) for w in both)
    return Outcome(float(error), ask.entry.tol, "" if error <= ask.entry.tol else "no such root")


def _assigned(ask: Ask, text: str) -> dict[str, Expr]:
    out = {}
    for piece in re.split(r",|\band\b|_(?=[A-Za-z]\w*=)", text):
        name, equals, value = piece.partition("=")
        if not equals or not isinstance(ask.names.get(name.strip()), Symbol):
            raise NotUnderstoodError(f"{piece!r} gives no parameter a value")
        try:
            out[name.strip()] = sympy.Rational(str(formula(value, {})))
        except (ModelError, TypeError, ValueError):
            raise NotUnderstoodError(f"{value!r} is no number") from None
    return out


@reads(r"samples|examples", "text {(K=1,T=1):stable, (K=1,T=1/9):axis pair +-j sqrt(3), ...}", ROOT)
def _samples(ask: Ask, _match: re.Match[str]) -> Outcome:
    pairs = re.findall(
        r"\(((?:\w+\s*=[^(),]+,?\s*)+)\)\s*:\s*((?:[^,{}()]|\([^()]*\))+)", str(ask.entry.value)
    )
    if not pairs:
        raise NotUnderstoodError("no pairs (values):verdict were found")
    for values, said in pairs:
        polynomial = ask.polynomial.at(_assigned(ask, values))
        axis = re.fullmatch(r"axis pair \+-\s*j\s*(.+)", said.strip())
        outcome = _pair(ask, polynomial, axis[1]) if axis else judge(_verdict_of(polynomial), said)
        if not outcome.passed:
            return outcome
    return Outcome(0.0, 0.0)


def _pair(ask: Ask, polynomial: Polynomial, text: str) -> Outcome:
    try:
        frequency = number(text.strip(), ask.names)
    except ModelError as error:
        raise NotUnderstoodError(str(error)) from None
    counts = _counts(polynomial)
    gap = min(abs(root - 1j * frequency) for root in polynomial.roots())
    right = counts.axis >= 2 and gap <= max(ask.entry.tol, _NEAR_ZERO * (1 + frequency))
    return Outcome(
        0.0 if right else max(float(gap), 1.0), 0.0, "" if right else f"no pair at {frequency:.9g} j"
    )


@reads(
    r"boundary|critical",
    "text 'a b=c gives +-j sqrt(d)': where the equation holds, that pair lies on the axis",
    ROOT,
)
def _boundary(ask: Ask, _match: re.Match[str]) -> Outcome:
    match = re.fullmatch(r"\s*([^=]+)=([^=]+?)\s+gives\s+\+-\s*j\s*(.+?)\s*", str(ask.entry.value))
    if match is None:
        raise NotUnderstoodError("the text is no equation that gives a pair")
    try:
        gap = formula(match[1], ask.names) - formula(match[2], ask.names)
        frequency = formula(match[3], ask.names)
    except ModelError as error:
        raise NotUnderstoodError(str(error)) from None
    x = next((s for s in ask.polynomial.symbols if sympy.degree(gap, s) == 1), None)
    if x is None:
        raise NotUnderstoodError("the equation is not linear in a parameter")
    value = sympy.solve(gap, x)[0]
    rest = [s for s in ask.polynomial.symbols if s != x]
    for numbers in itertools.product(
        (sympy.Rational(1, 3), sympy.Integer(2), sympy.Rational(7, 2)), repeat=len(rest)
    ):
        point = dict(zip(rest, numbers, strict=True))
        at = {**point, x: value.subs(point)}
        given = ask.polynomial.at({s.name: v for s, v in at.items()})
        outcome = _pair(ask, given, str(frequency.subs(at)))
        if not outcome.passed:
            return outcome
    return Outcome(0.0, 0.0)
