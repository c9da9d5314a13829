"""The study of stick-slip on a moving belt: what a study takes for any model with a section."""

from __future__ import annotations

from filippov.models.studies import Study, StudyCase, register_study

STUDY = register_study(Study(
    name="belt", title="Stick-slip on a moving belt", model="belt_stribeck",
    source="Armstrong-Helouvry, Dupont & Canudas de Wit 1994; numbers chosen here",
    cases=(StudyCase("1", {}, "β = 1"),),
    parameter="vb", values=(0.1, 0.15, 0.2, 0.25, 0.3),
    texts={"summary": (
        ("", "A block that a spring holds on a moving belt sticks again at x = {cycle_1_1:.6f} m."),
    )},
    mode_names={"0": "stick", "+": "faster", "-": "slip"},
))  # fmt: skip
