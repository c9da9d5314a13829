"""Periodic orbits by collocation: known beforehand, cascades, a converter, reversed time."""

import os
from functools import partial
from math import atan, exp, pi

import numpy as np
import pytest
from collocation_oracle import Member, member
from scipy.optimize import fsolve
from test_phase_of_orbits import buck, jacobian

from filippov import Surface, System, UsageError, parameters, sign, states
from filippov import cos as cosine
from filippov import t as time
from filippov.analysis.bifurcations.continuation import continuation
from filippov.analysis.orbits.floquet import multipliers, product_multipliers
from filippov.analysis.orbits.orbit import Orbit
from filippov.analysis.orbits.orbit_search import find_orbit
from filippov.analysis.orbits.shooting import NoConvergenceError
from filippov.models import registry

NIGHTLY = os.environ.get("FILIPPOV_PROFILE") == "nightly"
STATES = 16
x, v, z = states("x v z")


def two_fields(n: int) -> System:
    """x' = A x + b on either side of c x = 0, every number a parameter."""
    q = states(" ".join(f"x{i}" for i in range(n)))
    names = [f"c{i}" for i in range(n)]
    names += [f"b{k}{i}" for k in range(2) for i in range(n)]
    names += [f"a{k}{i}{j}" for k in range(2) for i in range(n) for j in range(n)]
    p = parameters(**dict.fromkeys(names, 1.0))
    side = sign(sum(getattr(p, f"c{i}") * q[i] for i in range(n)))
    sides = [
        [sum(getattr(p, f"a{k}{i}{j}") * q[j] for j in range(n)) + getattr(p, f"b{k}{i}") for i in range(n)]
        for k in range(2)
    ]
    return System({q[i]: (1 + side) / 2 * sides[0][i] + (1 - side) / 2 * sides[1][i] for i in range(n)})


def values(m: Member) -> dict[str, float]:
    n = len(m.c)
    out = {f"c{i}": m.c[i] for i in range(n)}
    out |= {f"b{k}{i}": m.b[k][i] for k in range(2) for i in range(n)}
    out |= {f"a{k}{i}{j}": m.A[k][i, j] for k in range(2) for i in range(n) for j in range(n)}
    return {name: float(value) for name, value in out.items()}


def guess(m: Member, seed: int, error: float) -> tuple[np.ndarray, float]:
    """States about the orbit, and its period, both with errors."""
    random = np.random.default_rng(seed)
    period = m.period * (1 + error * random.normal())
    at = np.array([m.state(0.4 * m.durations[0] + m.period * k / STATES) for k in range(STATES)])
    return at + error * np.ptp(at, axis=0) * random.normal(size=at.shape), period


def confirmed(m: Member, orbit: Orbit) -> bool:
    """Whether matrix exponentials find the orbit and its multipliers; True where it is the member itself.

    Newton's method may go to a neighbour of the member, which has to be an orbit as well.
    """
    events = [event for piece in orbit.pieces for event in piece.events]
    assert len(events) == 2
    down = next(e for e in events if e.after == (-1,))
    up = next(e for e in events if e.after == (1,))
    first = (down.t - up.t) % orbit.period
    gap, known = m.through((up.x, down.x), (first, orbit.period - first))
    assert gap < 1e-9
    near = min(1.0, float(np.min(np.abs(known - 1.0))))
    assert np.max(np.abs(orbit.multipliers - known) / np.maximum(np.abs(known), 1e-3)) < 1e-8 / near
    if abs(orbit.period - m.period) > 1e-3 * m.period:
        return False
    if np.max(np.abs(up.x - m.starts[0])) > 0.1 * np.max(np.abs(m.starts)):
        return False
    near = min(near, float(np.min(np.abs(m.through(m.starts, m.durations)[1] - 1.0))))
    return abs(orbit.period - m.period) < 1e-10 * m.period / near


@pytest.mark.parametrize("largest", [22.0, 1e3, 1e6])
def test_12_13_piecewise_linear_orbits_that_repel(largest: float) -> None:
    """Of random members all that are found are orbits, and nearly all are found."""
    system, wanted = two_fields(3), 200 if NIGHTLY else 6
    found, own, tried, seed = 0, 0, 0, 0
    while tried < wanted:
        seed += 1
        m = member(seed, largest)
        if m is None:
            continue
        tried += 1
        points, period = guess(m, seed, 0.01)
        try:
            orbit = find_orbit(
                system, points, parameters=values(m), period=period, method="collocation"
            )  # fmt: skip
        except NoConvergenceError:
            continue
        found += 1
        own += confirmed(m, orbit)
    assert found >= 0.95 * wanted
    assert own >= 0.9 * wanted


@pytest.mark.parametrize("method", ["collocation", "DOP853"])
@pytest.mark.parametrize("rate", [0.5, 1.0, 1.5])
def test_12_13_stick_slip_that_drives_an_unstable_state(rate: float, method: str) -> None:
    """x' = v, v' = -x - F(v - vb), z' = rate z + x: Coulomb friction, T and exp(rate T) in closed form."""
    p = parameters(rate=1.0, Fs=1.0, Fc=0.5, vb=0.2)
    belt = Surface("belt", v - p.vb, radius=p.Fs / p.Fc)
    system = System({x: v, v: -x - p.Fc * sign(v - p.vb), z: p.rate * z + x}, surfaces=[belt])
    stick, slip = 2 * 0.5 / 0.2, 2 * pi - 2 * atan(0.5 / 0.2)
    period = stick + slip

    def state(t: float) -> tuple[float, float, float]:
        if t < stick:
            return 0.2 * t, 0.2, -0.2 * t / rate
        t -= stick
        place = 0.5 + 0.5 * np.cos(t) + 0.2 * np.sin(t)
        return place, -0.5 * np.sin(t) + 0.2 * np.cos(t), -place / rate

    rows = np.array([state((0.3 + period * k / 24) % period) for k in range(24)])
    orbit = find_orbit(system, rows, period=1.01 * period, parameters={"rate": rate}, method=method)
    assert orbit.period == pytest.approx(period, rel=1e-11)
    assert orbit.word == "stick slip-"
    assert orbit.multipliers[0].real == pytest.approx(exp(rate * period), rel=1e-9)
    assert orbit.multipliers[1] == 0.0
    assert orbit.trivial == pytest.approx(1.0, abs=1e-8)


@pytest.mark.parametrize("rate", [1.0, 6.0])
def test_12_13_impacts_that_drive_an_unstable_state(rate: float) -> None:
    """The impact oscillator with z' = rate z + x: its own multipliers and exp(rate T), 2e6 times larger."""
    p = parameters(rate=1.0, omega=2.6, e=0.8, zeta=0.05)
    field = {x: v, v: cosine(p.omega * time) - 2 * p.zeta * v - x}
    wall = Surface("wall", -x, reset={v: -p.e * v})
    own = find_orbit(System(field, surfaces=[wall], parameters=p), (-0.5, 0.0), transient=200.0)
    driven = System({**field, z: p.rate * z + x}, surfaces=[wall])
    orbit = find_orbit(
        driven, (*own.x0, 0.0), t0=own.t0, parameters={"rate": rate}, method="collocation"
    )  # fmt: skip
    assert orbit.period == pytest.approx(2 * pi / 2.6, rel=1e-14)
    assert orbit.multipliers[0].real == pytest.approx(exp(rate * orbit.period), rel=1e-9)
    assert orbit.multipliers[1:] == pytest.approx(own.multipliers, rel=1e-7)


SUPPLIES = np.linspace(26.0, 400.0, 40).tolist() if NIGHTLY else [30.0, 250.0, 400.0]


@pytest.mark.parametrize("supply", SUPPLIES)
def test_12_13_a_converter_beyond_its_doubling(supply: float) -> None:
    model = registry.get("buck_pwm")
    system = model.build()
    orbit = find_orbit(
        system, model.x0, parameters={"Vin": supply}, period="T", transient=0.02, method="collocation"
    )  # fmt: skip
    names = system.parameters
    step = partial(buck, dict(zip(names.names, names.resolve({"Vin": supply}).tolist(), strict=True)))
    clock = next(e for piece in orbit.pieces for e in piece.events if e.kind == "time event")
    at = fsolve(lambda q: step(q) - q, clock.x[:2], xtol=1e-13)
    assert clock.x[:2] == pytest.approx(at, rel=1e-9)
    known = np.linalg.eigvals(jacobian(step, at))
    assert orbit.multipliers[0] == pytest.approx(known[np.argmax(np.abs(known))], rel=1e-6)


def test_12_13_continuation_from_an_orbit_that_repels() -> None:
    """From the multiplier -35 down through the doubling, on the nodes that collocation laid."""
    model = registry.get("buck_pwm")
    system = model.build()
    orbit = find_orbit(
        system, model.x0, parameters={"Vin": 400}, period="T", transient=0.02, method="collocation"
    )  # fmt: skip
    assert len(orbit.pieces) > 1
    run = continuation(system, orbit, parameter="Vin", bounds=(20, 400))
    run.run()
    (found,) = run.branch.special
    names = system.parameters
    p = dict(zip(names.names, names.resolve({"Vin": found.value}).tolist(), strict=True))
    at = fsolve(lambda q: buck(p, q) - q, np.array([12.0, 0.55]), xtol=1e-13)
    assert found.special == "period doubling"
    assert np.min(np.linalg.eigvals(jacobian(partial(buck, p), at)).real) == pytest.approx(-1, abs=1e-6)


@pytest.mark.parametrize("relay", [0.0, 0.3])
def test_12_13_a_stable_orbit_backwards_in_time(relay: float) -> None:
    """x'' = 2 (1 - x^2) x' - x + a relay: the multiplier of the reversed field is the inverse of its own."""
    p = parameters(way=1.0, relay=relay)
    field = 2 * (1 - x**2) * v - x + p.relay * sign(v)
    system = System({x: p.way * v, v: p.way * field})
    forwards = find_orbit(system, (2.0, 0.5), rtol=1e-12)
    motion, length = forwards.solution(), forwards.period
    rows = np.array([motion.sol(length * (1 - k / 24)) for k in range(24)]) * 1.01
    backwards = find_orbit(
        system, rows, parameters={"way": -1.0}, period=1.01 * length, method="collocation"
    )  # fmt: skip
    assert backwards.period == pytest.approx(forwards.period, rel=1e-10)
    assert backwards.multipliers[0].real > 400
    assert (backwards.multipliers[0] * forwards.multipliers[0]).real == pytest.approx(1.0, rel=1e-7)
    assert backwards.symmetric
    half = backwards.half_multipliers
    assert half is not None
    assert half[0] ** 2 == pytest.approx(backwards.multipliers[0], rel=1e-9)


def test_12_13_the_same_record_as_shooting() -> None:
    for name in ("belt", "relay"):
        model = registry.get(name)
        shot = find_orbit(model.build(), model.x0)
        found = find_orbit(model.build(), model.x0, method="collocation")
        assert found.period == pytest.approx(shot.period, rel=1e-11)
        assert found.word == shot.word
        assert found.low == pytest.approx(shot.low, abs=1e-10)
        assert found.multipliers == pytest.approx(shot.multipliers, abs=1e-9)
        assert found.symmetric == shot.symmetric


def test_12_13_from_another_orbit() -> None:
    model = registry.get("belt")
    system = model.build()
    start = find_orbit(system, model.x0)
    moved = find_orbit(system, start, parameters={"vb": 0.25}, method="collocation")
    direct = find_orbit(system, model.x0, parameters={"vb": 0.25})
    assert moved.period == pytest.approx(direct.period, rel=1e-11)


def test_12_13_no_orbit_is_made_up() -> None:
    """A centre that dry friction brings to rest has none; the reason is told."""
    system = System({x: v, v: -x - 0.3 * sign(v)})
    with pytest.raises(NoConvergenceError):
        find_orbit(system, (2.0, 0.5), period=6.3, method="collocation")
    with pytest.raises(UsageError, match="lays its own"):
        find_orbit(system, (2.0, 0.5), period=6.3, method="collocation", nodes=4)


def test_12_13_multipliers_of_a_product_keep_the_small_ones() -> None:
    """Of 40 factors whose product has 1e30 and 1e-30, in random bases."""
    random = np.random.default_rng(4)
    bases = [random.normal(size=(3, 3)) for _ in range(40)]
    rates = np.diag([10**0.75, 1.0, 10**-0.75])
    factors = [bases[(k + 1) % 40] @ rates @ np.linalg.inv(bases[k]) for k in range(40)]
    found = product_multipliers(factors, 0)
    assert found == pytest.approx(np.array([1e30, 1.0, 1e-30]), rel=1e-10)
    total = np.eye(3)
    for matrix in factors:
        total = matrix @ total
    assert abs(multipliers(total, 0)[1]) > 2  # lost in the rounding of the first
