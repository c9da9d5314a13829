"""A comparison of solutions as one HTML page: its table, its sentences and its picture; no script."""

from __future__ import annotations

import io
from typing import Any

from filippov.base.escape import markup

STYLE = (
    "body{font:15px/1.5 sans-serif;max-width:75em;margin:2em auto;padding:0 1em;color:#222}"
    "table{border-collapse:collapse;font-size:13px}th,td{padding:2px 10px;text-align:right}"
    "th:first-child,td:first-child,th:last-child,td:last-child{text-align:left}"
    "th{border-bottom:1px solid #888}svg{width:100%;height:auto}"
)


def page(comparison: Any, title: str = "Exact solution and approximations") -> str:
    """The page as text. The picture is left out where matplotlib is missing."""
    rows = [
        "<tr>" + "".join(f"<td>{markup(cell)}</td>" for cell in line) + "</tr>" for line in comparison.cells
    ]
    head = "".join(f"<th>{markup(word)}</th>" for word in comparison.head)
    parts = [
        f"<h1>{markup(title)}</h1>", _picture(comparison),
        f"<table><thead><tr>{head}</tr></thead><tbody>{''.join(rows)}</tbody></table>",
        "<h2>Orders in the width</h2>", _list(tuple(trend.sentence for trend in comparison.trends)),
    ]  # fmt: skip
    for name, sentences in comparison.paragraphs():
        parts += [f"<h2>{markup(name.rstrip(':'))}</h2>", _list(sentences)]
    return (
        f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"><title>{markup(title)}</title>'
        f"<style>{STYLE}</style></head><body>\n" + "\n".join(parts) + "\n</body></html>\n"
    )


def _list(sentences: tuple[str, ...]) -> str:
    return "<ul>" + "".join(f"<li>{markup(sentence)}</li>" for sentence in sentences) + "</ul>"


def _picture(comparison: Any) -> str:
    try:
        figure = comparison.plot()
    except ImportError:
        return ""
    from matplotlib import pyplot as plt

    drawn = io.StringIO()
    figure.savefig(drawn, format="svg", metadata={"Date": None})
    plt.close(figure)
    text = drawn.getvalue()
    return text[text.index("<svg") :]
