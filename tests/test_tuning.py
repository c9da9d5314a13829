"""Tuning: its borders are the fold and the change of stability known otherwise; its gains do not hunt."""

import itertools
import json
from pathlib import Path

import numpy as np
import pytest
from command import summary
from scipy.spatial import cKDTree

from filippov import UsageError, solve
from filippov.analysis.gains.contraction import contraction
from filippov.analysis.gains.gain_map import gain_map
from filippov.analysis.gains.tuning import Tuning, tune
from filippov.analysis.maps.event_map import EventMap
from filippov.analysis.maps.section import Section
from filippov.app.cli.main import main
from filippov.models import get
from filippov.models.static_cycle import coulomb_ratio, static_cycles

MODEL = get("hunting")
SYSTEM, SECTION = MODEL.build(), Section.from_model(MODEL)
# Fold at beta = 2 and change of stability at beta = 1 (reference/hunting: two tolerances, closed return map).
FOLD, CHANGE = 21.0149797699, 26.6019490377


def test_ratio_of_coulomb_friction_is_the_algebraic_one() -> None:
    model = get("hunting_coulomb")
    gains = np.array([10.0, 20.0, 31.0])
    got = contraction(model.build(), Section.from_model(model), {"P": gains}, (0, 0.5), rtol=1e-9)
    wanted = [coulomb_ratio(m=1, P=float(g), D=1, I=10, b=1) for g in gains]
    np.testing.assert_allclose(got.ratio, wanted, rtol=1e-6)
    np.testing.assert_allclose(got.nearest, wanted, rtol=1e-6)
    assert np.all(got.lost == 0)


@pytest.mark.parametrize(("beta", "border"), [(2.0, FOLD), (1.0, CHANGE)])
def test_border_of_one_gain(beta: float, border: float) -> None:
    found = tune(SYSTEM, SECTION, {"P": (10, 60)}, (0, 0.5), parameters={"beta": beta}, samples=32)
    assert found.best is not None
    (limit,) = found.limits
    assert limit.lower == pytest.approx(border, rel=1e-4)
    assert found.best["P"] / found.margin == pytest.approx(border, rel=0.02)
    good = found.gains[found.ratio < 1]
    assert good.min() > border * (1 - 1e-4)


@pytest.fixture(scope="module")
def two_gains() -> Tuning:
    ranges = {"P": (8.0, 40.0), "I": (4.0, 20.0)}
    return tune(SYSTEM, SECTION, ranges, (0, 0.5), band=[{"vs": 0.08}, {"vs": 0.12}], samples=64, points=32)


def test_no_cycle_at_the_best_gains_nor_on_their_box(two_gains: Tuning) -> None:
    assert two_gains.best is not None
    assert two_gains.margin > 1.2
    s = 0.999 * two_gains.margin
    for factors in ((1.0, 1.0), *itertools.product((1 / s, s), repeat=2)):
        gains = {n: v * f for (n, v), f in zip(two_gains.best.items(), factors, strict=True)}
        for vs in (0.08, 0.12):
            turns = EventMap(SYSTEM, SECTION, parameters={**gains, "vs": vs}, order=2)
            assert [p.kind for p in turns.fixed_points(0, 0.5, 120)] == ["equilibrium set"]


def test_best_gains_come_to_rest_where_others_hunt(two_gains: Tuning) -> None:
    assert two_gains.best is not None
    calm = solve(SYSTEM, (0.3, 0, 0), (0, 60), parameters=two_gains.best)
    hunts = solve(SYSTEM, (0.3, 0, 0), (0, 60), parameters={"P": 10, "I": 10})
    early, late = np.linspace(30, 40, 200), np.linspace(50, 60, 200)
    assert np.max(np.abs(calm.sol(late)[0])) < 0.5 * np.max(np.abs(calm.sol(early)[0])) < 0.02
    assert np.max(np.abs(hunts.sol(late)[0])) > 0.2


@pytest.mark.parametrize(("name", "change"), [("hunting", {"beta": 0.5}), ("hunting_static", {})])
def test_where_every_controller_hunts_it_says_so(name: str, change: dict[str, float]) -> None:
    model = get(name)
    ranges = {"P": (10.0, 60.0), "I": (2.0, 20.0)}
    section = Section.from_model(model)
    found = tune(model.build(), section, ranges, (0, 0.5), parameters=change, samples=16)
    assert found.best is None
    assert "integral action hunts whatever its gains" in found.reason
    assert "no gains without cycles" in str(found)
    if name == "hunting_static":  # the algebra of the slip phase agrees
        for gain in (10, 35, 60):
            assert static_cycles(m=1, P=gain, D=1, I=10, Fs=4, Fc=2, b=1)


def test_map_of_gains_agrees_with_the_fold() -> None:
    gains = np.array([FOLD * 0.999, FOLD * 1.001])
    found = gain_map(SYSTEM, SECTION, ("P", gains), ("I", [10.0]), (0, 0.5), points=40)
    assert found.ratio.shape == (1, 2)
    assert found.ratio[0, 0] > 1 > found.ratio[0, 1]


def test_an_interrupt_keeps_what_was_found() -> None:
    def stop(done: int, total: int) -> None:
        if done == 2:
            raise KeyboardInterrupt

    found = tune(SYSTEM, SECTION, {"P": (10, 60)}, (0, 0.5), samples=16, progress=stop)
    assert not found.complete
    assert found.best is not None
    assert len(found.ratio) >= 16


@pytest.mark.parametrize("seed", range(4))
def test_no_box_is_larger_by_a_dense_search(seed: int) -> None:
    rng = np.random.default_rng([67, seed])
    model = get("hunting_coulomb")
    section, system = Section.from_model(model), model.build()
    law = dict(zip("mDb", rng.uniform([0.5, 0.5, 0], 2).tolist(), strict=True))
    low = rng.uniform([3, 1], [15, 5])
    ranges = dict(zip("PI", zip(low, low * rng.uniform(3, 8, 2), strict=True), strict=True))
    found = tune(system, section, ranges, (0, 0.5), parameters=law, samples=32, points=16, seed=seed)
    axes = [np.linspace(np.log(a / 5), np.log(5 * b), 60) for a, b in ranges.values()]
    grid = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
    gains = dict(zip("PI", np.exp(grid).T, strict=True))
    seen = contraction(system, section, gains, (0, 0.5), parameters=law, points=8, least=1e-3)
    hunts = grid[(seen.lost > 0) | (seen.ratio >= 1)]
    centers = np.stack(np.meshgrid(*[np.log(np.linspace(*pair, 100)) for pair in ranges.values()]), axis=-1)
    room = np.max(cKDTree(hunts).query(centers, p=np.inf)[0]) if hunts.size else np.log(5)
    # The border lies less than a step of the grid before the first point that hunts.
    step = max(axis[1] - axis[0] for axis in axes)
    assert min(room, np.log(5)) - 1.5 * step < np.log(found.margin) <= min(room, np.log(5)) + 1e-9


def test_bad_requests_are_named() -> None:
    with pytest.raises(UsageError, match="did you mean 'P'"):
        tune(SYSTEM, SECTION, {"p": (1, 2)}, (0, 0.5))
    with pytest.raises(UsageError, match="0 < low < high"):
        tune(SYSTEM, SECTION, {"P": (0, 2)}, (0, 0.5))
    with pytest.raises(UsageError, match="band is empty"):
        tune(SYSTEM, SECTION, {"P": (1, 2)}, (0, 0.5), band=[])
    with pytest.raises(UsageError, match="lo <= 0 < hi"):
        tune(SYSTEM, SECTION, {"P": (1, 2)}, (0.1, 0.5))


def test_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "identified.json"
    content = {"fixed": {"beta": 2.0}, "values": {"vs": 0.1}, "covariance": [[1e-6]], "level": 0.95}
    file.write_text(json.dumps(content), encoding="utf-8")
    out = tmp_path / "out"
    words = ["tune", "hunting", "--over", "P=15:40", "--over", "I=8:12", "--samples", "16", "--grid", "6"]
    data = summary(capsys, *words, "--identified", str(file), "-o", str(out))
    assert data["best"]["P"] > FOLD * 0.9
    # 1.96 standard errors of 0.001 on both sides.
    ends = [item["vs"] for item in data["band"][1:]]
    assert data["band"][0] == {}
    assert ends == pytest.approx([0.1 - 0.00195996, 0.1 + 0.00195996], abs=1e-8)
    assert {p.name for p in out.iterdir()} == {"tuning.json", "samples.csv", "tuning.png"}
    assert main(["tune", "hunting"]) == 2
    # 16.10: the gains that were found, for the law that was identified; -p goes before both.
    again = ["simulate", "hunting", "--tuned", str(out / "tuning.json"), "--t-span", "0", "1", "-p", "m=2"]
    found = summary(capsys, *again)
    wanted = {**data["parameters"], **data["best"], "m": 2.0}
    assert found["parameters"] == wanted
    never = tmp_path / "never.json"
    never.write_text(json.dumps({"parameters": {}, "best": None, "reason": "it hunts"}), encoding="utf-8")
    for wrong, why in ((never, "none were found: it hunts"), (file, "is no tuning.json")):
        assert main(["simulate", "hunting", "--tuned", str(wrong)]) == 2
        assert why in capsys.readouterr().err
    file.write_text("[1, 2", encoding="utf-8")
    assert main([*words, "--identified", str(file)]) == 2
