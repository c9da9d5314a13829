"""Ready-made systems: friction laws, controllers and plants, by name in a registry."""

from __future__ import annotations

from filippov.base.exports import short_names

# Public name -> module of this package; imported when first used, so that listing models stays fast.
EXPORTS: dict[str, str] = {
    **dict.fromkeys(("Invariant", "Model", "broken", "get", "names", "register"), "registry"),
    "problem": "ready",
    "FrictionLaw": "friction",
    "friction_models": "friction_models",
    **dict.fromkeys(("Coulomb", "Hyperbolic", "StaticCoulomb", "Stribeck", "Viscous"), "laws"),
    **dict.fromkeys(("PD", "PID", "Controller", "P"), "controllers"),
    **dict.fromkeys(("ControlledMass", "controlled_mass", "degeneracies", "hunting"), "mass"),
    **dict.fromkeys(("coulomb_ratio", "static_cycles"), "static_cycle"),
    **dict.fromkeys(("Study", "StudyCase", "get_study", "register_study", "study_names"), "studies"),
    "Switch": "switch",
    "Karnopp": "karnopp",
    "LuGre": "lugre",
}

__all__ = sorted(EXPORTS)  # noqa: PLE0605
__getattr__, __dir__ = short_names(__name__, EXPORTS)
