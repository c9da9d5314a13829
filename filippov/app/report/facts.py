"""References of texts: computed values by name, and the numbers of sections, figures and tables."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import TYPE_CHECKING

from filippov.app.report.part import Chapter, Picture, TextTable
from filippov.base.escape import LINES, printable

if TYPE_CHECKING:
    from markupsafe import Markup

_CODE = re.compile(r"`([^`\n]+)`")
_PLACE = re.compile(r"\[\[((?:section|figure|table) [^\]]+)\]\]", re.IGNORECASE)


class Facts(dict[str, float]):
    """Values by name, for format_map; a value that was not computed reads as such.

    cycle_<case>_<k>, fold_<case>; change_<case> of the set's stability, change_rest_<case> by the linearised
    return map; bound_<case> of Routh-Hurwitz; jump_<case> of the map at 0; end_value, end_parameter,
    least_value, least_parameter of the fold curve; relative_fold_<case> of the smoother model; ratio_<k>,
    algebra_<k> of the k-th law; best_<k>_<setting>, margin_<k> of the settings for the k-th law; width,
    drift, lost of the widest band and narrow, narrow_error of the narrowest; safe: the border for every end
    of the experiment's intervals
    """

    def __missing__(self, key: str) -> _Unknown:
        return _Unknown()


def begun(number: str) -> str:
    """A reference at the start of a sentence: Table A1."""
    return number[0].upper() + number[1:]


class _Unknown:
    def __format__(self, spec: str) -> str:
        return "(not computed)"


class Numbers(dict[str, tuple[str, str]]):
    """("figure 3", its place on the page) by "figure NAME", and the same of sections and tables."""

    def __init__(self, sections: Iterable[Chapter], appendix: Iterable[Chapter]) -> None:
        super().__init__()
        self._count(sections, "section", [str(k) for k in range(1, 100)], "")
        self._count(appendix, "appendix", list("ABCDEFGH"), "A")

    def _count(self, sections: Iterable[Chapter], word: str, signs: list[str], prefix: str) -> None:
        figures = tables = 0
        for sign, section in zip(signs, sections, strict=False):
            self[f"section {section.anchor}"] = f"{word} {sign}", section.anchor
            for part in section.parts:
                if isinstance(part, Picture):
                    figures += 1
                    self[f"figure {part.name}"] = f"figure {prefix}{figures}", f"figure-{part.name}"
                elif isinstance(part, TextTable):
                    tables += 1
                    self[f"table {part.label}"] = f"table {prefix}{tables}", f"table-{part.label}"

    def told(self, texts: Iterable[tuple[str, str]], facts: Facts) -> list[tuple[str, str]]:
        """(title, paragraph) with the facts filled in; a text on something not computed is left out."""
        made = [(title, text.format_map(facts)) for title, text in texts]
        return [
            (title, text) for title, text in made
            if "(not computed)" not in text and all(key.lower() in self for key in _PLACE.findall(text))
        ]  # fmt: skip

    def linked(self, text: str) -> Markup:
        """Escaped text with [[figure NAME]] as its number and a link; an unknown name is left as it is."""
        from markupsafe import Markup, escape

        def link(found: re.Match[str]) -> str:
            if found[1].lower() not in self:
                return found[0]
            number, place = self[found[1].lower()]
            return f'<a href="#{place}">{begun(number) if found[1][0].isupper() else number}</a>'

        return Markup(_PLACE.sub(link, str(escape(printable(text, LINES)))))  # noqa: S704

    def coded(self, text: str) -> Markup:
        """As `linked`, with `code` between two backticks marked up; one without another is a character."""
        from markupsafe import Markup

        parts = [str(self.linked(part)) for part in _CODE.split(text)]
        return Markup("".join(f"<code>{p}</code>" if k % 2 else p for k, p in enumerate(parts)))  # noqa: S704
