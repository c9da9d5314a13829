"""Programs that cannot be translated. A comment `# <k>` marks the line that is to be named."""
# ruff: noqa: FURB192, PLW0603, RET503, S311  (written as users write)

import bisect
import random

import numpy as np
from scipy.interpolate import interp1d

history = [1.0]


def quantised(t, y):
    return [-np.floor(y[0] / 0.1) * 0.1]  # <1>


def wrapped(t, y):
    angle = y[0] % (2 * np.pi)  # <2>
    return [1.0 if angle < 3.0 else 2.0]


def noisy(t, y):
    return [-y[0] + random.random()]  # <3>


def looping(t, y):
    x = y[0]
    while x > 1.0:  # <4>
        x -= 1.0
    return [-x]


def looked_up(t, y):
    table = [0.0, 1.0]
    return [table[y[0] > 0] - y[0]]  # <5>


calls = 0


def counting(t, y):
    global calls  # <6>
    calls += 1
    return [-y[0] if calls % 2 else -2 * y[0]]


mode = "idle"


def named_mode(t, y):
    global mode  # <7>
    if y[0] > 1:
        mode = "run"
    return [1.0 if mode == "idle" else -1.0]


def silent(t, y):  # <8>
    if y[0] > 0:
        return [-1.0]


def tried(t, y):
    try:  # <9>
        return [1 / y[0]]
    except ZeroDivisionError:
        return [0.0]


def too_few(t, y):  # <10>
    return [y[1]]


def unset(t, y):
    if y[0] > 0:
        force = 1.0
    return [-force, 0.0]  # <11>


def sorted_state(t, y):
    return [-sorted(y, key=abs)[0], 0.0]  # <12>


def lagging(t, y):
    history.append(y[0])
    return [-history[-1]]  # <13>


def counted(t, y):
    return [-((y[0] > 0) + (y[0] > 1))]  # <14>


def tabled(t, y):
    return [-interp1d([-1.0, 1.0], [-2.0, 2.0])(y[0])]  # <15>


def scheduled(t, y):
    return [bisect.bisect([y[0], 2.0], t) - y[0]]  # <16>


def pieces(t, y):
    return [np.piecewise(y[0], [y[0] < 0], [1.0, -1.0, 2.0])]  # <17>


def largest(t, y):
    return [-float(np.argsort(np.array([y[0], 0.0]))[0])]  # <18>


def matched(t, y):
    match y[0] > 0:
        case True:  # <19>
            return [-1.0]
        case _:
            return [1.0]


def masked(t, y):
    return [-np.array([y[0], 2.0])[y[0] > np.array([0.0, 1.0])].sum()]  # <20>
