"""Programs f(t, y) as users write them, some of which switch. `# <k>` marks lines that are to be found."""
# ruff: noqa: B905, PLW0603, RET505, SIM108, SIM300  (written as users write)

import functools
import math
from types import SimpleNamespace

import numpy as np

K_SPRING = 1.0
MU = 0.2


def oscillator(t, y):
    x, v = y
    return [v, -K_SPRING * x - MU * np.sign(v)]  # <1>


def coulomb(v, level=1.0):
    if v > 0:  # <2>
        return level
    elif v < 0:  # <2>
        return -level
    return 0.0


def brake(t, y, m=2.0, g=9.81):
    """A block that slides on the floor, its friction in a helper with early returns."""
    dydt = np.zeros(2)
    dydt[0] = y[1]
    dydt[1] = -coulomb(y[1], 0.3 * m * g) / m
    return dydt


def relay_loop(t, y):
    u = -1 if y[0] > 0 else 1  # <3>
    return u + 0.5


def bang_bang_heater(t, y, setpoint=22.75):
    T = y[0]
    heat = 2.0 * np.heaviside(setpoint - T, 0.5)  # <4>
    return -0.1 * (T - 18.0) + heat


heating = True


def thermostat(t, y):
    global heating
    T = y[0]
    if T < 22.0:  # <5>
        heating = True
    elif T > 23.5:  # <6>
        heating = False
    heat = 2.0 if heating else 0.0
    return [-0.1 * (T - 18.0) + heat]


class Relay:
    """A relay with hysteresis that keeps its output in an attribute."""

    def __init__(self, width):
        self.width = width
        self.up = True

    def rhs(self, t, y):
        if self.up and y[0] > self.width:  # <7>
            self.up = False
        if not self.up and y[0] < -self.width:  # <8>
            self.up = True
        return np.array([1.0 if self.up else -1.0])


relay_with_memory = Relay(0.3)


def make_counter():
    """A closure that remembers on which side it was."""
    charging = False

    def f(t, y):
        nonlocal charging
        v = y[0]
        if v >= 2.0:  # <9>
            charging = False
        if v <= 1.0:  # <10>
            charging = True
        return (3.0 - v) * charging + (1 - charging) * (-v)

    return f


relaxation = make_counter()


def harvest(t, z, r=1.0, a=1.0, e=0.5, m=0.5, K=4.0, q=0.3, threshold=0.8):
    R, C = z
    harvested = (C > threshold) * q  # <11>
    return np.array([r * R * (1 - R / K) - a * R * C - harvested * R, e * a * R * C - m * C - harvested * C])


def two_prey(t, z):
    gains = {"e1": 0.2, "e2": 0.1, "m": 0.1}
    R1, R2, C = z
    if gains["e1"] * R1 >= gains["e2"] * R2:  # <12>
        u = 1
    else:
        u = 0
    eaten = [u * R1 * C, (1 - u) * R2 * C]
    growth = [1.5 * R1, 0.5 * R2]
    rates = [g - q for g, q in zip(growth, eaten)]
    rates.append(gains["e1"] * eaten[0] + gains["e2"] * eaten[1] - gains["m"] * C)
    return rates


def pwm(t, y, duty=0.3, period=0.01, R=2.0, L=0.1):
    """An inductor behind a switch that a clock turns on and off."""
    (i,) = y
    on = (t % period) < duty * period  # <13>
    return [(10.0 * on - R * i) / L]


def sliding_mode(t, y, K=2.0, c=1.0, A=0.5, omega=2.0):
    x, v = y
    s = c * x + v
    u = -K * s / abs(s)  # <14>
    return [v, u + A * math.sin(omega * t)]


PARAMS = SimpleNamespace(belt=0.4, friction=1.3)


def belt(t, y):
    b, u = y[0], y[1]
    slip = u - PARAMS.belt
    return np.hstack([u, -b - np.where(slip > 0, PARAMS.friction, -PARAMS.friction)])  # <15>


def pulse(t, y):
    push = 1000.0 if 50 <= t < 50.001 else 0.0  # <16>
    return -y + push


def neuron(t, y, a=0.25, eps=0.5, current=0.4):
    """McKean's caricature: the fast current is a step."""
    v, w = y[:2]
    step = np.where(v >= a, 1.0, 0.0)  # <17>
    return np.array([-v + step - w + current, eps * (v - 0.5 * w)])


def dead_band(t, y):
    x, v = y
    if abs(v) < 1e-3:  # <18>
        friction = 0.0
    else:
        friction = MU * np.sign(v)  # <19>
    return [v, -x - friction]


def stuck_by_equality(t, y):
    x, v = y
    if v == 0.0:  # <20>
        force = -x - np.clip(-x, -MU, MU)
    else:
        force = -x - MU * math.copysign(1.0, v)  # <21>
    return [v, force]


def unstable_relay(t, y):
    return np.sign(y) - 0.5 * y  # <22>


def chain(t, y, n=2, mu=0.3):
    """Blocks on springs on one floor, in arrays and loops."""
    x, v = y[:n], y[n:]
    a = np.zeros(n)
    for i in range(n):
        left = x[i - 1] if i > 0 else 0.0
        right = x[i + 1] if i + 1 < n else 0.0
        a[i] = left - 2 * x[i] + right
        a[i] -= mu * np.sign(v[i])  # <23>
    return np.concatenate([v, a])


def law(v, *, level):
    return level if v > 0 else -level  # <24>


drag = functools.partial(law, level=0.5)
lifted = lambda t, y: [y[1], -drag(y[1]) - y[0]]  # noqa: E731


def twisting(t, y, gain=10.0, ratio=0.3):
    x, v = y
    return [v, -gain * (np.sign(x) + ratio * np.sign(v))]  # <25>


def saturated(t, y):
    """A limited actuator: corners, no jump."""
    x, v = y
    u = np.clip(-10.0 * x - 2.0 * v, -1.0, 1.0)  # <26>
    return [v, u]


def staircase(t, y):
    level = math.floor(t / 0.5)  # <27>
    return [level - y[0]]


def compared_steps(t, y):
    """Equalities that hold in whole parts of the states, unlike those of floats."""
    x, v = y
    push = 1.0 if np.sign(v) == 1 else 0.0
    push += 2.0 if max(x, 0.0) == 0.0 else 0.0
    push += 3.0 if np.sign(x) + np.sign(v) != 0 else 0.0
    push -= 0.5 * (int(x > 0) + int(v > 0) >= 2)
    push += x if abs(v) == v and x != v else 0.0
    return [v, push - np.clip(x, -1, 1) * (np.clip(x, -1, 1) == 1.0)]


def tank(t, y):
    """An inflow every other two seconds."""
    inflow = 1.0 if (t // 2) % 2 == 0 else 0.0  # <28>
    return np.array([inflow - 0.5 * y[0]])


# -- smooth ones: to be left alone --------------------------------------------------------------------------


def van_der_pol(t, y, mu=1.5):
    x, v = y
    return [v, mu * (1 - x**2) * v - x]


def lorenz(t, s, sigma=10.0, rho=28.0, beta=8 / 3):
    x, y, z = s
    return sigma * (y - x), x * (rho - z) - y, x * y - beta * z


def pendulum(t, y):
    return np.array([y[1], -9.81 * np.sin(y[0])])


def lotka(t, z):
    rates = {"a": 1.1, "b": 0.4, "c": 0.1, "d": 0.4}
    N, P = z
    return [rates["a"] * N - rates["b"] * N * P, rates["c"] * N * P - rates["d"] * P]


def epidemic(t, y, *rates):
    S, I, R = y
    beta, gamma = rates
    new = beta * S * I / (S + I + R)
    return [-new, new - gamma * I, gamma * I]


A_MATRIX = np.array([[0.0, 1.0], [-4.0, -0.2]])


def linear(t, y):
    return A_MATRIX @ y


def soft_friction(t, y, width=0.05):
    x, v = y
    return [v, -x - 0.2 * math.tanh(v / width)]


LAW = "viscous"


def chosen_once(t, y):
    """What is chosen is fixed before the run: no condition of the state."""
    if LAW == "coulomb":
        drag = np.sign(y[1])
    elif MU > 0.1:
        drag = MU * y[1]
    else:
        drag = 0
    return [y[1], -y[0] - drag]


def phases(t, theta, coupling=0.7):
    own = [1.0, 1.2, 0.9]
    n = len(theta)
    return [own[i] + coupling / n * sum(np.sin(theta[j] - theta[i]) for j in range(n)) for i in range(n)]


class Duffing:
    """A smooth oscillator as an object with a property."""

    def __init__(self):
        self.stiffness, self.damping = 1.0, 0.1

    @property
    def forcing(self):
        return 0.3 * self.stiffness

    def __call__(self, t, y):
        x, v = y
        return [v, self.stiffness * (x - x**3) - self.damping * v + self.forcing * np.cos(1.2 * t)]


duffing = Duffing()


# -- written anew: other ways to say the same ----------------------------------------------------------------


def difference_of_conditions(t, y):
    x, v = y
    return [v, -x - 0.3 * ((v > 0) - 1.0 * (v < 0))]


def idiom(t, y):
    return [y[1], -y[0] - ((y[1] > 0 and 0.3) or -0.3)]


def walrus(t, y):
    return [y[1], -y[0] - (0.3 if (slip := y[1]) > 0 else -0.3) + 0.0 * slip]


def written_in_place(t, y):
    dydt = np.zeros_like(y)
    dydt[0] = y[1]
    dydt[1] = -y[0]
    dydt[1] -= 0.3 * np.sign(y[1])
    return dydt


def ring(t, y):
    n = len(y) // 2
    x, v = y[:n], y[n:]
    return np.concatenate([v, np.roll(x, 1) - 2 * x + np.roll(x, -1) - 0.3 * np.sign(v)])


STATE_MATRIX, INPUT, OUTPUT = np.array([[0.0, 1.0], [-1.0, 0.0]]), np.array([0.0, 0.3]), np.array([0.0, 1.0])


def matrix_form(t, y):
    return STATE_MATRIX @ y - INPUT * np.sign(OUTPUT @ y)


@functools.lru_cache
def stiffness():
    return 1.0


def with_cache(t, y):
    return [y[1], -stiffness() * y[0] - 0.3 * np.sign(y[1])]


def guarded(t, y):
    assert len(y) == 2
    if not np.all(np.isfinite(y)):
        raise ValueError("diverged")
    return [y[1], -y[0] - 0.3 * np.sign(y[1])]


def lockdown(t, y):
    S, I = y
    return [-(0.5 if I < 0.05 else 0.1) * S * I, (0.5 if I < 0.05 else 0.1) * S * I - 0.2 * I]


def damped_contact(t, y):
    depth = max(0.0, -y[0])
    return [y[1], -9.81 + 1e3 * depth - 10 * y[1] * (depth > 0)]


def square_wave(t, y):
    return [(1.0 if int(t / 0.5) % 2 == 0 else -1.0) - y[0]]


def fires_in_place(t, y):
    if y[0] >= 1.0:
        y[0] = 0.0
    return [1.5 - y[0]]


def planar_friction(t, y):
    v = y[2:]
    speed = np.linalg.norm(v)
    force = 0.3 * v / speed if speed > 0 else np.zeros(2)
    return np.hstack([v, -force])
