"""The event loop in parts, each a unit: one that every system needs, others that only some do.

A part is a set of kernel files. Its exported kernels are large and are called by address from other parts;
of smaller kernels the callers have copies. The parts that a system needs are linked with its unit; kernels of
the others are absent, and the system's constants rule out that they are called. Parts of entry points that
few runs call are linked at the first request.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from filippov.kernel.codegen.entries import PLAIN, PLAIN_FILES
from filippov.kernel.language.unit import Constant
from filippov.kernel.loop.rules import FILIPPOV


@dataclass(frozen=True)
class Part:
    """Kernel files; the kernels exported to other parts; whether a system with these constants needs them.

    asked: linked only when one of its entry points is requested
    """

    files: tuple[str, ...]
    offers: tuple[str, ...]
    needed: Callable[[Mapping[str, Constant]], bool] = lambda _: True
    asked: bool = False

    @property
    def entries(self) -> tuple[str, ...]:
        """Its entry points, which Python calls."""
        return tuple(name for name in PLAIN if PLAIN_FILES[name] in self.files)


CORE = Part(
    (
        "elementary", "recurrences", "series", "bernstein", "gradients", "field", "points", "sampling",
        "land", "locate", "control", "resolve", "event_cycle", "record", "segment", "attempt", "search",
        "decide", "advance", "probe", "start",
    ),
    (
        "field", "set_mode", "project", "side_rates", "record_event", "count_down", "zeno_remaining",
        "cycle_limit", "on_one_surface", "begin", "advance", "take", "project_on", "faint", "resolve_root",
    ),
)  # fmt: skip
PARTS = (
    CORE,
    Part(
        ("dense", "rules", "corner", "corner_event"),
        (
            "solve_linear", "solve_or_least", "sign_derivatives", "couple", "slide_affine",
            "slide_multi_affine", "slide_moments", "slide_utkin", "reach_corner", "leave_corner",
            "take_corner", "look_at_corner",
        ),
        lambda constants: constants["M"] > 1 or constants["RULE"] != FILIPPOV,  # type: ignore[operator]
    ),
    Part(
        ("coupled_corner",), ("follow_sides", "one_choice", "coupled_rates", "write_corner"),
        lambda constants: bool(constants["COUPLED"]),
    ),
    Part(
        ("simultaneous",), (
            "set_observers_apart", "decide_each", "all_changed", "record_reset", "take_observers",
        ),
        lambda constants: constants["M"] > 1,  # type: ignore[operator]
    ),
    Part(("reset",), ("apply_reset",), lambda constants: bool(constants["RESETS"])),
    Part(("ticks",), ("tick", "aim"), lambda constants: bool(constants["TICKS"])),
    Part(("limit", "ensemble"), (), asked=True),
)  # fmt: skip
FILES = tuple(file for part in PARTS for file in part.files)


def linked(constants: Mapping[str, Constant]) -> tuple[Part, ...]:
    """The parts that a system needs."""
    return tuple(part for part in PARTS if not part.asked and part.needed(constants))


def missing(constants: Mapping[str, Constant]) -> tuple[str, ...]:
    """The exported kernels of parts that a system does not need."""
    return tuple(
        name for part in PARTS if not (part.asked or part.needed(constants)) for name in part.offers
    )


def of_others(part: Part) -> frozenset[str]:
    """The kernels that a part calls by address."""
    return frozenset(name for other in PARTS if other is not part for name in other.offers)


def asked_for(entry: str) -> Part | None:
    """The part that is linked when this entry point is requested."""
    return next((part for part in PARTS if part.asked and entry in part.entries), None)
