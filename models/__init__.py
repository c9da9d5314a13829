"""Ready-made systems: friction laws, controllers and plants, by name in a registry."""

from __future__ import annotations

import importlib
from typing import Any

# Public name -> module of this package; imported when first used, so that listing models stays fast.
_EXPORTS: dict[str, str] = {
    **dict.fromkeys(("Invariant", "Model", "broken", "get", "names", "register"), "registry"),
    "FrictionLaw": "friction",
    **dict.fromkeys(("Coulomb", "Hyperbolic", "StaticCoulomb", "Stribeck", "Viscous"), "laws"),
    **dict.fromkeys(("PD", "PID", "Controller", "P"), "controllers"),
    **dict.fromkeys(("ControlledMass", "controlled_mass", "degeneracies", "hunting"), "mass"),
    **dict.fromkeys(("coulomb_ratio", "static_cycles"), "static_cycle"),
    **dict.fromkeys(("Study", "StudyCase", "get_study", "register_study", "study_names"), "studies"),
    "Switch": "switch",
    "Karnopp": "karnopp",
    "LuGre": "lugre",
}

__all__ = sorted(_EXPORTS)  # noqa: PLE0605


def __getattr__(name: str) -> Any:
    if name not in _EXPORTS:
        raise AttributeError(f"module 'filippov.models' has no attribute {name!r}")
    value = getattr(importlib.import_module(f"filippov.models.{_EXPORTS[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *_EXPORTS})
