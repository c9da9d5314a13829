"""The report as one self-contained HTML page: escaped text, tables, figures inline as SVG; no script."""

from __future__ import annotations

import os
import platform
import re
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import replace
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

from filippov.app.report.facts import Facts, Numbers, begun
from filippov.app.report.part import Chapter, Picture, TextTable, Words
from filippov.base.escape import LINES, markup, printable
from filippov.base.version import installed

if TYPE_CHECKING:
    from jinja2 import Environment

_DROP = re.compile(r"<\?xml.*?\?>|<!DOCTYPE.*?>|<metadata>.*?</metadata>|<!--.*?-->", re.DOTALL)
_SPACES = re.compile(r'\s+(?:xmlns(?::\w+)?|version)="[^"]*"')
_NUMBER = re.compile(r"[-+−]?(\d[\d.,]*([eE][-+]?\d+)?|∞)|—|")
# Sections that may consist of text alone.
ALONE = {"differences"}
PACKAGES = ("filippov", "numpy", "scipy", "sympy", "networkx", "llvmlite", "matplotlib")


def environment() -> Environment:
    """Templates in which every text is escaped. Raises ImportError without jinja2."""
    try:
        from jinja2 import Environment, StrictUndefined
    except ImportError:
        raise ImportError(
            "reports need jinja2, which is not installed: pip install filippov[report]"
        ) from None
    out = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True,
        finalize=lambda value: value if hasattr(value, "__html__") else printable(value, LINES),
    )  # fmt: skip
    out.filters |= {"alignment": alignment, "wrapped": wrapped}
    return out


def document(
    title: str, subtitle: str, sections: Sequence[Chapter], texts: Mapping[str, Any],
    drawings: Mapping[str, str], appendix: Sequence[Chapter] = (),
) -> str:  # fmt: skip
    """The whole page: the sections with content, each after its own paragraphs of `texts`.

    texts     (title, paragraph) by anchor, and by "figure NAME" the captions; drawings: SVG by name

    Sections, figures and tables are numbered in order; long tables go to the appendix.
    """
    facts = Facts({name: value for section in sections for name, value in section.facts.items()})
    every = [part for section in sections for part in section.parts]
    tables = [part for part in every if isinstance(part, TextTable) and part.long]
    short = [replace(s, parts=[part for part in s.parts if part not in tables]) for s in sections]
    main = [s for s in short if s.parts or s.anchor in ALONE & set(texts)]
    behind = [*([Chapter("tables", "Long tables", tables)] if tables else []), *appendix]
    numbers, shown = Numbers(main, behind), []
    for section in (*main, *behind):
        told = numbers.told(texts.get(section.anchor, ()), facts)
        titled = [words for words in told if words[0]]
        parts = [*(Words("p", text) for title, text in told if not title),
                 *([Words("dl", titled)] if titled else []), *section.parts]  # fmt: skip
        number = numbers[f"section {section.anchor}"][0].split()[-1]
        shown.append({
            "anchor": section.anchor, "title": section.title, "number": number,
            "parts": [_prepared(part, texts, facts, numbers, drawings) for part in parts],
        })  # fmt: skip
    folder = resources.files("filippov.app.report")
    page, style = (folder.joinpath(name).read_text(encoding="utf-8") for name in ("page.html", "page.css"))
    made = environment()
    made.filters |= {"linked": numbers.linked, "coded": numbers.coded}
    return made.from_string(page).render(title=title, subtitle=subtitle, sections=shown, style=style)


def _prepared(
    part: TextTable | Picture | Words, texts: Mapping[str, Any], facts: Facts, numbers: Numbers,
    drawings: Mapping[str, str],
) -> dict[str, Any]:  # fmt: skip
    """The template's variables for a part."""
    if isinstance(part, Words):
        return {"kind": part.kind, "content": part.content}
    if isinstance(part, TextTable):
        number, place = numbers[f"table {part.label}"]
        return {"kind": "table", "content": part, "number": begun(number), "place": place}
    said = texts.get(f"figure {part.label or part.name}", ())
    own = " ".join(text for _, text in numbers.told(said, facts))
    svg = inline_svg(drawings[part.name], f"f-{part.name}", part.title)
    caption = " ".join(filter(None, (own, part.caption)))
    number = begun(numbers[f"figure {part.name}"][0])
    return {"kind": "figure", "content": part, "caption": caption, "svg": svg, "number": number}


def inline_svg(svg: str, name: str, label: str) -> str:
    """The svg element of a file, for use in a page: no prologue, unique names, a label for screen readers."""
    body = _DROP.sub("", svg).strip()
    head, _, rest = body.partition(">")
    body = _SPACES.sub("", head) + ">" + rest
    body = body.replace("xlink:href=", "href=")
    body = re.sub(r'\bid="([^"]+)"', rf'id="{name}-\1"', body)
    body = re.sub(r'href="#([^"]+)"', rf'href="#{name}-\1"', body)
    body = re.sub(r"url\(#([^)]+)\)", rf"url(#{name}-\1)", body)
    return body.replace("<svg", f'<svg role="img" aria-label="{markup(label)}"', 1)


def wrapped(text: str, width: int = 112) -> str:
    """Text with its line breaks; long sentences are wrapped with a hanging indent."""
    lines = []
    for line in text.rstrip().splitlines():
        indent = " " * (len(line) - len(line.lstrip(" *-")))
        folded = textwrap.wrap(line, width, subsequent_indent=indent, break_long_words=False)
        lines += folded if len(line) > width else [line]
    return "\n".join(lines)


def alignment(table: TextTable) -> list[str]:
    """The class of each column: numbers are aligned on the right."""
    return [
        "num" if all(_NUMBER.fullmatch(row[k].strip()) for row in table.rows) else "text"
        for k in range(len(table.columns))
    ]


def machine() -> dict[str, str]:
    """Versions and the machine, in words."""
    out = {
        "Python": platform.python_version(), "system": platform.platform(), "processor": _processor(),
        "cores": str(os.cpu_count()),
    }  # fmt: skip
    return out | {name: installed(name) or "not installed" for name in PACKAGES}


def _processor() -> str:
    """The processor's name where the platform provides it."""
    try:
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()
