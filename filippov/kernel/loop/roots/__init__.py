"""Root isolation: the first event of a step, on the polynomials of its dense output and of its guards."""
