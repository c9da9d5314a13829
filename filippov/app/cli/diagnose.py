"""filippov diagnose: what switches in a program f(t, y), and the System to use instead."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from filippov.app.cli.console import Console
from filippov.app.cli.folder import Folder
from filippov.base.errors import UsageError
from filippov.base.escape import figure_text, printable
from filippov.base.names import closest
from filippov.base.user_file import load_file


def run(settings: dict[str, Any], console: Console) -> int:
    """Say whose code is run, import the file, diagnose the function."""
    path, colon, name = (settings["program"] or "").rpartition(":")
    if not colon or not path.endswith(".py") or not name:
        raise UsageError(f"no program was given, expected path/to/file.py:f, not {settings['program']!r}.")
    flags = {"x0": "--x0 1,0", "t_span": "--t-span T0 T1"}
    missing = [flag for key, flag in flags.items() if settings[key] is None]
    if missing:
        names = " and ".join(flag.split()[0] for flag in missing)
        raise UsageError(
            f"{names} {'is' if len(missing) == 1 else 'are'} missing: a program has none of its own. "
            f"Give {' and '.join(missing)}."
        )
    folder = Folder(settings["output"], console)
    console.say(
        f"runs {printable(path)} to import it, and calls its {printable(name)} up to "
        f"{settings['max_calls']} times by "
        "scipy and some hundred times at random states"
    )
    function = _function(path, name)
    from filippov.analysis.programs.diagnosis import diagnose

    options = {key: settings[key] for key in ("args", "method", "rtol", "atol", "max_calls")}
    with console.progress("diagnose"):
        found = diagnose(function, settings["x0"], settings["t_span"], **options)
    console.say(str(found))
    data = found.to_dict()
    console.result(data)
    folder.json("diagnosis.json", data)
    folder.content("diagnosis.txt", str(found) + "\n")
    if found.code:
        folder.content("system.py", found.code)
    folder.picture("diagnosis.png", lambda: found.plot(title=figure_text(found.name)))
    folder.report()
    return 0


def _function(path: str, name: str) -> Any:
    """What the file calls by a name with dots: a function, or a method of an object in it."""
    value: Any = load_file(Path(path))
    for part in name.split("."):
        if not hasattr(value, part):
            near = closest(part, [n for n in dir(value) if not n.startswith("_")])
            raise UsageError(f"{path!r} has no {name!r}; {near or 'name a function in it'}")
        value = getattr(value, part)
    if not callable(value):
        raise UsageError(f"{name!r} in {path!r} is {type(value).__name__}, expected a function f(t, y).")
    return value
