"""A system with one method as machine code, with the parameter values and user functions of one run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from filippov.base.arrays import Array
from filippov.base.errors import ModelError
from filippov.kernel.codegen.build import Compiled, build, generation
from filippov.kernel.codegen.callback import Callbacks, EventCallbacks, callback_unit, new_context
from filippov.kernel.codegen.entries import ARGUMENTS
from filippov.kernel.codegen.generated import Generated
from filippov.kernel.codegen.input_slots import EACH
from filippov.kernel.codegen.newton_band import FEW, newton_band
from filippov.kernel.language.primitives import KernelError
from filippov.kernel.language.records import address_of
from filippov.kernel.language.unit import Constant
from filippov.kernel.tables.layout import RULES
from filippov.kernel.tables.root_tables import NODES
from filippov.kernel.tables.tableaus import TABLEAUS, Collocation, Series
from filippov.model.surface import Role, Surface
from filippov.model.system import System
from filippov.model.time_event import TimeEvent
from filippov.solving.state.pieces import Pieces

_FLOAT = np.dtype(np.float64)
_SIDES: dict[str, tuple[int, ...]] = {"+": (1,), "-": (-1,), "both": (1, -1)}


def unit_of(system: System, blended: bool = False) -> Generated:
    """The unit of a system of expressions, made once and kept with it: another process need not make it.

    Nor does it use one that another version has made.
    """
    key = generation(), blended
    if key not in system.units:
        system.units[key] = _generated(_Equations(system.content, system.inputs, system), blended)
    unit: Generated = system.units[key]
    return unit


def non_lipschitz_of(system: System) -> int | None:
    """The surface of a system of expressions whose |h| stands under a root in its own rate, None without."""
    key = generation(), "non_lipschitz"
    if key not in system.units:
        from filippov.model.reduction import non_lipschitz_surface

        system.units[key] = non_lipschitz_surface(system)
    found: int | None = system.units[key]
    return found


@dataclass(frozen=True)
class _Equations:
    """A system told by its equations alone: those that differ in default values have one unit."""

    content: tuple[Any, ...]
    inputs: tuple[Any, ...]
    system: System = field(compare=False)


@lru_cache(maxsize=256)
def _generated(equations: _Equations, blended: bool) -> Generated:
    from filippov.kernel.codegen.generate import generate

    system = equations.system
    assert system.symbolic is not None
    return generate(system.symbolic, system.surfaces, blended)


@lru_cache(maxsize=256)
def _generated_with(system: System, expressions: tuple[Any, ...], functions: int, blended: bool) -> Generated:
    """The unit with user events; one for any functions."""
    from filippov.kernel.codegen.generate_events import generate_with_events

    assert system.symbolic is not None
    events = [Surface("event", e, kind="observer") for e in (*expressions, *[_placeholder] * functions)]
    return generate_with_events(system.symbolic, system.surfaces, tuple(events), blended)


def _band(system: System, unit: Generated) -> dict[str, Constant]:
    """The band of Newton's matrices of a system of expressions, found once and kept with it."""
    key = generation(), "band"
    if key not in system.units:
        assert system.symbolic is not None
        system.units[key] = newton_band(system.symbolic, unit.constants)
    found: dict[str, Constant] = system.units[key]
    return found


@lru_cache(maxsize=256)
def _jets(system: System, surfaces: int, order: int, free_only: bool) -> Generated:
    from filippov.kernel.codegen.system_jets import system_jets

    assert system.symbolic is not None
    return system_jets(system.symbolic, system.surfaces, surfaces, order, free_only)


def _placeholder(t: float, x: Any, p: Any) -> float:
    raise NotImplementedError


def _address(value: Any) -> int:
    """Where an array of numbers or a struct lies; refuses arrays of others."""
    if not isinstance(value, np.ndarray):
        return address_of(value.array)
    if value.dtype is not _FLOAT and value.dtype != _FLOAT:
        raise KernelError(f"an array of {value.dtype} is given to a kernel, expected one of floats")
    return address_of(value)


class Machine:
    """The compiled functions of a system. Each run makes its own: scratch and callbacks are not shared."""

    def __init__(
        self, system: System, method: str, p: Array, events: tuple[Surface, ...] = (),
        sliding: str = "filippov", compiled: bool | None = None,
    ) -> None:  # fmt: skip
        # What time stepping has found is looked at with the kernels of the loop.
        method = method if method in TABLEAUS else "DOP853"
        self.system, self.events = system, events
        self.n, self.m = system.dimension, len(system.surface_names) + len(events)
        self.callbacks: Callbacks | None = None
        if system.field is None:
            expressions = tuple(e.h for e in events if e.symbolic)
            functions = events[len(expressions) :]
            blended = sliding == "utkin"
            unit = (
                _generated_with(system, expressions, len(functions), blended)
                if events
                else unit_of(system, blended)
            )
            self.context = new_context()
            if functions:
                self.callbacks = EventCallbacks(functions, self.n, system.parameters.record)
                self.callbacks.parameters(p)
                self.context = self.callbacks.context
        else:
            unit = callback_unit(self.n, len(system.parameters), self.surfaces)
            self.callbacks = Callbacks(
                system.field, self.surfaces, self.n, system.parameters.record, system.time_events,
                compiled=system.compile if compiled is None else compiled,
            )  # fmt: skip
            self.callbacks.parameters(p)
            self.context = self.callbacks.context
        self.pieces: Pieces | None = None
        if system.inputs:
            # Behind what the context holds already, if anything.
            self.context = np.append(self.context, np.zeros(EACH * len(system.inputs), dtype=np.int64))
            self.pieces = Pieces(system.inputs, self.context)
            if self.callbacks is not None:
                self.callbacks.context = self.context
        self.unit = unit
        self.constants = unit.constants | {"RULE": RULES.index(sliding)}
        if sliding == "utkin" and system.field is not None:
            # One surface: two vertices say all for Filippov, nothing of what lies between them.
            self.constants["AFFINE"] = False
        source, tableau = unit.source, TABLEAUS[method]
        if isinstance(tableau, Series):
            assert system.symbolic is not None
            jets = _jets(system, self.m, tableau.order, sliding == "utkin" and not self.constants["AFFINE"])
            # Also without surfaces: the points inside a step are looked at side by side.
            small = self.m == 0 and source.startswith("@inline") and not system.inputs
            self.constants = self.constants | jets.constants | {"WIDE": self.constants["WIDE"] or small}
            source += jets.source
        if isinstance(tableau, Collocation) and self.n >= FEW and system.field is None:
            self.constants = self.constants | _band(system, unit)
        self.source = source
        self.compiled: Compiled = build(source, self.constants, method)
        self.p = self.derived(p)
        self.w, self.iw = self.compiled.scratch(), self.compiled.integers()
        self.event_size = int(unit.constants["EVENT_SIZE"])  # type: ignore[arg-type]
        self.affine = bool(self.constants["AFFINE"])
        # Surfaces whose signs do not act on each other's rates have different numbers.
        component: Any = unit.constants["COMPONENT"]
        self.component: tuple[int, ...] = tuple(component[: self.m])
        self.calls = 0
        # Of a knot of an input, where no run holds its pieces.
        self.side = "+"
        self.values, self.method, self.sliding = p, method, sliding
        # Scratch of batches by their lanes that waits for the next one (see `batch`).
        self.rooms: dict[int, list[Any]] = {}
        # Small batches that wait, by what was asked for.
        self.batches: dict[Any, Any] = {}

    def again(self, p: Array) -> None:
        """As new, with other parameter values: of a system of expressions without user events or inputs."""
        if self.system.variable_widths:
            self.p[:] = self.derived(p)
        else:
            self.p[: p.size] = p
            if self.p.size > p.size:
                self.compiled.functions["derive"](*self._deriving)
        self.w.array.fill(0.0)
        self.iw.array.fill(0)
        self.values, self.calls = p, 0

    @cached_property
    def _deriving(self) -> list[Any]:
        return self.compiled.arguments("derive", {"p": self.p})

    @cached_property
    def non_lipschitz(self) -> int | None:
        """The surface whose |h| stands under a root in its own rate (`non_lipschitz_surface`), or None."""
        if not self.constants["NON_LIPSCHITZ"] or self.system.field is not None:
            return None
        return non_lipschitz_of(self.system)

    @property
    def formulas(self) -> bool:
        """Whether formulas are all that is evaluated: no functions of the user, no inputs."""
        return self.callbacks is None and self.pieces is None

    @cached_property
    def surfaces(self) -> tuple[Surface, ...]:
        """The surfaces of the system and the events."""
        return (*self.system.surfaces, *self.events)

    @property
    def _roles(self) -> tuple[Role, ...]:
        return (*self.system.roles, *(event.role for event in self.events))

    @cached_property
    def roles(self) -> tuple[str, ...]:
        """The kind of each surface."""
        return tuple(role.kind for role in self._roles)

    @cached_property
    def widths(self) -> tuple[float, ...]:
        """The width of the hysteresis of each surface."""
        return tuple(role.width for role in self._roles)

    @cached_property
    def resets_from(self) -> tuple[tuple[int, ...], ...]:
        """The signs from which each surface resets the state."""
        return tuple(() if role.side is None else _SIDES[role.side] for role in self._roles)

    @cached_property
    def contacts(self) -> tuple[int, ...]:
        """The side from which each surface may be rested on, 0 for none."""
        return tuple(_SIDES[role.side][0] if role.side and role.contact else 0 for role in self._roles)

    @cached_property
    def local(self) -> Machine:
        """The machine for trial steps as short as one likes: one of stages, none solved for."""
        if not isinstance(TABLEAUS[self.method], Collocation | Series):
            return self
        other = Machine(self.system, "DOP853", self.values, self.events, self.sliding)
        # The same functions, parameters and times: only the method differs.
        other.callbacks, other.context, other.p = self.callbacks, self.context, self.p
        other.pieces = self.pieces
        return other

    @property
    def time_events(self) -> tuple[TimeEvent, ...]:
        """Those of the system, of which a worker has to ask only where there are any."""
        return self.system.time_events if self.system.clocked else ()

    @property
    def ticking(self) -> bool:
        """Whether the compiled loop can look after the time events: no knots, no functions of the user."""
        return self.callbacks is None and not self.system.inputs

    def derived(self, values: Array) -> Array:
        """Parameters, one row per set, with room for what the field derives from them; one set is derived.

        Raises ModelError where a width is not positive for them.
        """
        if self.system.variable_widths:
            from filippov.model.comparators.hysteresis import check_widths

            assert self.system.symbolic is not None
            check_widths(self.system.symbolic, self.system.surfaces, values)
        width = int(self.unit.constants["P"])  # type: ignore[arg-type]
        rows = np.zeros((*values.shape[:-1], width))
        rows[..., : values.shape[-1]] = values
        if rows.ndim == 1:
            self.compiled.functions["derive"](*self.compiled.arguments("derive", {"p": rows}))
        return rows

    def call(self, name: str, **values: Any) -> int:
        """Call a compiled function with values by name. Raises what user code raised."""
        if self.pieces is not None and "t" in values:
            self.pieces.at(values["t"], self.side)
        if self.callbacks is not None:
            self.callbacks.look()
        code = int(self.compiled.functions[name](*self.compiled.arguments(name, values)))
        self.raise_error()
        return code

    def ask(self, name: str, *values: Any) -> int:
        """`call` with numbers and arrays in the order of the entry point; the context follows them.

        What asks the formulas at thousands of points is spared to name what it gives.
        """
        if self.callbacks is not None or self.pieces is not None or self.compiled.plain:
            names = [argument for argument, _ in ARGUMENTS[name]]
            return self.call(name, **dict(zip(names, (*values, self.context), strict=True)))
        given = [value if type(value) is float else _address(value) for value in values]
        return int(self.compiled.functions[name](*given, address_of(self.context)))

    def raise_error(self) -> None:
        """Raise what a user function raised, unchanged."""
        if self.callbacks is not None and self.callbacks.error is not None:
            error, self.callbacks.error = self.callbacks.error, None
            raise error

    def rhs(self, t: float, x: Array, signs: Array, mode: Array) -> Array:
        """The vertex field at the given signs, with the sizes |h| of a mode."""
        out = np.empty(self.n)
        self.calls += 1
        self.ask("rhs", float(t), x, self.p, signs, mode, out)
        return out

    def rate(self, i: int, g: Array, velocity: Array) -> float:
        """grad h_i . velocity; components of the velocity on which h_i does not depend may be undefined."""
        with np.errstate(invalid="ignore"):
            return float(np.sum(g[i] * np.where(g[i] == 0.0, 0.0, velocity)))

    def guards(self, t: float, x: Array, mode: Array) -> Array:
        """All switching functions."""
        out = np.empty(self.m)
        self.ask("guards", float(t), x, self.p, mode, out)
        return out

    def signs_at(self, t: float, x: Array) -> tuple[Array, Array]:
        """All switching functions at a state, and their signs (+1 at 0), by which sizes in others go."""
        mode = np.ones(self.m)
        for _ in range(self.m + 1):
            h = self.guards(t, x, mode)
            last, mode = mode, np.where(h >= 0.0, 1.0, -1.0)
            if np.array_equal(last, mode):
                break
        return h, mode

    def gradients(self, t: float, x: Array, mode: Array) -> tuple[Array, Array]:
        """dh/dx, shape (m, n), and dh/dt, shape (m,)."""
        # Functions of the user write both into the first array, one behind the other.
        g, gt = np.zeros(self.m * self.n + self.m), np.zeros(self.m)
        self.ask("gradients", float(t), x, self.p, mode, g, gt)
        return g[: self.m * self.n].reshape(self.m, self.n), gt

    def radii(self, t: float, x: Array) -> Array:
        """The set of each sign at h = 0, shape (m, 2)."""
        out = np.empty((self.m, 2))
        self.ask("radii", float(t), x, self.p, out)
        if not np.all(out[:, 0] <= -1 + 1e-12) or not np.all(out[:, 1] >= 1 - 1e-12):
            i = int(np.argmax((out[:, 0] > -1 + 1e-12) | (out[:, 1] < 1 - 1e-12)))
            raise ModelError(
                f"surface {self.surfaces[i].name!r}: its set at h = 0 is "
                f"[{out[i, 0]:g}, {out[i, 1]:g}] at t = {t:g}, expected one that holds "
                "[-1, 1]. Check the radius with these parameters."
            )
        return out

    def corner_kind(self, t: float, x: Array, mode: Array, pair: Sequence[int], direction: float) -> int:
        """What the corner of two surfaces is, in the bits of `kernel.loop.corner`."""
        self.w.direction = direction
        return self.call(
            "corner_kind", t=float(t), x=x, p=self.p, m=mode, i=int(pair[0]), j=int(pair[1]), w=self.w,
            iw=self.iw, ctx=self.context,
        )  # fmt: skip

    def reset(self, i: int, t: float, x: Array, mode: Array) -> Array:
        """The state after the reset at surface i, reached in a mode; time events follow the surfaces."""
        out = np.empty(self.n)
        self.call("resets", i=int(i), t=float(t), x=x, p=self.p, m=mode, out=out, ctx=self.context)
        return out

    def between(self, low: float, high: float) -> None:
        """Call functions of the user with times strictly inside (low, high) only."""
        inside = np.array([np.nextafter(low, np.inf), np.nextafter(high, -np.inf)])
        self.context[5:7] = inside.view(np.int64)

    def probe(
        self, t: float, step: float, x: Array, mode: Array, guess: Array
    ) -> tuple[int, Array, Array, Array]:
        """(code, field, multipliers, guards along a trial step) of a mode; guards: shape (NODES, 2, m)."""
        out = np.zeros(self.n + NODES * 2 * self.m)
        lam = np.array(guess, dtype=np.float64)
        code = self.ask("probe", float(t), float(step), x, mode, self.p, lam, out, self.w, self.iw)
        return code, out[: self.n], lam, out[self.n :].reshape(NODES, 2, self.m)
