"""Groups of settings that several commands have: sections, axes, what is varied, where it is computed."""

from __future__ import annotations

from filippov.app.cli.configuration import Option
from filippov.app.cli.values import (
    formulas,
    named_ranges,
    number,
    one_of,
    pair,
    switch,
    text,
    varied,
    whole,
    whole_or_zero,
)


def choice(name: str, help_text: str, *known: str, default: str | None = None) -> Option:
    """A setting that is one of some words."""
    return Option(name, help_text, one_of(*known), metavar="{" + ",".join(known) + "}", default=default)


SECTION = (
    Option("surface", "surface of the section, where the model proposes none; several with commas", text,
           metavar="NAME"),
    Option("event", "kind of event that ends a turn, such as 'sliding entry'", text, metavar="KIND"),
    Option("after", "mode after the event, such as 0 or +0, with * for any sign: other events do not end a "
           "turn", text, metavar="MODE"),
    Option("coordinate", "what is read on the section: a state or a formula in states", text,
           metavar="STATE"),
    Option("lift", "where a turn starts, a formula in d and parameters for each state: x=d,v=0", formulas,
           metavar="FORMULAS"),
    Option("t_max", "longest time of a turn", number, metavar="T"),
)  # fmt: skip
X_AXIS = Option("x", "horizontal axis: name with its first and last value", named_ranges,
                metavar="NAME=LOW:HIGH", default={})  # fmt: skip
Y_AXIS = Option("y", "vertical axis", named_ranges, metavar="NAME=LOW:HIGH", default={})
CELLS = Option("cells", "cells along each axis", whole, metavar="N", default=60)
INTERVAL = Option("interval", "interval of the section's coordinate", pair, metavar=("LO", "HI"), count=2)
VARY = (
    Option("vary", "values of a parameter, or of an initial state as x0.NAME; LOW:HIGH:COUNT, LOW:HIGH for "
           "samples that are drawn, or lists in the file; can be repeated", varied,
           metavar="NAME=LOW:HIGH:COUNT", repeat=True, default={}),
    choice("samples", "every combination, the values pair by pair, or n points drawn between the ends",
           "grid", "list", "latin_hypercube", "sobol", default="grid"),
    Option("n", "number of points that are drawn", whole, metavar="N", flags=("-n", "--n")),
    Option("seed", "seed of points that are drawn", whole_or_zero, metavar="N", default=0),
)  # fmt: skip
ENGINE = (
    Option("jobs", "worker processes; default: all cores", whole, metavar="N", flags=("-j", "--jobs")),
    choice("executor", "where points are computed", "processes", "dask", default="processes"),
    Option("scheduler", "address of dask's scheduler; default: a cluster of -j processes here", text,
           metavar="ADDRESS"),
    Option("resume", "go on with what the folder holds", switch, default=False),
    Option("fresh", "remove what the sweep in the folder has written", switch, default=False),
    Option("trust", "resume although functions read what cannot be seen: none of it has changed", switch,
           default=False),
    Option("chunk", "points in a chunk; default: about a second's work", whole, metavar="N"),
    Option("max_memory", "bytes of address space of a worker", whole, metavar="BYTES"),
)  # fmt: skip
