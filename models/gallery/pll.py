"""A phase-locked loop whose phase detector only says whether the phase is ahead or behind."""

from __future__ import annotations

import math
from typing import Any

from filippov import Parameter, Surface, System, parameters, sign, sin, states
from filippov.models.registry import Invariant, Model, register


def pll(detuning: float = 4.0, kp: float = 1.0, ki: float = 0.5) -> System:
    """q' in detuning - w - kp Sgn(sin q), w' in ki Sgn(sin q).

    detuning   frequency of the input above that of the free oscillator [rad/s]
    kp, ki     gains of the proportional [rad/s] and of the integral path [rad/s^2]

    The phase slips whole turns until w is near enough. Locked it slides: detuning - w falls as exp(-ki/kp t).
    """
    p = parameters(
        detuning=Parameter(detuning, "rad/s", description="frequency offset of the input"),
        kp=Parameter(kp, "rad/s", 1e-12, description="proportional gain"),
        ki=Parameter(ki, "rad/s^2", 0, description="integral gain"),
    )
    q, w = states("q w")
    s = sign(sin(q))
    return System(
        {q: p.detuning - w - p.kp * s, w: p.ki * s},
        surfaces=[Surface("phase", sin(q))],
        parameters=p,
        labels={"t": "time [s]", "q": "phase error [rad]", "w": "correction [rad/s]"},
    )


def _offset(t: float, x: Any, p: Any) -> float:
    """Return (detuning - w) exp(ki/kp t), constant while locked."""
    return float((p.detuning - x[1]) * math.exp(p.ki / p.kp * t))


MODEL = register(
    Model(
        "pll",
        pll,
        (0.5, 0.0),
        (0.0, 20.0),
        "A bang-bang phase-locked loop: it slips cycles, then locks by sliding.",
        "Walker 2003; numbers chosen here",
        (Invariant("(detuning - w) exp(ki/kp t) while locked", _offset, "0"),),
    )
)
