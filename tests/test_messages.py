"""Mistakes that newcomers make, and what they are told: the place, and what to write instead.

A row is a mistake, a part of the message that names the place or what was given, and one that is the cure.
"""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy
from matplotlib import pyplot as plt

import filippov
from filippov import (
    Band,
    Heaviside,
    Hysteresis,
    Input,
    Max,
    ModelError,
    Parameter,
    Piecewise,
    Problem,
    Smooth,
    Solution,
    SolveError,
    Stop,
    Surface,
    Sweep,
    System,
    Table,
    TimeEvent,
    UsageError,
    UserEvent,
    log,
    parameters,
    sign,
    sin,
    solve,
    solve_many,
    sqrt,
    square,
    states,
    t,
)  # fmt: skip
from filippov.analysis import (
    EventMap,
    Section,
    Stroboscope,
    bifurcation,
    find_section,
    returns,
    stability_report,
)
from filippov.app.cli.main import main

x, v = states("x v")
w = states("w")
p = parameters(m=1.0, e=Parameter(0.5, "", 0, 1), width=0.1)
S = System({x: v, v: -x - 0.1 * sign(v)})
LINEAR = System({x: -p.m * x})
START, SPAN = (1.0, 0.0), (0.0, 1.0)
RUN = solve(S, START, SPAN)
RUN_OFF = solve(S, (1.0, 0.0), (0.0, 9.0))
MANY = solve_many(S, [START], SPAN)


def field(f: Callable[..., Any], **more: Any) -> Any:
    return solve(System(field=f, states="x v", **more), START, SPAN)


def with_surface(*values: Any, **named: Any) -> Any:
    return System({x: v, v: -sign(v)}, surfaces=[Surface(*values, **named)])


def plain(h: Callable[..., Any], **more: Any) -> System:
    return System(field=lambda t, y, p, s: y, states="x v", surfaces=[Surface("v", h, **more)])


CHOICE = "Piecewise((a, v > 0), (b, True))"
MISTAKES: dict[str, tuple[Callable[[], Any], str, str]] = {
    # Python and numpy in equations
    "if": (lambda: 1 if v > 0 else -1, "v > 0", CHOICE),
    "max": (lambda: max(v, 0), "v", "Max and Min"),
    "min": (lambda: min(v, p.m), "v", "Max and Min"),
    "and": (lambda: Piecewise((1, (x > 0) and (v > 0)), (0, True)), "x > 0", "& and |"),
    "not": (lambda: not x > 0, "x > 0", CHOICE),
    "while": (lambda: [1 for _ in range(1) if x < v], "x < v", CHOICE),
    "chained": (lambda: 0 < x < 1, "x > 0", "& and |"),
    "sorted": (lambda: sorted([x, v]), "v", "Max and Min"),
    "math.sin": (lambda: math.sin(x), "expression", "sin, cos, exp"),
    "math.exp": (lambda: math.exp(-x), "expression", "not those of math"),
    "float": (lambda: float(x), "expression", "from filippov"),
    "round": (lambda: round(x), "round", "Surface('name', sin(pi*u))"),
    "int": (lambda: int(x), "int", "TimeEvent('clock'"),
    "np.floor": (lambda: np.floor(x), "np.floor", "Piecewise"),
    "np.interp": (lambda: np.interp(x, [0, 1], [1, 2]), "np.interp", "System(field=f, ...)"),
    "np.mod": (lambda: np.mod(x, 2), "np.remainder", "Heaviside"),
    "floor": (lambda: System({x: x // 2}), "the equation of 'x'", "TimeEvent('clock'"),
    "mod": (lambda: System({x: x % 2}), "the equation of 'x'", "Surface('name', sin(pi*u))"),
    "condition": (lambda: System({x: x > 0}), "the equation of 'x'", "Heaviside(u - v)"),
    "equality": (lambda: System({x: sympy.Eq(x, v)}), "Eq(x, v)", "Piecewise((a, u > v)"),
    # equations
    "text": (lambda: System({x: "v"}), "the equation of 'x'", "write the expression itself"),
    "text key": (lambda: System({"x": v}), "'x' (str)", "states('x v')"),
    "list": (lambda: System([v, -x]), "[v, -x]", "{x: dx/dt, v: dv/dt}"),
    "function": (lambda: System(lambda t, y: -y), "equations", "System(field=f, states='x v')"),
    "function in": (lambda: System({x: lambda t: 1}), "the equation of 'x'", "System(field=f"),
    "matrix": (lambda: System({x: sympy.Matrix([1])}), "the equation of 'x'", "one equation per state"),
    "row": (lambda: System({x: [1, 2]}), "the equation of 'x'", "one equation per state"),
    "none": (lambda: System({x: None}), "the equation of 'x'", "expected a sympy expression"),
    "bool": (lambda: System({x: True}), "the equation of 'x'", "expected a sympy expression"),
    "empty": (lambda: System({}), "no equation", "System({x: ...})"),
    "nothing": (System, "neither was", "System({x: ..., v: ...})"),
    "both": (lambda: System({x: v}, field=lambda *_: [0]), "both were", "from equations"),
    "other symbol": (lambda: System({sympy.Symbol("x"): 1}), "'x'", "states('x')"),
    "mixed symbol": (lambda: System({x: sympy.Symbol("x")}), "another symbol named 'x'", "states('...')"),
    "free symbol": (lambda: System({x: sympy.Symbol("k") * x}), "symbol 'k'", "parameters(k=...)"),
    "missing state": (lambda: System({x: v}), "symbol 'v'", "add its equation"),
    "other t": (lambda: System({x: sympy.Symbol("t")}), "symbol 't'", "from filippov import t"),
    "state t": (lambda: states("x t"), "name 't'", "another name"),
    "keyword": (lambda: states("x lambda"), "'lambda'", "Write 'lambda_'"),
    "state digit": (lambda: states("1x"), "'1x'", "beginning with a letter"),
    "state twice": (lambda: states("x x"), "'x' is given twice", "its own name"),
    "no state": (lambda: states(""), "no state was named", "states('x v')"),
    "complex": (lambda: System({x: sqrt(-1) * x}), "the equation of 'x'", "expected a real expression"),
    "infinite": (lambda: System({x: x / sympy.S.Zero}), "the equation of 'x'", "division by zero"),
    "derivative": (lambda: System({x: sympy.Derivative(x, t)}), "Derivative", ".doit()"),
    "undefined": (lambda: System({x: sympy.Function("f")(t)}), "f(t)", "write its formula"),
    "dirac": (lambda: System({x: sympy.DiracDelta(x)}), "DiracDelta", "a reset of the state"),
    "states=": (lambda: System({x: v, v: 1}, states="x"), "'v'", "does not name"),
    "states missing": (lambda: System({x: 1}, states="x v"), "'v'", "Add one"),
    # parameters
    "parameters dict": (lambda: parameters({"m": 1}), "without a name", "parameters(m=1"),
    "parameter text": (lambda: parameters(m="1"), "parameter 'm'", "expected a real number"),
    "quantity": (lambda: Parameter("1 kg"), "'1 kg'", "Convert text and quantities"),
    "parameter bounds": (lambda: Parameter(2, "", 0, 1), "outside its bounds", "[0, 1]"),
    "empty bounds": (lambda: Parameter(1, "", 2, 0), "[2.0, 0.0]", "lower exceeds upper"),
    "p.mm": (lambda: p.mm, "'mm'", "did you mean 'm'"),
    "p['mm']": (lambda: p["mm"], "'mm'", "did you mean 'm'"),
    "p.m = 2": (lambda: setattr(p, "m", 2), "declared once", "give the value to the run"),
    "parameter name": (lambda: parameters(**{"1a": 2}), "'1a'", "beginning with a letter"),
    "two spaces": (lambda: System({x: p.m * parameters(m=2).m}), "'m'", "in one parameters(...)"),
    "parameters=dict": (lambda: System({x: p.m}, parameters={"m": 1}), "parameters are", "parameters(...)"),
    "unknown value": (lambda: solve(LINEAR, (1,), SPAN, parameters={"M": 2}), "'M'", "did you mean 'm'"),
    "value text": (lambda: solve(LINEAR, (1,), SPAN, parameters={"m": "2"}), "'m'", "a real number"),
    "value nan": (lambda: solve(LINEAR, (1,), SPAN, parameters={"m": math.nan}), "'m'", "finite"),
    # surfaces and events of the model
    "surface pair": (lambda: System({x: -sign(x)}, surfaces=[("x", x)]), "holds", "Surface('name', h)"),
    "surface bare": (lambda: System({x: -sign(x)}, surfaces=[x]), "surfaces holds x", "Surface('name', h)"),
    "surface dict": (lambda: System({x: -sign(x)}, surfaces={"x": x}), "'x'", "Surface('name', h)"),
    "surface swapped": (lambda: Surface(v, "v"), "the name v", "Surface('v', v)"),
    "surface no h": (lambda: Surface("v"), "Surface needs h", "Surface(name, h)"),
    "surface condition": (lambda: Surface("v", v > 0), "'v'", "the difference of its two sides"),
    "surface unused": (lambda: with_surface("q", x - 1), "'q'", "kind='observer'"),
    "surface square": (lambda: with_surface("q", v**2), "'q'", "without the square"),
    "surface constant": (lambda: with_surface("q", p.m), "'q'", "its sign never changes"),
    "surface twice": (lambda: System({x: -sign(x)}, surfaces=[Surface("a", x), Surface("a", x - 1)]), "'a'",
                      "its own name"),
    "surface same": (lambda: System({x: -sign(x)}, surfaces=[Surface("a", x), Surface("b", 2 * x)]), "'b'",
                     "Declare it once"),
    "surface kind": (lambda: Surface("v", v, kind="switch"), "'switch'", "'switching'"),
    "surface typo": (lambda: Surface("v", v, radious=2), "'radious'", "did you mean 'radius'"),
    "radius small": (lambda: Surface("v", v, radius=0.5), "'v'", "scale the field"),
    "width": (lambda: Surface("v", v, width=-1), "width", "expected a number >= 0"),
    "reset list": (lambda: Surface("f", x, reset=[x, -v]), "'f'", "{v: -p.e*v}"),
    "reset unknown": (lambda: System({x: v, v: -1}, surfaces=[Surface("f", x, reset={"q": 1})]), "'q'",
                      "known: x, v"),
    "side": (lambda: Surface("f", x, reset={v: -v}, side="up"), "'up'", "'+', '-' or 'both'"),
    "contact": (lambda: Surface("f", x, contact=True), "'f'", "reset={v: -p.e*v}"),
    "keyword surface": (lambda: System({x: 1}, surface=[]), "'surface'", "did you mean 'surfaces'"),
    "keyword params": (lambda: System({x: p.m}, params=p), "'params'", "did you mean 'parameters'"),
    "x0 of system": (lambda: System({x: 1}, x0=(1,)), "x0", "solve(system, x0="),
    "events of system": (lambda: System({x: 1}, events=[x]), "events", "solve(system, ..., events=g)"),
    "period": (lambda: TimeEvent("clock"), "clock", "period"),
    "system changed": (lambda: setattr(S, "states", ()), "'states'", "Make another System"),
    "width pair": (lambda: Surface("v", v, width=(-0.1, 0.1)), "'v'", "half the width of the hysteresis"),
    "clock phase": (lambda: TimeEvent("clock", period=1, phase=0.2), "phase", "start=0.2"),
    "clock typo": (lambda: TimeEvent("clock", perid=1), "'perid'", "did you mean 'period'"),
    "clock no name": (lambda: TimeEvent(period=1), "needs name", "TimeEvent(name)"),
    "clock surface": (lambda: System({x: 1}, surfaces=[TimeEvent("c", period=1)]), "surfaces holds",
                      "time_events="),
    "surface clock": (lambda: System({x: 1}, time_events=[Surface("f", x)]), "time_events", "surfaces="),
    "units": (lambda: System({x: v, v: 1}, units={"x": "m"}), "units", "labels={'x': 'position [m]'}"),
    # signals
    "input swapped": (lambda: Input([0, 1], [1, 2], "r"), "[0, 1]", "Input('r', times, values)"),
    "input kind": (lambda: Input("r", [0, 1], [1, 2], kind="zoh"), "'zoh'", "linear, hold, cubic"),
    "input lengths": (lambda: Input("r", [0, 1, 2], [1, 2]), "3 times and 2 values", "as many of each"),
    "input order": (lambda: Input("r", [0, 2, 1], [1, 2, 3]), "t[1] = 2", "increasing times"),
    "input over": (lambda: solve(System({x: v, v: Input("r", [0, 0.5], [1, 2])}), START, SPAN), "'r'",
                   "outside='hold'"),
    "input file": (lambda: Input.from_csv("r", "none.csv"), "none.csv", "path from the present folder"),
    "table": (lambda: System({x: Table([0, 1], [1, 2])}), "the equation of 'x'", "curve(x)"),
    "square": (lambda: square("d", p.m, (1, 0)), "period is m", "TimeEvent('clock', period=p.T"),
    "square order": (lambda: square("d", 1.0, 1, 0), "4 values in order", "duty=..."),
    "parameter list": (lambda: solve(LINEAR, (1,), SPAN, parameters={"m": [1, 2]}), "'m' is [1,", "Sweep("),
    "parameter f(t)": (lambda: solve(LINEAR, (1,), SPAN, parameters={"m": abs}), "'m'", "with_inputs("),
    # comparators
    "comparator number": (lambda: S.with_comparator(1e-3), "0.001", "Band(width)"),
    "comparator class": (lambda: S.with_comparator(Band), "Band", "Give its width"),
    "band 0": (lambda: Band(0), "the width of Band", "Exact()"),
    "band of a state": (lambda: S.with_comparator(Smooth(x)), "the width of Smooth is x", "parameters(w="),
    "hysteresis text": (lambda: Hysteresis("wide"), "the width of Hysteresis is 'wide'", "to a float first"),
    "width=": (lambda: solve(S, START, SPAN, width=1), "width", "with_comparator(Band(width))"),
    # plain functions
    "f(t, y)": (lambda: field(lambda t, y: y), "field takes (t, y)", "def f(t, x, p, s)"),
    "f(y)": (lambda: field(lambda y: y), "field takes (y)", "def f(t, x, p, s)"),
    "h(t, y)": (lambda: plain(lambda t, y: y[1]), "'v': h takes (t, y)", "def f(t, x, p)"),
    "h(y)": (lambda: plain(lambda y: y[1]), "'v': h takes (y)", "def f(t, x, p)"),
    "reset(x)": (lambda: plain(lambda t, x, p: x[1], reset=lambda x: x), "reset takes", "f(t, x, p)"),
    "s[0]": (lambda: field(lambda t, y, p, s: [y[1], -s[0]]), "no surfaces", "surfaces=[Surface('v', h)]"),
    "no states": (lambda: System(field=lambda *_: [0.0]), "states are missing", "states='x v'"),
    "short": (lambda: field(lambda t, y, p, s: [1.0]), "shape (1,)", "expected 2 numbers"),
    "no return": (lambda: field(lambda t, y, p, s: None), "returned None", "Is a return missing"),
    "text return": (lambda: field(lambda t, y, p, s: ["a", "b"]), "field", "expected 2 numbers"),
    "p.k": (lambda: field(lambda t, y, p, s: [p.kk, 0], parameters={"k": 1}), "'kk'", "did you mean 'k'"),
    "expression h": (lambda: System(field=lambda *_: [0.0], states="x", surfaces=[Surface("v", v)]), "'v'",
                     "a function of (t, x, p)"),
    "function h": (lambda: with_surface("v", lambda t, x, p: x[1]), "'v'", "System(field=f, ...)"),
    # solve
    "solve()": (solve, "needs system", "solve(system)"),
    "no span": (lambda: solve(S, START), "needs x0 and t_span", "t_span=(t0, t1)"),
    "solve f": (lambda: solve(lambda t, y: y, SPAN, START), "function", "System(field=f, states='x v')"),
    "solve dict": (lambda: solve({x: v, v: -x}, START, SPAN), "dict", "System({x: v, v: ...})"),
    "order": (lambda: solve(S, (0, 12), (1, 0)), "backwards in time", "x0=(1.0, 0.0), t_span=(0, 12)"),
    "order of one": (lambda: solve(LINEAR, (0, 12), [1.0]), "they look exchanged", "x0=[1.0]"),
    "backwards": (lambda: solve(S, START, (2, 1)), "runs backwards", "backward=True"),
    "forwards": (lambda: solve(S, START, SPAN, backward=True), "runs forwards", "drop backward"),
    "number span": (lambda: solve(S, START, 10), "t_span is 10", "t_span=(0, 10)"),
    "long span": (lambda: solve(S, START, (0, 1, 2)), "(0, 1, 2)", "(t0, t1)"),
    "text span": (lambda: solve(S, START, ("0", "1")), "t0 is '0'", "expected a number"),
    "endless": (lambda: solve(S, START, (0, math.inf)), "t1 is inf", "stop=Stop(surface, kind)"),
    "x0 short": (lambda: solve(S, (1,), SPAN), "shape (1,)", "x0=(0, 0)"),
    "x0 text": (lambda: solve(S, "1,0", SPAN), "'1,0'", "x0=(0.1, 0)"),
    "x0 part": (lambda: solve(S, {"x": 1}, SPAN), "no value for v", "one for each"),
    "x0 name": (lambda: solve(S, {"x": 1, "V": 0}, SPAN), "'V'", "did you mean 'v'"),
    "x0 nan": (lambda: solve(S, (math.nan, 0), SPAN), "state 'x' is nan", "finite number"),
    "x0 none": (lambda: solve(S, None, SPAN), "needs x0", "x0=(...)"),
    "args": (lambda: solve(S, START, SPAN, args=(1,)), "args", "parameters={'m': 2.0}"),
    "jac": (lambda: solve(S, START, SPAN, jac=None), "jac", "not needed"),
    "BDF": (lambda: solve(S, START, SPAN, method="BDF"), "'BDF'", "method='Radau'"),
    "LSODA": (lambda: solve(S, START, SPAN, method="LSODA"), "'LSODA'", "method='DOP853'"),
    "ode45": (lambda: solve(S, START, SPAN, method="ode45"), "'ode45'", "method='DP5'"),
    "dopri": (lambda: solve(S, START, SPAN, method="dop853"), "'dop853'", "did you mean 'DOP853'"),
    "fourth": (lambda: solve(S, START, SPAN, "RK45"), "4 values in order", "by name"),
    "tol": (lambda: solve(S, START, SPAN, tol=1e-6), "tol", "rtol (relative)"),
    "dt": (lambda: solve(S, START, SPAN, dt=1e-3), "dt", "max_step"),
    "parameter": (lambda: solve(S, START, SPAN, parameter={}), "'parameter'", "did you mean 'parameters'"),
    "rtol 0": (lambda: solve(S, START, SPAN, rtol=0), "rtol is 0", "number > 0"),
    "rtol fine": (lambda: solve(S, START, SPAN, rtol=1e-16), "rtol is 1e-16", "at least 2.2e-14"),
    "atol short": (lambda: solve(S, START, SPAN, atol=[1e-9]), "atol has shape (1,)", "one number or 2"),
    "max_step": (lambda: solve(S, START, SPAN, max_step=-1), "max_step is -1", "number > 0"),
    "long step": (lambda: solve(S, START, SPAN, max_step=10), "longer than t_span", "Leave it out"),
    "t_eval number": (lambda: solve(S, START, SPAN, t_eval=10), "t_eval has shape ()", "np.linspace(0, 1"),
    "t_eval outside": (lambda: solve(S, START, SPAN, t_eval=[2.0]), "t_eval[0] = 2.0", "t_span = (0.0, 1.0)"),
    "t_eval order": (lambda: solve(S, START, SPAN, t_eval=[0.5, 0.1]), "t_eval[0]", "sort them"),
    "stop text": (lambda: solve(S, START, SPAN, stop="v"), "'v'", "stop=Stop('v', 'crossing')"),
    "stop surface": (lambda: solve(S, START, SPAN, stop=Stop("q")), "'q'", "known: v"),
    "stop kind": (lambda: Stop("v", "entry"), "'entry'", "sliding entry"),
    "event text": (lambda: solve(S, START, SPAN, events="v"), "'v'", "g(t, y) -> float"),
    "event g(y)": (lambda: solve(S, START, SPAN, events=lambda y: y[0]), "takes (y)", "def f(t, y)"),
    "event g(t, y, p)": (lambda: UserEvent(lambda t, y, p: 0), "takes (t, y, p)", "def f(t, y)"),
    "zeno": (lambda: solve(S, START, SPAN, zeno="go"), "'go'", "stop, continue"),
    "nonunique": (lambda: solve(S, START, SPAN, nonunique="sticking"), "'sticking'", "did you mean 'stick'"),
    "tree option": (lambda: solve(S, START, SPAN, max_depth=2), "max_depth", "nonunique='branch'"),
    "1/x": (lambda: solve(System({x: v, v: -1 / x}), (0, 1), SPAN, throw=True), "x = 0", "Common causes"),
    "log x": (lambda: solve(System({x: v, v: log(x)}), (0, 1), SPAN, throw=True), "dv/dt", "Common causes"),
    "remake": (lambda: Problem(S, START, SPAN).remake(rtol=1), "rtol", "solve(problem, rtol=...)"),
    "problem edit": (lambda: setattr(Problem(S, START, SPAN), "x0", 1), "immutable", "remake(x0=...)"),
    "problem field": (lambda: Problem(lambda t, y: y, START, SPAN), "function", "Problem(System({...})"),
    "many shape": (lambda: solve_many(S, (1, 0, 2), SPAN), "shape (3,)", "(k, 2)"),
    "many t_eval": (lambda: solve_many(S, [START], SPAN, t_eval=[1]), "t_eval", "Use solve"),
    "sweep name": (lambda: Sweep(Problem(S, START, SPAN), {"q": [1]}), "'q'", "x0.x"),
    "sweep system": (lambda: Sweep(S, {"m": [1]}), "System", "Problem(system, x0, t_span)"),
    "sweep scalar": (lambda: Sweep(Problem(LINEAR, (1,), SPAN), {"m": 2}), "m is 2", "a list of numbers"),
    "sweep measure": (lambda: Sweep(Problem(S, START, SPAN), {"x0.x": [1]}, measure="amplitud(x)"),
                      "'amplitud(x)'", "did you mean 'amplitude'"),
    "sweep state": (lambda: Sweep(Problem(S, START, SPAN), {"x0.x": [1]}, measure="amplitude(q)"), "'q'",
                    "known: x, v"),
    "sweep function": (lambda: Sweep(Problem(S, START, SPAN), {"x0.x": [1]}, measure=len), "measure len",
                       "a dict of numbers by name"),
    "x0 several": (lambda: solve(S, [[1, 0], [2, 0]], SPAN), "shape (2, 2)", "solve_many("),
    # names that are not there
    "filippov.solve_ivp": (lambda: filippov.solve_ivp, "'solve_ivp'", "solve(system, x0, t_span)"),
    "filippov.sat": (lambda: filippov.sat, "'sat'", "Max(-1, Min(u, 1))"),
    "filippov.Backlash": (lambda: filippov.Backlash, "'Backlash'", "filippov.interop"),
    "filippov.solv": (lambda: filippov.solv, "'solv'", "did you mean 'solve'"),
    "analysis typo": (lambda: filippov.analysis.lyapunow, "'lyapunow'", "did you mean 'lyapunov'"),
    "system.solve": (lambda: S.solve, "System", "solve(system, x0, t_span)"),
    "system.plot": (lambda: S.plot, "System", "solve(system, x0, t_span).plot()"),
    "system.sates": (lambda: S.sates, "'sates'", "did you mean 'states'"),
    "analysis order": (lambda: bifurcation(LINEAR, "m", (0, 1)), "3 values in order", "parameter=..."),
    "analysis keyword": (lambda: find_section(S, START, paramters={}), "'paramters'",
                         "did you mean 'parameters'"),
    "analysis missing": (lambda: find_section(S), "needs x0", "find_section(system, x0)"),
    # what came out
    "r[0]": (lambda: RUN[0], "not by 0", "solution['x']"),
    "r[0:2]": (lambda: RUN[0:2], "slice(0, 2, None)", "solution['x']"),
    "list(r)": (lambda: list(RUN), "by name", "solution['x']"),
    "r.v": (lambda: RUN.v, "'v'", "solution['v']"),
    "r.sucess": (lambda: RUN.sucess, "'sucess'", "did you mean 'success'"),
    "r.savefig": (lambda: RUN.savefig("run.png"), "'savefig'", "plot()"),
    "r.to_csv": (lambda: RUN.to_csv("run.csv"), "'to_csv'", "to_pandas()"),
    "events['v']": (lambda: RUN.events["v"], "'v'", "events.of('v')"),
    "segments['stick']": (lambda: RUN.segments["stick"], "'stick'", "segments.of('stick')"),
    "sol('x')": (lambda: RUN.sol("x"), "t = 'x'", "solution['x']"),
    "plot xlim": (lambda: RUN.plot(xlim=(0, 1)), "xlim", ".axes"),
    "events typo": (lambda: RUN.events.of("typo"), "'typo'", "known: v"),
    "count typo": (lambda: RUN.events.count("typo"), "'typo'", "known: v"),
    "events kind": (lambda: RUN.events.of("v", "entry"), "'entry'", "sliding entry"),
    "ensemble typo": (lambda: MANY.events("q"), "'q'", "known: v"),
    "multiplier": (lambda: RUN.multiplier("q", 0.5), "'q'", "known: v"),
    "sol outside": (lambda: RUN.sol(5), "t = 5.0", "[0.0, 1.0]"),
    "mode outside": (lambda: RUN.mode_at(5), "t = 5", "[0.0, 1.0]"),
    "r['q']": (lambda: RUN["q"], "'q'", "known: t, x, v"),
    "evaluate": (lambda: RUN.evaluate("x + q", 0.5), "'q'", "known: pi, t, x, v"),
    "evaluate text": (lambda: RUN.evaluate("x +", 0.5), "'x +'", "not a formula"),
    "segments": (lambda: RUN.segments.of("stik"), "'stik'", "stick, sliding"),
    "plot typo": (lambda: RUN.plot("q"), "'q'", "known: x, v"),
    "plot phase": (lambda: RUN.plot(phase=True), "phase", "plot_phase(solution, 'x', 'v')"),
    "plot ax": (lambda: RUN.plot(ax=None), "ax", "figure=fig"),
    "plot label": (lambda: RUN.plot(labels={"q": "a"}), "'q'", "known: t, x, v"),
    "load": (lambda: Solution.load("nowhere.npz"), "nowhere.npz", "No such file"),
    "save": (lambda: RUN.save("no/such/folder.npz"), "'no/such/folder.npz'", "cannot be written"),
    "no section": (lambda: find_section(LINEAR, (1.0,)), "there is none", "--surface, --event"),
    "no parametrisation": (
        lambda: EventMap(S, Section("v", "crossing", "x"))(0.1), "no parametrisation", "returns(system",
    ),
    "nothing forces": (lambda: returns(S, Stroboscope("x"), START, 2), "no clock ticks", "find_section("),
    "film": (lambda: RUN.animate("film.avi"), "film.avi", ".gif or .mp4"),
    "jacobian": (lambda: S.jacobian("++"), "'++'", "expected 1 entries"),
    "output name": (lambda: System({x: v, v: 1}, outputs={"x": v}), "'x'", "Rename the output"),
    "label name": (lambda: System({x: 1}, labels={"q": ""}), "'q'", "known: t, x"),
    # of other solvers and tools
    "verbose": (lambda: solve(S, START, SPAN, verbose=True), "progress=f", "(t, t1)"),
    "n": (lambda: solve(S, START, SPAN, n=100), "t_eval", "np.linspace(t0, t1, 1001)"),
    "saveat": (lambda: solve(S, START, SPAN, saveat=0.1), "t_eval", "np.linspace"),
    "callback": (lambda: solve(S, START, SPAN, callback=print), "progress=f", "the reset of a Surface"),
    "tf": (lambda: solve(S, START, tf=10), "t1", "t_span=(t0, t1)"),
    "u0": (lambda: solve(S, u0=START, t_span=SPAN), "initial state", "x0=(...)"),
    "solver": (lambda: solve(S, START, SPAN, solver="DP5"), "method=", "'DP5'"),
    "maxiters": (lambda: solve(S, START, SPAN, maxiters=5), "maxiters", "max_steps"),
    "p=": (lambda: solve(S, START, SPAN, p={"m": 2}), "p is", "parameters={'m': 2.0}"),
    "comparator=": (lambda: solve(S, START, SPAN, comparator=Band(1e-3)), "comparator", "with_comparator("),
    "inputs=": (lambda: solve(S, START, SPAN, inputs={"u": 1}), "Input('r', t, values)", "with_inputs("),
    "surfaces=": (lambda: solve(S, START, SPAN, surfaces=[]), "System({...}", "surfaces=[Surface('v', v)]"),
    "reset=": (lambda: solve(S, START, SPAN, reset={}), "reset", "Surface('floor', y"),
    "terminal=": (lambda: solve(S, START, SPAN, terminal=True), "terminal", "UserEvent(g, terminal=True)"),
    "Euler": (lambda: solve(S, START, SPAN, method="Euler"), "'Euler'", "steps of one length dt"),
    "Moreau": (lambda: solve(S, START, SPAN, method="Moreau"), "needs dt", "dt=1e-3"),
    "many u0": (lambda: solve_many(S, u0=[START], t_span=SPAN), "initial state", "x0=(...)"),
    # one thing in the place of another
    "stop event": (lambda: solve(S, START, SPAN, stop=UserEvent(x)), "UserEvent(g=x", "events=UserEvent("),
    "stop g": (lambda: solve(S, START, SPAN, stop=lambda t, y: y[0]), "stop holds", "events=UserEvent("),
    "stop h": (lambda: solve(S, START, SPAN, stop=x - 0.5), "x - 0.5", "Stop('v', 'crossing')"),
    "event stop": (lambda: solve(S, START, SPAN, events=[Stop("v")]), "Stop(surface='v'", "stop="),
    "event vector": (lambda: solve(S, START, SPAN, events=lambda t, y: y), "shape (2,)", "[0]"),
    "event bool": (lambda: solve(S, START, SPAN, events=lambda t, y: y[0] > 0), "'event'",
                   "the difference of its two sides"),
    "event up": (lambda: UserEvent(x, direction="up"), "direction is 'up'", "a number"),
    "span of times": (lambda: solve(S, START, np.linspace(0, 1, 3)), "t_span", "(t0, t1)"),
    "x0 of symbols": (lambda: solve(S, (p.m, 0), SPAN), "(m, 0)", "real numbers"),
    "parameters list": (lambda: solve(S, START, SPAN, parameters=[1.0]), "[1.0]", "{name: value}"),
    "tuple": (lambda: System((v, -x)), "(v, -x)", "{x: dx/dt, v: dv/dt}"),
    "pair key": (lambda: System({(x, v): (v, -x)}), "(x, v)", "expected a state"),
    "two names": (lambda: states("x", "v"), "several values", "states('x v')"),
    "reset alone": (lambda: Surface("f", x, reset=-v), "'f'", "{v: -p.e*v}"),
    "clock both": (lambda: TimeEvent("c", period=1, times=(1, 2)), "'c'", "period=..., or times="),
    "clock back": (lambda: TimeEvent("c", times=(2, 1)), "'c'", "increasing"),
    "no branch": (lambda: System({x: Piecewise((1, x > 0))}), "where x < 0", "(expression, True)"),
    "flat sign": (lambda: System({x: v, v: -sign(Max(0, x))}), "the equation of 'v'", "changes sign"),
    "fields": (lambda: System.from_modes(h=[x], fields={"+": [-1]}, states=[x]), "fields", "for -"),
    "outputs text": (lambda: System({x: v, v: 1}, outputs={"u": "x+v"}), "'u'", "the expression itself"),
    "no comparator": (lambda: S.with_comparator("band"), "'band'", "Band(width)"),
    "comparator of w": (lambda: S.with_comparator({"w": Band(1e-3)}), "'w'", "known: v"),
    "mass 0": (lambda: solve(System({x: v, v: -sign(v) / p.m}), START, SPAN, parameters={"m": 0}, throw=True),
               "dy[1] (dv/dt)", "a division by zero"),
    # reading what came out
    "evaluate bars": (lambda: RUN.evaluate("|x|", 0.5), "'|x|'", "abs(u)"),
    "evaluate np": (lambda: RUN.evaluate("np.abs(x)", 0.5), "np.abs(x)", "write abs(...) alone"),
    "evaluate hat": (lambda: RUN.evaluate("x^2", 0.5), "x^2", "**"),
    "event.time": (lambda: RUN_OFF.events[0].time, "an Event", "'time'"),
    "events.times": (lambda: RUN.events.times, "'times'", "events.of('v').t"),
    "events.to_csv": (lambda: RUN.events.to_csv("e.csv"), "'to_csv'", "events.to_pandas()"),
    "segment.start": (lambda: RUN.segments[0].start, "a Segment", "t0"),
    "segment.duration": (lambda: RUN.segments[0].duration, "'duration'", "dwell"),
    "many.y": (lambda: MANY.y, "an Ensemble", "t and x"),
    "many.sucess": (lambda: MANY.sucess, "'sucess'", "did you mean 'success'"),
    "report.item": (lambda: stability_report(LINEAR).item, "'item'", "did you mean 'items'"),
}  # fmt: skip
ERRORS = (ModelError, UsageError, SolveError, TypeError, AttributeError, LookupError, FileNotFoundError)


@pytest.mark.parametrize("name", MISTAKES)
def test_16_4_a_mistake_is_told_with_place_and_cure(name: str) -> None:
    call, place, cure = MISTAKES[name]
    with pytest.raises(ERRORS) as caught:
        call()
    message = str(caught.value)
    plt.close("all")
    score = (place in message) + (cure in message)
    assert score == 2, f"scored {score} of 2: {message}"
    assert len(message) < 700


def test_16_4_there_are_150_of_them() -> None:
    assert len(MISTAKES) + len(COMMANDS) >= 150


COMMANDS: dict[str, tuple[list[str], str, str]] = {
    "module": (["simulate", "own:s"], "'own:s'", "own.py:s"),
    "stem": (["simulate", "own"], "'own'", "own.py:NAME"),
    "no file": (["simulate", "onw.py:s"], "'onw.py'", "did you mean 'own.py'"),
    "no name": (["simulate", "own.py"], "names a file", "own.py:s"),
    "other name": (["simulate", "own.py:system"], "'system'", "systems in it: s"),
    "model": (["simulate", "huntin"], "'huntin'", "did you mean 'hunting'"),
    "no x0": (["simulate", "own.py:s", "--t-span", "0", "1"], "initial state", "--x0"),
    "no span": (["simulate", "own.py:s", "--x0", "1,0"], "time span", "--t-span T0 T1"),
    "neither": (["simulate", "own.py:s"], "own.py:s", "--t-span T0 T1 and --x0 x=...,v=..."),
    "spaces": (["simulate", "own.py:s", "--x0", "1", "0", "--t-span", "0", "1"], "'0'", "--x0 1,0"),
    "choice": (["graph", "hunting", "--observed"], "'--observed'", "--kind observed"),
    "spoilt": (["simulate", "spoilt.py:s"], "line 2", "if __name__ == '__main__':"),
    "program": (["diagnose", "own.py:s"], "a program", "--x0 1,0 and --t-span T0 T1"),
    "range": (["diagram", "own.py:s", "--over", "m=0:1:20:2"], "m is '0:1:20:2'", "LOW:HIGH:COUNT"),
    "backwards": (["simulate", "own.py:s", "--x0", "1,0", "--t-span", "1", "0"], "backwards", "backward"),
    "parameter": (["simulate", "hunting", "-p", "p=2"], "'p'", "did you mean 'P'"),
    "command": (["simulat", "hunting"], "simulat", "simulate"),
    "flag": (["simulate", "hunting", "--rtoll", "1"], "--rtoll", "--rtol"),
    "evaluate": (["simulate", "hunting", "--evaluate", "x + q"], "'q'", "known: pi, t, x, v"),
    "folder": (["simulate", "hunting", "--t-span", "0", "1", "-o", "own.py"], "own.py", "name a folder"),
    "unwritable": (["simulate", "hunting", "--t-span", "0", "1", "-o", "own.py/run"], "own.py", "a folder"),
    "section": (["event-map", "own.py:s"], "section", "--surface"),
}


@pytest.mark.parametrize("name", COMMANDS)
def test_16_4_a_command_tells_place_and_cure(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    words, place, cure = COMMANDS[name]
    (tmp_path / "own.py").write_text(
        "from filippov import System, sign, states\nx, v = states('x v')\n"
        "s = System({x: v, v: -x - sign(v)})\n"
    )
    (tmp_path / "spoilt.py").write_text("from filippov import states\nprint(states('x').q)\n")
    monkeypatch.chdir(tmp_path)
    code: Any = 0
    try:
        code = main(words)
    except SystemExit as ended:
        code = ended.code
    assert code != 0
    message = capsys.readouterr().err
    assert (place in message) + (cure in message) == 2, message


def test_16_4_functions_of_numpy_are_those_of_expressions() -> None:
    """numpy asks expressions and conditions; each is the expression that one would have written."""
    pairs = {
        np.sin(x + v): sin(x + v),
        np.sign(v): sign(v),
        np.maximum(v, 0): Max(v, 0),
        np.maximum(0.0, p.m * v): Max(0.0, p.m * v),
        np.where(v > 0, x, -1): Piecewise((x, v > 0), (-1, True)),
        np.clip(v, -1, 1): Max(-1, sympy.Min(v, 1)),
        np.heaviside(v, 0.5): Heaviside(v),
        np.arctan2(x, v): sympy.atan2(x, v),
        np.select([x > 0, v > 0], [1, 2]): Piecewise((1, x > 0), (2, v > 0), (0, True)),
        (x > 0) * 1: Piecewise((1, x > 0), (0, True)),
        x * (v < 1): x * Piecewise((1, v < 1), (0, True)),
        2 * (x > 0) - 1: 2 * Piecewise((1, x > 0), (0, True)) - 1,
        np.float64(2) * x: 2.0 * x,
        np.dot(np.array([1, 2]), np.array([x, v])): x + 2 * v,
        np.sqrt(w**2): sqrt(w[0] ** 2),
    }
    for made, wanted in pairs.items():
        assert made == wanted
    assert np.array_equal(np.array([1, 2]) * x, np.array([x, 2 * x]))
    assert (np.array([x, v]) == x).tolist() == [True, False]
    jumping = System({x: v, v: -np.sin(x) - 0.2 * np.sign(v) - 0.1 * np.where(x > 0.3, 1, 0)})
    assert set(jumping.surface_names) == {"v", "x - 0.3"}
    run = solve(System({x: v, v: -x - 0.2 * (2 * (v > 0) - 1)}), (1.1, 0), (0, 12))
    assert run.x_end[0] == pytest.approx(0.1, abs=1e-8)


def test_16_4_one_state_is_a_state() -> None:
    """states("u") unpacks, and stands for u in expressions, as a key and in arrays of names."""
    u = states("u")
    (plain,) = states("u")
    assert [2 * u, -u, u**2, u - x, 1 / u, abs(u)] == [2 * plain, -plain, plain**2, plain - x, 1 / plain,
                                                       abs(plain)]  # fmt: skip
    system = System({u: -sign(u)}, surfaces=[Surface("s", u)], outputs={"o": u})
    run = solve(system, {u: 0.5}, (0, 1), events=u)
    assert run.events.of("s").t == pytest.approx([0.5])
    assert run[u] == pytest.approx(run.y[0])
    assert system.state_index(u) == 0
    assert len(u) == 1
