"""What a notebook shows of a result that tells itself in text."""

from __future__ import annotations

from filippov.base.escape import markup


class Shown:
    """`_repr_html_`: the text of str(), escaped, in the lines that it has."""

    __slots__ = ()

    def _repr_html_(self) -> str:
        return f"<pre>{markup(self)}</pre>"
