"""What functions of the user's depend on: what can change a result changes the digest, or is named.

The oracle is the function itself: a change after which it returns another number must change its digest, or
the digest must have said that it cannot see all of it.
"""

from __future__ import annotations

import functools
import importlib
import os
import subprocess
import sys
import types
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sweep_case import ROOT, serial

from filippov import Band, Problem, Surface, Sweep, System, TimeEvent, UsageError
from filippov.sweep.dataset import load_table
from filippov.sweep.dependence import dependence, plain_system

NIGHTLY = os.environ.get("FILIPPOV_PROFILE") == "nightly"

# One module each: `made` is the function, {} the place of a number that decides what it returns.
SOURCES = {
    "a global": "K = {}\ndef made(x): return K*x\n",
    "a global of a helper": "K = {}\ndef inner(x): return K*x\ndef made(x): return inner(x)\n",
    "a global of a helper of a helper": (
        "K = {}\ndef a(x): return K*x\ndef b(x): return a(x)\ndef made(x): return b(x)\n"
    ),
    "a constant": "def made(x): return {}*x\n",
    "a constant of a lambda inside": "def made(x):\n    f = lambda y: {}*y\n    return f(x)\n",
    "a comprehension": "def made(x): return sum({}*x for _ in range(2))\n",
    "a closure": "def outer(K):\n    def made(x): return K*x\n    return made\nmade = outer({})\n",
    "a list in a closure": (
        "def outer(K):\n    def made(x): return K[0]*x\n    return made\nmade = outer([{}])\n"
    ),
    "a default": "def made(x, K={}): return K*x\n",
    "a keyword's default": "def made(x, *, K={}): return K*x\n",
    "a dict": "K = {{'a': {{'b': {}}}}}\ndef made(x): return K['a']['b']*x\n",
    "a tuple": "K = (1, ({},))\ndef made(x): return K[1][0]*x\n",
    "a set": "K = {{{}, -1e9}}\ndef made(x): return max(K)*x\n",
    "an array": "import numpy as np\nK = np.array([1.0, {}])\ndef made(x): return K[1]*x\n",
    "an array of objects": (
        "import numpy as np\nK = np.array([1.0, {}], dtype=object)\ndef made(x): return K[1]*x\n"
    ),
    "an attribute of an object": (
        "class C:\n    def __init__(self, K): self.K = K\nc = C({})\ndef made(x): return c.K*x\n"
    ),
    "an attribute of a class": "class C:\n    K = {}\ndef made(x): return C.K*x\n",
    "a slot": (
        "class C:\n    __slots__ = ('K',)\n    def __init__(self, K): self.K = K\nc = C({})\n"
        "def made(x): return c.K*x\n"
    ),
    "a method": "class C:\n    def f(self, x): return {}*x\nmade = C().f\n",
    "a method of a base": (
        "class B:\n    def f(self, x): return {}*x\nclass C(B): pass\nc = C()\n"
        "def made(x): return c.f(x)\n"
    ),
    "a property": "class C:\n    @property\n    def K(self): return {}\nc = C()\ndef made(x): return c.K*x\n",
    "a static method": "class C:\n    @staticmethod\n    def f(x): return {}*x\ndef made(x): return C.f(x)\n",
    "a callable object": "class C:\n    def __call__(self, x): return {}*x\nmade = C()\n",
    "a dataclass": (
        "from dataclasses import dataclass\n@dataclass(frozen=True)\nclass C:\n    K: float = {}\n"
        "def made(x): return C().K*x\n"
    ),
    "a named tuple": (
        "from typing import NamedTuple\nclass C(NamedTuple):\n    K: float\nc = C({})\n"
        "def made(x): return c.K*x\n"
    ),
    "an enum": "import enum\nclass E(enum.Enum):\n    K = {}\ndef made(x): return E.K.value*x\n",
    "a member of an enum": (
        "import enum\nclass E(enum.Enum):\n    K = {}\nk = E.K\ndef made(x): return k.value*x\n"
    ),
    "partial": "import functools\ndef f(K, x): return K*x\nmade = functools.partial(f, {})\n",
    "a wrapper": (
        "import functools\ndef times(K):\n    def deco(f):\n        @functools.wraps(f)\n"
        "        def g(x): return K*f(x)\n        return g\n    return deco\n"
        "@times({})\ndef made(x): return x\n"
    ),
    "a cached function": (
        "import functools\nK = {}\n@functools.lru_cache\ndef f(x): return K*x\ndef made(x): return f(x)\n"
    ),
    "an attribute of the function": "def made(x): return made.K*x\nmade.K = {}\n",
    "an interpolator of scipy": (
        "from scipy.interpolate import CubicSpline\nf = CubicSpline([0, 1, 2, 3], [0, {}, 1, 2])\n"
        "def made(x): return float(f(1.0))*x\n"
    ),
    "a vectorised function": (
        "import numpy as np\nK = {}\ndef f(x): return K*x\ng = np.vectorize(f)\n"
        "def made(x): return float(g(x))\n"
    ),
    "a compiled function": (
        "import numba\nK = {}\n@numba.njit\ndef f(x): return K*x\ndef made(x): return f.py_func(x)\n"
    ),
    "a module": "import other_{n} as other\ndef made(x): return other.K*x\n",
    "a name of a module": "from other_{n} import K\ndef made(x): return K*x\n",
    "a function of a module": "import other_{n} as other\ndef made(x): return other.f(x)\n",
    "a module handed over": (
        "import other_{n} as other\ndef f(m, x): return m.K*x\ndef made(x): return f(other, x)\n"
    ),
    "an import inside": "def made(x):\n    import other_{n}\n    return other_{n}.K*x\n",
    "an import from inside": "def made(x):\n    from other_{n} import K\n    return K*x\n",
}
OTHER = "K = {}\ndef f(x): return K*x\n"
UNSEEN = {
    "a file": "def made(x):\n    with open(__file__) as f: return len(f.read())*x\n",
    "a path": "from pathlib import Path\ndef made(x): return len(Path(__file__).read_text())*x\n",
    "the environment": "import os\ndef made(x): return float(os.environ.get('K', 1))*x\n",
    "getenv": "from os import getenv\ndef made(x): return float(getenv('K', 1))*x\n",
    "the clock": "import time\ndef made(x): return time.time()*x\n",
    "the clock by name": "from time import monotonic\ndef made(x): return monotonic()*x\n",
    "the date": "import datetime\ndef made(x): return datetime.date.today().day*x\n",
    "random": "import random\ndef made(x): return random.random()*x\n",
    "a random generator": "import random\nr = random.Random(1)\ndef made(x): return r.random()*x\n",
    "numpy's random": "import numpy as np\ndef made(x): return np.random.rand()*x\n",
    "a generator of numpy": (
        "import numpy as np\nr = np.random.default_rng(1)\ndef made(x): return r.random()*x\n"
    ),
    "a file of numpy": "import numpy as np\ndef made(x): return np.load('K.npy')*x\n",
    "text as code": "def made(x): return eval('2')*x\n",
    "globals()": "K = 1\ndef made(x): return globals()['K']*x\n",
    "getattr": "import math\ndef made(x): return getattr(math, 'p' + 'i')*x\n",
    "a global that it changes": "n = 0\ndef made(x):\n    global n\n    n += 1\n    return n*x\n",
    "an open file": "f = open(__file__)\ndef made(x): return len(f.readline())*x\n",
    "a generator": "g = (k for k in range(99))\ndef made(x): return next(g)*x\n",
    "another program": "import subprocess\ndef made(x): return subprocess.call(['true'])*x\n",
    "an address": "def made(x): return id(x)\n",
}
_count = iter(range(10**9))


def module(folder: Path, text: str, number: object) -> types.ModuleType:
    """The module of a text with the number in its place, read anew."""
    n = next(_count)
    (folder / f"other_{n}.py").write_text(OTHER.format(number))
    (folder / f"made_{n}.py").write_text(text.replace("{n}", str(n)).format(number) if "{" in text else text)
    importlib.invalidate_caches()
    return importlib.import_module(f"made_{n}")


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.syspath_prepend(str(tmp_path))
    return tmp_path


def plain(folder: Path, text: str, number: object) -> tuple[str, float]:
    """The digest of the function as it is read again from the same file, and what it returns for 3."""
    for name in ("made_same", "other_same"):
        sys.modules.pop(name, None)
    (folder / "other_same.py").write_text(OTHER.format(number))
    (folder / "made_same.py").write_text(text.replace("{n}", "same").format(number))
    for cached in (folder / "__pycache__").glob("*same*"):
        cached.unlink()
    importlib.invalidate_caches()
    function = importlib.import_module("made_same").made
    found = dependence(function)
    assert found.unseen == ()
    assert dependence(function) == found
    return found.digest, float(function(3.0))


@pytest.mark.parametrize("what", SOURCES)
@settings(max_examples=60 if NIGHTLY else 3)
@given(numbers=st.tuples(st.floats(-1e6, 1e6), st.floats(-1e6, 1e6)))
def test_11_19_a_number_that_changes_the_value_changes_the_digest(
    what: str, numbers: tuple[float, float], tmp_path_factory: pytest.TempPathFactory
) -> None:
    folder = tmp_path_factory.mktemp("made")
    sys.path.insert(0, str(folder))
    try:
        (one, first), (again, same), (other, second) = (
            plain(folder, SOURCES[what], number) for number in (numbers[0], numbers[0], numbers[1])
        )
    finally:
        sys.path.remove(str(folder))
    assert (one, first) == (again, same)
    if first != second:
        assert one != other


@pytest.mark.parametrize("what", UNSEEN)
def test_11_19_what_cannot_be_seen_is_named(what: str, place: Path) -> None:
    made = module(place, UNSEEN[what], 0)
    found = dependence(made.made)
    if what == "an open file":
        made.f.close()
    assert found.unseen, what
    assert all(sentence.startswith(("'", "a function", "class")) for sentence in found.unseen)


def test_11_19_another_process_reads_the_same(place: Path) -> None:
    # Hashes of texts differ from process to process, addresses too.
    names = [module(place, text, 1.5).__name__ for text in SOURCES.values()]
    code = f"""
import importlib, sys
sys.path.insert(0, {str(place)!r})
from filippov.sweep.dependence import dependence
for name in {names!r}:
    print(dependence(importlib.import_module(name).made).digest)
"""
    path = os.pathsep.join((str(ROOT), os.environ.get("PYTHONPATH", "")))
    done = [
        subprocess.run(
            [sys.executable, "-c", code], env={**os.environ, "PYTHONPATH": path, "PYTHONHASHSEED": seed},
            capture_output=True, text=True, check=True,
        ).stdout.split() for seed in ("1", "2")
    ]  # fmt: skip
    assert done[0] == done[1] == [dependence(sys.modules[name].made).digest for name in names]


def field(t: float, x: Any, p: Any, s: Any) -> list[float]:
    return [-p.k * x[0]]


def times(number: float) -> Callable[..., Any]:
    return lambda t, x, p: number * x


CHANGES: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
    "h": ({"h": lambda t, x, p: x[0] - 1}, {"h": lambda t, x, p: x[0] - 2}),
    "reset": ({"reset": times(0.5)}, {"reset": times(0.6)}),
    "gradient": ({"gradient": lambda t, x, p: [1.0]}, {"gradient": lambda t, x, p: [2.0]}),
    "radius": ({"radius": lambda t, x, p: 1.0}, {"radius": lambda t, x, p: 1.5}),
    "a number as radius": ({"radius": 1.0}, {"radius": 1.5}),
    "width": ({"width": 0.0}, {"width": 0.1}),
    "kind": ({"kind": "observer"}, {"kind": "kink"}),
    "side": ({"reset": times(0.5), "side": "+"}, {"reset": times(0.5), "side": "-"}),
    "linear": ({"linear": True}, {"linear": False}),
    "the period of a clock": ({"period": 0.5}, {"period": 0.25}),
    "the reset of a clock": ({"tick": times(0.5)}, {"tick": times(0.6)}),
    "the comparator": ({"width of a band": 0.1}, {"width of a band": 0.2}),
    "compile": ({"compile": True}, {"compile": False}),
}


def of(
    h: Any = lambda t, x, p: x[0] - 1, period: float = 0.5, tick: Any = None, compile: Any = None,  # noqa: A002
    **surface: Any,
) -> System:  # fmt: skip
    band = surface.pop("width of a band", None)
    clock = TimeEvent("tick", period=period, reset=tick)
    system = System(
        field=field, surfaces=[Surface("one", h, **surface)], states="x", parameters={"k": 1.0},
        time_events=[clock], compile=compile,
    )  # fmt: skip
    return system.with_comparator(Band(band)) if band else system


@pytest.mark.parametrize("what", CHANGES)
def test_11_19_every_part_of_a_system_of_functions_is_read(what: str) -> None:
    one, other = (dependence(*plain_system(of(**change))) for change in CHANGES[what])
    assert one == dependence(*plain_system(of(**CHANGES[what][0])))
    assert one.digest != other.digest
    assert one.unseen == other.unseen == ()


HALF = """
import numpy as np
from filippov import Problem, System
K = [1.0]

def field(t, x, p, s):
    return [-K[0]*x[0] + 0*p.a]

def twice(solution):
    return {"twice": 2*K[0]}

problem = Problem(System(field=field, surfaces=[], states="x", parameters={"a": 0.0}), (1.0,), (0, 1))
"""


@pytest.mark.parametrize("measure", [["end"], ["end", "twice"]])
def test_11_19_a_changed_constant_is_not_mixed_with_what_there_is(place: Path, measure: list[str]) -> None:
    made = module(place, HALF.replace("{", "{{").replace("}", "}}"), 0)
    given = [made.twice if name == "twice" else name for name in measure]

    def sweep() -> Sweep:
        return Sweep(made.problem, {"a": range(8)}, measure=given)

    serial(sweep(), place / "out", chunk=2)
    for path in sorted((place / "out/chunks").glob("*.npz"))[:2]:
        path.unlink()
    made.K[0] = 2.0
    with pytest.raises(UsageError, match=r"do not mix with this one:.*model was"):
        serial(sweep(), place / "out", resume=True)
    made.K[0] = 1.0
    table = serial(sweep(), place / "out", resume=True)
    assert np.allclose(table["end(x)"], np.exp(-1), rtol=1e-6)
    assert load_table(place / "out").content_hash == table.content_hash


def test_11_19_a_resume_that_cannot_see_all_says_so_and_asks_for_trust(place: Path) -> None:
    (place / "K.txt").write_text("2")
    text = (
        f"def made(solution):\n    with open({str(place / 'K.txt')!r}) as file:\n"
        "        return {'K': float(file.read())}\n"
    )
    made = module(place, text.replace("{", "{{").replace("}", "}}"), 0)
    problem = Problem(of(), (0.5,), (0, 0.1))
    sweep = functools.partial(Sweep, problem, {"k": [1, 2, 3]}, measure=made.made)
    table = serial(sweep(), place / "out")
    with pytest.raises(UsageError, match=r"cannot be told: 'made' calls open\. If.*trust=True, --trust"):
        serial(sweep(), place / "out", resume=True)
    assert serial(sweep(), place / "out", resume=True, trust=True).content_hash == table.content_hash
    # What has changed and can be seen is not trusted.
    with pytest.raises(UsageError, match="tail was"):
        serial(sweep(tail=0.25), place / "out", resume=True, trust=True)
    assert serial(sweep(), place / "new", resume=True).complete  # nothing there yet to go on with
