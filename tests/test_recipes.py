"""The recipes of CONTRIBUTING, each followed in a copy of the packages: what it says is enough."""

import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


class Copy:
    """The three packages in a folder of their own, to be changed and run."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        for name in ("filippov", "models", "analysis"):
            shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))

    def add(self, path: str, text: str) -> None:
        """A new file."""
        assert not (self.folder / path).exists()
        (self.folder / path).write_text(text, encoding="utf-8")

    def put(self, path: str, before: str, added: str) -> None:
        """Text put in before the first place of another one."""
        file = self.folder / path
        text = file.read_text(encoding="utf-8")
        assert before in text, f"{path} has no {before!r}"
        file.write_text(text.replace(before, added + before, 1), encoding="utf-8")

    def python(self, *arguments: str, **settings: str) -> str:
        """What Python prints in it."""
        env = {**os.environ, "PYTHONPATH": str(self.folder), "PYTHONDONTWRITEBYTECODE": "1", **settings}
        done = subprocess.run(
            [sys.executable, *arguments], cwd=self.folder, env=env, capture_output=True, text=True,
            check=False, timeout=600,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr[-2000:]
        return done.stdout


@pytest.fixture(scope="module")
def copy(tmp_path_factory: pytest.TempPathFactory) -> Copy:
    return Copy(tmp_path_factory.mktemp("recipes"))


@pytest.fixture
def fresh(tmp_path: Path) -> Callable[[], Copy]:
    """A copy of its own, for a change of what every unit is compiled from."""
    return lambda: Copy(tmp_path)


def test_13_8_a_model(copy: Copy) -> None:
    text = (ROOT / "models/thermostat.py").read_text(encoding="utf-8")
    copy.add("models/greenhouse.py", text.replace("thermostat", "greenhouse"))
    copy.put("models/registry.py", '    "hunting": "mass",\n', '    "greenhouse": "greenhouse",\n')
    assert "greenhouse" in copy.python("-m", "filippov", "models", "describe", "greenhouse", "--json")
    code = """if True:
        from filippov import models, solve
        entry = models.get("greenhouse")
        run = solve(entry.build(), entry.x0, (0, 20))
        print(len(run.events.of("setpoint")) > 3)
    """
    assert copy.python("-c", code) == "True\n"


def test_13_8_a_friction_law(copy: Copy) -> None:
    """A constant level but for |v| < 1, where it falls as a straight line."""
    copy.put("models/laws.py", "@dataclass(frozen=True)\nclass Hyperbolic", '''@dataclass(frozen=True)
class Ramp(FrictionLaw):
    """g = Max(Fs - |v|, Fs - 1)."""

    Fs: Level = 3.0

    def parameters(self) -> dict[str, Parameter]:
        """Return Fs."""
        return declare("Fs", self.Fs, "N", "static friction level")

    def slip(self, speed: Expr, p: ParameterNamespace) -> Sides:
        """g = Max(Fs - |v|, Fs - 1)."""
        plus, minus = (sympy.Max(Fs - speed, Fs - 1) for Fs in sides(p, "Fs"))
        return plus, minus


''')
    copy.put("models/__init__.py", '"Stribeck", "Viscous"', '"Ramp", ')
    code = """if True:
        from filippov import solve
        from filippov.models import P, Ramp, controlled_mass
        run = solve(controlled_mass(Ramp((4, 3)), P(P=1)), (5, 0), (0, 1))
        print(Ramp((4, 3)).curve([-2, -0.5, 0.5, 2]).tolist(), run.start_mode, run.x_end[1] < 0)
    """
    assert copy.python("-c", code) == "[-2.0, -2.5, 3.5, 3.0] (-1, -1) True\n"


def test_13_8_a_measure(copy: Copy) -> None:
    """The range of a state over the tail: max - min."""
    path = "filippov/sweep/measure.py"
    copy.put(path, '"amplitude")\n', '"range", ')
    copy.put(path, '"amplitude": 0.5 * (high - low)}', '"range": high - low, ')
    code = """if True:
        import tempfile
        import numpy as np
        from filippov import Problem, Sweep, System, states
        x, v = states("x v")
        swing = Problem(System({x: v, v: -x}), (0, 0), (0, 10))
        ranges = Sweep(swing, {"x0.x": [1.0, 2.0]}, measure="range(x)")
        table = ranges.run(tempfile.mkdtemp() + "/kept", jobs=1)
        print(np.round(table["range(x)"], 6).tolist())
    """
    assert copy.python("-c", code) == "[2.0, 4.0]\n"


def test_13_8_a_quantity(copy: Copy) -> None:
    copy.add("filippov/app/bank/quantities/steps.py", '''"""How the run went."""

from filippov.app.bank.quantities.quantity import Quantity
from filippov.app.bank.case_runs import CaseRuns


class Modes(Quantity, quantity="number of segments"):
    """Number of segments of the solution."""

    def __call__(self, subject: CaseRuns) -> int:
        return len(subject.main.segments)
''')
    copy.put("filippov/app/bank/quantities/__init__.py", "    sliding,\n", "    steps,\n")
    copy.put("filippov/app/bank/quantities/__init__.py", "sliding, orbits", "steps, ")
    assert '"number of segments"' in copy.python("-m", "filippov", "bank", "schema")


def test_13_8_a_command(copy: Copy) -> None:
    copy.add("filippov/app/cli/greet.py", '''"""filippov greet: says whom it greets."""

from typing import Any

from filippov.app.cli.console import Console


def run(settings: dict[str, Any], console: Console) -> int:
    """Say it."""
    console.result({"greeted": settings["whom"]})
    console.say(f"hello {settings['whom']}")
    return 0
''')
    copy.put("filippov/app/cli/catalogue.py", '    Command(\n        "doctor"', """    Command(
        "greet", "say hello", "greet", (Option("whom", "who is greeted", text, metavar="NAME"),),
        "filippov greet --whom me",
    ),
""")
    assert "say hello" in copy.python("-m", "filippov", "--help")
    assert copy.python("-m", "filippov", "greet", "--whom", "me", "--json").count('"me"') == 1


def test_13_8_a_study(copy: Copy) -> None:
    text = (ROOT / "models/study/belt.py").read_text(encoding="utf-8")
    copy.add("models/study/brake.py", text.replace('name="belt"', 'name="brake"'))
    copy.put("models/studies.py", '"belt": "study.belt"}', '"brake": "study.brake", ')
    copy.put("filippov/app/report/checks.py", "def classification(", '''def about(run: StudyRun) -> Section:
    """A section of its own."""
    return Section("about", "About", [Words("p", f"A study of {run.study.model}.")])


''')
    copy.put("filippov/app/report/study.py", "    (response.model,", '    (checks.about, "", 0),\n')
    copy.put("filippov/app/report/study.py", '    "summary", "model",', '    "about",\n')
    code = """if True:
        from filippov.models.studies import get_study
        from filippov.app.report.study import SECTIONS
        print(get_study("brake").model, SECTIONS[0][0].__name__)
    """
    assert copy.python("-c", code) == "belt_stribeck about\n"


def test_13_8_an_elementary_function(fresh: Callable[[], Copy]) -> None:
    """x' = erfc(1), compiled, after a time of 1."""
    own = fresh()
    own.put("filippov/base/elementary.py", '"erf",\n', '"erfc", ')
    code = """if True:
        from math import erfc
        from filippov import System, solve, states
        from filippov.model.expression import parse_expression
        x, y = states("x y")
        run = solve(System({x: parse_expression("erfc(y)", {"y": y}), y: 0 * x}), (0, 1), (0, 1))
        print(abs(run.x_end[0] - erfc(1)) < 1e-12)
    """
    assert own.python("-c", code) == "True\n"


def test_13_8_a_method(fresh: Callable[[], Copy]) -> None:
    """Bogacki & Shampine 1989, with its cubic interpolant: order 3 on x' = -x, sliding and events."""
    own = fresh()
    own.put("filippov/kernel/tables/tableaus.py", "TABLEAUS: dict", """BS3 = Tableau(
    "BS3", 3, ({0: 1 / 2}, {1: 3 / 4}, {0: 2 / 9, 1: 1 / 3, 2: 4 / 9}), (1 / 2, 3 / 4, 1.0), (), (),
    ({0: 2 / 9 - 7 / 24, 1: 1 / 3 - 1 / 4, 2: 4 / 9 - 1 / 3, 3: -1 / 8},),
    ((0, 1, -4 / 3, 5 / 9), (0, 0, 1, -2 / 3), (0, 0, 4 / 3, -8 / 9), (0, 0, -1, 1)),
)
""")
    own.put("filippov/kernel/tables/tableaus.py", "DP5, RADAU)}", "BS3, ")
    code = """if True:
        import numpy as np
        from filippov import System, sign, solve, states
        x, v = states("x v")
        decay = System({x: -x, v: -2 * sign(v)})
        errors = []
        for step in (0.1, 0.05):
            run = solve(decay, (1, 1), (0, 2), method="BS3", max_step=step, first_step=step, rtol=0.5, atol=1)
            errors.append(abs(run.x_end[0] - np.exp(-2)))
            assert abs(run.events[0].t - 0.5) < 1e-12 and run.x_end[1] == 0
        print(2.7 < np.log2(errors[0] / errors[1]) < 3.6)
    """
    assert own.python("-c", code) == "True\n"


def test_13_8_a_kernel(fresh: Callable[[], Copy]) -> None:
    """A number that the loop keeps, the kernel that keeps it, and one that Python calls: the longest step."""
    own = fresh()
    own.put("filippov/kernel/loop/state.py", "    # The square of its error", "    longest: float\n")
    own.put("filippov/kernel/loop/search.py", "@inline\n@kernel\ndef carry_on(", '''@kernel
def note_length(run: Trajectory) -> None:
    """Keep the longest step."""
    run.clock.longest = max(run.clock.longest, abs(run.now.step))


''')
    own.put("filippov/kernel/loop/search.py", "    clock, m, order, w, now =", "    note_length(run)\n")
    own.put("filippov/kernel/loop/probe.py", "Integers, Scratch\n", "Trajectory, ")
    own.put("filippov/kernel/loop/probe.py", "@entry\n@kernel\ndef probe(", '''@entry
@kernel
def longest_step(run: Trajectory, out: Vector) -> int:
    """The longest step so far."""
    out[0] = run.clock.longest
    return 0


''')
    code = """if True:
        import numpy as np
        from filippov import System, solve, states
        from filippov.solving.state.run import Run
        x, v = states("x v")
        collect, out = Run.collect, np.zeros(1)
        def collected(run):
            run.machine.call("longest_step", run=run.trajectory, out=out)
            assert out[0] == run.clock.longest
            collect(run)
        Run.collect = collected
        for backend in ("compiled", "python"):
            run = solve(System({x: v, v: -x}), (1, 0), (0, 3), backend=backend)
            print(abs(out[0] - np.diff(run.t).max()) < 1e-14)
    """
    assert own.python("-c", code) == "True\nTrue\n"


def test_13_8_a_stop_in_a_kernel(fresh: Callable[[], Copy]) -> None:
    """Python stops there and shows names; compiled it is refused with file and line."""
    own = fresh()
    own.put("filippov/kernel/loop/advance.py", "    take_up(run)\n    code = AGAIN", "    breakpoint()\n")
    own.add("seen.py", '''"""What a debugger shows."""

import sys


def show() -> None:
    """The time of the trajectory."""
    frame = sys._getframe(1)
    print(frame.f_code.co_name, float(frame.f_locals["run"].clock.t))
''')
    code = """if True:
        from filippov import System, solve, states
        x, v = states("x v")
        try:
            solve(System({x: v, v: -x}), (1, 0), (0.25, 1))
        except Exception as error:
            print(error)
    """
    assert own.python("-c", code, FILIPPOV_PYTHON="1", PYTHONBREAKPOINT="seen.show") == "advance 0.25\n"
    lines = (own.folder / "filippov/kernel/loop/advance.py").read_text(encoding="utf-8").splitlines()
    place = f"advance.py:{lines.index('    breakpoint()') + 1}"
    assert place in own.python("-c", code)
