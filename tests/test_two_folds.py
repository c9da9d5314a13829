"""Two-folds: what is drawn into one is not unique, whatever the tolerance; what misses one is (U2)."""

import os
from typing import Any

import numpy as np
import pytest
from two_fold_oracle import Folds, draw, slide

from filippov import Solution, Status, Surface, System, exp, parameters, sign, solve, solve_many, states, t
from filippov.solving.state.events import Stop

X, Y, Z = states("x y z")
PROFILE = os.environ.get("FILIPPOV_PROFILE", "default")
TOLERANCES = (1e-6, 1e-8, 1e-10, 1e-12)
KINDS = ("visible", "visible-invisible", "invisible")


def size(ci: int, nightly: int) -> int:
    return {"ci": ci // 2, "nightly": nightly}.get(PROFILE, ci // 3)


_names = [
    *[f"c{j}" for j in range(3)],
    *[f"d{s}{j}" for s in range(2) for j in range(2)],
    *[f"a{s}{i}{j}" for s in range(2) for i in range(3) for j in range(3)],
]
P = parameters(**dict.fromkeys(_names, 0.1))


def _field(s: int) -> list[Any]:
    q = [x - getattr(P, f"c{j}") for j, x in enumerate((X, Y, Z))]
    rows = [sum(getattr(P, f"a{s}{i}{j}") * q[j] for j in range(3)) for i in range(3)]
    return [rows[0] + getattr(P, f"d{s}0"), rows[1] + getattr(P, f"d{s}1"), rows[2]]


# One compiled unit for all affine two-folds.
AFFINE = System.from_modes(
    h=[Z - P.c2], fields={"+": _field(0), "-": _field(1)}, states=[X, Y, Z], parameters=P
)
SURFACE = AFFINE.surfaces[0].name


def values(folds: Folds) -> dict[str, float]:
    out = {f"c{j}": float(folds.c[j]) for j in range(3)}
    for s in range(2):
        out |= {f"d{s}{j}": float(folds.d[s, j]) for j in range(2)}
        out |= {f"a{s}{i}{j}": float(folds.A[s, i, j]) for i in range(3) for j in range(3)}
    return out


def run_from(folds: Folds, xi: Any, end: float, rtol: float) -> Solution:
    x0 = folds.c + np.append(xi, 0.0)
    stop = Stop(SURFACE, "sliding exit")
    got = solve(AFFINE, x0, (0, end), parameters=values(folds), rtol=rtol, atol=1e-3 * rtol, stop=stop)
    assert isinstance(got, Solution)
    return got


@pytest.mark.parametrize("kind", KINDS)
def test_11_16_random_two_folds_whatever_the_tolerance(kind: str) -> None:
    rng = np.random.default_rng(KINDS.index(kind))
    done = entered = 0
    while done < size(30, 1000):
        folds = draw(rng, kind)
        xi = folds.start(np.array([-rng.uniform(0.02, 1), rng.uniform(0.02, 1)]) * rng.uniform(0.3, 1))
        end = None if xi is None else slide(folds, xi)
        # Where sliding may be drawn in, every other draw is.
        if end is None or (end.how != "in" and kind != "visible" and 2 * entered < done):
            continue
        done, entered = done + 1, entered + (end.how == "in")
        for rtol in TOLERANCES:
            got = run_from(folds, xi, end.t + 0.5, rtol)
            where = f"draw {done}, rtol {rtol:g}: {end}, {got.message}"
            if end.how == "in":
                assert got.status is Status.NON_UNIQUE, where
                assert got.ambiguity is not None, where
                assert got.ambiguity.name == f"{kind} two-fold", where
                assert got.t_end == pytest.approx(end.t, rel=1e-9), where
                np.testing.assert_allclose(got.x_end, folds.c, atol=1e-9)
            else:
                assert got.status is Status.STOPPED, where
                assert got.end_mode == ((1,) if end.how == "above" else (-1,)), where
                assert got.t_end == pytest.approx(end.t, rel=1e-2, abs=1e-3), where


def test_11_16_a_start_on_the_way_into_a_saddle() -> None:
    """One slide leads into a visible two-fold: an eigenvector, where the fields along it are constant."""
    rng = np.random.default_rng(3)
    done = 0
    while done < size(12, 300):
        folds = draw(rng, "visible", straight=True)
        rates, vectors = np.linalg.eig(folds.flow)
        if np.iscomplexobj(rates):
            continue
        entry = [q for q in (0, 1) if vectors[0, q] * vectors[1, q] < -1e-2 and rates[q] < -1e-2]
        # A deviation that grows faster than the slide is short hides the two-fold from the loosest tolerance.
        if not entry or rates[1 - entry[0]] > -rates[entry[0]]:
            continue
        # Every fourth is one whose rates are far apart: close to it the way there is long for the rates.
        if done % 4 == 3 and abs(rates[entry[0]]) < 20 * abs(rates[1 - entry[0]]):
            continue
        v = vectors[:, entry[0]] * np.sign(vectors[1, entry[0]])
        xi = folds.start(v * rng.uniform(0.3, 1))
        if xi is None:
            continue
        done += 1
        a, b = (field[2] for field in folds.rates(xi))
        arrival = (b - a) / -rates[entry[0]]
        for rtol in TOLERANCES:
            got = run_from(folds, xi, arrival + 0.5, rtol)
            assert got.status is Status.NON_UNIQUE, f"{done}: {got.message}"
            assert got.ambiguity is not None
            assert got.ambiguity.name == "visible two-fold"
            assert [c.mode for c in got.candidates] == [(1,), (-1,), (0,)]
            assert got.t_end == pytest.approx(arrival, rel=1e-3)


# Teixeira's singularity: above (x', y', z') is (1, -2, -x), below (-2, 1, y).
U, D = (1 + sign(Z)) / 2, (1 - sign(Z)) / 2
TEIXEIRA = System({X: U - 2 * D, Y: D - 2 * U, Z: D * Y - U * X})


@pytest.mark.parametrize("start", [(2, 0.5), (1, 0.3), (3, 0.2), (1, 1), (2, 2)])
def test_F3_all_sliding_runs_into_the_two_fold(start: tuple[float, float]) -> None:
    """x + y falls as 1: the arrival is at t = x + y, also on the diagonal."""
    for rtol in (1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12):
        got = solve(TEIXEIRA, (*start, 0), (0, 6), rtol=rtol, atol=1e-3 * rtol)
        assert got.status is Status.NON_UNIQUE, f"{rtol}: {got.message}"
        assert got.ambiguity is not None
        assert got.ambiguity.name == "invisible two-fold"
        assert got.t_end == pytest.approx(sum(start), rel=10 * rtol)
        np.testing.assert_allclose(got.x_end, 0, atol=1e-9)
        assert [c.mode for c in got.candidates] == [(1,), (-1,), (0,)]
        assert got.t[-1] == got.t_end
        assert np.all(np.diff(got.t) > 0)


def test_11_16_what_leaves_teixeiras_singularity() -> None:
    """Staying goes on along x = y with x' = -1/2; who leaves hops around the two-fold, farther and farther.

    A hop from (x, y) above lasts 2 |x| and changes y by -4 |x|, one below lasts 2 |y| and changes x by
    -4 |y|: their times obey T'' = 4 T' - T.
    """
    tree = solve(TEIXEIRA, (2, 0.5, 0), (0, 6), nonunique="branch")
    assert tree.success
    assert len(tree.leaves()) == 3
    for path in tree.paths():
        if path.modes == ("0",):
            np.testing.assert_allclose(path.x_end, [-1.75, -1.75, 0], atol=1e-9)
            continue
        hops = np.diff(path.events.t)
        assert len(hops) > 5
        np.testing.assert_allclose(hops[3:], 4 * hops[2:-1] - hops[1:-2], rtol=1e-6)
    released = solve(TEIXEIRA, (1, 1, 0), (0, 5.5), nonunique="branch", release_times=[4])
    late = [path for path in released.paths() if path.events and path.events[-1].t == 4]
    ends = sorted(tuple(path.x_end.round(9)) for path in late)
    # (x, y) is (-1, -1) at t = 4.
    assert ends == [(-4.0, 0.5, -0.375), (0.5, -4.0, 0.375)]


def test_11_16_plain_functions_and_lanes_say_the_same() -> None:
    def field(t: float, q: Any, p: Any, s: Any) -> list[float]:
        u, d = (1 + s[0]) / 2, (1 - s[0]) / 2
        return [u - 2 * d, d - 2 * u, d * q[1] - u * q[0]]

    plain = System(field=field, surfaces=[Surface("z", lambda t, q, p: q[2])], states=["x", "y", "z"])
    rng = np.random.default_rng(5)
    starts = np.column_stack([rng.uniform(0.1, 2, size=(64, 2)), np.zeros(64)])
    for rtol in (1e-6, 1e-9, 1e-12):
        got = solve(plain, starts[0], (0, 6), rtol=rtol, atol=1e-3 * rtol)
        assert got.status is Status.NON_UNIQUE
        assert got.t_end == pytest.approx(starts[0].sum(), rel=10 * rtol)
        many = solve_many(TEIXEIRA, starts, (0, 6), rtol=rtol, atol=1e-3 * rtol, lanes=8)
        assert set(many.status) == {Status.NON_UNIQUE}
        np.testing.assert_allclose(many.t, starts.sum(axis=1), rtol=10 * rtol)


def test_rates_that_fade_away_together_are_no_two_fold() -> None:
    """Friction exp(-t) holds against a load of 1/2 exp(-t): both rates fall, neither vanishes."""
    held = System({X: 0.5 * exp(-t) - exp(-t) * sign(X)})
    assert solve(held, (0,), (0, 20)).success
    # Let go at t = 12 as the load's part goes on growing.
    slips = System({X: exp(-t) * (0.5 + (t / 12) ** 40 / 2 - sign(X))})
    got = solve(slips, (0,), (0, 13))
    assert got.success
    assert got.events[0].t == pytest.approx(12, abs=1e-6)
    assert got.end_mode == (1,)


_n = ("p", "q", "above", "below", "at")
Q = parameters(**dict.fromkeys(_n, 1.0))
PLANAR = System.from_modes(
    h=[Y],
    fields={
        "+": [Q.p + 0 * X, Q.above / Q.p * (X - Q.at)],
        "-": [Q.q + 0 * X, Q.below / Q.q * (X - Q.at)],
    },
    states=[X, Y],
    parameters=Q,
)


def test_F14_random_planar_two_folds_from_the_fold() -> None:
    """Velocities p and q along y = 0, second derivatives of y: what follows from (at, 0) is known.

    A visible side can be left to. Beside the fold y = 0 is slid on if the rates differ in sign there; the way
    out is where the slide attracts, or where it repels: then it can be left to both sides. Where the motions
    along y = 0 oppose each other the fold is a place to rest, too.
    """
    rng = np.random.default_rng(11)
    for number in range(size(60, 2000)):
        p, q, above, below = rng.normal(size=4) + 0.1 * np.sign(rng.normal(size=4))
        at = float(rng.choice([0.0, rng.normal(), 100 * rng.normal()]))
        modes = {(1,)} if above > 0 else set()
        modes |= {(-1,)} if below < 0 else set()
        a, b = above / p, below / q
        slides = a * b < 0
        if slides or p * q < 0:
            modes.add((0,))
        if slides and b * p - a * q < 0:
            modes |= {(1,), (-1,)}
        given = dict(zip(_n, map(float, (p, q, above, below, at)), strict=True))
        got = solve(PLANAR, (at, 0), (0, 1), parameters=given)
        where = f"{number}: {given}, {got.message}"
        if len(modes) > 1:
            assert got.status is Status.NON_UNIQUE, where
            assert {c.mode for c in got.candidates} == modes, where
            continue
        assert got.success, where
        if modes == {(1,)}:
            want = [at + p, above / 2]
        elif modes == {(-1,)}:
            want = [at + q, below / 2]
        elif p * q < 0:
            want = [at, 0]
        else:
            # The weights b/(b - a) and -a/(b - a) do not change along y = 0.
            want = [at + (b * p - a * q) / (b - a), 0]
        np.testing.assert_allclose(got.x_end, want, atol=1e-7 * (1 + abs(at)), err_msg=where)
        assert len(got.events) <= 1, where


def test_F14_rest_at_a_two_fold_is_left_by_no_rounding() -> None:
    """Both sides push back to the fold with opposite velocities: it is rested at, alone and in lanes."""
    rng = np.random.default_rng(1)
    n = size(60, 600)
    drawn = {"p": rng.uniform(-1, -0.1, n), "q": rng.uniform(0.1, 1, n), "above": rng.uniform(-1, -0.1, n)}
    drawn |= {"below": rng.uniform(0.1, 1, n), "at": rng.choice([0.0, 1.0, 100.0], n) * rng.normal(size=n)}
    starts = np.column_stack([drawn["at"], np.zeros(n)])
    for k in range(n):
        got = solve(PLANAR, starts[k], (0, 1), parameters={name: float(v[k]) for name, v in drawn.items()})
        assert got.success, got.message
        np.testing.assert_allclose(got.x_end, starts[k], atol=1e-12)
    many = solve_many(PLANAR, starts, (0, 1), parameters=drawn, lanes=8)
    assert set(many.status) == {Status.SUCCESS}
    np.testing.assert_allclose(many.x, starts, atol=1e-12)
