"""From a program that was read to the System that it means, and the text that makes it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import sympy
from sympy import Expr, Symbol
from sympy.printing.str import StrPrinter

from filippov import Surface, System, TimeEvent
from filippov import t as time
from filippov.analysis.programs import automaton
from filippov.analysis.programs.choice import expression
from filippov.analysis.programs.notes import Clock, Site
from filippov.analysis.programs.outside import unique
from filippov.analysis.programs.reader import Reading
from filippov.base.arrays import Array
from filippov.model.parameter_symbol import ParameterSymbol, parameters
from filippov.model.symbolic import Select

FUNCTIONS = (
    "Abs", "Heaviside", "Max", "Min", "Piecewise", "cos", "exp", "log", "pi", "sign", "sin", "sqrt",
    "tan", "tanh",
)  # fmt: skip
OTHERS = ("Parameter", "Surface", "System", "TimeEvent", "parameters", "solve", "states")
_TAKEN = {
    "t", "p", "system", "solution", "asin", "acos", "atan", "atan2", "sinh", "cosh", "asinh", "acosh",
    "atanh", "erf", *FUNCTIONS, *OTHERS,
}  # fmt: skip


LAST = ")\n"  # behind the call of solve, the last one in a text


@dataclass(frozen=True)
class Translation:
    """The System of a program.

    system      what it means
    x0          the initial state, with those of clocks and memories after the program's own
    sites       where the program switches, in the symbols of the system
    clocks      those of the program, in the symbols of the system
    remembered  how many states memories became
    code        the text that makes the system
    dropped     dead bands that it has no more: condition, what is small there, half-width
    """

    system: System
    x0: tuple[float, ...]
    sites: tuple[Site, ...]
    clocks: tuple[Clock, ...]
    remembered: int
    code: str
    dropped: tuple[tuple[Any, Any, float], ...] = ()

    def extended(self, t: float, y: Any) -> Array:
        """A state of the program with those of its clocks after it (not those of memories)."""
        values = dict(
            zip(self.system.parameters.names, self.system.parameters.resolve({}).tolist(), strict=True)
        )
        return np.array([*np.asarray(y, dtype=float), *(reading(c, t, values) for c in self.clocks)])


def reading(clock: Clock, t: float, values: dict[str, float]) -> float:
    """What a clock shows at a time."""
    rate, offset, modulus = (_number(e, values) for e in (clock.rate, clock.offset, clock.modulus))
    a = rate * t + offset
    return a % modulus if clock.kind == "mod" else math.floor(a / modulus)


def _number(value: Any, values: dict[str, float]) -> float:
    expr = expression(value)
    return float(expr.subs({q: values[q.name] for q in expr.free_symbols}))


def translate(reading_: Reading, x0: Any, t_span: tuple[float, float]) -> Translation:
    """The System of a program that was read. Raises ModelError where it cannot be one."""
    found = reading_
    symbols = _symbols(found)
    names = {q.name for q in symbols.values() if isinstance(q, ParameterSymbol)}
    values = {
        q: sympy.Float(found.parameters.values[d], 17)
        for d, q in symbols.items()
        if isinstance(q, ParameterSymbol)
    }
    clocks = tuple(_in_symbols(clock, symbols) for clock in found.clocks)
    states = [
        symbols[x]
        for x in (*found.states, *(c.symbol for c in found.clocks), *(m.symbol for m in found.memories))
    ]
    field = [_tidy(rate.xreplace(symbols)) for rate in found.field]
    equations: dict[Any, Any] = dict(zip(states, field, strict=False))
    start, events = list(np.asarray(x0, dtype=float)), []
    numbers = {q.name: float(v) for q, v in values.items()}
    for clock in clocks:
        equations[clock.symbol] = clock.rate if clock.kind == "mod" else sympy.Integer(0)
        start.append(reading(clock, t_span[0], numbers))
        events.append(_time_event(clock, t_span[0], numbers))
    held = [(u.xreplace(symbols), r.xreplace(symbols)) for u, r in found.held]
    declared = [Surface(formula(u).replace("p.", ""), u, radius=r) for u, r in held]
    put = {symbols[x]: sympy.Float(v, 17) for x, v in zip(found.states, start, strict=False)}
    back = {d: put.get(q, values.get(q, q)) for d, q in symbols.items()}
    back[found.time] = sympy.Float(t_span[0], 17)
    for memory in found.memories:
        declared += automaton.surfaces(memory, automaton.rules(memory, found.parameters), symbols)
        equations[symbols[memory.symbol]] = sympy.Integer(0)
        start.append(automaton.first_value(memory, back))
    used = parameters(**{q.name: q.parameter for q in symbols.values() if isinstance(q, ParameterSymbol)})
    system = System(equations, surfaces=declared, time_events=events, parameters=used if names else None)
    sites = tuple(replace(s, h=None if s.h is None else s.h.xreplace(symbols)) for s in found.sites)
    code = _code(system, equations, declared, events, tuple(start), t_span)
    dropped = tuple((h.xreplace(symbols), u.xreplace(symbols), width) for h, u, width in found.dropped)
    return Translation(
        system, tuple(float(v) for v in start), sites, clocks, len(found.memories), code, dropped
    )


def _symbols(found: Reading) -> dict[Any, Any]:
    """The symbols of a system for those of a reading."""
    given = {x: name or f"y{i}" for i, (x, name) in enumerate(zip(found.states, found.names, strict=True))}
    given |= {c.symbol: c.symbol.name for c in found.clocks}
    given |= {m.symbol: m.name.rpartition(".")[2].partition("[")[0] for m in found.memories}
    chosen = unique(given, _TAKEN)
    out: dict[Any, Any] = {d: Symbol(name, real=True) for d, name in chosen.items()}
    used = set().union(*(rate.free_symbols for rate in found.field))
    for clock in found.clocks:
        used |= set().union(*(expression(e).free_symbols for e in (clock.rate, clock.offset, clock.modulus)))
    for memory in found.memories:
        used |= expression(memory.after).free_symbols
    dropped = {h for h, _, _ in found.dropped}
    for site in found.sites:
        used |= set() if site.h is None or site.h in dropped else site.h.free_symbols
    # One parameter for what has one name and one value, wherever the program reads it.
    same: dict[tuple[str, float], list[Any]] = {}
    for d, name in found.parameters.names.items():
        if d in used:
            same.setdefault((name, found.parameters.values[d]), []).append(d)
    names = unique({group[0]: name for (name, _), group in same.items()}, _TAKEN | set(chosen.values()))
    space = parameters(**{names[group[0]]: value for (_, value), group in same.items()})
    for group in same.values():
        out |= dict.fromkeys(group, space[names[group[0]]])
    out[found.time] = time
    return out


def _in_symbols(clock: Clock, symbols: dict[Any, Any]) -> Clock:
    parts = {
        name: expression(getattr(clock, name)).xreplace(symbols) for name in ("rate", "offset", "modulus")
    }
    return replace(clock, symbol=symbols[clock.symbol], **parts)


def _time_event(clock: Clock, t0: float, values: dict[str, float]) -> TimeEvent:
    """The instants at which a clock jumps: alpha t + beta is a multiple of its modulus."""
    rate, offset, modulus = (_number(e, values) for e in (clock.rate, clock.offset, clock.modulus))
    turns = math.ceil((rate * t0 + offset) / modulus - 1e-12)
    start = (turns * clock.modulus - clock.offset) / clock.rate
    after = 0 if clock.kind == "mod" else clock.symbol + 1
    return TimeEvent(
        f"clock {clock.symbol.name}",
        period=clock.modulus / clock.rate,
        start=start,
        reset={clock.symbol: after},
    )


def _tidy(expr: Expr) -> Expr:
    """The same with u/|u| written as sign(u)."""
    if not expr.args:
        return expr
    args = [_tidy(arg) for arg in expr.args]
    if expr.is_Mul:
        args = _signs(args)
    if len(args) == len(expr.args) and all(a is b for a, b in zip(args, expr.args, strict=True)):
        return expr
    return expr.func(*args)


def _signs(factors: list[Expr]) -> list[Expr]:
    """u/|u| among factors as sign(u)."""
    out = list(factors)
    for factor in factors:
        if factor.is_Pow and factor.args[1] == -1 and isinstance(factor.args[0], sympy.Abs):
            u = factor.args[0].args[0]
            for same, value in ((u, sympy.sign(u)), (-u, -sympy.sign(u))):
                if same in out:
                    out.remove(same)
                    out[out.index(factor)] = value
                    break
    return out


class _Python(StrPrinter):
    """Expressions as a user writes them: numbers in their shortest form, parameters as p.name."""

    def _print_Float(self, expr: Expr) -> str:
        return number(float(expr))

    def _print_Symbol(self, expr: Expr) -> str:
        return f"p.{expr.name}" if isinstance(expr, ParameterSymbol) else str(expr.name)

    _print_ParameterSymbol = _print_Symbol

    def _print_Select(self, expr: Expr) -> str:
        pieces: list[str] = []
        decided: set[str] = set()
        rest = expr
        while isinstance(rest, Select):
            h, plus, minus = rest.args
            where = [condition(h)]
            while isinstance(plus, Select) and plus.args[2] == minus:
                where.append(condition(plus.args[0]))
                plus = plus.args[1]
            both = where[0] if len(where) == 1 else " & ".join(f"({part})" for part in where)
            if both not in decided:  # else it never holds here
                pieces.append(f"({self._print(plus)}, {both})")
            decided.add(both)
            rest = minus
        return f"Piecewise({', '.join(pieces)}, ({self._print(rest)}, True))"


def condition(h: Expr) -> str:
    """h > 0 with what is constant on one side."""
    terms = h.args if h.is_Add else (h,)
    still = sympy.Add(*(q for q in terms if all(isinstance(s, ParameterSymbol) for s in q.free_symbols)))
    text, other = formula(h - still), formula(-still)
    if text.startswith("-"):
        return f"{formula(still - h)} < {formula(still)}"
    return f"{text} > {other}"


def formula(expr: Any) -> str:
    """An expression as text of Python."""
    return str(_Python().doprint(expression(expr)))


def number(value: float) -> str:
    """A number in its shortest form that reads back equal, or but for the rounding of a sum or a product,
    as 0.15 for 0.1 + 0.05; a whole one without a point."""
    plain = float(f"{value:.15g}")
    if len(repr(plain)) < len(repr(float(value))) - 3:
        value = plain
    return str(int(value)) if value == round(value) and abs(value) < 1e15 else repr(float(value))


def _code(
    system: System, equations: dict[Any, Any], surfaces: list[Surface], events: list[TimeEvent],
    x0: tuple[float, ...], t_span: tuple[float, float],
) -> str:  # fmt: skip
    rows = ", ".join(f"{x.name}: {formula(f)}" for x, f in equations.items())
    parts = [f"{{{rows}}}"]
    if len(parts[0]) > 90:
        rows = ",\n    ".join(f"{x.name}: {formula(f)}" for x, f in equations.items())
        parts = [f"{{\n    {rows},\n}}"]
    if surfaces:
        parts.append(f"surfaces=[{', '.join(map(_surface, surfaces))}]")
    if events:
        made = ", ".join(
            f"TimeEvent({e.name!r}, period={formula(e.period)}, start={formula(e.start)}, "
            f"reset={{{', '.join(f'{x}: {formula(r)}' for x, r in _pairs(e.reset))}}})" for e in events
        )  # fmt: skip
        parts.append(f"time_events=[{made}]")
    text = f"system = System({', '.join(parts)})"
    names, defaults = system.states, system.parameters
    lines = [f"{', '.join(names)}{',' if len(names) == 1 else ''} = states({' '.join(names)!r})"]
    if len(defaults):
        given = ", ".join(
            f"{k}={number(v)}" for k, v in zip(defaults.names, defaults.resolve({}).tolist(), strict=True)
        )
        lines.append(f"p = parameters({given})")
    lines += [
        text,
        f"solution = solve(system, x0={_tuple(x0)}, t_span=({number(t_span[0])}, {number(t_span[1])}))",
    ]
    body = "\n".join(lines)
    words = set(_words(body))
    own = sorted(words & {*FUNCTIONS, *OTHERS} - set(names), key=str.lower) + (["t"] if "t" in words else [])
    more = sorted(words & (_TAKEN - {*FUNCTIONS, *OTHERS, "t", "p", "system", "solution"}))
    head = [
        f"from filippov import {', '.join(own)}",
        *([f"from sympy import {', '.join(more)}"] if more else []),
    ]
    return "\n".join([*head, "", body]) + "\n"


def _surface(surface: Surface) -> str:
    """The text that makes a surface."""
    start = f"Surface({surface.name!r}, {formula(surface.h)}, "
    if surface.reset is None:
        return f"{start}radius={formula(surface.radius[1])})"
    reset = ", ".join(f"{x}: {formula(e)}" for x, e in _pairs(surface.reset))
    return f"{start}reset={{{reset}}}, side={surface.side!r})"


def going_on(code: str) -> str:
    """The text of a program whose events accumulate, to run beyond them."""
    return f"{code.removesuffix(LAST)}, zeno='continue'{LAST}"


def stiffly(code: str) -> str:
    """The text of a program whose field is stiff, to run with the implicit method."""
    return f"{code.removesuffix(LAST)}, method='Radau'{LAST}"


def _tuple(values: tuple[float, ...]) -> str:
    return f"({number(values[0])},)" if len(values) == 1 else f"({', '.join(map(number, values))})"


def _pairs(reset: Any) -> list[tuple[str, Any]]:
    items = reset.items() if hasattr(reset, "items") else reset
    return [(getattr(x, "name", x), e) for x, e in items]


def _words(text: str) -> list[str]:
    import re

    return re.findall(r"(?<![\w.'])[A-Za-z_]\w*", text)
