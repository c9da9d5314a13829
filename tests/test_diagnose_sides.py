"""What the doctor says of the sides of a surface: jumps and corners, chattering and rest, equalities."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from filippov.analysis import diagnose
from filippov.analysis.programs.diagnosis import Diagnosis
from filippov.base.user_file import load_file


def diagnosed(folder: Path, source: str, x0: Any, t_end: float, **options: Any) -> Diagnosis:
    """The diagnosis of a function f of this source."""
    path = folder / "program.py"
    path.write_text(source, encoding="utf-8")
    return diagnose(load_file(path).f, x0, (0, t_end), **options)


def kinds(found: Diagnosis) -> dict[str, str]:
    """The kind of each surface by its name."""
    return {switch.surface: switch.kind for switch in found.switches}


def test_15_5_a_jump_in_a_narrow_part_of_a_surface_is_no_corner(tmp_path: Path) -> None:
    """At |v| = 0.02 the field jumps by u where |u| < 0.3 only, which few random states and no step meet."""
    found = diagnosed(
        tmp_path,
        "def f(t, y):\n"
        "    x, v = y\n"
        "    u = 10*(1 - x) - 2*v\n"
        "    if abs(v) < 0.02 and abs(u) < 0.3: u = 0\n"
        "    return [v, u]\n",
        (5, 0), 1.0,
    )  # fmt: skip
    assert kinds(found)["Abs(v) - 0.02"] == "jump"
    assert found.of("dead band")


def test_15_5_a_band_of_velocities_by_hand_is_a_dead_band(tmp_path: Path) -> None:
    """Inside |w| < 1e-6 the friction of a pendulum balances its weight: w = 0 is meant, and the solution
    stays there, where the README's pendulum of the same numbers does."""
    found = diagnosed(
        tmp_path,
        "import numpy as np\n"
        "def f(t, y):\n"
        "    q, w = y\n"
        "    weight = -9.81*np.sin(q)\n"
        "    if abs(w) < 1e-6:\n"
        "        drag = -weight if abs(weight) <= 0.5 else -0.5*np.sign(weight)\n"
        "    else:\n"
        "        drag = -0.5*np.sign(w)\n"
        "    return [w, weight + drag]\n",
        (1, 0), 10.0,
    )  # fmt: skip
    place, = found.switches
    assert (place.surface, place.kind, place.slides) == ("w", "jump", True)
    assert found.solution is not None
    assert found.solution.x_end == pytest.approx((-0.028348, 0), abs=1e-6)
    assert [finding.lines for finding in found.of("dead band")] == [(5,)]


def test_15_5_a_run_that_rests_on_a_surface_does_not_chatter(tmp_path: Path) -> None:
    """With v == 0 written out the program rests at v = 0 to the last bit, up to t = 1: nothing changes sides
    there. It hangs later, and the surface is named."""
    found = diagnosed(
        tmp_path,
        "from math import copysign\n"
        "def drag(v, pull):\n"
        "    if v == 0: return min(max(pull, -4), 4)\n"
        "    return 2*copysign(1, v)\n"
        "def f(t, y):\n"
        "    x, v = y\n"
        "    pull = 20*(0.2*t - x)\n"
        "    return [v, pull - drag(v, pull)]\n",
        (0, 0), 8.0,
    )  # fmt: skip
    assert not found.of("chattering")
    hang, = found.of("hang")
    assert hang.surface == "v"
    assert hang.t is not None
    assert hang.t > 1
    assert found.of("equality")


def test_15_5_chattering_begins_in_the_stay_in_which_it_does(tmp_path: Path) -> None:
    """At rest from 0 to 1, with v = 0 to the last bit, then pushed; it stops at t = 3 and chatters."""
    found = diagnosed(
        tmp_path,
        "import numpy as np\n"
        "def f(t, y):\n"
        "    x, v = y\n"
        "    push = 1.5 if 1 < t < 2 else 0\n"
        "    return [v, push - 0.5*np.sign(v)]\n",
        (0, 0), 5.0, max_calls=3000,
    )  # fmt: skip
    said, = (finding for finding in found.findings if finding.surface == "v" and finding.t is not None)
    assert said.kind in ("hang", "chattering")
    assert said.t == pytest.approx(4, abs=1e-6)          # (1.5 - 0.5)*1/0.5 after t = 2


@pytest.mark.parametrize("condition", ["u != us", "not u == us", "us - u != 0"])
def test_15_5_whether_a_clip_holds_is_no_equality_of_floats(tmp_path: Path, condition: str) -> None:
    """u == clip(u, -2, 2) holds in a whole part of the states, exactly."""
    found = diagnosed(
        tmp_path,
        "def f(t, y):\n"
        "    x, i = y\n"
        "    u = 5*(1 - x) + i\n"
        "    us = max(-2, min(2, u))\n"
        f"    return [us - x, 0 if {condition} else 1 - x]\n",
        (0, 0), 10.0,
    )  # fmt: skip
    assert not found.of("equality")
    assert found.solution is not None
    assert found.solution.success


def test_15_5_what_has_no_value_at_a_surface_warns_of_nothing(tmp_path: Path) -> None:
    """1 - w/v < 0.2 of a wheel that starts at rest."""
    found = diagnosed(
        tmp_path,
        "def f(t, y):\n"
        "    v, w = y\n"
        "    slip = 1 - w/v if v > 0 else 0\n"
        "    return [-2.0, 3*(-1 if slip < 0.2 else 1)]\n",
        (3, 3), 2.0,
    )  # fmt: skip
    assert found.solution is not None


@pytest.mark.parametrize(
    "direction", ["v/n if n > EPS else np.zeros(2)", "v/max(n, EPS)", "v/(n if EPS < n else 1e-9)"]
)
def test_15_5_a_direction_with_a_band_by_hand_runs_and_is_named(tmp_path: Path, direction: str) -> None:
    """A body on springs with friction in the plane. Along x the direction is the sign of one speed, and the
    body rests at -0.2 after turns at -1.4 and 0.8; elsewhere scipy says, with a hundred times the band."""
    source = (
        "import numpy as np\n"
        "EPS = 1e-9\n"
        "def f(t, y):\n"
        "    x, v = y[:2], y[2:]\n"
        "    n = np.linalg.norm(v)\n"
        f"    return np.concatenate([v, -x - 0.3*({direction})])\n"
    )
    found = diagnosed(tmp_path, source, (2, 0, 0, 0), 12.0)
    assert found.solution is not None
    assert found.solution.success
    assert found.solution.x_end == pytest.approx([-0.2, 0, 0, 0], abs=1e-6)
    assert any("plane" in finding.sentence for finding in found.of("dead band"))
    found = diagnosed(tmp_path, source, (2, 0.5, 0.3, 0), 12.0)
    assert found.solution is not None
    assert found.solution.success
    assert found.code.rstrip().endswith("method='Radau')")

    def f(t: float, y: Any) -> Any:
        return [y[2], y[3], *(-y[:2] - 0.3 * y[2:] / max(float(np.hypot(*y[2:])), 1e-7))]

    known = solve_ivp(f, (0, 12), (2, 0.5, 0.3, 0), method="Radau", rtol=1e-9, atol=1e-12)
    assert found.solution.x_end == pytest.approx(known.y[:, -1], abs=2e-6)


def test_15_5_a_jump_at_some_times_only_is_no_corner(tmp_path: Path) -> None:
    """Between t = 1 and 2 the rate jumps where y passes 1.5, before and after it does not."""
    found = diagnosed(
        tmp_path,
        "def f(t, y):\n"
        "    if t < 1: return [1.0]\n"
        "    elif t < 2 and y[0] < 1.5: return [0.4]\n"
        "    return [-y[0]]\n",
        (0,), 40.0,
    )  # fmt: skip
    assert kinds(found)["y0 - 1.5"] == "jump"
