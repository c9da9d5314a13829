"""Systems from other descriptions: state-space matrices, block diagrams of python-control."""

from __future__ import annotations

from filippov.base.exports import short_names

# Short name -> module of this package.
EXPORTS: dict[str, str] = {
    "from_control": "control_systems",
    "from_statespace": "statespace",
    **dict.fromkeys(
        (
            "backlash", "dead_zone", "friction", "quantiser", "relay", "sample_and_hold", "sampled",
            "saturation",
        ),
        "control_blocks",
    ),
}  # fmt: skip

__all__ = sorted(EXPORTS)  # noqa: PLE0605
__getattr__, __dir__ = short_names(__name__, EXPORTS)
