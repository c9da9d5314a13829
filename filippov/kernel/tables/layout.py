"""Where everything of a trajectory's scratch stands: offsets into an array of doubles and one of integers."""

from dataclasses import dataclass

from filippov.kernel.tables.radau_tables import MEMORY
from filippov.kernel.tables.root_tables import DEGREE, DEPTH, NODES
from filippov.kernel.tables.tableaus import Collocation, Method

SPLITS, CHECKS = 10, 2
MULTIPLIER, LEAST, MOST, RATE_PLUS, RATE_MINUS, SLOPE, COLUMNS = 0, 1, 2, 3, 4, 5, 6
MOST_ENUMERATED = 6
# Trajectories side by side in a lane kernel: two vectors keep a processor busier whose vectors hold 8.
LANES, MOST_LANES = 8, 16
# Rules of sliding by name, in the order of their numbers in `rules`.
RULES = ("filippov", "moments", "utkin")


@dataclass(frozen=True)
class Layout:
    """Constants of a unit and the sizes of its scratch arrays."""

    constants: dict[str, int]
    doubles: int
    integers: int
    powers: int


def layout(
    n: int,
    m: int,
    affine: bool,
    tableau: Method,
    colours: int,
    largest: int,
    moments: bool = False,
    points: int | None = None,
) -> Layout:
    """Offsets W_... (doubles) and I_... (integers) for n states and m surfaces.

    colours: field calls that give the derivatives by all signs; largest: surfaces in the largest component;
    points: parameters of a field that is sampled in lanes (see `points`).
    """
    vertices = colours + 1 if affine else 2 ** min(m, MOST_ENUMERATED) + 1
    weights = 2 ** min(m, MOST_ENUMERATED) if moments and not affine else 0
    side = max(largest, 1) if affine else max(m, 1)
    powers = len(tableau.dense[0])
    # What an implicit method keeps from step to step; nothing for an explicit one.
    implicit = n if isinstance(tableau, Collocation) else 0
    sizes = {
        "S": m,
        "S2": m,
        "G": m * n,
        "GT": m,
        "VERT": max(vertices, 2) * n,
        "RATE": max(vertices, 2) * side if not affine else 0,
        "MAT": 2 * side * side,
        "VEC": side,
        "MOMENTS": weights * (weights + 1),
        "SLOPE": side,
        "RESIDUAL": m,
        "MULT": m * COLUMNS,
        "K": (tableau.stages + len(tableau.extra)) * n,
        "COEF": powers * n,
        "Y": n,
        "STAGE": n,
        "XE": n,
        "F": n,
        "XM": n,
        "H": m,
        "BEFORE": m,
        "ROW": 2 * m,
        "START": 2 * m,
        "END": 2 * m,
        "RADIUS": 2 * m,
        "TOUCH": m,
        "GRAZED": m,
        "FALL": m,
        "ATTRACT": m,
        "DIRECTION": 1,
        "CREEP": 6 * n,
        "JUMP": n,
        "NODE": NODES * 2 * m,
        "CHECK": CHECKS * 2 * m,
        "C": NODES,
        "WORK": NODES,
        "STACK": (DEPTH + 3) * NODES,
        "BOUNDS": (DEPTH + 3) * 2,
        "PIECES": (4 * SPLITS + 8) * 3,
        "ATOL": implicit,
        "RTOL": 1,
        "SCALE": implicit,
        "JAC": implicit * n,
        "JAC_X": implicit,
        "JAC_MODE": m if implicit else 0,
        "LU": implicit * n,
        "REAL": implicit * n,
        "IMAG": implicit * n,
        "Z": 3 * implicit,
        "W": 3 * implicit,
        "PAST": 3 * implicit,
        "REACHED": implicit,
        "DIFF": 3 * implicit,
        "ERROR": implicit,
        "MEMORY": MEMORY,
        "WIDE": 0 if points is None else LANES * (1 + 3 * n + points + 9 * m + m * n),
    }
    constants: dict[str, int] = {"SIDE": side, "DEGREE": DEGREE, "NODES": NODES}
    position = 0
    for name, size in sizes.items():
        constants[f"W_{name}"] = position
        position += size
    integers = {"SLIDING": 1, "LIST": m, "CALLS": 1, "JACOBIANS": 1, "FACTORS": 1, "KNOWN": 1, "PIECES": 1}
    integers |= {"GROUP": m, "PLACE": m, "PEERS": max(m, 1), "PIVOTS": implicit, "TWINS": implicit}
    count = 0
    for name, size in integers.items():
        constants[f"I_{name}"] = count
        count += size
    return Layout(constants, position, count, powers)
