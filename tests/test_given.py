"""Odd values for every keyword of what is public: taken for what they say, or refused with an own error.

The calls stand in `given_calls.py` and `given_analysis.py`. What an annotation says of a keyword is read here
by other means than in the package, and decides which values have to be refused.
"""

from __future__ import annotations

import inspect
import os
import signal
import traceback
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from decimal import Decimal
from fractions import Fraction
from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")

import numpy as np
import pytest
import sympy
from given_analysis import calls as analysis_calls
from given_calls import FRICTION, Call, calls, run
from matplotlib import pyplot as plt

import filippov
from filippov import ModelError, SolveError, UsageError
from filippov import analysis as an

OWN = (ModelError, UsageError, SolveError, OSError)
PACKAGE = str(Path(filippov.__file__).resolve().parent.parent)
LONGEST = 1200
PARTS = 8
# What takes longer is tried in every way then.
EVERYTHING = os.environ.get("FILIPPOV_PROFILE") == "nightly"
NUMBERS = {"float", "Positive", "NonNegative", "int", "Count", "Natural"}
# What others make, what takes any name, and what hands on to others.
RESULTS = {
    "Solution", "SolutionTree", "Ensemble", "Events", "Status", "EventKind", "Exact", "Branch", "Orbit",
    "Diagnosis", "parameters", "compare", "switch_curve",
}  # fmt: skip


class Odd:
    """Something that nobody expects."""

    def __repr__(self) -> str:
        return "an odd thing"


NO_NUMBER = {
    "text": "1e-9", "word": "zero", "True": True, "nan": float("nan"), "complex": 1 + 1j, "list": [1.0, 2.0],
    "dict": {}, "bytes": b"1", "symbol": sympy.Symbol("zz"), "odd": Odd(), "huge": 10**400,
    "flags": np.array([True]),
}  # fmt: skip
NO_FLAG = {"no": "no", "0": 0, "1": 1, "1.0": 1.0, "list": [], "odd": Odd(), "text": "True"}
NO_TEXT = {
    "5": 5, "True": True, "list": ["zz"], "bytes": b"zz", "odd": Odd(), "dict": {}, "nan": float("nan")
}  # fmt: skip
NO_NAMES = {"5": 5, "numbers": [5], "dict": {"zz": 1}, "True": True, "bytes": b"zz", "odd": Odd()}
NO_FUNCTION = {"5": 5, "text": "zz", "True": True, "list": [], "dict": {}}
NO_MAPPING = {"5": 5, "text": "zz", "True": True, "odd": Odd(), "nan": float("nan")}
ANYTHING = {
    **NO_NUMBER, "None": None, "0": 0, "-1": -1, "inf": float("inf"), "empty": [], "texts": ["1", "2"],
    "nested": [[1.0], [2.0, 3.0]], "unknown": "zz", "letters": "abc", "class": Odd, "function": lambda: 0,
    "array": np.array(["1", "2"]), "table": np.zeros((3, 3)), "generator": None, "nones": [None, None],
    "twice": ["x", "x"], "mapping": {"zz": 1}, "deep": [[[[[]]]]], "set": {1, 2}, "slice": slice(None),
    "dates": np.array(["2024-01-01"], dtype="M8[D]"), "fraction": Fraction(1, 2), "decimal": Decimal("0.5"),
    "masked": np.ma.masked_array([1.0, 2.0], [True, False]), "scalar": np.float32(0.5), "range": range(2),
    "no dimension": np.array(0.5), "surrogate": "\ud800", "nul": "a\0b", "blank": " ", "no text": "",
}  # fmt: skip
KINDS = {
    **dict.fromkeys(NUMBERS, NO_NUMBER), "bool": NO_FLAG, "str": NO_TEXT, "Sequence[str]": NO_NAMES,
    "Values": NO_MAPPING, "Mapping[str, float]": NO_MAPPING,
}  # fmt: skip


def refused(annotation: str) -> dict[str, Any]:
    """What may not be taken for a keyword of this annotation; nothing where it is not simple."""
    parts = {part.strip() for part in annotation.split("|")}
    left = [part for part in parts if part != "None"]
    if len(left) != 1:
        return {}
    found = dict(KINDS.get(left[0], NO_FUNCTION if left[0].startswith("Callable[") else {}))
    if found and "None" not in parts:
        found["None"] = None
    if left[0] in ("Positive", "Count"):
        found |= {"0": 0, "-1": -1}
    if left[0] in ("Count", "Natural", "int"):
        found["half"] = 0.5
    return found


@contextmanager
def limited(seconds: int) -> Iterator[None]:
    def late(*_: object) -> None:
        raise TimeoutError("it hangs")

    old = signal.signal(signal.SIGALRM, late)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, old)


def raw(error: BaseException) -> str:
    """What is wrong with an error: no own one, and not raised on purpose; "" where nothing is."""
    if isinstance(error, OWN) and not isinstance(error, TimeoutError):
        return "" if len(str(error)) < LONGEST else f"a message of {len(str(error))} characters"
    last = traceback.extract_tb(error.__traceback__)[-1]
    if (last.line or "").startswith("raise ") and PACKAGE in str(Path(last.filename).resolve()):
        return ""
    return f"{type(error).__name__}: {error} ({Path(last.filename).name}:{last.lineno})"


def outcome(call: Call, given: dict[str, Any]) -> BaseException | None:
    """What the call raises."""
    try:
        with limited(60), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            made = call.function(**given)
            if isinstance(made, Iterator):
                list(made)
    except BaseException as error:  # noqa: BLE001  # whatever it is, it is looked at
        return error
    finally:
        plt.close("all")
    return None


def wrong(name: str, call: Call) -> list[str]:
    """Everything that is wrong with what a call says to odd values."""
    out = []
    first = outcome(call, dict(call.given))
    if first is not None:
        return [f"{name} as it is: {type(first).__name__}: {first}"]
    signature = inspect.signature(call.function).parameters
    for keyword in call.given:
        annotation = str(signature[keyword].annotation) if keyword in signature else ""
        may_not = refused(annotation)
        for odd, value in ({**ANYTHING, **may_not} if call.quick or EVERYTHING else may_not).items():
            once = (letter for letter in "ab") if odd == "generator" else value
            error = outcome(call, {**call.given, keyword: once})
            told = f"{name}({keyword}: {annotation} = {odd})"
            if error is None and odd in may_not:
                out.append(f"{told} is taken")
            elif error is not None and raw(error):
                out.append(f"{told}: {raw(error)}")
    if inspect.isclass(call.function) or not getattr(call.function, "__name__", "__").startswith("__"):
        near = f"{next(iter(call.given))}s_"
        error = outcome(call, {**call.given, near: 1})
        if not isinstance(error, OWN) or near not in str(error):
            out.append(f"{name}(unknown keyword): {error!r}")
    return out


@pytest.fixture(scope="module")
def everything(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, Call]]:
    folder = tmp_path_factory.mktemp("given")
    here = Path.cwd()
    os.chdir(folder)
    yield {**calls(folder), **analysis_calls(folder)}
    os.chdir(here)


@pytest.mark.parametrize("part", range(PARTS))
def test_18_1_odd_values_are_taken_for_what_they_say_or_refused(
    part: int, everything: dict[str, Call]
) -> None:
    found = [wrong(name, call) for name, call in [*everything.items()][part::PARTS]]
    assert not [sentence for sentences in found for sentence in sentences]


def numbers_like(value: float) -> list[Any]:
    """The same number as others write it."""
    out = [np.float64(value), np.array(value), Fraction(value), Decimal(value), sympy.Float(value, 40)]
    if float(value).is_integer():
        out += [int(value), float(value), np.int32(value), sympy.Integer(int(value))]
    return out


def test_18_1_a_number_is_the_same_however_it_is_written(everything: dict[str, Call]) -> None:
    """Every keyword that is a number, of what runs in a moment: the results are equal."""
    tried = 0
    for name, call in everything.items():
        if not call.quick or not (inspect.isroutine(call.function) or inspect.isclass(call.function)):
            continue
        signature = inspect.signature(call.function).parameters
        for keyword, value in call.given.items():
            annotation = str(getattr(signature.get(keyword), "annotation", ""))
            kinds = {part.strip() for part in annotation.split("|")}
            if not kinds & NUMBERS or isinstance(value, bool) or not isinstance(value, int | float):
                continue
            wanted = repr(call.function(**call.given))
            for other in numbers_like(value):
                got = repr(call.function(**{**call.given, keyword: other}))
                assert got == wanted or " at 0x" in wanted, f"{name}({keyword}={other!r})"
                tried += 1
    assert tried > 200


def test_18_1_a_text_in_the_place_of_names_is_one_name() -> None:
    with pytest.raises(UsageError, match="'abc'"):
        an.flow_derivative(run(), parameters="abc")
    whole, alone = (an.equilibria(FRICTION, modes=modes) for modes in (["+"], "+"))
    assert [found.mode for found in whole] == [found.mode for found in alone]


def test_18_1_every_public_function_is_called(everything: dict[str, Call]) -> None:
    """What `filippov` and `filippov.analysis` export, but for sympy's functions, errors and results."""
    done = {inspect.unwrap(getattr(call.function, "__func__", call.function)) for call in everything.values()}
    missing = []
    for package in (filippov, an):
        for name in package.__all__:
            one = getattr(package, name)
            own = callable(one) and str(getattr(one, "__module__", "")).startswith("filippov.")
            error = inspect.isclass(one) and issubclass(one, Exception)
            own = own and name != "Piecewise"  # sympy's, with a check of its pieces
            if own and not error and name not in RESULTS and inspect.unwrap(one) not in done:
                missing.append(name)
    assert not missing
