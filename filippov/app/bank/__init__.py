"""A bank of cases: published systems as text with reference values, read, solved and compared."""

from filippov.app.bank.case import Case, read_bank
from filippov.app.bank.expectation import Expectation
from filippov.app.bank.form import schema
from filippov.app.bank.migrated import migrate_bank
from filippov.app.bank.row import Row, rows_json, rows_text
from filippov.app.bank.run import run_bank, run_case

__all__ = [
    "Case", "Expectation", "Row", "migrate_bank", "read_bank", "rows_json", "rows_text", "run_bank",
    "run_case", "schema",
]  # fmt: skip
