"""Names of what is expected of a polynomial."""

from __future__ import annotations

import re
from typing import Any

from sympy import Symbol

from filippov.app.bank.expectation import numbers
from filippov.app.bank.migrate.rule import Groups, Old, Reading, Rules
from filippov.app.bank.notation import formula
from filippov.app.bank.outcome import NotUnderstoodError
from filippov.app.bank.polynomial import Polynomial
from filippov.app.bank.quantities.polynomials import (
    AxisFrequencies,
    AxisPair,
    RootCounts,
    RootDistance,
    Roots,
    StabilityCondition,
    StabilityVerdict,
    StableRange,
)
from filippov.model.expression import parse_condition

_STABLE, _MARGINAL, _UNSTABLE = "asymptotically stable", "marginally stable", "unstable"
_MEANT = {
    word: verdicts for words, verdicts in (
        (("true", "stable", "asymptotically stable", "yes"), (_STABLE,)), (("marginal",), (_MARGINAL,)),
        (("false", "not stable", "no"), (_MARGINAL, _UNSTABLE)), (("unstable",), (_UNSTABLE,)),
    ) for word in words
}  # fmt: skip
_NEAR_ZERO = 1e-12
_FEW = 6


def _one_count(old: Old, g: Groups) -> list[Reading]:
    what = "lhp" if g["stable"] and not g["un"] else g["what"] or "rhp"
    take: Any = {"lhp": "left", "rhp": "right", "axis": "axis"}[what]
    return old.one(RootCounts(take))


def _pairs(old: Old, value: Any) -> list[list[Any]]:
    if not isinstance(value, list):
        raise NotUnderstoodError("roots are no list")
    pairs = [item if isinstance(item, list) else [item, "0"] for item in value]
    if any(len(pair) != 2 for pair in pairs):
        raise NotUnderstoodError("a root is [real, imaginary]")
    numbers(pairs, old.subject)
    return pairs


def verdicts(old: Old, text: str, at: dict[str, Any]) -> list[Reading]:
    """What a text says of stability."""
    # A remark in brackets at the end is prose.
    word = re.sub(r"\s+\([^()]*\)\s*$", "", text).strip().casefold()
    chosen = _MEANT.get("marginal" if word.startswith("marginal") else word)
    if chosen is None:
        raise NotUnderstoodError(f"{text!r} is no verdict")
    return [Reading((old.e(StabilityVerdict(at), text=said),)) for said in chosen]


def _verdict_is(old: Old, g: Groups) -> list[Reading]:
    word = old.text.strip().casefold()
    if word not in ("true", "yes", "false", "no"):
        raise NotUnderstoodError("it is neither true nor false")
    named = _UNSTABLE if g["what"] == "unstable" else _MARGINAL
    true = word in ("true", "yes")
    others = [said for said in (_STABLE, _MARGINAL, _UNSTABLE) if (said == named) == true]
    return [Reading((old.e(StabilityVerdict(), text=said),)) for said in others]


def _iff(old: Old, _: Groups) -> list[Reading]:
    text = old.text.replace("&", " and ").replace("^", "**")
    parse_condition(text, old.subject.names)
    return old.one(StabilityCondition(text), value=0, atol=0)


def _at(old: Old, g: Groups) -> list[Reading]:
    at = _assigned(old, g["values"])
    if isinstance(old.value, str):
        return verdicts(old, old.value, at)
    value = old.value
    rows = _pairs(old, value if value and isinstance(value[0], list) else [value])
    wanted = [(old.number(a), old.number(b)) for a, b in rows]
    both = wanted if len(wanted) > 1 else [*wanted, (wanted[0][0], -wanted[0][1])]
    return [Reading(tuple(old.e(RootDistance(root, at), value=0) for root in both))]


def _frequency_at(old: Old, g: Groups) -> list[Reading]:
    """The frequency of a pair on the axis at values of the parameters."""
    root = (0.0, float(old.wanted()))
    return [Reading((old.e(RootDistance(root, _assigned(old, g["values"])), value=0),))]


def _assigned(old: Old, text: str) -> dict[str, Any]:
    out: dict[str, Any] = {}
    for piece in re.split(r",|\band\b|_(?=[A-Za-z]\w*=)", text):
        name, equals, value = piece.partition("=")
        if not equals or not isinstance(old.subject.names.get(name.strip()), Symbol):
            raise NotUnderstoodError(f"{piece!r} gives no parameter a value")
        old.number(value.strip())
        out[name.strip()] = value.strip()
    return out


def _samples(old: Old, _: Groups) -> list[Reading]:
    pairs = re.findall(r"\(((?:\w+\s*=[^(),]+,?\s*)+)\)\s*:\s*((?:[^,{}()]|\([^()]*\))+)", old.text)
    if not pairs:
        raise NotUnderstoodError("no pairs (values):verdict were found")
    found: list[Any] = []
    for values, said in pairs:
        at = _assigned(old, values.rstrip(", "))
        axis = re.fullmatch(r"axis pair \+-\s*j\s*(.+)", said.strip())
        if axis is None:
            chosen = verdicts(old, said, at)
            if len(chosen) > 1:
                raise NotUnderstoodError(f"{said!r} is no verdict")
            found += chosen[0].expectations
            continue
        frequency = old.number(axis[1].strip())
        near = max(old.tol, _NEAR_ZERO * (1 + frequency))
        found.append(old.e(RootDistance((0.0, frequency), at), value=0, atol=near))
        found.append(old.e(RootCounts("axis", at), least=2, atol=0))
    return [Reading(tuple(found))]


def _boundary(old: Old, _: Groups) -> list[Reading]:
    match = re.fullmatch(r"\s*([^=]+=[^=]+?)\s+gives\s+\+-\s*j\s*(.+?)\s*", old.text)
    if match is None:
        raise NotUnderstoodError("the text is no equation that gives a pair")
    for text in (*match[1].split("="), match[2]):
        formula(text, old.subject.names)
    return old.one(AxisPair(match[1], match[2]), value=0, atol=max(old.tol, _NEAR_ZERO))


def _parameter(old: Old, name: str) -> str:
    """The one parameter, which may be called gain or parameter."""
    assert isinstance(old.subject, Polynomial)
    symbols = old.subject.free
    if len(symbols) != 1 or name not in (symbols[0].name, "gain", "parameter"):
        raise NotUnderstoodError(f"{name!r} is not the one parameter of the polynomial")
    return str(symbols[0].name)


def _extreme(old: Old, g: Groups) -> list[Reading]:
    take: Any = {"max": "largest", "min": "least"}.get(g["what"] or "", "interval")
    return old.one(StableRange(_parameter(old, g["name"]), take))


def _critical(old: Old, g: Groups) -> list[Reading]:
    name = g["name"]
    if name in ("frequency", "omega", "w"):
        return _frequencies(old)
    parameter = _parameter(old, name)
    return old.either(*(StableRange(parameter, "boundaries", k + 1) for k in range(_FEW)))


def _frequencies(old: Old) -> list[Reading]:
    return old.either(*(AxisFrequencies(k + 1) for k in range(_FEW)))


RULES: Rules = (
    (r"rhp_axis_lhp roots_rhp_axis_lhp", lambda o, _: o.one(RootCounts())),
    ((r"(?:n_?|number_of_)?(?P<what>rhp|axis|lhp)(?:_roots|_poles|_zeros|_count)? sign_changes "
     r"(?:n_|number_of_)?(?P<un>un)?(?P<stable>stable)_(?:roots|poles)"),
     _one_count),
    (r"roots poles zeros", lambda o, _: o.one(Roots(), value=_pairs(o, o.value), order="any")),
    (r"stable is_stable verdict stability", lambda o, _: verdicts(o, o.text, {})),
    (r"(?:is_)?(?P<what>unstable|marginally_stable|marginal)", _verdict_is),
    (r"stable_iff stability_condition hurwitz_iff stable_when stability_range", _iff),
    (r"at_(?P<values>\w+=.+)", _at),
    (r"(?:omega|frequency|w)_at_(?P<values>\w+=.+)", _frequency_at),
    (r"samples examples", _samples),
    (r"boundary critical", _boundary),
    ((r"(?P<name>\w+?)_(?P<what>max|min|range)(?:_stable)? (?P<what>max|min)_(?P<name>\w+) "
     r"stable_(?P<name>\w+)_range"),
     _extreme),
    (r"(?P<name>\w+?)_(?:critical|crit|marginal|limit) (?:critical|marginal|ultimate|limiting)_(?P<name>\w+)",
     _critical),
    (r"(?:oscillation|axis|crossover|jw)_frequency axis_omega", lambda o, _: _frequencies(o)),
)  # fmt: skip
