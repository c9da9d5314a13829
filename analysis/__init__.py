"""Analysis of any system: sections, event maps, equilibria, stability, bifurcations."""

from __future__ import annotations

from filippov.base.exports import short_names

# Short name -> module of this package.
EXPORTS: dict[str, str] = {
    "routh_hurwitz": "algebra.routh_hurwitz",
    "Branch": "bifurcations.branch",
    "continuation": "bifurcations.continuation",
    "curve": "bifurcations.curve",
    **dict.fromkeys(("curves_at", "switch_curve"), "bifurcations.curve_switch"),
    "switch": "bifurcations.switch",
    "BandModel": "comparisons.band_model",
    "Approximation": "comparisons.approximation",
    "compare": "comparisons.comparison",
    **dict.fromkeys(("compare_motions", "compare_solutions"), "comparisons.solutions"),
    "basin": "diagrams.basin",
    "bifurcation": "diagrams.bifurcation",
    "brute_force": "diagrams.brute_force",
    "regions": "diagrams.regions",
    **dict.fromkeys(("friction_force", "identify_curve"), "estimation.friction_curve"),
    "identify": "estimation.identification",
    **dict.fromkeys(("Curve", "Record", "read_record"), "estimation.record"),
    "gain_map": "gains.gain_map",
    "tune": "gains.tuning",
    **dict.fromkeys(("linear_mode", "relay_loop"), "harmonic.control_link"),
    "describing_function": "harmonic.describing_function",
    **dict.fromkeys(("certify", "stability_report"), "local_stability.stability"),
    "attractors": "invariant_sets.attractors",
    "manifold": "invariant_sets.manifold",
    "EventMap": "maps.event_map",
    "find_section": "maps.find_section",
    "returns": "maps.returns",
    "Section": "maps.section",
    "Stroboscope": "maps.stroboscope",
    "period_map": "diagrams.period_map",
    "find_homoclinic": "orbits.homoclinic",
    "Orbit": "orbits.orbit",
    "find_orbit": "orbits.orbit_search",
    "ReturnError": "orbits.shooting",
    **dict.fromkeys(("Diagnosis", "diagnose"), "programs.diagnosis"),
    "lyapunov": "sensitivity.lyapunov",
    "flow_derivative": "sensitivity.saltation",
    "equilibria": "steady.equilibria",
    "linearise": "steady.linearisation",
    **dict.fromkeys(("growth", "rest_map"), "steady.rest_map"),
}

__all__ = sorted(EXPORTS)  # noqa: PLE0605
__getattr__, __dir__ = short_names(__name__, EXPORTS)
