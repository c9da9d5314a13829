"""The report as one self-contained HTML page: escaped text, tables, figures inline as SVG; no script."""

from __future__ import annotations

import os
import platform
import re
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from importlib import resources
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, Any

from filippov.app.report.part import Picture, Section, Table, Words
from filippov.base.escape import LINES, markup, printable

if TYPE_CHECKING:
    from jinja2 import Environment

_DROP = re.compile(r"<\?xml.*?\?>|<!DOCTYPE.*?>|<metadata>.*?</metadata>|<!--.*?-->", re.DOTALL)
_SPACES = re.compile(r'\s+(?:xmlns(?::\w+)?|version)="[^"]*"')
_NUMBER = re.compile(r"[-+−]?(\d[\d.,]*([eE][-+]?\d+)?|∞)|—|")
PACKAGES = ("filippov", "numpy", "scipy", "sympy", "networkx", "llvmlite", "matplotlib")


class Facts(dict[str, float]):
    """Values by name, for format_map; what was not computed says so.

    cycle_<case>_<k>, fold_<case>; change_<case> of the set's stability, change_rest_<case> by the linearised
    return map; bound_<case> of Routh-Hurwitz; jump_<case> of the map at 0; end_value, end_parameter,
    least_value, least_parameter of the fold curve; relative_fold_<case> of the smoother model; ratio_<k>,
    algebra_<k> of the k-th law; safe: the border for every end of the experiment's intervals
    """

    def __missing__(self, key: str) -> _Unknown:
        return _Unknown()


class _Unknown:
    def __format__(self, spec: str) -> str:
        return "(not computed)"


def told(texts: Iterable[tuple[str, str]], facts: Facts) -> list[tuple[str, str]]:
    """(title, paragraph) with the facts put in; a quick study does not compute all that one may speak of."""
    made = [(title, text.format_map(facts)) for title, text in texts]
    return [(title, text) for title, text in made if "(not computed)" not in text]


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
    title: str, subtitle: str, sections: Sequence[Section], texts: Mapping[str, Any],
    drawings: Mapping[str, str],
) -> str:  # fmt: skip
    """The whole page: those of the sections that have parts, each after its own paragraphs of `texts`.

    texts     (title, paragraph) by anchor, and by "figure NAME" the captions; drawings: SVG by name
    """
    facts = Facts({name: value for section in sections for name, value in section.facts.items()})
    folder = resources.files("filippov.app.report")
    page, style = (folder.joinpath(name).read_text(encoding="utf-8") for name in ("page.html", "page.css"))
    shown = []
    for section in sections:
        words = [Words("p", text) for title, text in told(texts.get(section.anchor, ()), facts) if not title]
        parts = [_prepared(part, texts, facts, drawings) for part in (*words, *section.parts)]
        shown += [{"anchor": section.anchor, "title": section.title, "parts": parts}] if section.parts else []
    template = environment().from_string(page)
    return template.render(title=title, subtitle=subtitle, sections=shown, style=style)


def _prepared(
    part: Table | Picture | Words, texts: Mapping[str, Any], facts: Facts, drawings: Mapping[str, str]
) -> dict[str, Any]:
    """What the template shows of a part."""
    if isinstance(part, Words):
        return {"kind": part.kind, "content": part.content}
    if isinstance(part, Table):
        return {"kind": "table", "content": part}
    own = " ".join(text for _, text in told(texts.get(f"figure {part.label}", ()), facts))
    svg = inline_svg(drawings[part.name], f"f-{part.name}", part.title)
    return {"kind": "figure", "content": part, "caption": part.caption or own, "svg": svg}


def inline_svg(svg: str, name: str, label: str) -> str:
    """The svg element of a file, for use within a page: no prologue, its own names, a label for readers."""
    body = _DROP.sub("", svg).strip()
    head, _, rest = body.partition(">")
    body = _SPACES.sub("", head) + ">" + rest
    body = body.replace("xlink:href=", "href=")
    body = re.sub(r'\bid="([^"]+)"', rf'id="{name}-\1"', body)
    body = re.sub(r'href="#([^"]+)"', rf'href="#{name}-\1"', body)
    body = re.sub(r"url\(#([^)]+)\)", rf"url(#{name}-\1)", body)
    return body.replace("<svg", f'<svg role="img" aria-label="{markup(label)}"', 1)


def wrapped(text: str, width: int = 112) -> str:
    """Text with its own line breaks; long sentences are wrapped under their beginning."""
    lines = []
    for line in text.rstrip().splitlines():
        indent = " " * (len(line) - len(line.lstrip(" *-")))
        folded = textwrap.wrap(line, width, subsequent_indent=indent, break_long_words=False)
        lines += folded if len(line) > width else [line]
    return "\n".join(lines)


def alignment(table: Table) -> list[str]:
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
    for name in PACKAGES:
        try:
            out[name] = version(name)
        except PackageNotFoundError:
            out[name] = "not installed"
    return out


def _processor() -> str:
    """The processor's name where the system tells it."""
    try:
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()
