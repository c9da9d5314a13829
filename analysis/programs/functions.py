"""The functions of Python, math and numpy that a program may call, by what they are in formulas."""

from __future__ import annotations

import bisect
import builtins
import math
import operator
from collections.abc import Callable
from typing import Any

import numpy as np
import sympy
from numpy import linalg

from filippov.base.elementary import ELEMENTARY

Formula = Callable[..., Any]
_NUMPY = {
    "asin": "arcsin", "acos": "arccos", "atan": "arctan", "atan2": "arctan2", "asinh": "arcsinh",
    "acosh": "arccosh", "atanh": "arctanh",
}  # fmt: skip


def _smooth() -> dict[Any, Formula]:
    table: dict[Any, Formula] = {}
    for row in ELEMENTARY:
        if row.formula:
            for holder, name in ((math, row.name), (np, _NUMPY.get(row.name, row.name))):
                if hasattr(holder, name):
                    table[getattr(holder, name)] = getattr(sympy, row.symbolic)
    both: dict[str, Formula] = {
        "sqrt": sympy.sqrt,
        "expm1": lambda x: sympy.exp(x) - 1,
        "log1p": lambda x: sympy.log(1 + x),
        "log10": lambda x: sympy.log(x) / sympy.log(10),
        "log2": lambda x: sympy.log(x) / sympy.log(2),
        "hypot": lambda x, y: sympy.sqrt(x**2 + y**2),
        "radians": lambda x: x * sympy.pi / 180,
        "degrees": lambda x: x * 180 / sympy.pi,
    }
    for name, formula in both.items():
        table[getattr(math, name)] = table[getattr(np, name)] = formula
    table |= {
        math.pow: operator.pow, np.power: operator.pow, np.float_power: operator.pow, pow: operator.pow,
        np.square: lambda x: x**2, np.reciprocal: lambda x: 1 / x, np.exp2: lambda x: 2**x,
        np.negative: operator.neg, np.add: operator.add, np.subtract: operator.sub,
        np.multiply: operator.mul, np.divide: operator.truediv, np.sinc: lambda x: sympy.sinc(sympy.pi * x),
        np.deg2rad: lambda x: x * sympy.pi / 180, np.rad2deg: lambda x: x * 180 / sympy.pi,
    }  # fmt: skip
    return table


# Functions without jumps and corners, as formulas of their arguments.
SMOOTH = _smooth()

# Those that switch: the method of the reader that does them.
SWITCHING: dict[Any, str] = {
    np.sign: "sign", math.copysign: "copysign", np.copysign: "copysign", np.heaviside: "heaviside",
    builtins.abs: "magnitude", math.fabs: "magnitude", np.abs: "magnitude", np.fabs: "magnitude",
    np.where: "where", np.clip: "clip", np.maximum: "largest", np.fmax: "largest", builtins.max: "largest",
    np.minimum: "least", np.fmin: "least", builtins.min: "least", np.max: "largest", np.min: "least",
    np.select: "select", np.interp: "interpolate", np.cbrt: "cbrt", getattr(math, "cbrt", np.cbrt): "cbrt",
    math.floor: "floor", np.floor: "floor", math.ceil: "ceiling", np.ceil: "ceiling", math.trunc: "whole",
    np.trunc: "whole", int: "whole", round: "nearest", np.round: "nearest", np.rint: "nearest",
    math.fmod: "fmod", np.fmod: "fmod", np.mod: "mod", operator.mod: "mod", np.floor_divide: "divided",
    np.greater: "greater", np.less: "less", np.greater_equal: "greater", np.less_equal: "less",
    np.logical_and: "all_of", np.logical_or: "any_of", np.logical_not: "negated", np.all: "all_of",
    np.any: "any_of", builtins.all: "all_of", builtins.any: "any_of", bool: "as_bool", float: "as_float",
    np.float64: "as_float", np.linalg.norm: "norm", math.dist: "distance", np.signbit: "negative",
    builtins.isinstance: "instance", math.isnan: "never", np.isnan: "never", np.isfinite: "always",
    math.isfinite: "always", np.sum: "total", builtins.sum: "total", math.fsum: "total",
    math.isclose: "close",
    np.isclose: "close", np.allclose: "close", np.piecewise: "piecewise", np.vdot: "inner",
    np.amax: "largest", np.amin: "least", np.nan_to_num: "finite", builtins.divmod: "divided_and_rest",
    np.divmod: "divided_and_rest", np.argmax: "place_of_largest", np.argmin: "place_of_least",
    builtins.sorted: "in_order", np.sort: "sorted_array", np.median: "middle", np.ptp: "extent",
    np.var: "variance", np.std: "deviation", np.searchsorted: "place_in", np.digitize: "bin_of",
    bisect.bisect: "place_right", bisect.bisect_left: "place_left",
    linalg.solve: "solved", linalg.inv: "inverse", linalg.det: "determinant", np.einsum: "summed",
}  # fmt: skip

# Those that put values together or take them apart: done by themselves, on arrays of objects.
BUILDING = {
    np.array, np.asarray, np.atleast_1d, np.concatenate, np.hstack, np.vstack, np.stack, np.column_stack,
    np.append, np.ravel, np.reshape, np.transpose, np.dot, np.matmul, np.inner, np.outer, np.cross,
    np.diff, np.roll, np.flip, np.cumsum, np.prod, np.mean, np.squeeze, np.copy, np.diag, np.tile,
    np.repeat, np.zeros_like,
    np.empty_like, np.ones_like, np.full, np.full_like, np.trace, np.kron, np.tensordot, np.split,
    np.array_split,
    builtins.list, builtins.tuple, builtins.len, builtins.range, builtins.zip, builtins.enumerate,
    builtins.reversed, builtins.dict,
}  # fmt: skip
METHODS = {"copy", "flatten", "ravel", "reshape", "dot", "tolist", "transpose", "squeeze", "keys", "values",
           "items", "get", "index", "count", "astype", "item", "mean", "prod", "cumsum", "fill"}  # fmt: skip
# Those whose doing is not part of the field: a print, a check.
SILENT = {builtins.print}
# What to write in place of some that are not followed.
_CASES = "write its cases with if"
_INTERPOLATION = "np.interp(u, x, y) is followed"
INSTEAD = {
    "square": "np.where(t % T < T/2, 1, -1) is followed", "sawtooth": "t % T is followed",
    **dict.fromkeys(("argsort", "unwrap", "percentile", "quantile", "unique"), _CASES),
    **dict.fromkeys(
        ("interp1d", "make_interp_spline", "CubicSpline", "PchipInterpolator", "Akima1DInterpolator",
         "BSpline", "UnivariateSpline", "InterpolatedUnivariateSpline", "splev"), _INTERPOLATION,
    ),
}  # fmt: skip
UNSTEADY = ("random", "numpy.random", "time", "datetime", "secrets", "uuid")


def is_library(function: Any) -> bool:
    """Whether a function belongs to Python, numpy or scipy: it may be called with plain numbers."""
    home = str(getattr(function, "__module__", None) or "numpy")
    return home.partition(".")[0] in {"builtins", "math", "numpy", "operator", "scipy"} or home == "_operator"


def is_unsteady(function: Any) -> bool:
    """Whether a function gives another value each time it is called."""
    home = str(getattr(function, "__module__", "") or "")
    owner = getattr(function, "__self__", None)
    if owner is not None and not isinstance(owner, type(math)):
        home = type(owner).__module__ or home
    return home.lstrip("_").startswith(UNSTEADY) or (
        isinstance(owner, type(math)) and owner.__name__ in UNSTEADY
    )


def not_followed(function: Any) -> str:
    """What to say of a function without a formula, with what to write in its place."""
    name = str(getattr(function, "__name__", type(function).__name__))
    instead = INSTEAD.get(name, "write it with if, min, max, abs, np.where, np.interp or % of the time")
    return f"{name} is not among the functions that are followed; {instead}"
