"""The closed vocabulary of what an expectation can measure: one module for each group of quantities."""

from filippov.app.bank.measures import (
    along,
    events,
    orbits,
    polynomials,
    sliding,
    states,
)
from filippov.app.bank.measures.measure import Measure

QUANTITIES: dict[str, type] = Measure.FAMILY[1]
GROUPS = (events, states, along, sliding, orbits, polynomials)
