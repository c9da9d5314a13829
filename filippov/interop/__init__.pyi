# What this package offers, for type checkers and editors: a name is imported at its first use.

from filippov.interop.control_blocks import (
    backlash,
    dead_zone,
    friction,
    quantiser,
    relay,
    sample_and_hold,
    sampled,
    saturation,
)
from filippov.interop.control_systems import from_control
from filippov.interop.statespace import from_statespace

__all__ = [
    "backlash",
    "dead_zone",
    "friction",
    "from_control",
    "from_statespace",
    "quantiser",
    "relay",
    "sample_and_hold",
    "sampled",
    "saturation",
]
