"""A surface asked for by the formula of its switching function, written either way round."""

from __future__ import annotations

from collections.abc import Sequence

from sympy import Expr
from sympy.printing.str import sstr

from filippov.base.errors import ModelError
from filippov.model.expression import parse_expression
from filippov.model.symbolic import SymbolicForm
from filippov.model.table import decimal, vanishes


def surface_name(h: Expr) -> str:
    """The text of h with a term in front that is not negative: "v - vb", never "-vb + v"."""
    text = str(h)
    if not text.startswith("-") or not h.is_Add:
        return text
    terms = [str(sstr(term, full_prec=False)) for term in h.as_ordered_terms()]
    first = next((term for term in terms if not term.startswith("-")), None)
    if first is None:
        return text
    rest = [term for term in terms if term is not first]
    return first + "".join(f" - {term[1:]}" if term.startswith("-") else f" + {term}" for term in rest)


def place_of(form: SymbolicForm, names: Sequence[str], text: str) -> tuple[int, int] | None:
    """The number of the surface that a name or formula means, and +1, or -1 where the formula is -h.

    None where it is neither a name nor +-h of a surface.
    """
    if text in names:
        return names.index(text), 1
    try:
        asked = decimal(parse_expression(text, form.names()))
    except ModelError:
        return None
    for i, h in enumerate(form.plain_h()):
        # Of a width that depends on parameters the system has h/width.
        width = form.widths[i] if form.widths else None
        known = decimal(h if width is None else h * width)
        if vanishes(known - asked):
            return i, 1
        if vanishes(known + asked):
            return i, -1
    return None
