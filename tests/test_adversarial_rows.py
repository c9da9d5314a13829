"""Every row of docs/adversarial.md has a test that carries its id, and names only tests that there are."""

import ast
import re
from pathlib import Path

import pytest

TESTS = Path(__file__).parent
PAGE = (TESTS.parent / "docs" / "adversarial.md").read_text(encoding="utf-8")
NAMES = {
    node.name
    for path in TESTS.glob("test_*.py")
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
    if isinstance(node, ast.FunctionDef) and node.name.startswith("test_")
}
ROWS = [f"A{i}" for i in range(1, 31)] + [f"B{i}" for i in range(1, 25)]


@pytest.mark.parametrize("row", ROWS)
def test_every_row_has_a_test_and_a_line(row: str) -> None:
    pattern = re.compile(rf"test_{row[0].lower()}0*{row[1:]}_")
    assert any(pattern.match(name) for name in NAMES)
    assert len(re.findall(rf"^\| {row} \|", PAGE, flags=re.MULTILINE)) == 1


def test_the_page_names_tests_that_there_are() -> None:
    assert set(re.findall(r"`(test_[ab]\d+_\w+)`", PAGE)) <= NAMES
