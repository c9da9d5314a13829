"""Plain Python functions behind the compiled loop: called by address, checked, their errors kept."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from filippov.base.errors import ModelError
from filippov.kernel.codegen.generated import TWICE, Generated, unit_constants
from filippov.kernel.codegen.jit import ASK
from filippov.kernel.codegen.plain_contact import OPEN_END, PlainContacts
from filippov.kernel.codegen.plain_gradient import PlainGradients
from filippov.kernel.codegen.replacement import Replacement
from filippov.kernel.codegen.structure import Structure
from filippov.model.surface import Surface
from filippov.model.time_event import TimeEvent

# The largest distance from a surface that is rounding, relative to the state and to the way that led to it.
ON_SURFACE = 1e-13
# Points of which the gradients of user events are kept.
KNOWN = 256

_FIELD = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_double, *([ctypes.c_void_p] * 5))
_GUARD = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_double, *([ctypes.c_void_p] * 4))

SOURCE = """
@kernel
def inside(t: float, ctx: Indices) -> float:
    return min(max(t, from_bits(ctx[5])), from_bits(ctx[6]))

@kernel
def rhs(t: float, x: Vector, p: Vector, s: Vector, m: Vector, out: Vector, ctx: Indices) -> int:
    place = 0
    for i in range(M):
        # What pushes off a surface that is rested on only the callback knows.
        if CONTACT[i] != 0 and m[i] == 0.0:
            place = 7
    code = call_field(ctx[place], inside(t, ctx), x, p, s, m, out)
    if code == {ASK}:
        code = call_field(ctx[7], inside(t, ctx), x, p, s, m, out)
    return code

@kernel
{TWICE}

@kernel
def guards(t: float, x: Vector, p: Vector, m: Vector, out: Vector, ctx: Indices) -> int:
    return call_guard(ctx[1], inside(t, ctx), x, p, m, out)

@kernel
def gradients(t: float, x: Vector, p: Vector, m: Vector, g: Vector, gt: Vector, ctx: Indices) -> int:
    code = call_guard(ctx[2], inside(t, ctx), x, p, m, g)
    for i in range(M):
        gt[i] = g[M * N + i]
    return code

@kernel
def radii(t: float, x: Vector, p: Vector, out: Vector, ctx: Indices) -> int:
    return call_guard(ctx[3], inside(t, ctx), x, p, p, out)

@kernel
def derive(p: Vector) -> int:
    return 0

@kernel
def resets(i: int, t: float, x: Vector, p: Vector, m: Vector, out: Vector, ctx: Indices) -> int:
    out[0] = float(i)
    return call_guard(ctx[4], t, x, p, m, out)
""".replace("{TWICE}", "\n".join(TWICE)).replace("{ASK}", str(ASK))


def callback_unit(n: int, parameters: int, surfaces: tuple[Surface, ...]) -> Generated:
    """The unit of any system of this size given by plain functions."""
    linear = [surface.linear for surface in surfaces]
    pattern = Structure.full(n, len(surfaces))
    affine = len(surfaces) < 2
    moving = [any(callable(end) for end in surface.radius) for surface in surfaces]
    straight = [False] * len(surfaces)
    constants = unit_constants(
        n, parameters, surfaces, linear, affine, True, pattern, moving, straight, clamped=False
    )
    return Generated(SOURCE, constants)


def new_context() -> npt.NDArray[np.int64]:
    """An array for five addresses, the times between which functions may be called (as bits), and an address.

    The last is that of the plain field, also where machine code replaces it as the first.
    """
    context = np.zeros(8, dtype=np.int64)
    context[5:7] = np.array([-np.inf, np.inf]).view(np.int64)
    return context


class Callbacks:
    """The user's functions as C addresses. An exception in one stops the loop and is kept in `error`."""

    def __init__(
        self,
        field: Callable[..., Any],
        surfaces: tuple[Surface, ...],
        n: int,
        record: Callable[[Any], Any],
        time_events: tuple[TimeEvent, ...] = (),
        compiled: bool | None = None,
    ) -> None:
        self.time_events = time_events
        self.field, self.surfaces, self.n, self.record = field, surfaces, n, record
        self.error: BaseException | None = None
        self.values: tuple[float, ...] | None = None
        self.p: Any = None
        self.replacement = Replacement(field, n, len(surfaces), compiled)
        self.gradients = PlainGradients(surfaces, field, n, self._h, self._given)
        self.contacts = None
        if any(surface.contact for surface in surfaces):
            slopes = self.gradients.rate_slopes
            self.contacts = PlainContacts(surfaces, self._free, self._row, self._after, slopes)
        self._handles = [
            _FIELD(self._rhs),
            _GUARD(self._guarded(self._guards)),
            _GUARD(self._guarded(self._gradients)),
            _GUARD(self._guarded(self._radii)),
            _GUARD(self._resets),
        ]
        addresses = [ctypes.cast(handle, ctypes.c_void_p).value or 0 for handle in self._handles]
        self.context = new_context()
        self.context[: len(addresses)] = addresses
        self.context[7] = addresses[0]

    def parameters(self, p: npt.NDArray[np.float64]) -> None:
        """Set the record that the user's functions see."""
        self.p = self.record(p)
        self.gradients.parameters(self.p)

    def speed_up(self, names: tuple[str, ...], t: float, x: npt.NDArray[np.float64]) -> None:
        """Replace the callback by the field's machine code where that is allowed; the run is at t, x.

        Raises ModelError where it was asked for and cannot be.
        """
        self.look()
        self.context[0] = self.replacement.at(names, self.p, t, x) or self.context[7]

    def look(self) -> None:
        """Go back to the callback if a name that the field reads has been bound to something else."""
        if not self.replacement.holds():
            self.context[0] = self.context[7]

    def _state(self, address: int) -> npt.NDArray[np.float64]:
        return _copied(address, self.n)

    def _mode(self, address: int) -> npt.NDArray[np.float64]:
        return _copied(address, len(self.surfaces))

    def _free(
        self, t: float, x: npt.NDArray[np.float64], signs: npt.NDArray[np.float64]
    ) -> npt.NDArray[np.float64]:
        return checked_vector(self.field(t, x, self.p, signs), self.n, signs)

    def _rhs(self, t: float, x: int, p: int, s: int, m: int, out: int) -> int:
        try:
            signs = np.empty(max(len(self.surfaces), 1))
            ctypes.memmove(signs.ctypes.data, s, 8 * len(self.surfaces))
            signs = signs[: len(self.surfaces)]
            signs.flags.writeable = False
            value = checked_vector(self.field(t, self._state(x), self.p, signs), self.n, signs)
            if not np.isfinite(value).all():
                value = self._on_its_side(t, self._state(x), signs, value)
            self.replacement.count(t, x, signs, value)
            if self.contacts is not None and self.contacts.held(mode := self._mode(m)):
                value = self.contacts.pushed(value, t, self._state(x), signs, mode)
            ctypes.memmove(out, value.ctypes.data, 8 * self.n)
        except BaseException as error:  # noqa: BLE001 - none can pass through C
            self.error = named_write(error, "field")
            return 1
        return 0

    def _on_its_side(
        self,
        t: float,
        x: npt.NDArray[np.float64],
        signs: npt.NDArray[np.float64],
        value: npt.NDArray[np.float64],
    ) -> npt.NDArray[np.float64]:
        """The field of a point that lies beyond surfaces by rounding, where it is undefined: at its image.

        On a surface rounding leaves h on either side of 0, and the field of one side may be a root of h.
        """
        image = x.copy()
        for i in range(len(self.surfaces)):
            h, row = self._h(i, t, x), self.gradients.row(i, t, x)[: self.n]
            if h * signs[i] < 0.0 and abs(signs[i]) == 1.0 and (size := float(row @ row)) > 0.0:
                image -= 2.0 * h / size * row
        if np.array_equal(image, x):
            return value
        image.flags.writeable = False
        there = checked_vector(self.field(t, image, self.p, signs), self.n, signs)
        near = np.max(np.abs(x)) + abs(t) * np.max(np.abs(there))
        return there if np.max(np.abs(image - x)) <= ON_SURFACE * near else value

    def _guarded(
        self, function: Callable[[float, int, int], npt.NDArray[np.float64]]
    ) -> Callable[..., int]:
        def call(t: float, x: int, p: int, m: int, out: int) -> int:
            try:
                value = function(t, x, m)
                ctypes.memmove(out, value.ctypes.data, 8 * value.size)
            except BaseException as error:  # noqa: BLE001 - none can pass through C
                self.error = error
                return 1
            self.look()
            return 0

        return call

    def _resets(self, t: float, x: int, p: int, m: int, out: int) -> int:
        try:
            i = int(ctypes.c_double.from_address(out).value)
            value = self._after(i, t, self._state(x))
            ctypes.memmove(out, value.ctypes.data, 8 * self.n)
        except BaseException as error:  # noqa: BLE001 - none can pass through C
            self.error = named_write(error, "reset")
            return 1
        self.look()
        return 0

    def _after(self, i: int, t: float, x: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        m = len(self.surfaces)
        source: Surface | TimeEvent = self.surfaces[i] if i < m else self.time_events[i - m]
        assert source.reset is not None
        return checked_vector(source.reset(t, x, self.p), self.n, None, f"reset of {source.name!r}")

    def _h(self, i: int, t: float, x: npt.NDArray[np.float64]) -> float:
        surface = self.surfaces[i]
        try:
            return checked_number(surface.h(t, x, self.p), surface.name)
        except ValueError as error:
            raise named_write(error, f"surface {surface.name!r}") from None

    def _guards(self, t: float, x: int, m: int) -> npt.NDArray[np.float64]:
        state = self._state(x)
        out = np.array([self._h(i, t, state) for i in range(len(self.surfaces))])
        if self.contacts is not None:
            mode = self._mode(m)
            for i in self.contacts.held(mode):
                out[i] = self.contacts.rate(i, t, state, self.contacts.signs(mode))
        return out

    def _gradients(self, t: float, x: int, m: int) -> npt.NDArray[np.float64]:
        count, n = len(self.surfaces), self.n
        out = np.zeros(count * n + count)
        state = self._state(x)
        mode = None if self.contacts is None else self._mode(m)
        held = [] if self.contacts is None or mode is None else self.contacts.held(mode)
        for i in range(count):
            if self.contacts is not None and mode is not None and i in held:
                row = self.contacts.slopes(i, t, state, self.contacts.signs(mode))
            else:
                row = self.gradients.row(i, t, state)
            out[i * n : (i + 1) * n] = row[:n]
            out[count * n + i] = row[n]
        return out

    def _row(self, i: int, t: float, x: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """The row (h_i, dh_i/dx, dh_i/dt)."""
        return np.concatenate([[self._h(i, t, x)], self.gradients.row(i, t, x)])

    def _given(self, i: int, t: float, x: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        surface = self.surfaces[i]
        assert surface.gradient is not None
        value = surface.gradient(t, x, self.p)
        return checked_vector(value, self.n, None, f"gradient of {surface.name!r}")

    def _radii(self, t: float, x: int, m: int) -> npt.NDArray[np.float64]:
        state = self._state(x)
        ends = []
        for surface in self.surfaces:
            for end in surface.radius:
                value = end(t, state, self.p) if callable(end) else end
                ends.append(checked_number(value, surface.name))
            if surface.contact:
                ends[-2 if surface.side == "+" else -1] = -OPEN_END if surface.side == "+" else OPEN_END
        return np.array(ends)


class EventCallbacks(Callbacks):
    """Functions of user events beside a system of expressions: guards, rows of gradients, slopes in time."""

    def __init__(self, surfaces: tuple[Surface, ...], n: int, record: Callable[[Any], Any]) -> None:
        super().__init__(_no_field, surfaces, n, record, compiled=False)
        self._known: dict[tuple[float, bytes], npt.NDArray[np.float64]] = {}
        rows, slopes = _GUARD(self._guarded(self._rows)), _GUARD(self._guarded(self._slopes))
        self._handles += [rows, slopes]
        self.context[2:4] = [ctypes.cast(handle, ctypes.c_void_p).value or 0 for handle in (rows, slopes)]

    def _gradients(self, t: float, x: int, m: int) -> npt.NDArray[np.float64]:
        # Rows and slopes are asked for in turn, and the same points again where an event is decided.
        key = t, ctypes.string_at(x, 8 * self.n)
        found = self._known.get(key)
        if found is None:
            if len(self._known) >= KNOWN:
                self._known.clear()
            found = self._known[key] = super()._gradients(t, x, m)
        return found

    def _rows(self, t: float, x: int, m: int) -> npt.NDArray[np.float64]:
        return self._gradients(t, x, m)[: len(self.surfaces) * self.n]

    def _slopes(self, t: float, x: int, m: int) -> npt.NDArray[np.float64]:
        return self._gradients(t, x, m)[len(self.surfaces) * self.n :]


def _copied(address: int, size: int) -> npt.NDArray[np.float64]:
    """Read-only copy of numbers at an address."""
    out = np.empty(max(size, 1))
    ctypes.memmove(out.ctypes.data, address, 8 * size)
    out = out[:size]
    out.flags.writeable = False
    return out


def _no_field(*_: Any) -> Any:
    raise NotImplementedError


def named_write(error: BaseException, name: str) -> BaseException:
    """The error, or a clearer one where the user's function wrote into the state."""
    if isinstance(error, ValueError) and "read-only" in str(error):
        return ModelError(
            f"{name}: the function writes into its argument. Arguments are read-only; write to a copy."
        )
    return error


def checked_vector(
    value: Any, n: int, signs: npt.NDArray[np.float64] | None, what: str = "field"
) -> npt.NDArray[np.float64]:
    """A float64 vector of length n, or a ModelError that says what was returned instead."""
    marks = "" if signs is None else "".join("+" if s > 0 else "-" for s in signs)
    mode = marks and f" in mode {marks}"
    if type(value) is np.ndarray and value.dtype == np.float64 and value.shape == (n,):
        return np.ascontiguousarray(value)
    if value is None:
        raise ModelError(f"{what}{mode} returned None, expected {n} numbers. Is a return missing?")
    try:
        array = np.asarray(value)
    except (ValueError, TypeError):
        array = np.asarray(None)
    if array.shape != (n,):
        raise ModelError(f"{what}{mode} returned {_shape(value, array)}, expected {n} numbers.")
    if array.dtype.kind == "c":
        raise ModelError(f"{what}{mode} returned complex numbers, expected {n} real ones.")
    if isinstance(value, np.ma.MaskedArray) and np.ma.is_masked(value):
        raise ModelError(f"{what}{mode} returned masked entries, expected {n} numbers.")
    try:
        return np.ascontiguousarray(array, dtype=np.float64)
    except (TypeError, ValueError):
        raise ModelError(
            f"{what}{mode} returned entries of type {array.dtype}, expected {n} numbers."
        ) from None


def checked_number(value: Any, name: str) -> float:
    """A float, or a ModelError naming the surface; conditions (booleans) are refused."""
    if isinstance(value, float):
        return value
    array = np.asarray(value)
    if array.shape != ():
        raise ModelError(
            f"surface {name!r}: h returned shape {array.shape}, expected a float. "
            "Return h(t, x, p)[0], or declare one Surface per component."
        )
    if array.dtype.kind not in "fiu":
        raise ModelError(
            f"surface {name!r}: h returned {value!r}, expected a real number that varies continuously. "
            "A condition has no sign change to locate: return the difference of its two sides."
        )
    return float(array)


def _shape(value: Any, array: npt.NDArray[Any]) -> str:
    return f"shape {array.shape}" if array.dtype != object or array.shape else repr(value)[:80]
