"""Text from outside (names, messages, file names), escaped for formats that could interpret it.

A terminal obeys control characters, a spreadsheet evaluates cells that begin like a formula, Markdown and
HTML interpret tags, and matplotlib reads text between dollar signs as a formula. JSON needs no escapes.
"""

from __future__ import annotations

import html
import re
import unicodedata

LINES = "\n\t"
# Signs alone are the modes of the package; without a cell, a function or a digit but 0 they compute nothing.
_SIGNS = re.compile(r"[-+0]*")
_FORMULA = "=+-@＝＋－＠"


def printable(text: object, keep: str = "") -> str:
    """Text in which every character can be seen: the others as \\x1b, \\u202e, those in `keep` as they are.

    Escaped are control and format characters (including those that reverse the direction of writing), line
    ends, lone surrogates and characters that Unicode does not have.
    """
    given = str(text)
    if given.isprintable():
        return given
    return "".join(c if c in keep else _shown(c) for c in given)


def _shown(character: str) -> str:
    if character.isprintable() or unicodedata.category(character) == "Zs":
        return character
    return character.encode("unicode_escape").decode("ascii")


def cell(text: object) -> str:
    """Text for a cell that a spreadsheet may open: where it begins like a formula it gets an apostrophe.

    Numbers, and modes such as +0-, stay as they are.
    """
    shown = printable(text)
    if shown.lstrip()[:1] in tuple(_FORMULA) and not (_SIGNS.fullmatch(shown) or _is_number(shown)):
        return "'" + shown
    return shown


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def markup(text: object) -> str:
    """Text for HTML, in an element or in an attribute."""
    return html.escape(printable(text, LINES), quote=True)


_MARKDOWN = str.maketrans(
    {"\\": r"\\", "`": r"\`", "*": r"\*", "|": r"\|", "$": r"\$", "<": "&lt;", "&": "&amp;"}
)


def markdown(text: object) -> str:
    """Text for Markdown: no tag, no link, no emphasis, no formula of its own."""
    return printable(text).translate(_MARKDOWN).replace("](", r"]\(")


_LATEX = str.maketrans({
    "\\": r"\textbackslash{}", "{": r"\{", "}": r"\}", "$": r"\$", "~": r"\textasciitilde{}", "_": r"\_",
    "&": r"\&", "%": r"\%", "#": r"\#", "^": r"\^{}", "|": r"$|$", "*": r"$*$", "<": "$<$", ">": "$>$",
})  # fmt: skip


def latex(text: object) -> str:
    """Text for LaTeX, without commands of its own."""
    return printable(text).translate(_LATEX)


def figure_text(text: object) -> str:
    """Text for matplotlib, dollar signs as such."""
    return printable(text, LINES).replace("$", r"\$")
