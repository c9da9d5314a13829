"""What `compare` says of cycles, over spans that hold any number of periods of one that is known."""

from __future__ import annotations

import numpy as np
import pytest

from filippov.analysis import compare
from filippov.models import get


@pytest.mark.parametrize("span", np.linspace(20.0, 66.0, 8))
def test_no_cycle_is_said_to_be_invented_where_the_exact_solution_has_one(span: float) -> None:
    """The block on the belt is on its cycle of period 12.0010 from the first catch on, and so are its
    approximations on theirs: however short the span is, none of them invents or loses one."""
    against = ["tanh", "arctan", "sqrt", "band"]
    table = compare(get("belt").build(), x0=(0, 0), t_span=(0, span), against=against, widths=(1e-1, 3e-2))
    assert not [text for text in table.faults if "invents a cycle" in text or "loses the cycle" in text]
