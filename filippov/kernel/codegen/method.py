"""Source text of the method's part of a compiled unit: stages and error terms.

Those of an explicit method are its tableau written out; those of an implicit one are kernel files.
"""

from filippov.kernel.files import kernel_file
from filippov.kernel.language.unit import Constant
from filippov.kernel.tables.root_tables import DEGREE, by_degree, to_bernstein
from filippov.kernel.tables.tableaus import DOP853, Collocation, Method, Row, Series, Tableau, weighted

_IMPLICIT = ("radau", "jacobian", "band_lu", "dense_lu")
# What a file imports comes after it: the functions made for the system take the place of those imported.
_SERIES = ("taylor", "inside")
_SIGNATURE = "t: float, x: Vector, p: Vector, m: Vector"
_SCRATCH = "w: Scratch, iw: Integers, ctx: Indices"


def _advanced(row: Row) -> str:
    """x + step * sum, with the latest stage added last: everything else is ready before it."""
    *early, late = row.items()
    first = f"(x[i] + step * ({_sum(dict(early))}))" if early else "x[i]"
    return f"{first} + (step * {late[1]!r}) * w.k[{late[0]} * N + i]"


def _sum(row: Row) -> str:
    return " + ".join(f"{value!r} * w.k[{stage} * N + i]" for stage, value in row.items())


def _stage(row: Row, node: float, target: int, sliding: bool | None = None) -> list[str]:
    place, out = f"t + {node!r} * step, w.stage", f"shift(w.k, {target} * N)"
    lines = ["    for i in range(N):", f"        w.stage[i] = {_advanced(row)}"]
    if sliding is not None:
        call = f"field({place}, p, m, {out}, w, iw, ctx)" if sliding else f"rhs({place}, p, m, m, {out}, ctx)"
        return [*lines, f"    {call}"]
    return [
        *lines,
        "    if iw.sliding == 0:",
        f"        code = rhs({place}, p, m, m, {out}, ctx)",
        "    else:",
        f"        code = field({place}, p, m, {out}, w, iw, ctx)",
        "    if code != 0:",
        "        return code",
    ]


def method_source(method: Method) -> str:
    """The functions `stages`, `extra_stages` and `error_terms` of the interface in `model`.

    `free_stages` and `sliding_stages` are explicit `stages` for lanes: none of them slides, or some do.
    """
    if isinstance(method, Collocation):
        return "\n\n".join(kernel_file(name).read_text(encoding="utf-8") for name in _IMPLICIT)
    if isinstance(method, Series):
        files = (kernel_file(name).read_text(encoding="utf-8") for name in _SERIES)
        return "\n\n".join(files) + _stand_in()
    return _explicit_source(method)


def _explicit_source(tableau: Tableau) -> str:
    lines = ["@contract", f"def stages({_SIGNATURE}, step: float, y: Vector, {_SCRATCH}) -> int:"]
    for target, (row, node) in enumerate(zip(tableau.main, tableau.main_nodes, strict=False), start=1):
        lines += _stage(row, node, target)
    lines += ["    if iw.sliding == 0:", f"        iw.calls += {len(tableau.main) - 1}"]
    lines += ["    for i in range(N):", f"        y[i] = {_advanced(tableau.main[-1])}", "    return 0"]
    for name, sliding in (("free", False), ("sliding", True)):
        lines += ["", "", "@contract"]
        lines += [f"def {name}_stages({_SIGNATURE}, step: float, y: Vector, {_SCRATCH}) -> int:"]
        for target, (row, node) in enumerate(zip(tableau.main, tableau.main_nodes, strict=False), start=1):
            lines += _stage(row, node, target, sliding)
        lines += ["    for i in range(N):", f"        y[i] = {_advanced(tableau.main[-1])}", "    return 0"]
    lines += ["", "", "@contract", f"def extra_stages({_SIGNATURE}, step: float, {_SCRATCH}) -> int:"]
    for offset, (row, node) in enumerate(zip(tableau.extra, tableau.extra_nodes, strict=True)):
        lines += _stage(row, node, tableau.stages + offset)
    lines += [
        "    return 0",
        "",
        "",
        "@contract",
        "def error_terms(i: int, w: Scratch) -> tuple[float, float]:",
    ]
    estimates = [f"({_sum(row)})" for row in tableau.errors] + ["0.0"]
    lines += [f"    return {estimates[0]}, {estimates[1]}", "", ""]
    return "\n".join(lines)


def _stand_in() -> str:
    """The stages of DOP853 under other names, for modes without Taylor coefficients."""
    text = _explicit_source(DOP853).replace("w.k", "w.rk")
    for name in ("stages", "extra_stages", "error_terms"):
        text = text.replace(f"def {name}(", f"def explicit_{name}(")
    return "\n\n" + text


def method_constants(tableau: Method) -> dict[str, Constant]:
    """The constants of the interface in `model` that belong to the method."""
    series = isinstance(tableau, Series)
    degree = tableau.order if series else DEGREE
    constants: dict[str, Constant] = {
        "STAGES": tableau.stages,
        "EXTRA": len(tableau.extra),
        "DEGREE_DENSE": len(tableau.dense[0]) - 1,
        "PER_NODE": _per_node(tableau),
        "ORDER": _error_order(tableau),
        "IMPLICIT": isinstance(tableau, Collocation),
        "SERIES": series,
        "END_IN_ERROR": tableau.end_in_error,
        "DENSE": [value for row in tableau.dense for value in row],
        "DENSE_BERNSTEIN": to_bernstein(tableau.dense, degree),
        "WEIGHTED": weighted(tableau.dense),
        "WEIGHTED_STAGES": len(weighted(tableau.dense)),
    }
    if series:
        stand_in = [value for row in DOP853.dense for value in row]
        constants |= {**by_degree(degree), "STAND_IN": stand_in, "STAND_IN_STAGES": len(DOP853.dense)}
        constants["PER_POWER"] = [1.0 / (k + 1) for k in range(degree)]
    return constants


def _error_order(method: Method) -> int:
    """The power of the step with which the error estimate scales."""
    if isinstance(method, Collocation):
        return method.error_order
    return method.order + 1 if isinstance(method, Series) else method.order


def _per_node(method: Method) -> list[float]:
    """1 / theta of every main stage, 1 at the start of the step."""
    if isinstance(method, Collocation | Series):
        return [1.0] * method.stages
    return [1.0, *[1.0 / node for node in method.main_nodes], 1.0]
