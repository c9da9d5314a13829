"""The oldest versions that pyproject.toml allows, for pip; `make test-oldest` runs tests with them.

    python tests/oldest.py requirements    a line for each: `numpy>=2` as numpy==2
    python tests/oldest.py python          the oldest Python: `>=3.11` as 3.11
    python tests/oldest.py tests           the tests to run: together they touch every dependency
"""

from __future__ import annotations

import re
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
# What the tests need; linters, documentation and benchmarks stand beside the package.
EXTRAS = ("plots", "report", "tables", "clusters", "control", "certificates", "fmu", "progress", "tests")
SUBSET = (
    "tests/test_complementarity.py", "tests/test_describing_function.py", "tests/test_export.py",
    "tests/test_graph.py", "tests/test_hostile_text.py",
    "tests/test_identification.py", "tests/test_lane_functions.py", "tests/test_lock.py",
    "tests/test_parameter.py", "tests/test_quadratic.py",
    "tests/test_plotting.py", "tests/test_routh_hurwitz.py", "tests/test_storage.py", "tests/test_sweep.py",
    "tests/test_sweep_dask.py", "tests/test_zeno.py",
)  # fmt: skip
_REQUIREMENT = re.compile(r"(?P<name>[A-Za-z0-9._-]+)>=(?P<version>[0-9.]+)")


def oldest(content: str) -> list[str]:
    """Every requirement at its lower bound. Raises ValueError for one that has no lower bound alone."""
    project = tomllib.loads(content)["project"]
    extras = project["optional-dependencies"]
    found: dict[str, str] = {}
    for requirement in [*project["dependencies"], *(item for name in EXTRAS for item in extras[name])]:
        match = _REQUIREMENT.fullmatch(requirement)
        if match is None:
            raise ValueError(f"{requirement!r} has no lower bound alone, expected NAME>=VERSION.")
        if found.setdefault(match["name"], match["version"]) != match["version"]:
            raise ValueError(f"{match['name']} has two lower bounds.")
    return [f"{name}=={version}" for name, version in found.items()]


def python(content: str) -> str:
    """The oldest Python."""
    match = re.fullmatch(r">=(3\.\d+)", tomllib.loads(content)["project"]["requires-python"])
    if match is None:
        raise ValueError("requires-python has no lower bound alone, expected >=3.N.")
    return match[1]


def main(what: str) -> None:
    """Print what was asked for."""
    content = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    lines = {"requirements": oldest(content), "python": [python(content)], "tests": list(SUBSET)}[what]
    print("\n".join(lines))


if __name__ == "__main__":
    main(sys.argv[1])
