"""Why an expectation has no error: it is not understood, or the motion does not have what it asks for."""

from __future__ import annotations


class NotUnderstoodError(Exception):
    """The runner cannot evaluate this expectation; it is listed as not evaluated."""


class MissingError(Exception):
    """The expectation is understood and the result does not have it: it counts as failed."""


class OutOfTimeError(Exception):
    """The time allowed for the case is used up."""
