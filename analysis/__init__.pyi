# What this package offers, for type checkers and editors: a name is imported at its first use.

from filippov.analysis.algebra.routh_hurwitz import routh_hurwitz
from filippov.analysis.bifurcations.branch import Branch
from filippov.analysis.bifurcations.continuation import continuation
from filippov.analysis.bifurcations.curve import curve
from filippov.analysis.bifurcations.curve_switch import curves_at, switch_curve
from filippov.analysis.bifurcations.switch import switch
from filippov.analysis.comparisons.approximation import Approximation
from filippov.analysis.comparisons.band_model import BandModel
from filippov.analysis.comparisons.comparison import compare
from filippov.analysis.comparisons.solutions import compare_motions, compare_solutions
from filippov.analysis.diagrams.basin import basin
from filippov.analysis.diagrams.bifurcation import bifurcation
from filippov.analysis.diagrams.brute_force import brute_force
from filippov.analysis.diagrams.period_map import period_map
from filippov.analysis.diagrams.regions import regions
from filippov.analysis.estimation.friction_curve import friction_force, identify_curve
from filippov.analysis.estimation.identification import identify
from filippov.analysis.estimation.record import Curve, Record, read_record
from filippov.analysis.gains.gain_map import gain_map
from filippov.analysis.gains.tuning import tune
from filippov.analysis.harmonic.control_link import linear_mode, relay_loop
from filippov.analysis.harmonic.describing_function import describing_function
from filippov.analysis.invariant_sets.attractors import attractors
from filippov.analysis.invariant_sets.manifold import manifold
from filippov.analysis.local_stability.stability import certify, stability_report
from filippov.analysis.maps.event_map import EventMap
from filippov.analysis.maps.find_section import find_section
from filippov.analysis.maps.returns import returns
from filippov.analysis.maps.section import Section
from filippov.analysis.maps.stroboscope import Stroboscope
from filippov.analysis.orbits.homoclinic import find_homoclinic
from filippov.analysis.orbits.orbit import Orbit
from filippov.analysis.orbits.orbit_search import find_orbit
from filippov.analysis.orbits.shooting import ReturnError
from filippov.analysis.programs.diagnosis import Diagnosis, diagnose
from filippov.analysis.sensitivity.lyapunov import lyapunov
from filippov.analysis.sensitivity.saltation import flow_derivative
from filippov.analysis.steady.equilibria import equilibria
from filippov.analysis.steady.linearisation import linearise
from filippov.analysis.steady.rest_map import growth, rest_map

__all__ = [
    "Approximation",
    "BandModel",
    "Branch",
    "Curve",
    "Diagnosis",
    "EventMap",
    "Orbit",
    "Record",
    "ReturnError",
    "Section",
    "Stroboscope",
    "attractors",
    "basin",
    "bifurcation",
    "brute_force",
    "certify",
    "compare",
    "compare_motions",
    "compare_solutions",
    "continuation",
    "curve",
    "curves_at",
    "describing_function",
    "diagnose",
    "equilibria",
    "find_homoclinic",
    "find_orbit",
    "find_section",
    "flow_derivative",
    "friction_force",
    "gain_map",
    "growth",
    "identify",
    "identify_curve",
    "linear_mode",
    "linearise",
    "lyapunov",
    "manifold",
    "period_map",
    "read_record",
    "regions",
    "relay_loop",
    "rest_map",
    "returns",
    "routh_hurwitz",
    "stability_report",
    "switch",
    "switch_curve",
    "tune",
]
