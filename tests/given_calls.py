"""Calls of what is public, each with values that it takes: what odd values are put into, one at a time."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import filippov as fi
from filippov import (
    Band,
    Hysteresis,
    Input,
    Karnopp,
    Parameter,
    Problem,
    Smooth,
    Stop,
    Surface,
    Sweep,
    Switch,
    System,
    Table,
    TimeEvent,
    UserEvent,
    chirp,
    export_system,
    graphs,
    interop,
    models,
    parameters,
    plot,
    prbs,
    sign,
    solve,
    solve_many,
    square,
    states,
    step,
)
from filippov import analysis as an
from filippov.io.storage import load
from filippov.io.tree_storage import load_tree
from filippov.models import laws
from filippov.sweep.dataset import load_table, write_csv

x, v = states("x v")
p = parameters(k=1.0, c=Parameter(0.2, "", 0, 10), a=0.5)
# A limit cycle: the relay drives what the damper takes away.
DRIVEN = System(
    {x: v, v: -p.k * x - p.c * v + p.a * sign(v)}, outputs={"power": v * sign(v)}, labels={"x": "place [m]"}
)
FRICTION = System({x: v, v: -p.k * x - p.c * sign(v)})
LEAVES = System({x: sign(x)})
SECTION = an.Section("v", "crossing up", "x", {"x": "d", "v": "0"}, t_max=30.0)
START, SPAN = (-1.0, 0.0), (0.0, 7.0)


class Call(NamedTuple):
    """A function and values for its keywords; quick: that run in a moment."""

    function: Callable[..., Any]
    given: dict[str, Any]
    quick: bool = True


@cache
def run() -> fi.Solution:
    return solve(DRIVEN, START, SPAN)


@cache
def tree() -> Any:
    return solve(LEAVES, (0.0,), (0.0, 1.0), nonunique="branch")


@cache
def table() -> Any:
    return Sweep(Problem(DRIVEN, START, SPAN), {"k": [1.0, 2.0]}).run(executor=_serial(), jobs=1)


def _serial() -> Any:
    from concurrent.futures import ThreadPoolExecutor

    return ThreadPoolExecutor(1)


def calls(folder: Path) -> dict[str, Call]:
    """What is public, with values; files go into the folder."""
    saved = run().save(folder / "run.npz")
    grown = tree().save(folder / "tree.npz")
    graph = graphs.observed_graph(run())
    drawn = graphs.save_graph(graph, folder / "graph.json")
    problem = Problem(DRIVEN, START, SPAN)
    csv = folder / "signal.csv"
    csv.write_text("t,r\n0,1\n1,2\n2,0\n", encoding="utf-8")
    span = {"x0": START, "t_span": SPAN}
    options = {
        "parameters": {"k": 1.0},
        "method": "DOP853",
        "rtol": 1e-8,
        "atol": 1e-11,
        "first_step": 0.01,
        "max_step": 0.5,
        "max_steps": 100_000,
        "max_events": 1000,
        "nonunique": "stick",
        "zeno": "stop",
        "simultaneous": "raise",
        "sliding": "filippov",
        "stop": (),
        "backward": False,
    }
    one = {"t_eval": [1.0, 2.0], "events": [x], "throw": False, "progress": None, "dense_output": True,
           "max_time": 100.0, "save_events": "all", "on_graze": "continue", "compile": None,
           "backend": "compiled"}  # fmt: skip
    solved = run()
    swept = folder / "swept"
    Sweep(problem, {"k": [1.0]}).run(swept, executor=_serial(), jobs=1)
    return {
        # models
        "System": Call(
            System,
            {
                "equations": {x: v, v: -x - p.k * sign(v)},
                "surfaces": [Surface("v", v)],
                "states": "x v",
                "parameters": p,
                "time_events": [TimeEvent("clock", 1.0)],
                "outputs": {"e": x * v},
                "labels": {"x": "place [m]"},
                "compile": None,
            },
        ),
        "System of functions": Call(
            System,
            {
                "field": lambda t, y, q, s: [y[1], -y[0] - s[0]],
                "surfaces": [Surface("v", lambda t, y, q: y[1])],
                "states": "x v",
                "parameters": {"k": 1.0},
                "compile": False,
                "labels": {},
            },
        ),
        "from_modes": Call(
            System.from_modes,
            {
                "h": [v],
                "fields": {"+": [v, -x - 1], "-": [v, -x + 1]},
                "states": [x, v],
                "parameters": None,
                "time_events": (),
                "outputs": None,
                "labels": None,
            },
        ),
        "Surface": Call(
            Surface,
            {
                "name": "v",
                "h": v,
                "radius": 1.5,
                "kind": "switching",
                "gradient": None,
                "linear": False,
                "width": 0.0,
                "reset": None,
                "side": "+",
                "contact": None,
            },
        ),
        "Parameter": Call(
            Parameter, {"default": 1.0, "unit": "m", "lower": 0.5, "upper": 2.0, "description": "length"}
        ),
        "TimeEvent": Call(TimeEvent, {"name": "clock", "period": 1.0, "start": 0.5, "reset": {x: -x}}),
        "TimeEvent at": Call(TimeEvent, {"name": "clock", "times": [0.5, 1.0]}),
        "UserEvent": Call(UserEvent, {"g": x, "terminal": False, "direction": 1.0, "name": "g"}),
        "Stop": Call(Stop, {"surface": "v", "kind": "crossing", "count": 2}),
        "states": Call(states, {"names": "x v"}),
        "Band": Call(Band, {"width": 0.1}),
        "Smooth": Call(Smooth, {"width": 0.1, "shape": "tanh"}),
        "Hysteresis": Call(Hysteresis, {"width": 0.1}),
        "Switch": Call(Switch, {"eta": 0.1, "alpha": 10.0, "balance": "at rest"}),
        "Karnopp": Call(Karnopp, {"DV": 0.1, "alpha": 10.0}),
        "Input": Call(
            Input,
            {
                "name": "r",
                "t": [0.0, 1.0, 2.0],
                "values": [0.0, 1.0, 0.0],
                "kind": "linear",
                "outside": "hold",
                "period": 3.0,
            },
        ),
        "Input.from_csv": Call(
            Input.from_csv, {"name": "r", "path": csv, "time": "t", "value": "r", "kind": "hold"}
        ),
        "Table": Call(Table, {"x": [0.0, 1.0], "y": [1.0, 2.0], "outside": "hold"}),
        "Table of": Call(Table([0.0, 1.0], [1.0, 2.0]), {"u": x}),
        "step": Call(step, {"name": "r", "times": [1.0], "levels": (0.0, 1.0)}),
        "square": Call(
            square, {"name": "r", "period": 2.0, "levels": (1.0, 0.0), "duty": 0.25, "start": 0.0}
        ),
        "prbs": Call(prbs, {"name": "r", "clock": 0.5, "levels": (1.0, 0.0), "order": 3, "start": 0.0}),
        "chirp": Call(chirp, {"f0": 1.0, "f1": 2.0, "duration": 5.0, "phase": 0.5}),
        "with_comparator": Call(DRIVEN.with_comparator, {"comparator": Band(0.1)}),
        "with_inputs": Call(DRIVEN.with_inputs, {"signals": {"a": Input("r", [0.0, 9.0], [0.5, 0.6])}}),
        "jacobian": Call(DRIVEN.jacobian, {"mode": "+"}),
        "state_index": Call(DRIVEN.state_index, {"name": "v"}),
        "export_system": Call(
            export_system,
            {"system": DRIVEN, "path": folder / "m.py", "to": "python", "parameters": {}, **span},
        ),
        "export": Call(
            DRIVEN.export, {"path": folder / "model.c", "to": "c", "parameters": {"k": 1.0}, **span}
        ),
        # runs
        "Problem": Call(Problem, {"system": DRIVEN, **span, "parameters": {"k": 1.0}, "backward": False}),
        "remake": Call(
            problem.remake, {"system": DRIVEN, **span, "parameters": {"k": 1.0}, "backward": False}
        ),
        "solve": Call(solve, {"system": DRIVEN, **span, **options, **one}),
        "solve by steps": Call(
            solve, {"system": DRIVEN, **span, "method": "Moreau", "dt": 0.01, "theta": 0.5}
        ),
        "solve all": Call(
            solve,
            {
                "system": LEAVES,
                "x0": (0.0,),
                "t_span": (0.0, 1.0),
                "nonunique": "branch",
                "max_branches": 4,
                "max_depth": 2,
                "release_times": 2,
            },
        ),
        "solve_many": Call(
            solve_many,
            {
                "system": DRIVEN,
                "x0": [START, (1.0, 1.0)],
                "t_span": SPAN,
                **options,
                "threads": 1,
                "lanes": 1,
                "measure": None,
                "progress": None,
                "compile": None,
            },
        ),
        "Sweep": Call(
            Sweep,
            {
                "problem": problem,
                "over": {"k": [1.0, 2.0]},
                "samples": "grid",
                "measure": ("end", "t_end"),
                "n": None,
                "seed": 0,
                "tail": 0.5,
                "reduce": ("mean",),
                **{name: value for name, value in options.items() if name not in ("parameters", "backward")},
                "on_graze": "continue",
            },
        ),
        "Sweep drawn": Call(
            Sweep, {"problem": problem, "over": {"k": (1.0, 2.0)}, "samples": "sobol", "n": 4, "seed": 1}
        ),
        "Sweep.run": Call(
            Sweep(problem, {"k": [1.0, 2.0]}).run,
            {
                "folder": None,
                "jobs": 1,
                "executor": _serial(),
                "resume": False,
                "fresh": False,
                "trust": False,
                "max_time": None,
                "max_memory": None,
                "chunk": 1,
                "context": "spawn",
                "progress": None,
            },
        ),
        "problem_at": Call(Sweep(problem, {"k": [1.0, 2.0]}).problem_at, {"point": 1}),
        # what came out
        "sol": Call(solved.sol, {"t": 1.0, "side": "-"}),
        "mode_at": Call(solved.mode_at, {"t": 1.0, "side": "-"}),
        "evaluate": Call(solved.evaluate, {"what": "x + v", "t": 1.0, "side": "-"}),
        "multiplier": Call(solved.multiplier, {"surface": "v", "t": 1.0}),
        "[]": Call(solved.__getitem__, {"name": "x"}),
        "save": Call(solved.save, {"path": folder / "again.npz"}),
        "load": Call(fi.Solution.load, {"path": saved, "system": DRIVEN}),
        "storage.load": Call(load, {"path": saved, "system": DRIVEN, "max_bytes": 1 << 30}),
        "events.of": Call(solved.events.of, {"surface": "v", "kind": "crossing", "direction": 1}),
        "events.count": Call(solved.events.count, {"surface": "v", "kind": "crossing", "direction": 1}),
        "segments.of": Call(solved.segments.of, {"mode": "+", "surface": "v"}),
        "plot": Call(
            solved.plot,
            {
                "states": ["x"],
                "multiplier": "v",
                "labels": {"x": "x"},
                "events": True,
                "points": 20,
                "title": "a",
                "figure": None,
            },
            quick=False,
        ),
        "plot_phase": Call(
            plot.plot_phase,
            {
                "solution": solved,
                "x": "x",
                "y": "v",
                "labels": {},
                "events": True,
                "points": 20,
                "title": "a",
                "figure": None,
            },
            quick=False,
        ),
        "ensemble.events": Call(
            solve_many(DRIVEN, [START], SPAN).events, {"surface": "v", "kind": "crossing"}
        ),
        "tree.path": Call(tree().path, {"leaf": 1}),
        "tree.reachable": Call(tree().reachable, {"t": 0.5}),
        "tree.save": Call(tree().save, {"path": folder / "tree2.npz"}),
        "tree.load": Call(fi.SolutionTree.load, {"path": grown, "system": LEAVES}),
        "load_tree": Call(load_tree, {"path": grown, "system": LEAVES, "max_bytes": 1 << 30}),
        "write_csv": Call(write_csv, {"table": table(), "path": folder / "t.csv"}),
        "load_table": Call(load_table, {"folder": swept}),
        # graphs
        "observed_graph": Call(graphs.observed_graph, {"solution": solved}),
        "possible_graph": Call(
            graphs.possible_graph,
            {"system": DRIVEN, "start": "+", "modes": ["+", "-"], "parameters": {"k": 1.0}, "limit": 9},
        ),
        "mode_word": Call(
            graphs.mode_word, {"solution": solved, "names": {"+": "right", "-": "left", "0": "stick"}}
        ),
        "recurrent_part": Call(graphs.recurrent_part, {"graph": graph}),
        "save_graph": Call(graphs.save_graph, {"graph": graph, "path": folder / "graph2.json"}),
        "load_graph": Call(graphs.load_graph, {"path": drawn}),
        # other descriptions
        "from_statespace": Call(
            interop.from_statespace,
            {
                "A": [[0.0, 1.0], [-1.0, -0.2]],
                "B": [[0.0], [1.0]],
                "C": [[0.0, 1.0]],
                "D": [[0.0]],
                "nonlinearity": lambda y: -sign(y),
                "states": "x v",
                "outputs": ["w"],
                "surfaces": (),
            },
        ),
        # models
        "models.get": Call(models.get, {"name": "hunting"}),
        "models.problem": Call(models.problem, {"name": "hunting"}),
        "controlled_mass": Call(
            models.controlled_mass, {"friction": laws.Coulomb(), "controller": models.PID(), "m": 1.0}
        ),
        "static_cycles": Call(
            models.static_cycles, {"m": 1.0, "P": 10.0, "D": 3.0, "I": 10.0, "Fs": 4.0, "Fc": 2.0, "b": 0.0}
        ),
        "coulomb_ratio": Call(models.coulomb_ratio, {"m": 1.0, "P": 10.0, "D": 3.0, "I": 10.0, "b": 0.0}),
    }
