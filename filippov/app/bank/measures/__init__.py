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
    turns,
)
from filippov.app.bank.measures import sets as many
from filippov.app.bank.measures.measure import Measure

QUANTITIES: dict[str, type] = Measure.FAMILY[1]
GROUPS = (events, states, turns, along, phases, sliding, orbits, accumulations, many, parameters, polynomials)
