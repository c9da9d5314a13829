"""Trees of solutions as files: one uncompressed npz with a header in JSON (see `filippov.io.storage`).

The header contains the system and the options once, and the description of each branch; the arrays of all
branches are concatenated in `floats` and `integers`, with their names and shapes in the header.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from filippov.base.errors import UsageError
from filippov.base.given import Count
from filippov.base.keywords import keywords
from filippov.base.read_whole import content_of
from filippov.base.status import Status
from filippov.io.archive import Archive, refuse_other_ending
from filippov.io.storage import (
    MAX_BYTES,
    ambiguity_data,
    ambiguity_of,
    check_seal,
    check_system,
    read_header,
    solution_arrays,
    solution_header,
    solution_of,
    stored_system_of,
    write_sealed,
)
from filippov.model.system import System
from filippov.solving.solution_tree import SolutionTree, TreeBranch
from filippov.solving.state.problem import Problem

FORMAT, VERSION = "filippov tree of solutions", 1
SHARED = ("format", "version", "filippov", "digest", "system", "states", "surfaces", "parameters", "options")
MOST_BRANCHES = 100_000
Array = npt.NDArray[Any]


def save_tree(tree: SolutionTree, path: str | Path) -> Path:
    """Write a tree; the file appears complete or not at all. Returns the path, used as it is."""
    if not isinstance(tree, SolutionTree):
        raise UsageError(f"save_tree was given {type(tree).__name__}, expected a SolutionTree.")
    refuse_other_ending(path, "tree.branches[0].solution")
    parts: dict[str, list[Array]] = {"f": [np.zeros(0)], "i": [np.zeros(0, dtype=np.int64)]}
    rows = []
    for branch in tree.branches:
        arrays = solution_arrays(branch.solution)
        header = solution_header(branch.solution)
        for array in arrays.values():
            parts[array.dtype.kind].append(array.ravel())
        rows.append(
            {
                "parent": branch.parent,
                "depth": branch.depth,
                "chosen": _number(branch),
                "ambiguity": None if branch.ambiguity is None else ambiguity_data(branch.ambiguity),
                "solution": {key: value for key, value in header.items() if key not in SHARED},
                "arrays": [[name, array.dtype.kind, list(array.shape)] for name, array in arrays.items()],
            }
        )
    shared = solution_header(tree.root.solution)
    header = {key: shared[key] for key in SHARED} | {
        "format": FORMAT,
        "version": VERSION,
        "x0": tree.problem.x0.tolist(),
        "t_span": list(tree.problem.t_span),
        "status": tree.status.value,
        "message": tree.message,
        "branches": rows,
    }
    arrays = {"floats": np.concatenate(parts["f"]), "integers": np.concatenate(parts["i"])}
    return write_sealed(path, header, arrays)


def _number(branch: TreeBranch) -> int | None:
    """Which of the candidates was taken."""
    if branch.ambiguity is None or branch.chosen is None:
        return None
    return branch.ambiguity.candidates.index(branch.chosen)


@keywords()
def load_tree(
    path: str | Path, system: System | None = None, *, max_bytes: Count = MAX_BYTES
) -> SolutionTree:
    """Read a tree written by `save_tree`; system and max_bytes as for `filippov.io.storage.load`."""
    check_system(system)
    with Archive(path, max_bytes) as archive:
        header = read_header(archive, FORMAT, VERSION)
        if archive.names != {"header", "floats", "integers"}:
            raise archive.refuse(f"does not hold the entries of format version {VERSION}")
        arrays = {name: archive.read(name) for name in ("floats", "integers")}
        check_seal(header, arrays, archive)
        data = {"f": arrays["floats"], "i": arrays["integers"]}
        with content_of(archive.path):
            return _tree(header, data, stored_system_of(header, system, archive))


def _tree(header: dict[str, Any], data: dict[str, Array], system: System) -> SolutionTree:
    rows = header["branches"]
    if not 0 < len(rows) <= MOST_BRANCHES:
        raise ValueError(f"{len(rows)} branches")
    children: list[list[int]] = [[] for _ in rows]
    position = {"f": 0, "i": 0}
    branches: list[TreeBranch] = []
    for number, row in enumerate(rows):
        parent = row["parent"]
        if (parent is None) != (number == 0) or (parent is not None and not 0 <= parent < number):
            raise ValueError(f"branch {number} has the parent {parent}")
        if parent is not None:
            children[parent].append(number)
        arrays = {}
        for name, kind, shape in row["arrays"]:
            size = math.prod(shape)
            if size < 0 or position[kind] + size > len(data[kind]):
                raise ValueError(f"branch {number}: {name} is cut off")
            arrays[name] = data[kind][position[kind] : position[kind] + size].reshape(shape).copy()
            position[kind] += size
        ambiguity = None if row["ambiguity"] is None else ambiguity_of(row["ambiguity"])
        chosen = None if ambiguity is None else ambiguity.candidates[row["chosen"]]
        solution = solution_of({**header, **row["solution"]}, arrays, system)
        branches.append(TreeBranch(number, parent, int(row["depth"]), chosen, ambiguity, solution))
    done = tuple(
        TreeBranch(b.number, b.parent, b.depth, b.chosen, b.ambiguity, b.solution, tuple(numbers))
        for b, numbers in zip(branches, children, strict=True)
    )
    low, high = header["t_span"]
    problem = Problem(system, header["x0"], (low, high), header["parameters"], high < low)
    return SolutionTree(problem, done, Status(header["status"]), str(header["message"]))
