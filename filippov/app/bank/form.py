"""The form of a bank: what a case may say, as dataclasses, and the JSON Schema made from them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from filippov.app.bank import quantities, typed_json
from filippov.app.bank.expectation import Expectation
from filippov.app.bank.notation import Number
from filippov.app.bank.system_form import SystemForm

__all__ = ["BankForm", "CaseForm", "quantities", "read_case", "schema"]


@dataclass(frozen=True)
class _Whole:
    id: str
    expected: tuple[Expectation, ...]


@dataclass(frozen=True)
class CaseForm(SystemForm, _Whole):
    """A system, or a polynomial, and what is expected of it.

    id          its name; --only takes it, or the part before the first _
    polynomial  in place of a system: coefficients, highest power first, numbers or formulas in parameters
    parts       systems of its own by label, with the case's params where they have none
    about       sources and notes, in any form
    """

    polynomial: tuple[Number, ...] | None = None
    parts: dict[str, SystemForm] | None = None
    about: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class BankForm:
    """A file of cases."""

    cases: tuple[CaseForm, ...]
    about: dict[str, Any] = field(default_factory=dict)


def read_case(given: Mapping[str, Any]) -> CaseForm:
    """A checked case of this form. Raises ModelError that names what is wrong, and where."""
    case: CaseForm = typed_json.read(CaseForm, given, "the case")
    return case


def schema() -> dict[str, Any]:
    """The JSON Schema (draft 2020-12) of a bank."""
    return typed_json.schema(BankForm, "A bank of cases for filippov")
