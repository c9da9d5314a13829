"""Orders of smooth signs where sliding ends: how slowly their shape comes to 1 decides.

x' = t - Sgn(x) from 0 slides until t = 1 and is (t - 1)**2/2 from there on. A sign with 1 - s ~ (w/x)**k has
x' = (t - 1) + (w/x)**k there, whose terms are of one size for t - 1 ~ w**(k/(2 k + 1)), x ~ its square: the
error is of order 2 k/(2 k + 1), 2/3 for arctan and 4/5 for sqrt. tanh has the logarithm of its exponential
for k, and the order 1 but for logarithms; the band is 1 exactly from its edge on.
"""

import numpy as np
import pytest

from filippov import Band, System, sign, solve, states, t
from filippov.model.comparator import Smooth

x = states("x")
WIDTHS = (1e-3, 1e-5)


@pytest.mark.parametrize(
    ("comparator", "order", "margin"),
    [(lambda w: Smooth(w, shape="arctan"), 2 / 3, 0.02), (lambda w: Smooth(w, shape="sqrt"), 4 / 5, 0.02),
     (Smooth, 0.93, 0.03), (Band, 1.0, 0.01)],
    ids=["arctan", "sqrt", "tanh", "band"],
)  # fmt: skip
def test_15_1_smooth_signs_have_the_order_of_their_shape(comparator, order, margin) -> None:  # type: ignore[no-untyped-def]
    errors = []
    for width in WIDTHS:
        made = System({x: t - sign(x)}).with_comparator(comparator(width))
        run = solve(made, (0.0,), (0.0, 3.0), method="Radau", rtol=1e-10, atol=1e-13)
        assert run.success
        assert run.sol is not None
        errors.append(abs(run.sol(3.0)[0] - 2.0))
    assert np.log10(errors[0] / errors[1]) / 2 == pytest.approx(order, abs=margin)
