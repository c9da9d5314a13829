"""The automaton of a system as Modelica: its equations as functions, its events as when-equations.

The tool that runs it locates the events, so it is as exact as that tool's event search. What the
when-equations do not decide (corners of coupled surfaces, ends of attraction, a surface passed without its
event, accumulations) ends the run with a sentence. The mode and the start are those of one initial state.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from sympy import Float

from filippov.base.errors import ModelError
from filippov.base.escape import printable
from filippov.io.automaton.equations import Equations, names_of
from filippov.io.automaton.fmu import PLAIN, check_plain
from filippov.io.automaton.modelica_functions import (
    HELPERS,
    after_function,
    function,
    multipliers_function,
    rates_function,
    slides,
    ticks_functions,
    velocity_function,
)
from filippov.io.automaton.printers import ModelicaText
from filippov.model.symbols import t as time_symbol

# Up to this part of its largest |h| a state counts as on a surface after a jump, which a tool has located.
NEAR = 1e-6

# Words of the language, functions that are built in, and names that the model has of its own.
_WORDS = (
    "algorithm and annotation assert block break class connect connector constant constrainedby der "
    "discrete each else elseif elsewhen encapsulated end enumeration equation expandable extends "
    "external false final flow for function if import impure in initial inner input loop model not "
    "operator or outer output package parameter partial protected public pure record redeclare "
    "replaceable return stream then true type when while within time abs acos asin atan atan2 ceil cos "
    "cosh cross delay div edge exp fill floor homotopy identity integer linspace log log10 matrix max "
    "min mod noEvent ones pre product reinit rem sample sign sin sinh size skew smooth sqrt sum tan "
    "tanh terminal terminate transpose vector zeros Real Integer Boolean String field guards gradients "
    "ends velocity rates sign_of size_power change interval "
)
TAKEN = frozenset(_WORDS.split())


def modelica_text(
    eq: Equations, name: str, values: Sequence[float], x0: Sequence[float], t_span: Sequence[float],
    mode: Sequence[int], extents: Sequence[float],
) -> str:  # fmt: skip
    """The text of the model; mode: the one at the start; extents: the largest |h| of a run, by surface.

    Raises ModelError for what it cannot hold.
    """
    _check(eq, name, mode)
    system, form = eq.system, eq.form
    n, m, k = len(form.x), len(form.h), len(form.p)
    end = "_"
    while any(word.endswith(end) for word in (*system.states, *system.parameters.names, *system.outputs)):
        end += "_"
    here = f"{{{', '.join(system.states)}}}", f"{{{', '.join(system.parameters.names) or '0'}}}"
    point = f"time, {here[0]}, {here[1]}"
    modes = ", ".join(f"mode{i + 1}{end}" for i in range(m))
    old = ", ".join(f"pre(mode{i + 1}{end})" for i in range(m))
    state = f"input Real t; input Real x[{n}]; input Real p[{max(k, 1)}];"
    lines = [f'model {name} "The exact automaton of a system, written by filippov export"']
    lines += [
        f"  parameter Real {q} = {float(v)!r};" for q, v in zip(system.parameters.names, values, strict=True)
    ]
    lines += [
        f"  Real {q}(start = {float(v)!r}, fixed = true);" for q, v in zip(system.states, x0, strict=True)
    ]
    shown = _output_names(system.outputs, end)
    lines += [
        f"  output Real {word}{'' if word == q else f' {_string(q)}'};"
        for word, q in zip(shown, system.outputs, strict=True)
    ]
    jumps, struck = list(_jumps(eq)), [i for i, after in enumerate(eq.strikes) if after is not None]
    lines += _declared(eq, end, heights(eq, values, x0, float(t_span[0])), mode, extents)
    lines.append(HELPERS)
    signs = f"{state} input Real s[{m}]; input Integer m[{m}]; output Real"
    moded = f"{state} input Integer m[{m}]; output Real"
    lines += function(eq, "field", f"{signs} y[{n}];", [(f"y[{j + 1}]", e) for j, e in enumerate(eq.field)])
    lines += function(eq, "guards", f"{moded} y[{m}];", [(f"y[{i + 1}]", e) for i, e in enumerate(eq.guards)])
    rows = [(f"y[{i + 1}, {j + 1}]", e) for i, row in enumerate(eq.gradients) for j, e in enumerate(row)]
    lines += function(eq, "gradients", f"{moded} y[{m}, {n + 1}];", rows)
    pairs = [(f"y[{i + 1}, {j + 1}]", e) for i, pair in enumerate(eq.ends) for j, e in enumerate(pair)]
    lines += function(eq, "ends", f"{state} output Real y[{m}, 2];", pairs)
    changed = dict(zip(form.s, eq.modes, strict=True))
    for word, tables in (("reset", eq.resets), ("strike", eq.strikes)):
        for i, after in enumerate(tables):
            if after is not None:
                targets = [(f"y[{j + 1}]", e.xreplace(changed)) for j, e in enumerate(after)]
                lines += function(eq, f"{word}{i + 1}{end}", f"{moded} y[{n}];", targets)
                lines += after_function(eq, f"{word}{i + 1}", end)
    if struck:
        lines += ticks_functions(eq, struck, end)
    if shown:
        lines += multipliers_function(n, m, k, end)
        given = [(f"y[{j + 1}]", e) for j, e in enumerate(eq.outputs)]
        lines += function(eq, f"output_values{end}", f"{signs} y[{len(shown)}];", given)
    lines += [*velocity_function(n, m, k), *rates_function(n, m, k), "equation"]
    lines += [f"  f{end} = velocity({point}, {{{modes}}});"]
    if shown:
        sign = f"multipliers{end}({point}, {{{modes}}})"
        lines.append(f"  o{end} = output_values{end}({point}, {sign}, {{{modes}}});")
        lines += [f"  {word} = o{end}[{j + 1}];" for j, word in enumerate(shown)]
    lines += [f"  der({q}) = f{end}[{j + 1}];" for j, q in enumerate(system.states)]
    lines += [f"  h{end} = guards({point}, {{{old}}});", f"  r{end} = rates({point}, {{{old}}});"]
    lines += _clocks(eq, end, float(t_span[0]))
    for i in range(m):
        lines += _surface(eq, i, end, jumps)
    held = f"time, {{{', '.join(f'pre({q})' for q in system.states)}}}, {here[1]}, {{{old}}}"
    lines += _chain(list(_jumping(eq, struck, held, end)))
    lines += _in_any_order(eq, struck, end, float(t_span[0]))
    start, stop = (float(q) for q in t_span)
    lines += [
        f"  annotation(experiment(StartTime = {start!r}, StopTime = {stop!r}, Tolerance = 1e-9));",
        f"end {name};",
    ]
    return "\n".join(lines) + "\n"


def _declared(
    eq: Equations, end: str, at_start: Sequence[float], mode: Sequence[int], extents: Sequence[float]
) -> list[str]:  # fmt: skip
    """The variables of the automaton's own; at_start: h of every surface there, extents: its largest size."""
    n, m, lines = len(eq.form.x), len(eq.form.h), []
    for i, surface in enumerate(eq.system.surfaces):
        near = NEAR * (extents[i] or 1.0)
        clear = mode[i] and mode[i] * at_start[i] + eq.widths[i] > near * 1e-3
        free = "true" if clear else "false"
        told = _string(f"|h| up to which a state counts as on {surface.name}")
        lines.append(f"  parameter Real near{i + 1}{end} = {near!r} {told};")
        lines.append(f"  Integer mode{i + 1}{end}(start = {mode[i]}, fixed = true) {_string(surface.name)};")
        lines.append(f'  Boolean free{i + 1}{end}(start = {free}, fixed = true) "clear of the surface";')
        lines.append(f"  Boolean event{i + 1}{end}(start = false, fixed = true);")
        if slides(eq, i) and _coupled(eq, i):
            lines.append(f"  Boolean corner{i + 1}{end}(start = false, fixed = true);")
    lines.append(f"  Real f{end}[{n}]; Real h{end}[{m}]; Real r{end}[{2 * m}];")
    if eq.outputs:
        lines.append(f"  Real o{end}[{len(eq.outputs)}];")
    jumps = [word for word, _ in _jumps(eq)]
    if jumps:
        lines.append(f"  discrete Real x{end}[{n}]; discrete Real m{end}[{m}];")
        lines += [f"  discrete Real side{j + 1}{end}(start = 1, fixed = true);" for j in _resetting(eq)]
    if "strike" in jumps:
        lines.append(f"  Boolean order{end}(start = false, fixed = true);")
    for k in range(1, len(eq.system.time_events) + 1):
        lines.append(f"  Boolean clock{k}{end}; Real next{k}{end};")
        lines.append(f"  Integer count{k}{end}(start = 0, fixed = true);")
    return lines


def _clocks(eq: Equations, end: str, start: float) -> list[str]:
    """The next instant of every clock, whether it has come, and how many there were."""
    names = names_of(eq.form, eq.modes) | dict(zip(eq.form.p, eq.system.parameters.names, strict=True))
    printer, lines = ModelicaText().name(names, eq.form.a), []
    for k, event in enumerate(eq.system.time_events, 1):
        # In brackets: Modelica has no sign behind an operator.
        begin, period = (f"({q!r})" if isinstance(q, float) else f"({printer(q)})" for q in event.instants)
        t0, clock, count = f"({start!r})", f"clock{k}{end}", f"count{k}{end}"
        first = (
            f"(if {begin} > {t0} then {begin} else {begin} + {period}*(floor(({t0} - {begin})/{period}) + 1))"
        )
        lines += [f"  next{k}{end} = {first} + pre({count})*{period};", f"  {clock} = time >= next{k}{end};"]
        lines += _chain([(clock, [f"{count} = pre({count}) + 1;"])])
    return lines


def _check(eq: Equations, name: str, mode: Sequence[int]) -> None:
    """Raise ModelError for what the text cannot hold."""
    system = eq.system
    for word in (name, *system.states, *system.parameters.names):
        check_plain(word, "Modelica")
        if word in TAKEN:
            raise ModelError(f"the name {word!r} is a word of Modelica or of the exported model. Rename it.")
    if not eq.form.h:
        raise ModelError("the system has no surfaces, so there is no automaton to write in Modelica.")
    if len(eq.form.h) > 1 and not eq.affine:
        raise ModelError(
            "the field holds products of signs, which the Modelica text has no sliding field for."
        )
    for event in system.time_events:
        if event.times is not None:
            raise ModelError(
                f"time event {event.name!r} has a list of times, expected a period. Export to C."
            )
    _check_resets(eq)
    for surface, contact, sign in zip(system.surfaces, eq.contact, mode, strict=True):
        if contact and sign == 0:
            raise ModelError(
                f"the state rests on surface {surface.name!r}, which the Modelica text does not hold."
            )


def _check_resets(eq: Equations) -> None:
    """Raise ModelError where a reset moves h of another surface that has one.

    Where that leads across, the second reset follows at once, and reads the state before the first by `pre`.
    """
    for i, after in enumerate(eq.resets):
        moved = {x for x, e in zip(eq.form.x, after or (), strict=bool(after)) if e != x}
        for j, h in enumerate(eq.form.plain_h()):
            if j != i and eq.reset_from[j] and h.free_symbols & moved:
                one, other = (repr(eq.system.surfaces[k].name) for k in (i, j))
                raise ModelError(
                    f"the reset of surface {one} changes what surface {other} depends on, which has a reset "
                    "too: the Modelica text has no order of resets at one instant. Export to C."
                )


def _output_names(outputs: Iterable[str], end: str) -> list[str]:
    """What outputs are called: by number where the name has no form, with an end where it is a word."""
    named = [q if PLAIN.match(q) else f"output{k}{end}" for k, q in enumerate(outputs, 1)]
    return [q + end if q in TAKEN else q for q in named]


def _jumps(eq: Equations) -> Iterator[tuple[str, int]]:
    """What changes the state at once: ("strike", number of the clock), ("reset", number of the surface)."""
    yield from (("strike", i) for i, after in enumerate(eq.strikes) if after is not None)
    yield from (("reset", i) for i, after in enumerate(eq.resets) if after is not None)


def _resetting(eq: Equations) -> list[int]:
    """The surfaces with a reset."""
    return [i for i, sign in enumerate(eq.reset_from) if sign]


def _jumping(eq: Equations, struck: Sequence[int], held: str, end: str) -> Iterator[tuple[str, list[str]]]:
    """The branches in which the state jumps: at any clock, then at every surface with a reset.

    Clocks of one instant strike in one branch, since only one branch of a when-equation is taken.
    """
    near = f"{{{', '.join(f'near{i + 1}{end}' for i in range(len(eq.form.h)))}}}"
    reinits = [f"reinit({q}, x{end}[{j + 1}]);" for j, q in enumerate(eq.system.states)]
    if struck:
        due = ", ".join(f"if clock{i + 1}{end} then 1 else 0" for i in struck)
        yield _any([f"clock{i + 1}{end}" for i in struck]), [
            f"x{end} = ticks{end}({held}, {{{due}}}, {near});",
            f"m{end} = ticks_sign{end}({held}, {{{due}}}, {near});",
            *_sides(eq, -1, end), *reinits,
        ]  # fmt: skip
    for i, after in enumerate(eq.resets):
        if after is not None:
            yield f"event{i + 1}{end}", [
                f"x{end} = reset{i + 1}{end}({held});",
                f"m{end} = reset{i + 1}_sign{end}({held}, {near});",
                *_sides(eq, i, end), *reinits,
            ]  # fmt: skip


def _in_any_order(eq: Equations, struck: Sequence[int], end: str, t0: float) -> list[str]:
    """The end of the run where a clock and another one, or a surface, reset at once and may not commute."""
    m, at_once = len(eq.form.h), []
    same = f"1e-14*max(abs(time), abs(time - ({t0!r})))"
    for i in struck:
        at_once += [
            f"abs(next{i + 1}{end} - next{j + 1}{end}) <= {same}" for j in struck
            if j < i and eq.order[m + j] == eq.order[m + i]
        ]  # fmt: skip
        for j in _resetting(eq):
            if eq.order[j] == eq.order[m + i]:
                mode, side = f"pre(mode{j + 1}{end})", eq.reset_from[j]
                own = f" and {mode} == {side}" if side != 2 else ""
                near = f"pre(free{j + 1}{end}) and {mode}*h{end}[{j + 1}] <= near{j + 1}{end}*1e-3"
                at_once.append(f"clock{i + 1}{end} and {near}{own}")
    if not at_once:
        return [f"  order{end} = false;"] if struck else []
    clocks = _any([f"clock{i + 1}{end}" for i in struck])
    lines = _chain([(clocks, [f"order{end} = {' or '.join(f'({q})' for q in at_once)};"])])
    said = "non_unique: resets are due at once, and the state after them may depend on their order"
    return lines + _ending(f"order{end}", said)


def _any(conditions: Sequence[str]) -> str:
    """What is true where one of the conditions becomes so, also while another is."""
    return conditions[0] if len(conditions) == 1 else f"{{{', '.join(conditions)}}}"


def _sides(eq: Equations, own: int, end: str) -> list[str]:
    """Whether a jump leaves the state on its side of each surface with a reset but its own: 1, else -1."""
    return [
        f"side{j + 1}{end} = "
        + ("1;" if own == j else f"pre(mode{j + 1}{end})*m{end}[{j + 1}];")
        for j in _resetting(eq)
    ]


def _when(word: str, i: int, end: str) -> str:
    return f"{'clock' if word == 'strike' else 'event'}{i + 1}{end}"


def _chain(parts: Sequence[tuple[str, list[str]]]) -> list[str]:
    """when ... elsewhen ... end when."""
    lines = []
    for k, (condition, body) in enumerate(parts):
        lines += [f"  {'elsewhen' if k else 'when'} {condition} then", *(f"    {line}" for line in body)]
    return [*lines, "  end when;"] if lines else []


def _surface(eq: Equations, i: int, end: str, jumps: Sequence[tuple[str, int]]) -> list[str]:
    """The when-equations of a surface, and what ends the run there."""
    k, surface, width = i + 1, eq.system.surfaces[i], eq.widths[i]
    mode, free, event, h = f"mode{k}{end}", f"free{k}{end}", f"event{k}{end}", f"h{end}[{k}]"
    upper, lower, near = f"r{end}[{2 * k - 1}]", f"r{end}[{2 * k}]", f"near{k}{end}"
    side = f" and pre({mode}) == {eq.reset_from[i]}" if eq.reset_from[i] in (1, -1) else ""
    reached = f"pre({free}) and pre({mode})*{h} + {width!r} < 0"
    # The jump of a clock comes first: where h is beyond 0 behind it, this is no event of its own.
    struck = " or ".join(_when(word, j, end) for word, j in jumps if word == "strike")
    first = f" and not ({struck})" if struck else ""
    lines = [f"  {event} = {reached}{side if eq.reset_from[i] else ''}{first};"]
    jumped = _any([_when(word, j, end) for word, j in jumps]) if jumps else ""
    chain = [(jumped, [f"{mode} = {_sign_of(f'm{end}[{k}]')};"])] if jumps else []
    sliding = slides(eq, i)
    if not eq.reset_from[i] or side:
        where = event if not side else f"{reached} and not {event}"
        decided = f"if {upper} < 0 and {lower} > 0 then 0 else -pre({mode})" if sliding else f"-pre({mode})"
        chain.append((where, [f"{mode} = {decided};"]))
    if sliding:
        chain += [(f"pre({mode}) == 0 and {upper} > 0", [f"{mode} = 1;"]),
                  (f"pre({mode}) == 0 and {lower} < 0", [f"{mode} = -1;"])]  # fmt: skip
    lines += _chain(chain)
    clear = f"{mode}*{h} + {width!r} > {near}*1e-3"
    lines += _chain(
        [(f"{event} or {mode} <> pre({mode})", [f"{free} = {clear};"]), (clear, [f"{free} = true;"])]
    )
    told = surface.name
    behind = f"not pre({free}) and pre({mode})*{h} + {width!r} < -{near}"
    lines += _ending(behind, f"surface {told} was passed unseen, or events accumulate there")
    if jumps and eq.reset_from[i]:
        across = f"corner: a jump leads across surface {told}, which has a reset"
        lines += _ending(f"side{k}{end} < -0.5", across)
    if sliding:
        lines += _ending(
            f"pre({mode}) == 0 and {lower} - {upper} < 0", f"two-fold: surface {told} attracts no more"
        )
        coupled = [f"mode{j + 1}{end}" for j in _coupled(eq, i)]
        if coupled:
            # Kept in a variable: tools may not look at a condition that holds within one event only.
            slid = " or ".join(f"pre({q}) == 0" for q in coupled)
            lines += _chain([(event if not side else reached, [f"corner{k}{end} = {slid};"])])
            both = " or ".join(f"{q} == 0" for q in coupled)
            corner = f"corner: surface {told} is reached while a coupled one is slid on"
            lines += _ending(f"corner{k}{end} or {mode} == 0 and ({both})", corner)
    return lines


def _coupled(eq: Equations, i: int) -> list[int]:
    """The other surfaces that can be slid on and whose signs have to do with surface i."""
    same = [j for j, part in enumerate(eq.component) if part == eq.component[i] and j != i]
    return [j for j in same if eq.system.surfaces[j].kind == "switching"]


def _sign_of(value: str) -> str:
    return f"if {value} > 0.5 then 1 elseif {value} < -0.5 then -1 else 0"


def _ending(condition: str, sentence: str) -> list[str]:
    return [f"  when {condition} then", f"    terminate({_string(sentence)});", "  end when;"]


def _string(text: str) -> str:
    """A string of Modelica, in one line."""
    plain = printable(text).replace("\\", "\\\\").replace('"', '\\"')
    return f'"{plain}"'


def heights(eq: Equations, values: Sequence[float], x0: Sequence[float], t0: float) -> list[float]:
    """h of every surface at a state and time."""
    at = {time_symbol: Float(t0)}
    at |= {q: Float(float(v)) for q, v in zip((*eq.form.p, *eq.form.x), (*values, *x0), strict=True)}
    return [float(h.xreplace(at)) for h in eq.form.plain_h()]
