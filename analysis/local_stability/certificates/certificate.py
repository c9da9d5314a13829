"""Certificates: verdicts with the theorem that gives them and the hypotheses that were checked."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

from filippov.analysis.local_stability.stability_result import Answer, Statement
from filippov.analysis.local_stability.stick_parts import Beside

Reach = Literal["local", "global"]


@dataclass(frozen=True)
class Certificate:
    """A verdict on an equilibrium or a set of equilibria.

    answer   "asymptotically stable", "stable" or "unstable"; "undecided" where sets that touch leave it open
    theorem  what gives the verdict, in words
    source   where the theorem is proved
    checked  the hypotheses, each with what was found
    reach    "local", or "global" where all solutions converge to the equilibrium or set
    """

    answer: Answer
    theorem: str
    source: str
    checked: tuple[str, ...]
    reach: Reach = "local"

    def statements(self) -> list[Statement]:
        """The certificate as lines of a report."""
        head = self.theorem + (", for all solutions" if self.reach == "global" else "")
        return [Statement(head, self.source), *(Statement(f"checked: {text}") for text in self.checked)]

    def beside(self, others: Beside) -> Certificate:
        """The certificate with what equilibria arbitrarily near leave of it."""
        reach: Reach = self.reach if others.together else "local"
        return replace(self, answer=others.answer, checked=(*self.checked, others.text), reach=reach)
