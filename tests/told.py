"""What a mistake is answered with: the place and the cure, in a few lines."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from filippov import ModelError, SolveError, UsageError

ERRORS = (ModelError, UsageError, SolveError, AttributeError, IndexError, OSError, TypeError)


def told(call: Callable[[], object], place: str, cure: str) -> None:
    """Assert that a call is refused with these words."""
    with pytest.raises(ERRORS) as caught:
        call()
    assert place in str(caught.value), str(caught.value)
    assert cure in str(caught.value), str(caught.value)
    assert len(str(caught.value)) < 500
