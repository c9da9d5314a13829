"""Dead bands by hand that stand for u = 0: the doctor's System holds what the program means to hold.

The oracle follows a block with friction phase by phase with scipy: at rest while the load is below the static
limit, else in motion one way until v = 0.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from test_diagnose_sides import diagnosed, kinds

from filippov.analysis import diagnose
from filippov.analysis.programs.diagnosis import Diagnosis
from filippov.base.arrays import Array

END = 12.0
HEAD = """
import numpy as np
FS, FC, EPS = {fs}, {fc}, {eps}
def pull(t, x):
    return -2.0*x + {drive}*np.sin(1.3*t)
def f(t, y):
    x, v = y
    load = pull(t, x)
"""
# As users write what is held at rest; the first two hold no more than what acts in motion.
SAME_LIMIT = {
    "clip": """
    F = np.clip(load, -FC, FC) if abs(v) < EPS else FC*np.sign(v)
    return [v, load - F]
""",
    "least of both": """
    if np.isclose(v, 0, atol=EPS):
        F = min(abs(load), FC)*np.sign(load)
    else:
        F = FC*np.sign(v)
    return [v, load - F]
""",
}
OWN_LIMIT = {
    "clip": """
    F = np.where(np.abs(v) <= EPS, np.clip(load, -FS, FS), FC*np.sign(v))
    return [v, load - F]
""",
    "if in if": """
    if abs(v) < EPS:
        if abs(load) <= FS:
            F = load
        else:
            F = FS*np.sign(load)
    elif v > 0:
        F = FC
    else:
        F = -FC
    return [v, load - F]
""",
    "early return": """
    if abs(v) < EPS and abs(load) <= FS:
        return [0.0, 0.0]
    return [v, load - FC*np.sign(v)]
""",
    "edges apart": """
    if v > EPS:
        F = FC
    elif v < -EPS:
        F = -FC
    else:
        F = np.clip(load, -FS, FS)
    return [v, load - F]
""",
    "within": """
    if -EPS < v < EPS:
        F = np.sign(load)*min(FS, abs(load))
    else:
        F = np.copysign(FC, v)
    return [v, load - F]
""",
    "largest and least": """
    F = max(-FS, min(FS, load)) if EPS > abs(v) else FC*np.sign(v)
    return [v, load - F]
""",
}


def block(
    load: Callable[[float, float], float], static: float, kinetic: float, x0: float
) -> Callable[[float], Array]:
    """Place and velocity over time of a unit mass from rest, phase by phase."""
    pieces: list[tuple[float, float, Callable[[float], Array]]] = []
    t, x = 0.0, x0
    while t < END:
        grid = np.linspace(t, END, 4000)
        above = [q for q in grid if abs(load(float(q), x)) > static]
        if abs(load(t, x)) <= static:
            here = x
            last = END if not above else brentq(
                lambda q, x=x: abs(load(q, x)) - static, above[0] - (grid[1] - grid[0]), above[0], xtol=1e-14
            )  # fmt: skip
            pieces.append((t, last, lambda q, here=here: np.array([here, 0.0])))
            t = last
            if not above:
                break
        way = np.sign(load(t, x))

        def stops(q: float, y: Array) -> float:
            return float(y[1])

        stops.terminal, stops.direction = True, -way  # type: ignore[attr-defined]
        run = solve_ivp(
            lambda q, y, way=way: [y[1], load(q, y[0]) - way * kinetic], (t, END), (x, 0.0), "DOP853",
            events=stops, dense_output=True, rtol=1e-12, atol=1e-13, max_step=0.1,
        )  # fmt: skip
        pieces.append((t, run.t[-1], run.sol))
        t, x = float(run.t[-1]), float(run.y[0, -1])
    return lambda q: next(at(q) for start, end, at in pieces if start <= q <= end)


def written(folder: Path, text: str, rng: np.random.Generator, ratio: float) -> tuple[Diagnosis, float]:
    """The diagnosis of a program with numbers drawn at random, and the largest error of its solution."""
    kinetic, drive, x0 = (round(float(rng.uniform(*ends)), 3) for ends in ((0.3, 0.8), (0.6, 2.5), (-2, 2)))
    static, width = round(ratio * kinetic, 3), float(rng.choice([1e-9, 1e-6, 1e-4, 1e-3]))
    source = HEAD.format(fs=static, fc=kinetic, eps=width, drive=drive) + text
    found = diagnosed(folder, source, (x0, 0), END)
    exact = block(lambda t, x: -2.0 * x + drive * np.sin(1.3 * t), static, kinetic, x0)
    assert found.solution is not None
    assert found.solution.sol is not None
    times = np.linspace(0, END, 400)
    error = max(float(np.max(np.abs(found.solution.sol(q) - exact(q)))) for q in times)
    return found, error


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("text", SAME_LIMIT.values(), ids=SAME_LIMIT.keys())
def test_15_5_what_a_band_holds_is_held_by_the_sign(text: str, seed: int, tmp_path: Path) -> None:
    found, error = written(tmp_path, text, np.random.default_rng(seed), 1.0)
    assert error < 1e-6
    assert kinds(found) == {"v": "jump"}
    assert "radius" not in found.code
    assert "EPS" not in found.code


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("text", OWN_LIMIT.values(), ids=OWN_LIMIT.keys())
def test_15_5_a_larger_limit_at_rest_is_the_radius_of_the_surface(
    text: str, seed: int, tmp_path: Path
) -> None:
    rng = np.random.default_rng(seed)
    found, error = written(tmp_path, text, rng, float(rng.uniform(1.1, 1.8)))
    assert error < 1e-6
    assert kinds(found) == {"v": "jump"}
    assert "surfaces=[Surface('v', v, radius=p.FS/p.FC)]" in found.code.replace("Abs(p.FC)", "p.FC")
    (band,) = found.of("dead band")
    assert "for v = 0" in band.sentence
    made: dict[str, object] = {}
    exec(found.code, made)  # noqa: S102  (the text that the doctor printed itself)
    assert made["solution"].x_end == pytest.approx(found.solution.x_end, abs=1e-12)  # type: ignore[attr-defined, union-attr]


@pytest.mark.parametrize("test", ["v == 0", "v == 0.0 and abs(load) <= FS", "0 == v"])
def test_15_5_what_an_equality_holds_is_the_radius_too(test: str, tmp_path: Path) -> None:
    text = f"""
    if {test}:
        F = load if abs(load) <= FS else FS*np.sign(load)
    else:
        F = FC*np.sign(v)
    return [v, load - F]
"""
    found, error = written(tmp_path, text, np.random.default_rng(1), 1.5)
    assert error < 1e-6
    assert "radius=p.FS/p.FC" in found.code
    assert "the System says so by a radius" in found.of("equality")[0].sentence


def test_15_5_a_limited_load_keeps_the_limit_at_rest() -> None:
    """The effort of a controller that saturates acts in motion and at rest."""

    def f(t: float, y: Array) -> list[float]:
        x, v = y
        effort = np.clip(10 * (np.sin(t) - x), -3, 3)
        friction = np.clip(effort, -1.2, 1.2) if abs(v) < 1e-5 else 0.8 * np.sign(v)
        return [v, effort - friction]

    found = diagnose(f, (1, 0), (0, 5))
    assert found.system is not None
    assert [s.radius for s in found.system.surfaces if s.name == "v"] == [
        (pytest.approx(-1.5), pytest.approx(1.5))
    ]


def test_15_5_a_dead_zone_of_the_plant_stays() -> None:
    """So do the rest of a relay within 0.01 of its set point, a play, a slope by hand, a step controller."""

    def relay(t: float, y: Array) -> list[float]:
        s = y[0] + y[1]
        return [y[1], 0.0 if abs(s) < 0.01 else -float(np.sign(s))]

    def play(t: float, y: Array) -> list[float]:
        return [y[1], -(0.0 if abs(y[0]) < 0.05 else y[0] - 0.05 * float(np.sign(y[0]))) - 0.1 * y[1]]

    def slope(t: float, y: Array) -> list[float]:
        return [y[1], -y[0] - (0.5 * y[1] / 1e-2 if abs(y[1]) < 1e-2 else 0.5 * float(np.sign(y[1])))]

    for program, band in (
        (relay, "Abs(y0 + y1) - 0.01"),
        (play, "Abs(y0) - 0.05"),
        (slope, "Abs(y1) - 0.01"),
    ):
        assert band in kinds(diagnose(program, (1, 0), (0, 5)))


def test_15_5_limits_that_differ_by_direction_keep_their_band() -> None:
    """No radius holds 0.9 one way and 0.6 the other."""

    def f(t: float, y: Array) -> list[float]:
        x, v = y
        load = -2.0 * x + np.sin(t)
        friction = np.clip(load, -0.6, 0.9) if abs(v) < 1e-4 else 0.5 * np.sign(v)
        return [v, load - friction]

    assert "Abs(v) - 0.0001" in kinds(diagnose(f, (1, 0), (0, 1)))
