"""The list of public names in docs/api.md, one line each: python docs/names.py writes it anew.

A line is the first sentence of the docstring. `tests/test_docs.py` asks that the list is the one that is
written here.
"""

from __future__ import annotations

import importlib
import inspect
import re
from pathlib import Path

PAGE = Path(__file__).parent / "api.md"
PACKAGES = ("filippov", "filippov.analysis", "filippov.plot", "filippov.graphs", "filippov.interop")
HEAD, END = "## All names in one line each\n", "## Short names\n"
INTRO = """
The first sentence of each docstring, by the package that the name is imported from; `help(name)` shows
the rest.
`python docs/names.py` writes this list.
"""


def listed() -> str:
    """The list as it is to stand on the page."""
    parts = [INTRO]
    for package in PACKAGES:
        module = importlib.import_module(package)
        own = {name: getattr(module, name) for name in module.__all__}
        of_sympy = [name for name, value in own.items() if _home(value) != "filippov"]
        ours = sorted(set(own) - set(of_sympy), key=lambda name: (name.lower(), name))
        lines = [f"- `{name}`: {first_sentence(own[name])}" for name in ours]
        if of_sympy:
            lines.append(f"- of sympy: {', '.join(f'`{name}`' for name in of_sympy)}")
        parts.append(f"\n**`{package}`**\n\n" + "\n".join(lines) + "\n")
    return "".join(parts)


def _home(value: object) -> str:
    """The package that a name is made in."""
    return str(getattr(inspect.getmodule(value), "__name__", "")).partition(".")[0]


def first_sentence(value: object) -> str:
    """Of a docstring, in one line."""
    text = " ".join((inspect.getdoc(value) or "").split("\n\n")[0].split())
    return re.split(r"(?<=[.:;])\s+(?=[A-Z])", text)[0].rstrip(":")


def with_list(page: str) -> str:
    """The page with the list between its headings."""
    before, _, rest = page.partition(HEAD)
    return before + HEAD + listed() + "\n" + END + rest.partition(END)[2]


if __name__ == "__main__":
    PAGE.write_text(with_list(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
