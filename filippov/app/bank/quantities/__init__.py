"""The closed vocabulary of what an expectation can measure: one module for each group of quantities."""

from filippov.app.bank.quantities import (
    along,
    events,
    orbits,
    polynomials,
    sliding,
    states,
)
from filippov.app.bank.quantities.quantity import Quantity

QUANTITIES: dict[str, type] = Quantity.FAMILY[1]
GROUPS = (events, states, along, sliding, orbits, polynomials)
