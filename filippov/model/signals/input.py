"""Inputs: signals from samples as functions of time in the equations, r(t)."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any, ClassVar
from weakref import WeakValueDictionary

import sympy
from sympy import Expr, Symbol
from sympy.printing.str import StrPrinter

from filippov.base.errors import ModelError
from filippov.base.keywords import keywords
from filippov.base.names import check_name, unknown
from filippov.model.signals.columns import read_columns
from filippov.model.signals.samples import ORDERS, Samples
from filippov.model.symbols import t

OPTIONS = ("kind", "outside", "period")
_OTHER_FILE = (
    "{0} is not known: columns are separated by commas, with a decimal point. Read another file with pandas: "
    "table = pandas.read_csv(path, {0}=...), then Input(name, table['t'], table['u'])."
)
_READ_BY_PANDAS = {
    key: _OTHER_FILE.format(key) for key in ("sep", "delimiter", "decimal", "skiprows", "header")
}
_KINDS: WeakValueDictionary[tuple[str, str, int], Any] = WeakValueDictionary()


class InputSymbol(Symbol):
    """The symbol of an input while a model is read: it may have any value at any time."""

    __slots__ = ()


class Input:
    """r(t) from samples: r = Input("r", times, values), then r in equations, surfaces and resets.

    name        an identifier, no state's and no parameter's
    t, values   increasing times and the values there: arrays, lists, or columns of a table. A pandas Series
                may be given alone: its index holds the times
    kind        "linear"; "hold": each value until the next time; "cubic": the spline through all of them
                (scipy's CubicSpline, not-a-knot, or periodic)
    outside     "refuse" a run over times that have no samples, or "hold" the first and the last value there
    period      repeat the samples: a number; the first sample comes again one period later

    Runs reach the knots exactly, to the last bit, like the instants of a time event, and no step passes over
    one. At a knot where the signal or its slope jumps the mode is decided again if it can change; no event is
    recorded for it, and the step size is kept. `r.diff(t)` is its derivative, `r.samples.at(times)` its
    values. Raises ModelError.
    """

    @keywords("keyword", error=ModelError, own=("name", "t"))
    def __new__(
        cls, name: str, t: Any, values: Any = None, kind: str = "linear", *, outside: str = "refuse",
        period: float | None = None,
    ) -> Expr:  # fmt: skip
        """Make the function of time."""
        checked = check_input_name(name)
        _refuse_no_column(checked, t, values)
        if values is None and hasattr(t, "index") and hasattr(t, "to_numpy"):
            t, values = t.index.to_numpy(), t.to_numpy()
        return input_of(Samples(checked, t, values, kind, outside, period))

    @classmethod
    @keywords("keyword", error=ModelError)
    def from_csv(
        cls, name: str, path: str | Path, *, time: str | int = 0, value: str | int | None = None,
        **options: Any,
    ) -> Expr:  # fmt: skip
        """The input from two columns of a file of numbers separated by commas.

        time, value   the columns, by their titles in the first line, or by number from 0; default: the
                      first, and the one titled as the input, else the second
        options       kind, outside, period as in `Input`
        """
        unknown_ones = [key for key in options if key not in OPTIONS]
        if unknown_ones:
            raise ModelError(
                _READ_BY_PANDAS.get(unknown_ones[0])
                or unknown("keyword", unknown_ones[0], ("path", "time", "value", *OPTIONS))
            )
        made: Any = cls
        own = {1: name} if value is None else None
        columns = read_columns(Path(path), (time, 1 if value is None else value), own)
        out: Expr = made(name, *columns, **options)
        return out


def _refuse_no_column(name: str, times: Any, values: Any) -> None:
    """Raise ModelError for a file, a function or a whole table in place of columns."""
    if isinstance(times, str | Path):
        raise ModelError(
            f"input {name!r}: t is the text {str(times)!r}, expected times. Read a file with "
            f"Input.from_csv({name!r}, {str(times)!r})."
        )
    for what, given in (("t", times), ("values", values)):
        if callable(given) and not isinstance(given, sympy.Basic):
            raise ModelError(
                f"input {name!r}: {what} is a function, expected samples. Give Input({name!r}, times, "
                "f(times)), or write the formula itself, in filippov.t: sin(3*t)."
            )
        if hasattr(given, "columns") and hasattr(given, "to_numpy"):
            titles = [str(title) for title in given.columns]
            first, second = titles[0] if titles else "t", titles[-1] if titles else "u"
            raise ModelError(
                f"input {name!r}: {what} is a table with the columns {', '.join(titles)}, expected one "
                f"column. Give Input({name!r}, table[{first!r}], table[{second!r}])."
            )


class Sampled(sympy.Function):
    """The function of time that samples stand for, or its derivative of an order."""

    nargs = 1
    samples: ClassVar[Samples]
    order: ClassVar[int]

    @classmethod
    def eval(cls, time: Expr) -> Expr | None:
        """Return the number at a number."""
        if cls.order >= ORDERS[cls.samples.kind]:
            return sympy.S.Zero
        if time.is_number and time.is_comparable:
            return sympy.Float(cls.samples.at(float(time), cls.order))
        return None

    def fdiff(self, argindex: int = 1) -> Expr:
        """Return the derivative by time."""
        return input_of(self.samples, self.order + 1, self.args[0])

    def _eval_is_extended_real(self) -> bool:
        return True

    def _eval_is_finite(self) -> bool:
        return True

    def _sympyrepr(self, printer: Any, *args: Any) -> str:
        return f"Input({self.func.__name__!r}, {self.samples.digest!r}, {printer._print(self.args[0])})"

    def __reduce_ex__(self, protocol: Any) -> Any:
        return input_of, (self.samples, self.order, self.args[0])


def input_of(samples: Samples, order: int = 0, time: Expr = t) -> Expr:
    """The signal of samples at a time, or its derivative of an order."""
    return _kind(samples, order)(time)


def _kind(samples: Samples, order: int) -> Any:
    """The function that samples stand for: one for equal samples, so that equal inputs are equal."""
    key = samples.name, samples.digest, order
    found = _KINDS.get(key)
    if found is None:
        content = {
            "samples": samples, "order": order, "nargs": 1, "__module__": __name__,
            "_imp_": staticmethod(lambda time: samples.at(time, order)),
        }  # fmt: skip
        made: Any = type(Sampled)
        found = made(samples.name + ("_" + "d" * order if order else ""), (Sampled,), content)
        _KINDS[key] = found
    return found


def check_input_name(name: object) -> str:
    """Return a name that an input may have; ModelError for a function's."""
    from filippov.model.expression import FUNCTIONS

    if not isinstance(name, str):
        raise ModelError(
            f"an input has the name {name!r}, expected text. It goes first: Input('r', times, values)."
        )
    text = check_name(name, "input")
    # A printer asks by the name of its class what to do with a function.
    if text in FUNCTIONS or text == "pi" or hasattr(StrPrinter, f"_print_{text}"):
        raise ModelError(f"input name {text!r} is taken by a function. Give the input another name.")
    return text


def inputs_in(expressions: Iterable[Any]) -> tuple[Samples, ...]:
    """The samples of the inputs in expressions, by name. Raises ModelError for two of one name."""
    found: dict[str, Samples] = {}
    for e in expressions:
        for node in e.atoms(Sampled) if isinstance(e, sympy.Basic) and e.args else ():
            if node.args[0] != t:
                raise ModelError(f"input {node.samples.name!r} is taken at {node.args[0]}, expected at t.")
            known = found.setdefault(node.samples.name, node.samples)
            if known.digest != node.samples.digest:
                raise ModelError(
                    f"two inputs are named {known.name!r}, with different samples. Rename one of them."
                )
    return tuple(found[name] for name in sorted(found))


def sampled_in(e: Expr) -> list[Any]:
    """The inputs and derivatives of inputs in an expression, in a fixed order."""
    return sorted(e.atoms(Sampled), key=lambda node: (node.samples.name, node.order))


def as_symbols(expressions: Iterable[Any]) -> dict[Expr, Symbol]:
    """A symbol for each input, and for each derivative of one, in expressions."""
    nodes = set().union(*(e.atoms(Sampled) for e in expressions if isinstance(e, sympy.Basic)))
    return {node: InputSymbol(str(node), real=True) for node in nodes}
