"""Item 12.A.1: intervals hold the parameters that records were made with, or the law is refused by name."""

import json
import sys
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import binom

from filippov import UsageError, solve
from filippov.analysis.estimation.force_input import SmoothForce
from filippov.analysis.estimation.identification import identify, parameter_bounds
from filippov.analysis.estimation.identify_fit import Fitting
from filippov.analysis.estimation.record import Record
from filippov.analysis.estimation.residual_noise import generalised
from filippov.app.cli.main import main
from filippov.models import get
from filippov.models.driven import driven_mass

sys.path.insert(0, str(Path(__file__).parent / "benchmarks"))
import intervals

KINDS = {kind.name: kind for kind in intervals.KINDS}


@lru_cache
def drawn(name: str, draws: int) -> list[dict[str, object]]:
    return intervals.campaign([name], draws, workers=1)


def test_12_1_intervals_cover() -> None:
    """Draws of every sort of noise together: fails where 90 % allow as few hits once in 10,000 times.

    Before, 0 of 4 held with noise on the force, and about one in six at 20 ms.
    """
    rows = [*drawn("page, 20 ms", 5), *drawn("force 0.5 %", 2), *drawn("AR 0.8", 2), *drawn("held force", 1)]
    assert all(row["success"] for row in rows), [row["message"] for row in rows]
    for name in intervals.TRUE:
        hits = sum(bool(row[f"{name} held"]) for row in rows)
        assert hits >= binom.ppf(1e-4, len(rows), 0.9), (name, hits)


def fitting(name: str, seed: int) -> Fitting:
    """A fit to a draw, as `identify` prepares it."""
    system, names = driven_mass(), list(intervals.TRUE)
    return Fitting(
        intervals.record(KINDS[name], seed), system, names, ["m", "beta"], {"m": 1, "beta": 2}, 2, 1e-9,
        parameter_bounds(system, names), None,
    )  # fmt: skip


@pytest.mark.parametrize("name", ["page, 10 ms", "AR 0.5", "AR 0.8", "held force"])
def test_12_1_a_force_without_noise_widens_little(name: str) -> None:
    """Intervals 1.19 times as wide as those under a force known throughout would hold 98 % in place of 95.

    What the samples leave open of the force is the same in each draw: it does not show as spread. It made
    errors of Fc and b 1.3 to 2.3 times as large.
    """
    own = fitting(name, 3)
    first = np.concatenate((list(intervals.START.values()), own.initial_states().ravel()))
    fit = own.fit(first, KINDS[name].hold)
    assert fit.success
    noise, windows = fit.noise, fit.linear.windows
    known = [replace(w, load=w.load[:, :0]) for w in windows]
    errors, least = (
        np.sqrt(np.diag(generalised(q, noise.sigma, noise.rho, noise.kappa).covariance)[:4])
        for q in (windows, known)
    )
    assert np.all(errors < 1.1 * least), errors / least


def test_12_1_the_force_between_samples_is_that_of_the_motion() -> None:
    """Beside estimates that are as wrong as usual, the loop's gains and its force at any time are found.

    The oracle is the effort of the exact loop; at a stop the force was wrong by 2e-3.
    """
    own = fitting("page, 10 ms", 0)
    run = solve(get("hunting").build(), (0.1, 0, 0), (0, 5), rtol=1e-11, atol=1e-13)
    t = own.record.t
    starts = [run.sol(t[q.start])[:2] for q in own.known]
    theta = np.concatenate(([4.0001, 1.9999, 0.10002, 1.0002], *starts))
    pieces = own.force("cubic")
    for _ in range(3):
        force = own.smooth(theta, pieces)
        pieces = tuple(force.pieces(q.start, q.stop) for q in own.known)
    gains = force.gains / force.units
    np.testing.assert_allclose(gains[:3], [-100, -10, -10], rtol=2e-3)
    for part, own_pieces in zip(own.known, pieces, strict=True):
        at = t[part.start] + np.concatenate(([0.0], np.cumsum(own_pieces.length)))[:-1]
        for tau in (0.2, 0.5, 0.8):
            x, v, z = run.sol(at + tau * own_pieces.length)
            value = own_pieces.terms @ tau ** np.arange(4)
            assert np.max(np.abs(value + 10 * (x + v + 10 * z))) < 1e-4


@pytest.mark.parametrize("name", ["beta 1.5", "LuGre"])
def test_12_1_another_law_is_refused(name: str) -> None:
    """Where the record is of another law there is no interval, and a sentence says why."""
    (row,) = drawn(name, 1)
    assert not row["success"]
    assert "refused: the residuals depend on" in str(row["message"])
    assert row["Fs low"] == -np.inf
    assert row["Fs high"] == np.inf


def test_12_1_the_command_refuses_as_well(tmp_path: Path) -> None:
    """Exit code 3, intervals that are null in JSON, and the sentence; tune takes no such file."""
    record = intervals.record(KINDS["beta 1.5"], 2)
    rows = zip(record.t, record.x, record.force, strict=True)
    data, out = tmp_path / "measured.csv", tmp_path / "out"
    lines = ["t,x,force", *(f"{a:.9g},{b:.9g},{c:.9g}" for a, b, c in rows)]
    data.write_text("\n".join(lines) + "\n", encoding="utf-8")
    words = ["identify", str(data), "--fixed", "m=1", "--fixed", "beta=2", "--hold", "cubic"]
    words += ["--windows", "2"]
    for name, value in intervals.START.items():
        words += ["--start", f"{name}={value}"]
    assert main([*words, "-o", str(out)]) == 3
    found = json.loads((out / "identified.json").read_text(encoding="utf-8"))
    assert found["refused"].startswith("refused: the residuals depend on")
    assert found["intervals"]["Fs"] == [None, None]
    assert found["hold"] == "cubic"
    words = ["tune", "hunting", "--identified", str(out / "identified.json"), "--over", "P=5:60"]
    assert main([*words, "-o", str(tmp_path / "tuning")]) == 2


def test_12_1_a_held_force_is_recognised() -> None:
    """The sampling is inferred where it is not declared: the sampled controller holds its effort."""
    kind = KINDS["held force"]
    found = identify(
        intervals.record(kind, 0), driven_mass(), list(intervals.TRUE), start=intervals.START,
        fixed={"m": 1, "beta": 2}, windows=2,
    )  # fmt: skip
    assert found.success
    assert found.hold == "zero"
    for name, value in intervals.TRUE.items():
        assert abs(found.values[name] - value) < 4 * found.errors[name] < 0.01 * value


def test_12_1_noise_is_estimated() -> None:
    """The correlation of the position's noise from sample to sample, and its size, are estimated."""
    kind = KINDS["AR 0.8"]
    found = identify(
        intervals.record(kind, 1), driven_mass(), list(intervals.TRUE), start=intervals.START,
        fixed={"m": 1, "beta": 2}, windows=2, hold="cubic",
    )  # fmt: skip
    # sd(rho) = sqrt((1 - rho^2)/n) = 0.027; of the size sqrt((1 + rho^2)/(1 - rho^2)/(2 n)) = 7 %.
    assert abs(found.rho - 0.8) < 4 * 0.027
    assert found.sigma == pytest.approx(intervals.NOISE, rel=4 * 0.07)


def kinked(t: np.ndarray) -> np.ndarray:
    """3 sin 2 t up to t = 1.003, where its slope turns round; straight from there."""
    s = 1.003
    return np.where(t < s, 3 * np.sin(2 * t), 3 * np.sin(2 * s) + 6 * np.cos(2 * s) * -2 * (t - s))


def test_12_1_kinks_are_kept_between_samples() -> None:
    """Without noise a kink between samples is found where it is, and the force on both sides."""
    t = np.arange(0, 2, 0.01)
    force = SmoothForce(t, kinked(t), [99], t[:-1] < 1)
    pieces = force.pieces(0, len(t))
    starts = np.concatenate(([0.0], np.cumsum(pieces.length)))[:-1]
    tau = np.array([0.1, 0.5, 0.9])
    values = pieces.terms @ np.vander(tau, 4, increasing=True).T
    truth = kinked(starts[:, None] + tau * pieces.length[:, None])
    assert len(pieces.length) == len(t)
    assert np.any(np.abs(starts - 1.003) < 1e-5)
    assert np.max(np.abs(values - truth)) < 1e-5


def test_12_1_noise_of_the_force_is_known() -> None:
    """The smooth force lies within its spread of the true one, as often as a normal error does."""
    t = np.arange(0, 2, 0.01)
    noisy = kinked(t) + 0.05 * np.random.default_rng(5).standard_normal(t.size)
    force = SmoothForce(t, noisy, [99], t[:-1] < 1)
    assert force.s == pytest.approx(0.05, rel=4 / np.sqrt(2 * 190))
    pieces = force.pieces(0, len(t))
    size = np.linalg.norm(pieces.spread[:, 0], axis=1)
    starts = np.concatenate(([0.0], np.cumsum(pieces.length)))[:-1]
    off = (pieces.terms[:, 0] - kinked(starts)) / size
    # Neighbours err together: some 40 independent errors among them.
    assert 0.6 < np.sqrt(np.mean(off**2)) < 1.4


def test_12_1_level_is_checked() -> None:
    record = Record(np.arange(20.0), np.zeros(20), np.zeros(20))
    with pytest.raises(UsageError, match="between 0 and 1"):
        identify(record, driven_mass(), ["Fs"], windows=1, level=95)


@pytest.mark.parametrize("start", [(5.3, 2.8, 0.11, 1.3), (3.2, 1.3, 0.06, 0.6)])
def test_12_1_jumps_of_the_objective_are_passed(start: tuple[float, ...]) -> None:
    """A held force frees the mass at samples only; a guess at which it never moves finds the values too."""
    kind = KINDS["held force"]
    found = identify(
        intervals.record(kind, 1), driven_mass(), list(intervals.TRUE),
        start=dict(zip(intervals.TRUE, start, strict=True)), fixed={"m": 1, "beta": 2}, windows=2,
        hold="zero",
    )  # fmt: skip
    assert found.success
    for name, value in intervals.TRUE.items():
        # Errors of 1e-13 were the sign of a difference step that had met a jump.
        assert abs(found.values[name] - value) < 4 * found.errors[name] < 0.01 * value
        assert found.errors[name] > 1e-6
