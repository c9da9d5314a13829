"""Random networks of bodies with friction, belts and walls with restitution, against least squares.

m_i v_i' = P_i + Q_i cos t - sum_c G_ci F_c sign(G_c v - u_c), v_i -> -e_i v_i at walls s_i (x_i - w_i) >= 0.
Of all forces that contacts can carry (|friction| <= F_c where bodies stick, wall forces >= 0 where they rest)
those with the shortest M^(-1/2) f act (Moreau 1988).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import lsq_linear

from filippov import Solution, Surface, System, cos, sign, solve, states, t

END = 3.0
GROUND, BELT = -1, -2
# A contact that sticks, a body that rests at its wall, is held to rounding: one that slips by 1e-9 and turns
# back, or a bounce of 1e-13, moves.
STUCK = 1e-11


@dataclass(frozen=True)
class Network:
    """pairs: (body, body, GROUND or BELT); belt: its speed; walls: {body: (side, place, e)}."""

    pairs: tuple[tuple[int, int], ...]
    mass: np.ndarray
    constant: np.ndarray
    swing: np.ndarray
    friction: np.ndarray
    belt: float
    walls: dict[int, tuple[float, float, float]]

    def slip(self, v: np.ndarray) -> np.ndarray:
        """Relative velocities at the contacts."""
        other = {GROUND: 0.0, BELT: self.belt}
        return np.array([v[i] - (v[j] if j >= 0 else other[j]) for i, j in self.pairs])

    def rows(self) -> np.ndarray:
        """G, shape (contacts, bodies)."""
        out = np.zeros((len(self.pairs), len(self.mass)))
        for c, (i, j) in enumerate(self.pairs):
            out[c, i] = 1
            if j >= 0:
                out[c, j] = -1
        return out

    def acceleration(self, time: float, x: np.ndarray, v: np.ndarray, pace: np.ndarray) -> np.ndarray:
        """By bounded least squares over the forces that are free; pace: largest speeds about that time."""
        slip, G = self.slip(v), self.rows()
        stuck = np.abs(slip) < STUCK
        slipping = np.where(stuck, 0.0, self.friction * np.sign(slip))
        pull = self.constant + self.swing * np.cos(time) - slipping @ G
        resting = [
            i for i, (side, place, _) in self.walls.items() if abs(x[i] - place) < 1e-8 and pace[i] < STUCK
        ]
        columns = [self.friction[c] * G[c] for c in np.flatnonzero(stuck)]
        columns += [-self.walls[i][0] * np.eye(len(v))[i] for i in resting]
        if not columns:
            return np.asarray(pull / self.mass)
        A = np.array(columns).T
        low = np.array([-1.0] * int(np.sum(stuck)) + [0.0] * len(resting))
        high = np.array([1.0] * int(np.sum(stuck)) + [np.inf] * len(resting))
        root = np.sqrt(self.mass)
        best = lsq_linear(A / root[:, None], pull / root, (low, high), method="bvls", tol=1e-14).x
        return np.asarray((pull - A @ best) / self.mass)


def drawn(seed: int) -> tuple[Network, np.ndarray]:
    """A tree of 3 to 6 bodies with loops, a belt and walls, 3 to 9 contacts in all, and a start."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 6))
    pairs = [(i, int(rng.integers(0, i))) for i in range(1, n)]
    spare = [(i, j) for i in range(n) for j in range(i) if (i, j) not in pairs]
    spare += [(i, GROUND) for i in range(n)] + [(i, BELT) for i in range(n)]
    rng.shuffle(spare)
    walls = {
        i: (float(rng.choice([-1.0, 1.0])), 0.0, float(rng.choice([0.0, rng.uniform(0.1, 0.9), 1.0])))
        for i in range(n)
        if rng.random() < 0.4
    }
    contacts = int(rng.integers(3, 10))
    pairs += [(int(i), int(j)) for i, j in spare[: max(0, contacts - len(pairs) - len(walls))]]
    whole = rng.random() < 0.5
    m = len(pairs)
    if whole:
        mass, friction = rng.integers(1, 3, n).astype(float), rng.integers(1, 4, m) / 2.0
        constant, swing = rng.integers(-2, 3, n).astype(float), rng.integers(-2, 3, n).astype(float)
    else:
        mass, friction = rng.uniform(0.5, 3, n), rng.uniform(0.2, 2, m)
        constant, swing = rng.uniform(-2, 2, n), rng.uniform(-3, 3, n)
    net = Network(tuple(pairs), mass, constant, swing, friction, float(rng.choice([0.3, -1.0])), walls)
    v = np.zeros(n) if rng.random() < 0.3 else rng.uniform(-2, 2, n)
    x = np.array([walls[i][0] * rng.uniform(0.05, 1) if i in walls else 0.0 for i in range(n)])
    return net, np.concatenate([x, v])


def shared(seed: int) -> tuple[Network, np.ndarray]:
    """2 to 4 bodies at rest with more contacts than bodies, many of them on walls that let nothing bounce."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 5))
    pairs = [(i, j) for i in range(n) for j in (*range(i), GROUND, BELT)]
    rng.shuffle(pairs)
    walls = {i: (float(rng.choice([-1.0, 1.0])), 0.0, 0.0) for i in range(n) if rng.random() < 0.6}
    pairs = [(int(i), int(j)) for i, j in pairs[: int(rng.integers(n + 1, 2 * n + 3))]]
    m = len(pairs)
    if rng.random() < 0.4:
        mass, friction = rng.integers(1, 3, n).astype(float), rng.integers(1, 4, m) / 2.0
        constant, swing = rng.integers(-2, 3, n).astype(float), rng.integers(-2, 3, n).astype(float)
    else:
        mass, friction = rng.uniform(0.5, 3, n), rng.uniform(0.2, 2, m)
        constant, swing = rng.uniform(-2, 2, n), rng.uniform(-3, 3, n)
    net = Network(tuple(pairs), mass, constant, swing, friction, float(rng.choice([0.3, -1.0])), walls)
    x = np.zeros(n)
    for i, (side, _, _) in sorted(walls.items()):
        x[i] = 0.0 if rng.random() < 0.6 else side * rng.uniform(0.05, 0.5)
    return net, np.concatenate([x, np.zeros(n)])


def system(net: Network) -> System:
    """The network as a symbolic system."""
    n = len(net.mass)
    x, v = states([f"x{i}" for i in range(n)]), states([f"v{i}" for i in range(n)])
    slip = [v[i] - (v[j] if j >= 0 else (net.belt if j == BELT else 0)) for i, j in net.pairs]
    force = [net.constant[i] + net.swing[i] * cos(t) for i in range(n)]
    for c, (i, j) in enumerate(net.pairs):
        force[i] -= net.friction[c] * sign(slip[c])
        if j >= 0:
            force[j] += net.friction[c] * sign(slip[c])
    surfaces = [Surface(f"c{c}", h) for c, h in enumerate(slip)]
    surfaces += [
        Surface(f"wall{i}", side * (x[i] - place), reset={v[i]: -e * v[i]})
        for i, (side, place, e) in net.walls.items()
    ]
    field = {x[i]: v[i] for i in range(n)} | {v[i]: force[i] / net.mass[i] for i in range(n)}
    return System(field, surfaces=surfaces)


def faults(net: Network, run: Solution) -> list[str]:
    """What is wrong with a motion: accelerations, walls, impacts."""
    n, found = len(net.mass), []
    assert run.sol is not None
    impacts = run.events.of(kind="reset")
    for event in impacts:
        i = int(event.surface[4:])
        if abs(event.x_after[n + i] + net.walls[i][2] * event.x[n + i]) > 1e-9 * (1 + abs(event.x[n + i])):
            found.append(f"impact {event}")
    # What is left of the bounces before a rest is bridged: their sum is known, each of them is not.
    bridged = {limit.t for limit in run.accumulations}
    for piece in run.segments:
        if piece.dwell < 1e-6 or piece.t1 in bridged:
            continue
        for part in (0.1, 0.3, 0.5, 0.7, 0.9):
            time, small = piece.t0 + part * piece.dwell, 0.05 * piece.dwell
            if np.any(np.abs(impacts.t - time) <= small):
                continue
            y = run.sol(time)
            for i, (side, place, _) in net.walls.items():
                if side * (y[i] - place) < -1e-9:
                    found.append(f"through wall {i} at {time}")
            before, after = run.sol(time - small)[n:], run.sol(time + small)[n:]
            rate, pace = (after - before) / (2 * small), np.maximum(np.abs(before), np.abs(after))
            expected = net.acceleration(time, y[:n], y[n:], pace)
            # The mean over [t - s, t + s] of A + B cos t: s^2/6 of its curvature.
            mean = 1 - small**2 / 6
            expected_mean = expected + (mean - 1) * net.swing * np.cos(time) / net.mass
            miss = float(np.max(np.abs(rate - expected_mean)) * min(1.0, small / 1e-6))
            if miss > 1e-5 + 2 * small**2:
                found.append(f"{piece.mode} at {time:.9g}: acceleration {rate}, least constraint {expected}")
    return found


def examine(seed: int, draw: Callable[[int], tuple[Network, np.ndarray]] = drawn) -> list[str]:
    """Faults of one run; to end before END is one."""
    net, x0 = draw(seed)
    run = solve(system(net), x0, (0, END), rtol=1e-9, atol=1e-11, zeno="continue", max_events=2000)
    found = faults(net, run)
    if not run.success:
        size = f"{len(net.pairs)} contacts, {len(net.walls)} walls"
        found.append(f"{run.status.value} with {size}: {run.message}")
    return found
