"""Functions of the user: whether they take what they will be called with."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from typing import Any

from filippov.base.errors import ModelError


def check_signature(
    function: Callable[..., Any], wanted: Sequence[str], what: str, gives: str,
    error: type[Exception] = ModelError,
) -> None:  # fmt: skip
    """Refuse a function that cannot be called with these values in order.

    what    names it in the message; gives: what it is to return
    """
    try:
        signature = inspect.signature(function)
    except (TypeError, ValueError):
        return  # written in C, or wrapped: it may take them
    try:
        signature.bind(*wanted)
    except TypeError:
        listed, taken = ", ".join(wanted), ", ".join(signature.parameters)
        raise error(
            f"{what} takes ({taken}), expected ({listed}): write def f({listed}): return {gives}."
        ) from None
