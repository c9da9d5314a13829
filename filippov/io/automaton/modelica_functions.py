"""The functions of a Modelica text: the equations, the field of a mode, rates, and the modes after a jump.

They are written without loops, which compilers of Modelica unroll anyway.
"""

from __future__ import annotations

from collections.abc import Sequence

from sympy import Expr

from filippov.io.automaton.equations import Equations, names_of
from filippov.io.automaton.printers import ModelicaText, assignments

HELPERS = """
  function size_power "a power of a size |h|, held at 0 below it"
    input Real size;
    input Real exponent;
    output Real y;
  algorithm
    assert(exponent >= 1, "non_lipschitz: the field holds a power of |h| below 1");
    y := if exponent == 1 then size elseif exponent == 2 then size*size
      elseif size > 0 then size^exponent else 0;
  end size_power;

  function sign_of
    input Real value;
    output Real y;
  algorithm
    y := if value > 0 then 1 elseif value < 0 then -1 else 0;
  end sign_of;
"""


def function(eq: Equations, name: str, interface: str, targets: Sequence[tuple[str, Expr]]) -> list[str]:
    """A function of the model."""
    printer = ModelicaText().name(names_of(eq.form, eq.modes, first=1), eq.form.a)
    sizes = eq.sizes([e for _, e in targets])
    lines = assignments(printer, targets, sizes, "{name} := {value}")
    local = [line.split(" := ")[0] for line in lines[: len(lines) - len(targets)]]
    body = [line if " := " in line else line.replace(" = ", " := ", 1) for line in lines]
    protected = ["  protected", *(f"    Real {word};" for word in local)] if local else []
    return [f"  function {name}", f"    {interface}", *protected, "  algorithm", *(f"    {q};" for q in body),
            f"  end {name};", ""]  # fmt: skip


def _straight(name: str, interface: str, local: Sequence[str], lines: Sequence[str]) -> list[str]:
    return [f"  function {name}", f"    {interface}", "  protected", *(f"    {line};" for line in local),
            "  algorithm", *(f"    {line};" for line in lines), f"  end {name};", ""]  # fmt: skip


def _inputs(n: int, m: int, k: int) -> str:
    return f"input Real t; input Real x[{n}]; input Real p[{max(k, 1)}]; input Integer m[{m}];"


def _signs(m: int, other: int, at: int = -1, value: int = 0, modes: bool = False) -> str:
    """The signs of a mode, `other` while sliding, with `value` at one place; modes: the modes themselves."""
    own = [f"m[{i + 1}]" if modes else f"if m[{i + 1}] == 0 then {other} else m[{i + 1}]" for i in range(m)]
    return "{" + ", ".join(str(value) if i == at else word for i, word in enumerate(own)) + "}"


def _rate(row: str, i: int, field: str, n: int) -> str:
    return f"{row}[{i + 1}, {n + 1}]" + "".join(
        f" + {row}[{i + 1}, {j + 1}]*{field}[{j + 1}]" for j in range(n)
    )


def velocity_function(n: int, m: int, k: int) -> list[str]:
    """The field of the mode: while sliding, both sides combined so that dh/dt = 0."""
    local, lines = _parts(n, m)
    sums = [f"f[{j + 1}] := low[{j + 1}]" for j in range(n)]
    for i in range(m):
        sums = [f"{q} + part{i + 1}*(high{i + 1}[{j + 1}] - low[{j + 1}])" for j, q in enumerate(sums)]
    return _straight("velocity", f"{_inputs(n, m, k)} output Real f[{n}];", local, [*lines, *sums])


def multipliers_function(n: int, m: int, k: int, end: str) -> list[str]:
    """The sign of every surface, of one that is slid on the multiplier with which dh/dt = 0."""
    local, lines = _parts(n, m)
    lines += [f"s[{i + 1}] := if m[{i + 1}] == 0 then 2*part{i + 1} - 1 else m[{i + 1}]" for i in range(m)]
    return _straight(f"multipliers{end}", f"{_inputs(n, m, k)} output Real s[{m}];", local, lines)


def _parts(n: int, m: int) -> tuple[list[str], list[str]]:
    """Variables and lines: the share of the upper side where each surface is slid on, 0 elsewhere."""
    local, lines = [f"Real g[{m}, {n + 1}]", f"Real low[{n}]"], []
    lines += [f"low := field(t, x, p, {_signs(m, -1)}, m)", "g := gradients(t, x, p, m)"]
    for i in range(m):
        high, part = f"high{i + 1}", f"part{i + 1}"
        local += [f"Real {high}[{n}]", f"Real {part}", f"Real minus{i + 1}", f"Real plus{i + 1}"]
        lines.append(f"{high} := field(t, x, p, {_signs(m, -1, i, 1)}, m)")
        lines.append(f"minus{i + 1} := {_rate('g', i, 'low', n)}")
        lines.append(f"plus{i + 1} := {_rate('g', i, high, n)}")
        lines.append(f"{part} := if m[{i + 1}] == 0 then minus{i + 1}/(minus{i + 1} - plus{i + 1}) else 0")
    return local, lines


def rates_function(n: int, m: int, k: int) -> list[str]:
    """dh/dt at the upper and at the lower end of the set of signs at h = 0, in turn."""
    local, lines = [f"Real e[{m}, 2]"], ["e := ends(t, x, p)"]
    for i in range(m):
        c = i + 1
        local += [f"Real g{c}[{m}, {n + 1}]", f"Real plus{c}", f"Real minus{c}", f"Real high{c}[{n}]",
                  f"Real low{c}[{n}]"]  # fmt: skip
        on = _signs(m, 0, i, 0, modes=True)
        lines.append(f"g{c} := gradients(t, x, p, {on})")
        lines.append(f"high{c} := field(t, x, p, {_signs(m, 1, i, 1)}, {on})")
        lines.append(f"low{c} := field(t, x, p, {_signs(m, 1, i, -1)}, {on})")
        lines.append(f"plus{c} := {_rate(f'g{c}', i, f'high{c}', n)}")
        lines.append(f"minus{c} := {_rate(f'g{c}', i, f'low{c}', n)}")
        for place, end in ((2 * i + 1, 2), (2 * i + 2, 1)):
            value = f"0.5*((1 + e[{c}, {end}])*plus{c} + (1 - e[{c}, {end}])*minus{c})"
            lines.append(f"r[{place}] := {value}")
    return _straight("rates", f"{_inputs(n, m, k)} output Real r[{2 * m}];", local, lines)


def slides(eq: Equations, i: int) -> bool:
    """Whether the solution can slide on a surface."""
    return eq.system.surfaces[i].kind == "switching" and eq.widths[i] == 0


def _off(eq: Equations, i: int) -> str:
    """The branches of the sign that a jump gives a surface by h; what stays is on it, or within its width."""
    h, sign = f"h[{i + 1}]", f"m[{i + 1}]"
    if eq.widths[i] > 0:
        return f"if {sign}*{h} + {eq.widths[i]!r} <= 0 then -{sign}"
    near = f"near[{i + 1}]"
    return f"if {h} > {near} then 1 elseif {h} < -{near} then -1"


def after_function(eq: Equations, name: str, end: str) -> list[str]:
    """The modes after a jump: of surfaces that it puts the state off by their h, of others by their rates.

    Hysteresis keeps its sign until h is beyond its width on the other side.
    """
    n, m, k = len(eq.form.x), len(eq.form.h), len(eq.form.p)
    local = [f"Real y[{n}]", f"Real h[{m}]", f"Real g[{m}, {n + 1}]", f"Real f[{n}]", f"Real r[{2 * m}]",
             f"Integer q[{m}]"]  # fmt: skip
    # Signs off the surfaces first: the rates of those that the state lies on are those of the new mode.
    lines = [f"y := {name}{end}(t, x, p, m)", "h := guards(t, y, p, m)"]
    lines += [f"q[{i + 1}] := {_off(eq, i)} else m[{i + 1}]" for i in range(m)]
    lines += ["g := gradients(t, y, p, q)", f"f := field(t, y, p, {_signs(m, 1).replace('m[', 'q[')}, q)",
              "r := rates(t, y, p, q)"]  # fmt: skip
    for i in range(m):
        if eq.widths[i] > 0:
            lines.append(f"after[{i + 1}] := q[{i + 1}]")
            continue
        on = f"if {_rate('g', i, 'f', n)} > 0 then 1 else -1"
        if slides(eq, i):
            upper, lower = f"r[{2 * i + 1}]", f"r[{2 * i + 2}]"
            on = f"if {upper} < 0 and {lower} > 0 then 0 elseif {upper} > 0 then 1 else -1"
        lines.append(f"after[{i + 1}] := {_off(eq, i)} else{on}")
    interface = f"{_inputs(n, m, k)} input Real near[{m}]; output Real after[{m}];"
    return _straight(f"{name}_sign{end}", interface, local, lines)


def ticks_functions(eq: Equations, struck: Sequence[int], end: str) -> list[str]:
    """States and modes after the clocks that are due, one after the other in their order."""
    n, m, k = len(eq.form.x), len(eq.form.h), len(eq.form.p)
    local, lines, x, mode = [], [], "x", "m"
    for place, i in enumerate(struck, 1):
        old, (new, after, signs) = (x, mode), (f"x{place}", f"a{place}", f"m{place}")
        local += [f"Real {new}[{n}]", f"Real {after}[{m}]", f"Integer {signs}[{m}]"]
        at = f"t, {old[0]}, p, {old[1]}"
        lines += [f"{new} := strike{i + 1}{end}({at})", f"{after} := strike{i + 1}_sign{end}({at}, near)"]
        for j in range(1, n + 1):
            lines.append(f"{new}[{j}] := if due[{place}] > 0 then {new}[{j}] else {x}[{j}]")
        for j in range(m):
            sign = f"{after}[{j + 1}]"
            taken = f"if {sign} > 0.5 then 1 elseif {sign} < -0.5 then -1 else 0"
            lines.append(f"{signs}[{j + 1}] := if due[{place}] < 1 then {mode}[{j + 1}] else{taken}")
        x, mode = new, signs
    given = f"{_inputs(n, m, k)} input Integer due[{len(struck)}]; input Real near[{m}];"
    parts = ((f"ticks{end}", n, x), (f"ticks_sign{end}", m, mode))
    return [line for name, size, last in parts for line in _straight(
        name, f"{given} output Real y[{size}];", local,
        [*lines, *(f"y[{j + 1}] := {last}[{j + 1}]" for j in range(size))],
    )]  # fmt: skip
