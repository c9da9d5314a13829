"""When the machine code of a plain field may replace it: pure or requested, with the same values."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from filippov.base.arrays import Array
from filippov.base.errors import ModelError
from filippov.kernel.codegen.jit import ASK, CompiledField, NotCompiledError, compile_field
from filippov.kernel.codegen.purity import Purity, purity

# Compiling a field takes about a second, the time of this many callbacks.
COMPILE_AFTER = 100_000
# The values of every so many-th call are kept for comparison.
_SPACING = 1024
# Relative difference that counts as equal: elementary functions of two libraries differ by rounding.
_DIGITS, _ROUNDING = 1e-13, 8 * float(np.finfo(float).eps)
# A difference above this part of the field's magnitude means another field.
_OTHER = 1e-9
_FIELD = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_double, *([ctypes.c_void_p] * 5))


class _Call(NamedTuple):
    """Arguments of the field and what it gave."""

    t: float
    x: Array
    signs: Array
    value: Array


class Replacement:
    """The machine code of a field, made after many calls (or at once), and the reason not to use it.

    wanted   True: requested; False: never; None: where the field is pure by inspection
    """

    def __init__(self, field: Callable[..., Any], n: int, m: int, wanted: bool | None) -> None:
        self.field, self.n, self.m, self.wanted = field, n, m, wanted
        self.calls = 0
        self.tried = wanted is False
        self.kept: list[_Call] = []
        self.found: Purity | None = None
        self.code: CompiledField | None = None
        self.scale = np.zeros(n)

    def count(self, t: float, x: int, signs: Array, value: Array) -> None:
        """Count a call of the plain field; x is the address of the state."""
        self.calls += 1
        if self.tried or (self.calls % _SPACING and self.calls & (self.calls - 1)):
            return
        state = np.empty(self.n)
        ctypes.memmove(state.ctypes.data, x, 8 * self.n)
        self.kept.append(_Call(t, state, signs.copy(), value.copy()))

    def holds(self) -> bool:
        """Whether the machine code, if any, still represents the field."""
        if self.code is not None and self.found is not None and not self.found.unchanged():
            self.code = None
        return self.code is not None

    def at(self, names: tuple[str, ...], record: Any, t: float, x: Array) -> int:
        """The address of the machine code to use from t, x on, 0 for none. Raises ModelError."""
        if self.code is None and not self.tried and (self.wanted or self.calls >= COMPILE_AFTER):
            self.tried = True
            self.code = self._made(names, record)
        if self.code is None:
            return 0
        if self.wanted:
            self._compare(self.code, record, t, x)
        return self.code.address

    def _made(self, names: tuple[str, ...], record: Any) -> CompiledField | None:
        found = purity(self.field)
        if found.reason and not self.wanted:
            return None
        try:
            code = compile_field(self.field, names, self.n, self.m)
        except NotCompiledError as error:
            if self.wanted:
                raise ModelError(
                    f"compile=True, but the field cannot be compiled: {error}. Leave compile out: the field "
                    "is then called as it is."
                ) from None
            return None
        if self.wanted:
            return code
        self.found = found
        if not all(self._same(code, record, call) for call in self.kept):
            return None
        self.kept.clear()
        return code

    def _plain(self, record: Any, call: _Call) -> Array:
        x, signs = call.x.copy(), call.signs.copy()
        x.flags.writeable = signs.flags.writeable = False
        return np.asarray(self.field(call.t, x, record, signs), dtype=np.float64)

    def _value(self, code: CompiledField, record: Any, call: _Call) -> Array | None:
        """The value of the machine code; None where it defers to the plain field."""
        p, out = np.array(list(record), dtype=np.float64), np.empty(self.n)
        signs = np.ones(max(self.m, 1))
        signs[: self.m] = call.signs
        x, s = call.x.copy(), signs.ctypes.data
        if _FIELD(code.address)(call.t, x.ctypes.data, p.ctypes.data, s, s, out.ctypes.data) == ASK:
            return None
        return out

    def _same(self, code: CompiledField, record: Any, call: _Call) -> bool:
        """Whether machine code and field both reproduce a value recorded from the field."""
        self.scale = np.fmax(self.scale, np.abs(call.value))
        out = self._value(code, record, call)
        if out is None:
            return True
        room = _DIGITS * np.abs(call.value) + _ROUNDING * self.scale
        again = self._plain(record, call)
        return bool(np.all(np.abs(out - call.value) <= room) and np.array_equal(again, call.value))

    def _compare(self, code: CompiledField, record: Any, t: float, x: Array) -> None:
        """Compare with the field as it is now, which detects a field with memory. Raises ModelError."""
        for sign in (1.0, -1.0) if self.m else (1.0,):
            call = _Call(t, np.array(x), np.full(self.m, sign), np.empty(0))
            out = self._value(code, record, call)
            if out is None:
                continue
            plain = self._plain(record, call)
            self.scale = np.fmax(self.scale, np.abs(plain))
            if plain.shape != out.shape or not np.all(np.abs(out - plain) <= _OTHER * self.scale):
                raise ModelError(
                    f"compile=True, but at t = {t:.9g} the compiled field gives {out.tolist()} where the "
                    f"function gives {plain.tolist()}: it reads what has changed since it was compiled. "
                    "Leave compile out."
                )
