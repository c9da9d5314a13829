"""The lower bounds of pyproject.toml as requirements: each exactly once, none without a bound."""

import re

import pytest
from oldest import ROOT, SUBSET, oldest, python

PYPROJECT = (ROOT / "pyproject.toml").read_text(encoding="utf-8")


def test_11_24_every_requirement_of_the_package_is_pinned_to_its_lower_bound() -> None:
    found = oldest(PYPROJECT)
    assert len({line.partition("==")[0] for line in found}) == len(found)
    for line in found:
        name, version = line.split("==")
        assert re.search(rf'"{re.escape(name)}>={re.escape(version)}"', PYPROJECT)
    assert {"numpy", "scipy", "sympy", "networkx", "llvmlite", "numba", "pytest"} <= {
        line.partition("==")[0] for line in found
    }
    assert re.fullmatch(r"3\.\d+", python(PYPROJECT))


def test_11_24_the_subset_is_made_of_tests_that_there_are() -> None:
    assert all((ROOT / name).is_file() for name in SUBSET)


@pytest.mark.parametrize("requirement", ["numpy", "numpy<3", "numpy>=2,<3", "numpy==2"])
def test_a_requirement_without_a_lower_bound_alone_is_refused(requirement: str) -> None:
    wrong = re.sub(r'"numpy>=[\d.]+"', f'"{requirement}"', PYPROJECT, count=1)
    with pytest.raises(ValueError, match="no lower bound alone"):
        oldest(wrong)
