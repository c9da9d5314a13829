"""A bank of the earlier form, whose expectations are understood by name, in today's form.

    python tests/migrate_bank.py cases.json bank.json

What is not carried over, and what had to be guessed, is told line by line; `filippov bank migrate` does the
same.
"""

from __future__ import annotations

import sys
from pathlib import Path

from filippov.app.bank import migrate_bank
from filippov.base.json_text import json_text


def main(source: str, target: str) -> None:
    bank, said = migrate_bank(source)
    Path(target).write_text(json_text(bank), encoding="utf-8")
    print("\n".join(said))
    left = sum("not carried over" in line for line in said)
    print(f"{len(bank['cases'])} cases written to {target}; {left} things not carried over")


if __name__ == "__main__":
    main(*sys.argv[1:])
