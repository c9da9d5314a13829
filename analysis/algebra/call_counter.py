"""Calls of Python functions counted in machine code, by the hook for the evaluation of frames of PEP 523.

A trace hook counts the same and makes sympy take more than twice as long: it is what counts where another
trace hook is at work, in a second thread, and in interpreters without this hook.
"""

from __future__ import annotations

import ctypes
import threading
from collections.abc import Callable
from functools import cache
from typing import Any

from llvmlite import ir

from filippov.kernel.language.compiler import load_module

CALLS, LIMIT = 0, 1
NEVER = 2**62
_THREAD, _CELLS, _NEXT = 0, 1, 2
# An exception that the handler raised may be lost, as in a callback: it is told again after so many calls.
_AGAIN = 10_000
_EVALUATE = "_PyEval_EvalFrameDefault"
_GET, _SET = "_PyInterpreterState_GetEvalFrameFunc", "_PyInterpreterState_SetEvalFrameFunc"


def cells() -> Any:
    """The calls so far and their limit."""
    return (ctypes.c_int64 * 2)(0, NEVER)


class CallCounter:
    """Counts the calls of one thread at a time, and tells `handler` of those beyond the limit."""

    def __init__(self) -> None:
        self.handler: Callable[[], None] = _nothing
        self.control = (ctypes.c_int64 * 3)(0, 0, 0)
        self.lock = threading.Lock()
        python = ctypes.pythonapi
        self._set = getattr(python, _SET)
        self._set.argtypes, self._set.restype = [ctypes.c_void_p, ctypes.c_void_p], None
        self._get = getattr(python, _GET)
        self._get.argtypes, self._get.restype = [ctypes.c_void_p], ctypes.c_void_p
        self._default = _address(_EVALUATE)
        self._told = self._tell  # one object, of which the machine code holds the address
        python.PyInterpreterState_Get.restype = python.PyThreadState_Get.restype = ctypes.c_void_p
        self._interpreter, self._thread = python.PyInterpreterState_Get(), python.PyThreadState_Get
        self.engine = load_module(_written(ctypes.addressof(self.control), id(self._told), self._default))
        self._counting = self.engine.get_function_address("counting")

    def _tell(self) -> None:
        self.handler()

    def start(self, count: Any, handler: Callable[[], None]) -> bool:
        """Count into `cells` until `stop`; False where another thread or another hook is at work."""
        if self._get(self._interpreter) != self._default or not self.lock.acquire(blocking=False):
            return False
        self.handler = handler
        self.control[_CELLS], self.control[_NEXT] = ctypes.addressof(count), 0
        self.control[_THREAD] = self._thread()
        self._set(self._interpreter, self._counting)
        return True

    def again(self) -> None:
        """The limit is another one: tell the handler of the next call beyond it."""
        self.control[_NEXT] = 0

    def stop(self) -> None:
        """Count no more."""
        self._set(self._interpreter, self._default)
        self.control[_THREAD] = 0
        self.handler = _nothing
        self.lock.release()


@cache
def call_counter() -> CallCounter | None:
    """The counter of this interpreter; None where it has no such hook."""
    names = (_GET, _SET, _EVALUATE, "PyObject_CallNoArgs", "PyInterpreterState_Get", "PyThreadState_Get")
    return CallCounter() if all(hasattr(ctypes.pythonapi, name) for name in names) else None


def _nothing() -> None:
    pass


def _address(name: str) -> int:
    return ctypes.cast(getattr(ctypes.pythonapi, name), ctypes.c_void_p).value or 0


def _written(control: int, told: int, evaluate: int) -> str:
    """The function that evaluates a frame after it has counted it, as LLVM IR."""
    word, whole, pointer = ir.IntType(64), ir.IntType(32), ir.IntType(8).as_pointer()
    module = ir.Module("counting")
    evaluated = ir.FunctionType(pointer, (pointer, pointer, whole))
    function = ir.Function(module, evaluated, "counting")
    thread, frame, thrown = function.args
    entry, counts, asks, tells, drops, interrupted, goes_on = map(
        function.append_basic_block,
        ("entry", "counts", "asks", "tells", "drops", "interrupted", "goes_on"),
    )

    b = ir.IRBuilder(entry)

    def constant(address: int, kind: ir.Type) -> Any:
        return b.inttoptr(ir.Constant(word, address), kind.as_pointer())

    def of_python(name: str, kind: ir.FunctionType) -> Any:
        return constant(_address(name), kind)

    own = b.load(constant(control + 8 * _THREAD, word))
    # Where an exception is thrown into a frame nothing is called, and nothing else can be.
    called = b.icmp_signed("==", thrown, ir.Constant(whole, 0))
    b.cbranch(b.and_(called, b.icmp_signed("==", own, b.ptrtoint(thread, word))), counts, goes_on)
    b.position_at_end(counts)
    kept = b.inttoptr(b.load(constant(control + 8 * _CELLS, word)), word.as_pointer())
    calls = b.add(b.load(kept), ir.Constant(word, 1))
    b.store(calls, kept)
    limit = b.load(b.gep(kept, [ir.Constant(word, LIMIT)]))
    b.cbranch(b.icmp_signed(">", calls, limit), asks, goes_on)
    b.position_at_end(asks)
    next_time = b.load(constant(control + 8 * _NEXT, word))
    b.cbranch(b.icmp_signed(">", calls, next_time), tells, goes_on)
    b.position_at_end(tells)
    b.store(b.add(calls, ir.Constant(word, _AGAIN)), constant(control + 8 * _NEXT, word))
    handler = b.inttoptr(ir.Constant(word, told), pointer)
    result = b.call(of_python("PyObject_CallNoArgs", ir.FunctionType(pointer, (pointer,))), [handler])
    b.cbranch(b.icmp_unsigned("==", b.ptrtoint(result, word), ir.Constant(word, 0)), interrupted, drops)
    b.position_at_end(drops)
    b.call(of_python("Py_DecRef", ir.FunctionType(ir.VoidType(), (pointer,))), [result])
    b.branch(goes_on)
    b.position_at_end(interrupted)
    # The handler raises nothing of its own: an interrupt that came in it comes once more, in Python.
    for name in ("PyErr_Clear", "PyErr_SetInterrupt"):
        b.call(of_python(name, ir.FunctionType(ir.VoidType(), ())), [])
    b.branch(goes_on)
    b.position_at_end(goes_on)
    b.ret(b.call(constant(evaluate, evaluated), [thread, frame, thrown], tail=True))
    return str(module)
