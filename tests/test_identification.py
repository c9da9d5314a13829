"""Friction from data: records made by the exact model with stated noise, read back within their intervals."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import mpmath as mp
import numpy as np
import pytest
from command import summary

from filippov import UsageError, solve
from filippov.analysis.estimation import misfit
from filippov.analysis.estimation.friction_curve import friction_force, identify_curve
from filippov.analysis.estimation.identification import Identified, identify
from filippov.analysis.estimation.record import Curve, Record, read_record
from filippov.analysis.estimation.residual_noise import Noise, Window, generalised
from filippov.app.cli.main import main
from filippov.models import get
from filippov.models.driven import driven_mass
from filippov.models.laws import Stribeck

TRUE = {"Fs": 4.0, "Fc": 2.0, "vs": 0.1, "b": 1.0}
START = {"Fs": 3.4, "Fc": 2.5, "vs": 0.16, "b": 0.5}
NOISE, SEED = 1e-5, 7


def hunting_record(samples: int = 600, noise: float = NOISE) -> Record:
    """The reference loop from x = 0.1 over 6 s: position with Gaussian noise, and the effort."""
    run = solve(get("hunting").build(), (0.1, 0, 0), (0, 6), rtol=1e-11, atol=1e-13)
    t = np.linspace(0, 6, samples + 1)
    x, v, z = run.sol(t)
    effort = 10 * (x + v + 10 * z)
    return Record(t, x + noise * np.random.default_rng(SEED).standard_normal(t.size), -effort)


@pytest.fixture(scope="module")
def found() -> Identified:
    return identify(hunting_record(), driven_mass(), list(TRUE), start=START, fixed={"beta": 2}, windows=3)


def test_reference_friction_is_found_within_its_intervals(found: Identified) -> None:
    assert found.success
    for name, value in TRUE.items():
        assert abs(found.values[name] - value) < 3.5 * found.errors[name]
        assert abs(found.values[name] - value) < 2e-3 * value
    # 600 residuals: the standard deviation is known to 1/sqrt(2 * 590) = 3 %.
    assert found.sigma == pytest.approx(NOISE, rel=0.1)
    assert found.degrees == 601 - 4 - 6


def test_intervals_are_students(found: Identified) -> None:
    """Student's factor at 95 % is 1.9640 with all 591 degrees of freedom, and 2.0 with 60 of them."""
    assert not found.refused
    for name, (low, high) in found.intervals.items():
        assert 1.9639 < (high - low) / (2 * found.errors[name]) < 2.0
        assert (low + high) / 2 == pytest.approx(found.values[name])
    assert found.covariance[0, 0] == pytest.approx(found.errors["Fs"] ** 2)
    np.testing.assert_allclose(found.measured - found.fitted, found.residual)


def test_without_noise_the_parameters_are_recovered() -> None:
    """Held force: the model is exact on every interval, so nothing is left but the tolerances."""
    system = driven_mass(Stribeck(Fs=1.5, Fc=1.0, vs=0.2, beta=2, b=0.3), m=2.0)
    t = np.linspace(0, 4, 161)
    force = np.where(np.sin(3 * t) > 0, 3.0, -2.6)
    x = [np.array([0.0, 0.0])]
    for k in range(len(t) - 1):
        inputs = {"force": force[k], "interval": t[k + 1] - t[k]}
        x.append(solve(system, x[-1], (0, 1), parameters=inputs, rtol=1e-11, atol=1e-13).x_end)
    record = Record(t, np.array(x)[:, 0], force)
    got = identify(
        record, driven_mass(m=2.0), ["Fs", "Fc", "b", "m"], fixed={"vs": 0.2, "beta": 2}, hold="zero",
        start={"Fs": 2.0, "Fc": 0.7, "b": 0.1, "m": 1.5}, windows=1,
    )  # fmt: skip
    for name, value in {"Fs": 1.5, "Fc": 1.0, "b": 0.3, "m": 2.0}.items():
        assert got.values[name] == pytest.approx(value, abs=1e-5)


def test_friction_curve() -> None:
    rng = np.random.default_rng(3)
    v = np.concatenate((-np.geomspace(1, 1e-3, 80), np.geomspace(1e-3, 1, 80)))
    force = np.sign(v) * (2 + 2 * np.exp(-(np.abs(v) / 0.1) ** 1.4)) + v
    law = driven_mass()
    np.testing.assert_allclose(friction_force(law, v, {"beta": 1.4}), force, rtol=1e-13)
    noisy = Curve(v, force + 0.02 * rng.standard_normal(v.size))
    got = identify_curve(noisy, law, ["Fs", "Fc", "vs", "beta", "b"], start={"vs": 0.4, "beta": 1.0})
    for name, value in {"Fs": 4, "Fc": 2, "vs": 0.1, "beta": 1.4, "b": 1}.items():
        assert abs(got.values[name] - value) < 3.5 * got.errors[name]
    assert got.sigma == pytest.approx(0.02, rel=0.2)


@pytest.mark.parametrize(("speed", "force"), [(1e6, 1e-6), (1e-6, 1.0), (1.0, 1e-6), (1e3, 1e6)])
def test_a_curve_in_other_units_has_the_same_parameters_in_these(speed: float, force: float) -> None:
    """The sum of squares is the same function: its minimum and the errors there scale as the units do."""
    rng = np.random.default_rng(3)
    v = np.concatenate((-np.geomspace(1, 1e-3, 40), np.geomspace(1e-3, 1, 40)))
    points = np.sign(v) * (2 + 2 * np.exp(-((v / 0.1) ** 2))) + v + 0.05 * rng.standard_normal(v.size)
    known, free = {"Fs": 4.0, "Fc": 2.0, "vs": 0.1, "b": 1.0}, ["Fs", "Fc", "vs", "b"]
    unit = {"Fs": force, "Fc": force, "vs": speed, "b": force / speed}
    plain = identify_curve(Curve(v, points), driven_mass(), free, fixed={"beta": 2})
    start = {name: 0.8 * known[name] * unit[name] for name in free}
    measured = Curve(speed * v, force * points)
    got = identify_curve(measured, driven_mass(), free, start=start, fixed={"beta": 2})
    assert got.success
    for name in free:
        assert got.values[name] == pytest.approx(plain.values[name] * unit[name], rel=1e-6)
        assert got.errors[name] == pytest.approx(plain.errors[name] * unit[name], rel=1e-5)


@pytest.mark.parametrize(
    ("made", "said"),
    [
        (lambda t: Record(t, np.where(t == 3, np.nan, t), t), "x[3] is nan"),
        (lambda t: Record(t, t, np.where(t == 5, np.inf, t)), "force[5] is inf"),
        (lambda t: Record(np.where(t == 4, 3, t), t, t), "t[4] = 3 does not come after t[3] = 3"),
        (lambda t: Curve(t, np.where(t == 2, np.nan, t)), "friction[2] is nan"),
    ],
)
def test_samples_without_a_value_or_out_of_order_are_refused(made: Callable[[Any], Any], said: str) -> None:
    with pytest.raises(UsageError, match=re.escape(said)):
        made(np.arange(20.0))


@pytest.mark.parametrize("level", [0, 1, -0.5, 95, float("nan"), "0.95", True, None])
def test_a_level_is_a_number_between_0_and_1(level: Any) -> None:
    v = np.linspace(0.1, 3, 12)
    with pytest.raises(UsageError, match=r"level is .*, expected a"):
        identify_curve(Curve(v, 1 + np.exp(-v)), driven_mass(), ["Fs", "Fc", "vs"], level=level)
    with pytest.raises(UsageError, match=r"level is .*, expected a"):
        identify(Record(v, v, v), driven_mass(), ["Fc"], level=level)


@pytest.mark.parametrize(
    ("speeds", "free", "lost"),
    [
        ([0.5, -0.5], ["Fc", "b"], ["Fc", "b"]),  # Fc + b/2 alone
        ([0.5, -0.5, 0.8], ["Fc", "b", "vs"], ["Fc", "b", "vs"]),  # two forces, three parameters
        ([2, 3, 5], ["Fc", "b", "Fs"], ["Fs"]),  # exp(-400)
        ([0.01, 0.05, 0.5, 2], ["Fc", "b", "Fs"], []),
        ([0.01, 0.05, 0.5, 2], ["Fc", "b", "m"], ["m"]),
    ],
)
def test_what_a_curve_does_not_determine_has_no_interval(
    speeds: list[float], free: list[str], lost: list[str]
) -> None:
    """By the rank of dF/dp at the speeds, of F = Fc + (Fs - Fc) exp(-(v/vs)^2) + b v."""
    v = np.repeat(speeds, 12)
    force = np.sign(v) * (2 + 2 * np.exp(-((v / 0.1) ** 2))) + v
    noise = 0.02 * np.random.default_rng(1).standard_normal(v.size)
    got = identify_curve(Curve(v, force + noise), driven_mass(), free, fixed={"beta": 2})
    assert [name for name in free if got.errors[name] == np.inf] == lost
    assert all(np.isfinite(got.intervals[name]).all() == (name not in lost) for name in free)
    assert got.success == (not lost)
    assert got.message.startswith(f"the data do not determine {', '.join(lost)}: ") == bool(lost)


def test_what_a_record_does_not_determine_has_no_interval() -> None:
    """A mass that rests under a force below Fs tells nothing of friction."""
    t = np.linspace(0, 4, 201)
    noise = 1e-5 * np.random.default_rng(2).standard_normal(t.size)
    got = identify(Record(t, 0.1 + noise, np.sin(t)), driven_mass(), ["Fc", "b"], windows=1)
    assert not got.success
    assert all(got.errors[name] == np.inf for name in ("Fc", "b"))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("t,x\n" + "0,1\n" * 9, r"no column u \(or force\)"),
        ("t,x,u\n" + "".join(f"{k},1,2\n" for k in (*range(8), 7)), "line 10: t = 7 does not come after 7"),
        ("t,x,u\n" + "".join(f"{k},1,nan\n" for k in range(9)), "line 2: u is nan"),
        ("t,x,u\n" + "".join(f"{k},1,__import__('os')\n" for k in range(9)), "expected a number"),
        ("t,x,u\n0,1,2\n", "expected at least 8"),
        ("t,x,w\n0,1,2\n", "unknown column 'w'"),
        ("t,x,u\n0,1\n", "2 values, expected 3"),
    ],
)
def test_bad_files_are_named(text: str, said: str, tmp_path: Path) -> None:
    path = tmp_path / "data.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(UsageError, match=said):
        read_record(path)


def test_bad_requests_are_named() -> None:
    record = hunting_record(60)
    with pytest.raises(UsageError, match="did you mean 'Fs'"):
        identify(record, driven_mass(), ["fs"])
    with pytest.raises(UsageError, match="both free and fixed"):
        identify(record, driven_mass(), ["Fs"], fixed={"Fs": 1})
    with pytest.raises(UsageError, match="too few"):
        identify(record, driven_mass(), ["Fs"], windows=30)
    with pytest.raises(UsageError, match="driven_mass"):
        identify(record, get("hunting").build(), ["Fs"])
    with pytest.raises(UsageError, match="hold"):
        identify(record, driven_mass(), ["Fs"], hold="second")


def test_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    record = hunting_record(300)
    path = tmp_path / "measured.csv"
    rows = zip(record.t, record.x, -record.force, strict=True)
    lines = ["time [s],position [m],effort [N]", *(f"{a:.9g},{b:.9g},{c:.9g}" for a, b, c in rows)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    words = ["identify", str(path), "--fixed", "m=1", "--fixed", "beta=2", "--windows", "2"]
    for name, value in START.items():
        words += ["--start", f"{name}={value}"]
    data = summary(capsys, *words, "-o", str(tmp_path / "out"))
    assert abs(data["values"]["Fs"] - 4) < 0.02
    assert data["success"]
    assert {p.name for p in (tmp_path / "out").iterdir()} == {"identified.json", "fit.csv", "fit.png"}
    assert main(["identify", str(tmp_path / "none.csv")]) == 2


@pytest.mark.parametrize("rho", [0.0, 0.7, -0.4])
@pytest.mark.parametrize("decades", [0, 6, 10])
def test_residuals_are_whitened_beside_a_force_of_any_size(rho: float, decades: int) -> None:
    """The factor of sigma^2 R + kappa F F' in 60 digits; in double precision that sum is indefinite."""
    rng = np.random.default_rng(decades)
    window = Window(rng.normal(size=8), rng.normal(size=(8, 2)), 10.0**decades * rng.normal(size=(8, 2)))
    noise = Noise(0.3, rho, 2.0, 0.0, np.zeros(3))
    step = generalised([window], noise.sigma, noise.rho, noise.kappa).step
    rows, jacobians = misfit._white([window], noise)
    with mp.workdps(60):
        load = mp.matrix(window.load.tolist())
        covariance = noise.kappa * load * load.T
        for i in range(8):
            for j in range(8):
                covariance[i, j] += mp.mpf(noise.sigma) ** 2 * mp.mpf(rho) ** abs(i - j)
        inverse = mp.cholesky(covariance) ** -1
        rest = window.residual - window.jacobian @ step
        for got, given in ((rows[0], rest), (jacobians[0], window.jacobian)):
            exact = inverse * mp.matrix(given.tolist())
            np.testing.assert_allclose(got.ravel(), [float(q) for q in exact], rtol=1e-8, atol=1e-8)


@pytest.mark.parametrize("seed", [1, 9, 45])
def test_starts_far_off_end_where_the_data_say(seed: int) -> None:
    """Each parameter up to 300 times too large or small: no worse than the law that made the points."""
    rng = np.random.default_rng(seed)
    true = {"Fc": rng.uniform(1, 3), "vs": 0.1 * 10 ** rng.uniform(-0.5, 0.5), "beta": rng.uniform(0.7, 2.2),
            "b": rng.uniform(0.2, 2)}  # fmt: skip
    true["Fs"] = true["Fc"] * rng.uniform(1.3, 2.5)
    v = np.concatenate((-np.geomspace(1, 1e-3, 80), np.geomspace(1e-3, 1, 80)))
    fall = np.exp(-((np.abs(v) / true["vs"]) ** true["beta"]))
    exact = np.sign(v) * (true["Fc"] + (true["Fs"] - true["Fc"]) * fall) + true["b"] * v
    points = exact + 0.02 * rng.standard_normal(v.size)
    start = {name: value * 10 ** rng.uniform(-2.5, 2.5) for name, value in true.items()}
    got = identify_curve(Curve(v, points), driven_mass(), ["Fs", "Fc", "vs", "beta", "b"], start=start)
    assert got.success, got.message
    assert np.sum(got.residual**2) <= np.sum((points - exact) ** 2)
    for name, value in true.items():
        assert abs(got.values[name] - value) < 4.5 * got.errors[name]
