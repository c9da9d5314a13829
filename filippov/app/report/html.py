"""One self-contained HTML page: escaped text, tables, figures inline as SVG; no script, nothing loaded."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterable, Sequence
from importlib import resources

from filippov.app.report.tables import Table
from filippov.base.escape import markup

_DROP = re.compile(r"<\?xml.*?\?>|<!DOCTYPE.*?>|<metadata>.*?</metadata>|<!--.*?-->", re.DOTALL)
_SPACES = re.compile(r'\s+(?:xmlns(?::\w+)?|version)="[^"]*"')


def escape(text: object) -> str:
    """Text for HTML."""
    return markup(text)


def inline_svg(svg: str, name: str, label: str) -> str:
    """The svg element of a file, for use within a page: no prologue, its own names, a label for readers."""
    body = _DROP.sub("", svg).strip()
    head, _, rest = body.partition(">")
    body = _SPACES.sub("", head) + ">" + rest
    body = body.replace("xlink:href=", "href=")
    body = re.sub(r'\bid="([^"]+)"', rf'id="{name}-\1"', body)
    body = re.sub(r'href="#([^"]+)"', rf'href="#{name}-\1"', body)
    body = re.sub(r"url\(#([^)]+)\)", rf"url(#{name}-\1)", body)
    return body.replace("<svg", f'<svg role="img" aria-label="{escape(label)}"', 1)


def figure(name: str, svg: str, title: str, caption: str, origin: str) -> str:
    """A figure with its caption and where it comes from."""
    told = f"{escape(caption)} " if caption else ""
    return (
        f'<figure id="figure-{escape(name)}">{inline_svg(svg, f"f-{name}", title)}'
        f"<figcaption><b>{escape(title)}.</b> {told}"
        f'<span class="source">Files: {escape(name)}.svg, {escape(name)}.png. {_source(origin)}</span>'
        "</figcaption></figure>"
    )


def table(content: Table) -> str:
    """A table with its note and source; columns of numbers are aligned on the right."""
    numeric = [all(_is_number(row[k]) for row in content.rows) for k in range(len(content.columns))]
    kind = ["num" if n else "text" for n in numeric]
    head = "".join(f'<th class="{k}">{escape(c)}</th>' for k, c in zip(kind, content.columns, strict=True))
    rows = "".join(
        "<tr>"
        + "".join(f'<td class="{k}">{escape(c)}</td>' for k, c in zip(kind, row, strict=True))
        + "</tr>\n"
        for row in content.rows
    )
    note = f'<p class="note">{escape(content.note)}</p>' if content.note else ""
    told = source(content.source) if content.source else ""
    return (
        f'<div class="table"><table><caption>{escape(content.title)}</caption>'
        f"<thead><tr>{head}</tr></thead>\n<tbody>{rows}</tbody></table>{note}{told}</div>"
    )


def section(anchor: str, title: str, parts: Iterable[str]) -> str:
    """A section of the page."""
    return f'<section id="{escape(anchor)}"><h2>{escape(title)}</h2>\n' + "\n".join(parts) + "</section>"


def paragraph(text: str) -> str:
    """A paragraph of plain text."""
    return f"<p>{escape(text)}</p>"


def source(text: str) -> str:
    """A line that says where something comes from; `...` is a command."""
    return f'<p class="source">{_source(text)}</p>'


def preformatted(text: str, width: int = 112) -> str:
    """Text with its own line breaks; long sentences are wrapped under their beginning."""
    lines = []
    for line in text.rstrip().splitlines():
        body = line.lstrip(" *-")
        indent = " " * (len(line) - len(body))
        wrapped = textwrap.wrap(line, width, subsequent_indent=indent, break_long_words=False)
        lines += wrapped if len(line) > width else [line]
    return f"<pre>{escape(chr(10).join(lines))}</pre>"


def definitions(items: Iterable[tuple[str, str]]) -> str:
    """Titles with their texts."""
    return "<dl>" + "".join(f"<dt>{escape(a)}</dt><dd>{escape(b)}</dd>" for a, b in items) + "</dl>"


def page(title: str, subtitle: str, sections: Sequence[tuple[str, str, str]]) -> str:
    """The whole document from (anchor, title, html) of its sections."""
    style = resources.files("filippov.app.report").joinpath("page.css").read_text(encoding="utf-8")
    contents = "".join(f'<li><a href="#{escape(a)}">{escape(t)}</a></li>' for a, t, _ in sections)
    body = "\n".join(content for _, _, content in sections)
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(title)}</title><style>\n{style}</style></head>\n<body><main>"
        f'<header><h1>{escape(title)}</h1><p class="subtitle">{escape(subtitle)}</p></header>'
        f"<nav><ol>{contents}</ol></nav>\n{body}\n</main></body></html>\n"
    )


def _source(text: str) -> str:
    """Plain text in which `...` is a command."""
    parts = escape(text).split("`")
    return "".join(f"<code>{part}</code>" if k % 2 else part for k, part in enumerate(parts))


def _is_number(cell: str) -> bool:
    return bool(re.fullmatch(r"[-+−]?(\d[\d.,]*([eE][-+]?\d+)?|∞)|—|", cell.strip()))
