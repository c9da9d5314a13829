"""Calls of what is public in `filippov.analysis`, each with values that it takes."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import control
import numpy as np
from given_calls import DRIVEN, FRICTION, SECTION, START, Call, run, v, x

from filippov import Heaviside, Surface, System, parameters, states
from filippov import analysis as an
from filippov.analysis.bifurcations.continuation import Continuation
from filippov.analysis.comparisons.comparison import compare_sections
from filippov.models import get
from filippov.models.driven import driven_mass

(z,) = states("z")
g = parameters(a=2.6, q=0.0)
q = parameters(mu=0.0)
HUNTING = get("hunting").build()
HUNTS = an.Section("velocity", "sliding entry", "x", {"x": "d", "v": "0", "z": "(sign(d)*Fs/P - d)/I"})
MASS, SPEEDS = driven_mass(), np.linspace(-1.0, 1.0, 21)
SADDLE = System({x: v, v: x - 0.5 * v * Heaviside(v - 5)})
LOOP = System({x: v, v: x - x**3 + q.mu * v})


def naive(t: float, y: Any) -> list[float]:
    return [-1.0 if y[0] > 0 else 1.0]


@cache
def orbit() -> an.Orbit:
    return an.find_orbit(DRIVEN, START)


@cache
def continued() -> Continuation:
    """The logistic map between the ticks of a clock, past its period doubling at a = 3."""
    tick = Surface("tick", z - 1, reset={x: (g.a + g.q) * x * (1 - x), z: 0 * z}, side="-")
    system = System({x: 0 * x, z: 1 + 0 * z}, surfaces=[tick], parameters=g)
    returns = an.EventMap(system, an.Section("tick", "reset", "x", {"x": "d", "z": 0}, t_max=5))
    found = an.continuation(
        system, (returns, 1 - 1 / 2.6), parameter="a", bounds=(2.6, 3.4), direction=1, step=0.1, max_step=0.4
    )
    found.run()
    return found


@cache
def bent() -> Continuation:
    past = continued()
    found = an.curve(past, past.branch.special[0], parameter="q", bounds=(0.0, 0.4), max_points=3)
    found.run()
    return found


def calls(folder: Path) -> dict[str, Call]:
    """What is public, with values; files go into the folder."""
    event_map = an.EventMap(DRIVEN, SECTION)
    record = folder / "record.csv"
    record.write_text(
        "t,x,u\n" + "".join(f"{0.1 * k},{np.cos(0.1 * k)},0\n" for k in range(40)), encoding="utf-8"
    )
    of_section = {"system": DRIVEN, "section": SECTION}
    bounds = {"bounds": (0.4, 0.6), "direction": 0, "step": 0.02, "min_step": 1e-8, "max_step": 0.1,
              "max_points": 3, "max_time": 50.0}  # fmt: skip
    found = an.equilibria(FRICTION)
    solved = run()
    return {
        "Section": Call(
            an.Section,
            {
                "surface": "v",
                "kind": "crossing",
                "coordinate": "x",
                "parametrisation": {"x": "d", "v": "0"},
                "t_max": 10.0,
                "after": "+",
            },
        ),
        "Stroboscope": Call(an.Stroboscope, {"coordinate": "x", "period": 1.0, "clock": ""}),
        "find_section": Call(
            an.find_section,
            {
                "system": DRIVEN,
                "x0": (-2.0, 0.0),
                "parameters": {"k": 1.0},
                "t_max": 300.0,
                "period": None,
                "coordinate": "x",
            },
        ),
        "returns": Call(
            an.returns,
            {
                "system": DRIVEN,
                "section": SECTION,
                "x0": START,
                "count": 2,
                "parameters": {"k": 1.0},
                "t0": 0.0,
                "rtol": 1e-9,
                "atol": 1e-12,
                "method": "DOP853",
                "max_events": 100,
            },
        ),
        "EventMap": Call(
            an.EventMap,
            {
                **of_section,
                "parameters": {"k": 1.0},
                "order": 1,
                "rtol": 1e-9,
                "atol": 1e-12,
                "method": "DOP853",
            },
        ),
        "EventMap.remake": Call(event_map.remake, {"parameters": {"k": 1.5}, "order": 2, "rtol": 1e-9}),
        "EventMap()": Call(event_map, {"d": 0.7}),
        "EventMap.returns": Call(event_map.returns, {"d": [0.7, 0.8]}),
        "power": Call(event_map.power, {"order": 2}),
        "iterate": Call(event_map.iterate, {"d": 0.7, "n": 2}),
        "orbit": Call(event_map.orbit, {"d": 0.7}),
        "derivative": Call(event_map.derivative, {"d": -0.7}),
        "jet": Call(event_map.jet, {"d": -0.7, "parameters": ["k"]}),
        "fixed_points": Call(event_map.fixed_points, {"lo": -4.0, "hi": -0.6, "points": 8}),
        "basins": Call(event_map.basins, {"lo": -4.0, "hi": -0.6, "points": 8}),
        "jumps": Call(event_map.jumps, {"lo": -4.0, "hi": -0.6, "points": 8}),
        "bifurcation": Call(
            an.bifurcation,
            {
                **of_section,
                "parameter": "a",
                "values": [0.4, 0.5],
                "interval": (-4.0, -0.6),
                "parameters": {"k": 1.0},
                "order": 1,
                "points": 8,
                "rtol": 1e-9,
                "atol": 1e-12,
                "engine": None,
                "progress": None,
            },
            quick=False,
        ),
        "brute_force": Call(
            an.brute_force,
            {
                **of_section,
                "parameter": "a",
                "values": [0.4, 0.5],
                "start": -1.0,
                "transient": 3,
                "keep": 2,
                "parameters": {"k": 1.0},
                "follow": False,
                "rtol": 1e-8,
                "threads": 1,
                "max_events": 1000,
                "progress": None,
            },
            quick=False,
        ),
        "basin": Call(
            an.basin,
            {
                **of_section,
                "x": ("x", [-2.0, -1.0]),
                "y": ("v", [0.0, 0.1]),
                "interval": (-4.0, -0.6),
                "at": {},
                "parameters": {"k": 1.0},
                "order": 1,
                "points": 8,
                "rtol": 1e-8,
                "threads": 1,
                "engine": None,
                "progress": None,
            },
            quick=False,
        ),
        "regions": Call(an.regions, {
            **of_section, "x": ("a", [0.4, 0.5]), "y": ("c", [0.2, 0.3]), "interval": (0.0, 3.0),
            "parameters": {"k": 1.0}, "order": 1, "points": 8, "rtol": 1e-8, "borders": (), "threads": 1,
            "engine": None, "progress": None,
        }, quick=False),
        "period_map": Call(an.period_map, {
            **of_section, "x": ("a", [0.4, 0.5]), "y": ("c", [0.2, 0.3]), "x0": (1.0, 0.0),
            "parameters": {"k": 1.0}, "transient": 2, "keep": 2, "rtol": 1e-8, "progress": None,
        }, quick=False),
        "gain_map": Call(an.gain_map, {
            **of_section, "x": ("a", [0.4, 0.5]), "y": ("c", [0.2, 0.3]), "interval": (0.0, 3.0),
            "parameters": {"k": 1.0}, "band": ({},), "points": 8, "progress": None,
        }, quick=False),
        "tune": Call(
            an.tune,
            {
                **of_section,
                "over": {"c": (0.2, 0.4)},
                "interval": (0.0, 3.0),
                "parameters": {"k": 1.0},
                "band": ({},),
                "samples": 16,
                "points": 8,
                "seed": 0,
                "progress": None,
            },
            quick=False,
        ),
        "attractors": Call(
            an.attractors,
            {
                "system": DRIVEN,
                "box": {"x": (-3.0, 3.0), "v": (-3.0, 3.0)},
                "parameters": {"k": 1.0},
                "section": None,
                "period": None,
                "step": 0.2,
                "t0": 0.0,
                "samples": 2,
                "seed": 0,
                "plane": None,
                "resolution": 2,
                "at": None,
                "cells": 20,
                "recurrences": 10,
                "most": 300,
                "reach": 1e-3,
                "escape": 100.0,
                "rtol": 1e-6,
                "threads": 1,
                "progress": None,
                "store": None,
            },
            quick=False,
        ),
        "find_orbit": Call(
            an.find_orbit,
            {
                "system": DRIVEN,
                "guess": START,
                "parameters": {"k": 1.0},
                "period": None,
                "symmetry": None,
                "nodes": 1,
                "transient": 0.0,
                "t_max": 100.0,
                "t0": 0.0,
                "rtol": 1e-10,
                "atol": 1e-12,
                "method": "DOP853",
                "jacobian": None,
                "progress": None,
            },
            quick=False,
        ),
        "orbit.solution": Call(orbit().solution, {"periods": 1.0}),
        "orbit.save": Call(orbit().save, {"path": folder / "orbit.json"}),
        "continuation": Call(
            an.continuation,
            {
                "system": DRIVEN,
                "start": orbit(),
                "parameter": "a",
                **bounds,
                "value": None,
                "mode": None,
                "parameters": None,
                "resume": None,
            },
            quick=False,
        ),
        "branch.coordinate": Call(continued().branch.coordinate, {"name": "x"}),
        "branch.save": Call(continued().branch.save, {"path": folder / "branch.json"}),
        "curve": Call(
            an.curve,
            {
                "run": continued(), "special": continued().branch.special[0], "parameter": "q", **bounds,
                "bounds": (0.0, 0.4),
            },
            quick=False,
        ),
        "curves_at": Call(an.curves_at, {"run": bent(), "special": bent().branch.points[0]}),
        "switch": Call(
            an.switch,
            {"run": continued(), "special": continued().branch.special[0], **bounds, "bounds": (2.6, 3.4)},
            quick=False,
        ),
        "Approximation": Call(
            an.Approximation,
            {
                "name": "band", "build": lambda w: DRIVEN, "stiff": False, "method": None, "start": (),
                "stick": None, "sticks": True, "without": {}, "timed": False,
            },
        ),
        "BandModel": Call(
            an.BandModel,
            {
                "name": "band", "build": lambda w: DRIVEN, "stick": None, "options": {}, "reach": 1.0,
                "attracted": False,
            },
        ),
        "compare_sections": Call(
            compare_sections,
            {
                "exact": HUNTING, "section": HUNTS, "bands": (), "widths": [1e-3, 1e-4],
                "comparators": ["band"],
                "coordinates": [0.1], "interval": None, "order": 2, "x0": (0.1, 0.0, 0.0), "events": 2,
                "position": None, "parameters": {"m": 1.0}, "rtol": 1e-9, "atol": 1e-11, "max_steps": 10_000,
                "repeats": 1, "progress": None,
            },
            quick=False,
        ),
        "Curve": Call(an.Curve, {"v": [-1.0, 1.0], "friction": [-2.0, 2.0]}),
        "friction_force": Call(
            an.friction_force, {"system": MASS, "v": [-1.0, 1.0], "values": {"Fs": 4.0, "Fc": 2.0}}
        ),
        "identify_curve": Call(
            an.identify_curve,
            {
                "curve": an.Curve(SPEEDS, an.friction_force(MASS, SPEEDS, {})), "system": MASS,
                "free": ["Fc", "b"], "start": {"Fc": 1.9}, "fixed": {"beta": 2.0}, "level": 0.9,
            },
            quick=False,
        ),
        "identify": Call(
            an.identify,
            {
                "record": an.read_record(record), "system": MASS, "free": ["b"], "start": {"b": 0.9},
                "fixed": {"beta": 2.0}, "windows": 1, "hold": "auto", "level": 0.9, "rtol": 1e-7,
                "progress": None,
            },
            quick=False,
        ),
        "growth": Call(an.growth, {"maps": [an.rest_map([1.0, 0.4, 2.0])] * 2}),
        "linear_mode": Call(
            an.linear_mode,
            {
                "system": DRIVEN, "mode": "+", "x": START, "t": 0.0, "parameters": {"k": 1.0},
                "inputs": ["k"], "outputs": ["x"],
            },
        ),
        "relay_loop": Call(an.relay_loop, {"plant": control.tf([1], [1, 2, 2, 1])}),
        "equilibria": Call(
            an.equilibria,
            {
                "system": FRICTION,
                "parameters": {"k": 1.0},
                "modes": ["+", "0"],
                "t": 0.0,
                "box": {"x": (-1.0, 1.0), "v": (-1.0, 1.0)},
                "budget": 5.0,
            },
        ),
        "linearise": Call(
            an.linearise, {"system": FRICTION, "equilibrium": next(iter(found)), "values": {}, "sides": ["+"]}
        ),
        "stability_report": Call(
            an.stability_report,
            {
                "system": FRICTION,
                "parameters": {"k": 1.0},
                "solve_for": "k",
                "modes": ["0"],
                "t": None,
                "assume": None,
                "hook": None,
                "budget": 5.0,
            },
            quick=False,
        ),
        "certify": Call(
            an.certify, {"system": FRICTION, "parameters": {"k": 1.0}, "budget": 5.0}, quick=False
        ),
        "describing_function": Call(
            an.describing_function,
            {"system": DRIVEN, "surface": "v", "parameters": {"k": 1.0}, "amplitudes": (0.01, 100.0)},
            quick=False,
        ),
        "routh_hurwitz": Call(
            an.routh_hurwitz, {"polynomial": [1, 2, 3], "s": None, "assume": (), "budget": 5.0}
        ),
        "rest_map": Call(an.rest_map, {"polynomial": [1.0, 2.0, 3.0]}),
        "lyapunov": Call(
            an.lyapunov,
            {
                "system": DRIVEN,
                "x0": START,
                "duration": 20.0,
                "interval": 5.0,
                "transient": 1.0,
                "t0": 0.0,
                "number": 1,
                "parameters": {"k": 1.0},
                "rtol": 1e-8,
                "atol": 1e-11,
                "progress": None,
            },
            quick=False,
        ),
        "flow_derivative": Call(
            an.flow_derivative,
            {"solution": solved, "before_last": False, "parameters": ["k"], "jacobian": None},
        ),
        "compare_solutions": Call(
            an.compare_solutions,
            {
                "system": FRICTION,
                "x0": (1.0, 0.0),
                "t_span": (0.0, 2.0),
                "against": ["band"],
                "widths": [1e-2, 1e-3],
                "measures": (),
                "parameters": {"k": 1.0},
                "accuracy": None,
                "quantity": "error_state",
                "alpha": 10.0,
                "rtol": 1e-8,
                "atol": 1e-10,
                "max_steps": 10_000,
                "max_events": 1000,
                "repeats": 1,
                "progress": None,
            },
            quick=False,
        ),
        "diagnose": Call(
            an.diagnose,
            {
                "f": naive,
                "x0": [1.0],
                "t_span": (0.0, 2.0),
                "args": (),
                "method": "RK45",
                "rtol": 1e-3,
                "atol": 1e-6,
                "max_calls": 2000,
            },
            quick=False,
        ),
        "read_record": Call(an.read_record, {"path": record}),
        "Record": Call(an.Record, {"t": [0.0, 1.0], "x": [0.0, 1.0], "force": [0.0, 0.0]}),
        "manifold": Call(
            an.manifold,
            {
                "system": SADDLE,
                "at": (0.0, 0.0),
                "side": "unstable",
                "length": 1.0,
                "parameters": {},
                "mode": None,
                "section": None,
                "spacing": 0.1,
                "offset": 1e-4,
                "t_max": 50.0,
                "rtol": 1e-8,
                "most": 100,
            },
            quick=False,
        ),
        "saddle": Call(
            an.find_homoclinic,
            {
                "system": LOOP,
                "near": (0.01, 0.0),
                "free": "mu",
                "parameters": {"mu": 0.03},
                "mode": None,
                "side": 1,
                "t_max": 200.0,
                "rtol": 1e-9,
                "atol": 1e-11,
                "jacobian": None,
            },
            quick=False,
        ),
    }
