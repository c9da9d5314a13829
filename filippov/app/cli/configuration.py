"""Settings of a command: from its flags, from a TOML file, from defaults, in this order of precedence.

A file holds the settings of a command at the top, or in a table with the name of the command, which goes
before the top. Names are those of the flags with _ for -:

    model = "path/to/model.py:system"
    rtol = 1e-10
    [parameters]
    P = 20
    [simulate]
    x0 = { x = 0.1 }
    t_span = [0, "10*pi"]

Numbers may be written as formulas in text; they are read by `filippov.model.expression` and never run as
code.
"""

from __future__ import annotations

import importlib
import importlib.util
import tomllib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from filippov.app.cli.values import (
    counted_ranges,
    formulas,
    number,
    number_or_formula,
    one_of,
    pair,
    switch,
    text,
    varied,
    whole,
    whole_or_zero,
)
from filippov.base.errors import UsageError
from filippov.base.names import unknown
from filippov.base.read_whole import read_text, unread

LARGEST_FILE = 1 << 20


@dataclass(frozen=True)
class Option:
    """One setting of a command.

    name     key in a file and in the settings; its flag is --name with - for _, unless `flags` says otherwise
    help     for --help
    read     function from a flag's text or a file's value to the setting; raises UsageError
    metavar  what stands for the value in --help
    count    number of values on the command line, None for one; "?" for one or none, "+" for one or more
    default  value where neither the command line nor the file has one
    flags    short and long flag, or the bare name of a positional argument
    repeat   whether the flag can be given several times
    earlier  an earlier name, taken as well
    former   names that it had, which are refused with the present one
    """

    name: str
    help: str
    read: Callable[[Any, str], Any]
    metavar: str | tuple[str, ...] | None = None
    count: int | str | None = None
    default: Any = None
    flags: tuple[str, ...] = ()
    repeat: bool = False
    earlier: str = ""
    former: tuple[str, ...] = ()

    @property
    def flag(self) -> str:
        """The long flag; the name itself for a positional argument."""
        return self.flags[-1] if self.flags else "--" + self.name.replace("_", "-")

    @property
    def positional(self) -> bool:
        """Whether it is given by place."""
        return not self.flag.startswith("-")


def read_file(path: Path) -> dict[str, Any]:
    """What a TOML file holds. Raises UsageError."""
    try:
        return tomllib.loads(read_text(path, LARGEST_FILE))
    except OSError as error:
        raise UsageError(f"cannot read the configuration {str(path)!r}: {unread(error)}.") from None
    except (UnicodeDecodeError, tomllib.TOMLDecodeError, RecursionError) as error:
        raise UsageError(
            f"the configuration {str(path)!r} is not TOML: {error}. Its lines are such as rtol = 1e-9, "
            "text in quotes, below [simulate] those of one command."
        ) from None


class Merged(dict[str, Any]):
    """The settings of a command; given: the names of those that the command line has."""

    given: frozenset[str] = frozenset()


def unused(settings: Mapping[str, Any], names: Iterable[str], why: str) -> None:
    """Raise UsageError where the command line has one of these flags, which would do nothing."""
    given = [name for name in names if name in getattr(settings, "given", ())]
    if given:
        flags = " and ".join("--" + name.replace("_", "-") for name in given)
        raise UsageError(f"{flags} would do nothing here: {why}. Leave {'them' if given[1:] else 'it'} out.")


def merge(
    command: str, options: Sequence[Option], given: Mapping[str, Any], commands: Mapping[str, Iterable[str]],
    former: Mapping[str, str] | None = None,
) -> Merged:  # fmt: skip
    """The settings of a command.

    given     what the command line has, by name; absent: not given. `config` names the file
    commands  the keys of every command, to check the tables of the file
    former    keys that the file may still have, with what they are called now

    Numbers by name (parameters, x0) are merged name by name. Raises UsageError.
    """
    layers: list[tuple[Mapping[str, Any], str]] = []
    if given.get("config") is not None:
        path = Path(given["config"])
        top, own = _tables(read_file(path), command, commands, str(path), former or {})
        layers = [(top, f"{path}: "), (own, f"{path}: {command}.")]
    layers.append((given, ""))
    layers = [(_by_present_names(options, layer, where), where) for layer, where in layers]
    settings = Merged()
    settings.given = frozenset(given)
    for option in options:
        value = option.default
        for layer, where in layers:
            if option.name in layer:
                new = option.read(layer[option.name], where + (option.name if where else option.flag))
                both = isinstance(value, dict) and isinstance(new, dict)
                value = {**value, **new} if both else new
        settings[option.name] = value
    return settings


def _by_present_names(options: Sequence[Option], layer: Mapping[str, Any], where: str) -> Mapping[str, Any]:
    """A layer with every setting under its present name. Raises UsageError where it has both names."""
    for option in options:
        if option.earlier in layer:
            if option.name in layer:
                names = f"{option.earlier!r} and {option.name!r}"
                raise UsageError(f"{where}{names} mean the same, and both are given. Leave one out.")
            layer = {option.name if key == option.earlier else key: value for key, value in layer.items()}
    return layer


def _tables(
    data: dict[str, Any], command: str, commands: Mapping[str, Iterable[str]], path: str,
    former: Mapping[str, str],
) -> tuple[dict[str, Any], dict[str, Any]]:  # fmt: skip
    """The top of a file and the command's own table, all names checked."""
    own: dict[str, Any] = {}
    top: dict[str, Any] = {}
    known = [key for key in commands[command] if key != "config"]
    for key, value in data.items():
        if key in commands and isinstance(value, dict):
            _check(value, [k for k in commands[key] if k != "config"], f"{path}: [{key}]", former)
            own = value if key == command else own
        elif key in known:
            top[key] = value
        else:
            others = [name for name, keys in commands.items() if key in keys and key != "config"]
            if others:
                raise UsageError(
                    f"{path}: {key!r} is no setting of {command}; it belongs to {', '.join(others)}. "
                    f"Put it into a table [{others[0]}]."
                )
            _check({key: value}, [*known, *commands], path, former)
    return top, own


def _check(given: Iterable[str], known: Sequence[str], where: str, former: Mapping[str, str]) -> None:
    for key in given:
        if former.get(key) in known and key not in known:
            raise UsageError(f"{where}: {key!r} is now written {former[key]!r}.")
        if key not in known:
            raise UsageError(f"{where}: {unknown('setting', key, known)}")


STROBE = (
    Option("period", "once per period of a forced system: T, a number or a formula such as 2*pi/omega; "
           "default: read off the forcing", number_or_formula, metavar="T"),
    Option("clock", "once per tick of this time event, after its reset", text, metavar="NAME"),
)  # fmt: skip
COMMON = (
    Option("config", "TOML file with settings by name; flags go before it", text, metavar="FILE.toml"),
    Option("output", "folder for the files, made if missing", text, metavar="DIR", flags=("-o", "--output")),
    Option("json", "write the result to stdout as one JSON document", switch, default=False),
    Option("quiet", "no text on stderr but errors", switch, default=False),
    Option("traceback", "show where an error arose", switch, default=False),
)


def choice(name: str, help_text: str, *known: str, default: str | None = None) -> Option:
    """An option that takes one of some words."""
    return Option(name, help_text, one_of(*known), metavar="{" + ",".join(known) + "}", default=default)


@dataclass(frozen=True)
class Command:
    """A command of the tool.

    module, function   what does it: function(settings, console) -> exit code; a module of this package by
                       its short name
    needs              module without which it is not offered
    """

    name: str
    help: str
    module: str
    options: tuple[Option, ...]
    example: str
    function: str = "run"
    needs: str = ""

    @property
    def offered(self) -> bool:
        """Whether its module is there."""
        try:
            return not self.needs or importlib.util.find_spec(self.needs) is not None
        except ModuleNotFoundError:
            return False

    @property
    def settings(self) -> tuple[Option, ...]:
        """All its options: its own, and the common ones that it has none of its own for."""
        own = {option.name for option in self.options}
        return (*self.options, *(option for option in COMMON if option.name not in own))

    def load(self) -> Callable[..., int]:
        """Import what does it."""
        module = self.module if "." in self.module else f"filippov.app.cli.{self.module}"
        function: Any = getattr(importlib.import_module(module), self.function)
        return function  # type: ignore[no-any-return]


# Options that several commands have: sections, axes, what is varied, where it is computed.
SECTION = (
    Option("surface", "surface of the section, where the model proposes none; several with commas", text,
           metavar="NAME"),
    Option("event", "kind of event that completes a return, such as 'sliding entry'", text, metavar="KIND"),
    Option("after", "mode after the event, such as 0 or +0, with * for any sign: other events end no "
           "return", text, metavar="MODE"),
    Option("coordinate", "what is read on the section: a state or a formula in states", text,
           metavar="STATE"),
    Option("parametrisation", "the state at coordinate d, a formula in d and parameters for each state: "
           "x=d,v=0", formulas, metavar="FORMULAS", earlier="lift"),
    Option("t_max", "longest time of a return", number, metavar="T"),
)  # fmt: skip
PLANE = (
    Option("over", "an axis: its name, first and last value, and where wanted the number of cells; given "
           "twice, the horizontal one first", counted_ranges, metavar="NAME=LOW:HIGH[:COUNT]", repeat=True,
           default={}, former=("x", "y")),
    Option("cells", "cells along each axis, in place of a number in --over (default 60)", whole, metavar="N"),
)  # fmt: skip
INTERVAL = Option("interval", "interval of the section's coordinate", pair, metavar=("LO", "HI"), count=2)
POINTS = (
    Option("over", "values of a parameter, or of an initial state as x0.NAME; LOW:HIGH:COUNT, LOW:HIGH for "
           "samples that are drawn, or lists in the file; can be repeated", varied,
           metavar="NAME=LOW:HIGH:COUNT", repeat=True, default={}, former=("vary",)),
    choice("samples", "every combination, the values pair by pair, or n points drawn between the ends",
           "grid", "list", "latin_hypercube", "sobol", default="grid"),
    Option("n", "number of points that are drawn", whole, metavar="N", flags=("-n", "--n")),
    Option("seed", "seed of points that are drawn", whole_or_zero, metavar="N", default=0),
)  # fmt: skip
OVER = (
    Option("over", "parameter that is varied, with its first and last value, and where wanted their number; "
           "as --parameter, --values and --count", counted_ranges, metavar="NAME=LOW:HIGH[:COUNT]",
           repeat=True, default={}),
    Option("parameter", "parameter that is varied", text, metavar="NAME"),
    Option("values", "its first and last value", pair, metavar=("LO", "HI"), count=2),
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
ENGINE_NAMES = tuple(option.name for option in ENGINE)
SECTION_NAMES = tuple(option.name for option in SECTION)
