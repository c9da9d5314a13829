"""Programs in the spirit of public issue threads about chattering and missed events; the code is our own.

A comment `# <k>` marks the lines that are to be found.
"""
# ruff: noqa: RUF059, SIM108  (written as users write)

import numpy as np


def openmodelica_9711(t, y, a=-1.0):
    """OpenModelica/OpenModelica#9711: the solver chatters at x = 0.5, which its pictures do not show."""
    return [a if y[0] > 0.5 else 1.0]  # <1>


def scipy_18039(t, y):
    """scipy/scipy#18039: solve_ivp is inaccurate for a piecewise-smooth system; a second pulse is missed."""
    source = 0.0
    for start in (1.0, 60.0):
        if start < t < start + 0.5:  # <2>
            source = 1.0
    return np.array([source - 0.05 * y[0]])


def differential_equations_167(t, u):
    """SciML/DifferentialEquations.jl#167: too long steps; one state back and forth beside one that decays."""
    s = np.sign(np.sin(40.0 * t))  # <3>
    return [s, -u[1]]


def chebfun_1512(t, u):
    """chebfun/chebfun#1512: the solver is wrong for short forcing pulses."""
    pulse = 20.0 * (t > 10) * (t < 10.05)  # <4>
    return [pulse - t * u[0] if t < 1 else pulse - u[0]]  # <5>


def diffrax_58(t, y, w=2.0, damping=0.2):
    """patrick-kidger/diffrax#58: an oscillator whose forcing jumps at t = 7.5."""
    x, v = y
    force = np.where(t < 7.5, 0.0, 1.0)  # <6>
    return np.array([v, force - w**2 * x - 2 * damping * v])


def opty_476(t, y, m=1.0, mu=0.6, g=9.81):
    """csu-hmc/opty#476: friction that points against the velocity, on a block that is pushed."""
    x, v = y
    push = 4.0 * np.cos(0.5 * t)
    normal = m * g
    if v > 0:  # <7>
        friction = -mu * normal
    else:
        friction = mu * normal
    return v, (push + friction) / m


def scipy_9228(t, y):
    """scipy/scipy#9228: of three zeros of a cubic an event finds one; here a time is taken between them."""
    q = y[0]
    inside = 1.0 if q > 0 else 0.0  # <8>
    return [3 * t**2 + 12 * t - 4, inside]


def diffrax_507(t, y):
    """patrick-kidger/diffrax#507: on a straight line large steps pass over two changes of sign."""
    x = y[0]
    dose = 100.0 * (x > 2.5 and x < 2.51)  # <9>
    return [1.0, dose]


def cyrk_98(t, y):
    """jrenaud90/CyRK#98: several crossings in one step; a mass on a spring with a stop in its way."""
    x, v = y
    stop = 0.0
    if x < -0.999:  # <10>
        stop = 2.0
    return [v, -x + stop]


def diffeqbase_634(t, y, M=1.0, F=1.0):
    """SciML/DiffEqBase.jl#634: a valve with dry friction under a pressure that pulses."""
    x, v = y
    pressure = 0.8 + 0.6 * np.sin(6.0 * t) if t > 0 else 0.0  # <11>
    load = pressure - 0.5 * x
    return [v, (load - F * np.sign(v)) / M]  # <12>
