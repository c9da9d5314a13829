"""The closed vocabulary of what an expectation can measure: one module for each group of quantities."""

from filippov.app.bank.measures import (
    accumulations,
    along,
    events,
    orbits,
    parameters,
    phases,
    polynomials,
    sliding,
    states,
    turning_points,
)
from filippov.app.bank.measures import sets as many
from filippov.app.bank.measures.measure import Measure

QUANTITIES: dict[str, type] = Measure.FAMILY[1]
GROUPS = (
    events, states, turning_points, along, phases, sliding, orbits, accumulations, many, parameters,
    polynomials,
)  # fmt: skip
