"""The command `filippov`: reads flags and configuration, runs a command, returns its exit code.

    0    done
    1    failed, with a named cause on stderr
    2    wrong usage: unknown name, flag or setting, with a suggestion
    3    done, and some case of a bank did not pass, or some point of a sweep failed
    130  interrupted; what had been computed is written

Text for people goes to stderr, one JSON document to stdout with --json. `--help` imports nothing heavy.
"""

from __future__ import annotations

import argparse
import os
import re
import sys
import traceback
from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Any, NoReturn

from filippov.app.cli.catalogue import commands
from filippov.app.cli.configuration import Command, Option, merge
from filippov.app.cli.console import Console, write_error
from filippov.app.cli.values import switch
from filippov.base.errors import UsageError
from filippov.base.names import closest

OK, FAILED, USAGE, INTERRUPTED = 0, 1, 2, 130
_NEGATIVE = re.compile(r"-[\d.(]")
# Matrices here are small: threads that wait for each other take a third of the time of a study.
_ONE_THREAD = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")

# What others call these, and what to write.
_OTHER_COMMANDS = {
    "plot": "every command draws what it computes: filippov simulate MODEL -o DIR.",
    "report": "a report is written by filippov study NAME -o DIR.",
    **dict.fromkeys(("run", "solve", "integrate"), "write filippov simulate MODEL."),
    **dict.fromkeys(("describe", "info", "show"), "write filippov models describe NAME."),
    **dict.fromkeys(("list", "ls", "model"), "write filippov models."),
    "help": "write filippov --help, or filippov COMMAND --help.", "version": "write filippov --version.",
}  # fmt: skip
_PARAMETERS = dict.fromkeys(
    ("--params", "--parameters", "--param", "--set", "-P"), "parameters are set by -p NAME=VALUE, one each"
)
_PARAMETERS |= dict.fromkeys(
    ("--plot", "--figure", "--fig", "--png", "--save"), "figures are written with the results: -o DIR"
)
# What the end of a run is called elsewhere.
_ENDS = (
    "--tend", "--t-end", "--tf", "--t-final", "--tfinal", "--tmax", "--tspan", "--tstop", "--t-stop",
    "--stop-time", "--until", "--time", "--duration", "--end",
)  # fmt: skip


class Parser(argparse.ArgumentParser):
    """argparse that raises UsageError, with suggestions, in place of leaving the process."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**{"allow_abbrev": False, "formatter_class": _formatter, **options})
        self.words: list[str] = ["-h", "--help"]
        self.forms: dict[str, str] = {}

    def add(self, option: Option) -> None:
        """Add an option; one that is not given leaves no trace, so that file and default can step in."""
        shared: dict[str, Any] = {"help": option.help, "default": argparse.SUPPRESS}
        if option.default not in (None, False, {}):
            shared["help"] += f" (default {option.default})"
        if option.positional:
            self.add_argument(option.name, nargs="?", metavar=option.metavar, **shared)
            return
        flags = option.flags or (option.flag,)
        values = (option.metavar,) if isinstance(option.metavar, str) else option.metavar or ()
        self.forms |= {flag: " ".join((flag, *values)) for flag in flags if values}
        self.words += flags
        if option.earlier:
            self.add_argument(f"--{option.earlier}", dest=option.earlier, default=argparse.SUPPRESS,
                              help=argparse.SUPPRESS)  # fmt: skip
        if option.read is switch:
            self.add_argument(*flags, dest=option.name, action=argparse.BooleanOptionalAction, **shared)
        else:
            action = "append" if option.repeat else "extend" if option.count == "+" else "store"
            shared |= {} if option.count is None else {"nargs": option.count}
            self.add_argument(*flags, dest=option.name, action=action, metavar=option.metavar, **shared)

    def error(self, message: str) -> NoReturn:
        """Raise UsageError."""
        wrong = re.search(r"argument COMMAND: invalid choice: '([^']*)'", message)
        if wrong:
            hint = _OTHER_COMMANDS.get(wrong[1]) or closest(wrong[1], self.words)
            known = ", ".join(word for word in self.words if not word.startswith("-"))
            raise UsageError(f"unknown command {wrong[1]!r}; {hint}{' ' * bool(hint)}known: {known}")
        few = re.search(r"argument (\S+): expected ", message)
        form = self.forms.get(few[1].split("/")[-1], "") if few else ""
        raise UsageError(f"{message}{': ' + form if form else ''} (see {self.prog} --help)")


def _formatter(prog: str) -> argparse.HelpFormatter:
    return argparse.RawDescriptionHelpFormatter(prog, max_help_position=30)


class _Version(argparse.Action):
    def __call__(self, parser: argparse.ArgumentParser, *_: object, **__: object) -> None:
        from filippov.base.version import CHECKOUT, installed

        sys.stdout.write(f"filippov {installed('filippov') or CHECKOUT}\n")
        parser.exit()


def build_parser(known: dict[str, Command]) -> Parser:
    """The tree of commands and flags."""
    parser = Parser(
        prog="filippov", description="Filippov differential inclusions, solved and analysed exactly.",
        epilog="filippov COMMAND --help tells the flags of a command.\n"
        "Exit codes: 0 done, 1 failed, 2 wrong usage, 3 a case or point failed, 130 interrupted.",
    )  # fmt: skip
    parser.add_argument("--version", action=_Version, nargs=0, help="show the version and leave")
    parser.words += known
    tree = parser.add_subparsers(dest="command", metavar="COMMAND", parser_class=Parser)
    for command in known.values():
        part = tree.add_parser(
            command.name, help=command.help, description=command.help, epilog=f"example: {command.example}"
        )
        part.set_defaults(parser=part)
        for option in command.settings:
            part.add(option)
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command; returns its exit code."""
    show: dict[str, bool] = {}
    if argv is None:
        for name in _ONE_THREAD:
            os.environ.setdefault(name, "1")
    try:
        return _main(list(sys.argv[1:] if argv is None else argv), show, argv is None)
    except SystemExit as leave:
        if not show.get("begun"):  # --help and --version
            return int(leave.code or 0)
        return _failed(FAILED, _left(leave), show)
    except UsageError as error:
        return _failed(USAGE, str(error), show)
    except KeyboardInterrupt:
        return _failed(INTERRUPTED, "interrupted", show)
    except BrokenPipeError:
        # Whoever read stdout has left; Python would complain once more when it closes the stream.
        with suppress(OSError, ValueError, AttributeError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return FAILED
    except BaseException as error:  # noqa: BLE001
        # A user's own function may raise anything; its cause is named and the exit code tells of it.
        from filippov.base.user_file import placed

        return _failed(FAILED, placed(error), show)


def _parted(argv: list[str], pairs: set[str]) -> list[str]:
    """The words, with those that give a flag of two values both in one ("0,10") as two."""
    out: list[str] = []
    for before, word in zip(["", *argv], argv, strict=False):
        halves = word.split(",")
        out += halves if before in pairs and len(halves) == 2 and all(halves) else [word]
    return out


def _choice(options: Sequence[Option], flag: str) -> str:
    """What to write for a flag that is a word which another one takes, as --observed for --kind observed."""
    word = flag.lstrip("-")
    choices = ((q.flag, q.metavar.strip("{}").split(",")) for q in options if isinstance(q.metavar, str))
    takers = [taker for taker, words in choices if word in words]
    return f"write {takers[0]} {word}" if takers else ""


def _span(options: Sequence[Option], flag: str) -> str:
    """What to write for the end of a run, where the command has a time span."""
    has = any("--t-span" in (q.flags or (q.flag,)) for q in options)
    return "the times of a run are --t-span T0 T1, such as --t-span 0 5" if flag in _ENDS and has else ""


def _renamed(options: Sequence[Option], argv: Sequence[str]) -> str:
    """What to write for flags that are called otherwise now, with the values that they were given."""
    now = {f"--{former}": q.flag for q in options for former in q.former}
    old: list[str] = []
    new: list[str] = []
    for word, after in zip(argv, [*argv[1:], ""], strict=True):
        flag, equals, value = word.partition("=")
        if flag in now:
            value = value if equals else "" if after.startswith("--") else after
            old, new = [*dict.fromkeys((*old, flag))], [*new, f"{now[flag]} {value}".strip()]
    return f"{' and '.join(old)} {'are' if old[1:] else 'is'} now written {' '.join(new)}" if old else ""


def _elsewhere(name: str | None, flag: str, known: Mapping[str, Command]) -> str:
    """Which commands have a flag that this one has not, and what stands for a span where there is none."""
    if name is None:
        return ""
    having = [
        key for key, command in known.items() if any(flag in (q.flags or (q.flag,)) for q in command.settings)
    ]
    if not having:
        return ""
    follows = flag == "--t-span" and any(q.flag == "--t-max" for q in known[name].settings)
    return (
        f"it is an option of {', '.join(having)}, not of {name}"
        + (", which follows a return as long as --t-max" if follows else "")
    )  # fmt: skip


def _joined(argv: list[str], word: str) -> str:
    """What to write where a flag of one value was given several: the words after it, with commas."""
    end = next((k for k, given in enumerate(argv) if given.strip() == word), 0)
    flags = [k for k in range(end) if argv[k].startswith("-") and not _NEGATIVE.match(argv[k])]
    start = flags[-1] if flags else end
    if end - start < 2:
        return ""
    with_name = "=" if argv[start] == "-p" and end - start == 2 else ","
    return f"one word goes with {argv[start]}: {argv[start]} {with_name.join(argv[start + 1 : end + 1])}"


def _nearest(flag: str, words: list[str]) -> str:
    """The flag that may be meant; -p is never, but a parameter's name is."""
    hint = closest(flag, words)
    return f"a parameter is set by -p {flag.lstrip('-')}=VALUE" if "'-p'" in hint else hint


def _in_order(known: Mapping[str, Command], given: Mapping[str, Any]) -> str:
    """The words that a command takes without a flag, each with a blank after it."""
    own = known[given["command"]].settings if given.get("command") else ()
    words = [q.metavar or q.name.upper() for q in own if not (q.flags or (q.flag,))[0].startswith("-")]
    return "".join(f"{word} " for word in words) or "a command "


def _left(leave: SystemExit) -> str:
    """What to say where a function of the user's ended the program: none of its codes is that of a result."""
    frames = traceback.extract_tb(leave.__traceback__)
    where = f", line {frames[-1].lineno} of {frames[-1].filename}" if frames else ""
    return (
        f"the model or a function of yours left the program (SystemExit: {leave.code}{where}), so there is "
        "no result. Raise an exception that says why, or return a value."
    )


def _failed(code: int, said: str, show: dict[str, bool]) -> int:
    """Name the cause of the error at hand."""
    if show.get("traceback"):
        write_error(traceback.format_exc())
    write_error(f"filippov: {said}")
    return code


def _main(argv: list[str], show: dict[str, bool], for_good: bool) -> int:
    """The work; for_good: nothing comes after it in this process."""
    known = commands()
    parser = build_parser(known)
    options = [option for command in known.values() for option in command.settings]
    argv = _parted(argv, {flag for q in options if q.count == 2 for flag in q.flags or (q.flag,)})
    # A leading blank keeps argparse from taking -1e-3 and -(pi/2) for flags.
    space, extra = parser.parse_known_args([" " + word if _NEGATIVE.match(word) else word for word in argv])
    given = vars(space)
    if given.get("command") is None and not extra:
        parser.print_help(sys.stderr)
        raise UsageError(f"no command was given, expected one of {', '.join(known)}")
    part: Parser = given.pop("parser", parser)
    if extra:
        word = extra[0].strip()
        if word.startswith("-") and not _NEGATIVE.match(word):
            own = known[given["command"]].settings if given.get("command") else ()
            flag = word.split("=")[0]
            hint = _renamed(own, argv) or _span(own, flag) or _elsewhere(given.get("command"), flag, known)
            hint = hint or _PARAMETERS.get(flag, "") or _nearest(flag, part.words) or _choice(own, word)
        else:
            hint = _joined(argv, word) or f"{part.prog} takes {_in_order(known, given)}and options, no more"
        raise UsageError(f"unknown argument {word!r}{'; ' + hint if hint else ''} (see {part.prog} --help)")
    command = known[given.pop("command")]
    show["traceback"] = bool(given.get("traceback"))
    keys = {
        name: [key for option in other.settings for key in (option.name, option.earlier) if key]
        for name, other in known.items()
    }
    former = {old: q.name for other in known.values() for q in other.settings for old in q.former}
    settings = merge(command.name, command.settings, given, keys, former)
    show["traceback"] = settings["traceback"]
    console = Console(settings["json"] is True, settings["quiet"])
    show["begun"] = True
    with console.alone(for_good):
        return command.load()(settings, console)
