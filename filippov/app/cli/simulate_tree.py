"""filippov simulate --nonunique branch: every solution, as a tree."""

from __future__ import annotations

from typing import Any

from filippov import Problem, solve
from filippov.app.cli.console import Console
from filippov.app.cli.folder import Folder
from filippov.app.cli.solved import event_data, solver_options
from filippov.base.escape import figure_text
from filippov.base.status import Status, mode_text
from filippov.solving.solution_tree import Path, SolutionTree

COLUMNS = ("solution", "branches", "modes", "status", "t_end")
TREE = ("max_branches", "max_depth", "release_times")


def run(name: str, problem: Problem, settings: dict[str, Any], console: Console, folder: Folder) -> int:
    """Follow every mode that can follow; write the tree, its table and its pictures."""
    options = solver_options(settings) | {"nonunique": "branch"}
    options |= {key: settings[key] for key in TREE if settings.get(key) is not None}
    start = problem.t_span[0]
    with console.progress("simulate") as progress:
        tree: SolutionTree = solve(
            problem,
            progress=lambda t, end: progress(abs(t - start), abs(end - start), f"t = {t:.6g}"),
            **options,
        )
    states = problem.system.states
    console.result(tree_data(name, tree))
    console.say(repr(tree))
    paths = tree.paths()
    width = max(len(_words(path)) for path in paths)
    for path in paths:
        end = ", ".join(f"{q} = {v:.9g}" for q, v in zip(states, path.x_end, strict=True))
        console.say(f"{path.number:4d}  {_words(path):{width}}  {path.status.value:10}  {end}")
    folder.csv("solutions.csv", COLUMNS + states, (_row(path) for path in paths))
    folder.json("tree.json", tree_data(name, tree))
    folder.file("tree.npz", tree.save)
    if tree.status is not Status.INTERRUPTED:
        folder.picture("branches.png", lambda: tree.plot(title=figure_text(name)))
        folder.picture("tree.png", lambda: tree.plot_tree(title=figure_text(name)))
    folder.report()
    if tree.success:
        console.say(tree.message)
        return 0
    console.warn(f"{tree.status.value}: {tree.message}")
    return 130 if tree.status is Status.INTERRUPTED else 1


def tree_data(name: str, tree: SolutionTree) -> dict[str, Any]:
    """The tree by name: its branches with their places in it, its solutions with their events."""
    problem, states = tree.problem, tree.system.states
    return {
        "model": name,
        "parameters": dict(problem.parameters),
        "x0": dict(zip(states, problem.x0.tolist(), strict=True)),
        "t_span": list(problem.t_span),
        "status": tree.status.value,
        "success": tree.success,
        "message": tree.message,
        "branches": [
            {
                "number": branch.number,
                "parent": branch.parent,
                "depth": branch.depth,
                "at": branch.ambiguity.name if branch.ambiguity is not None else None,
                "mode": branch.mode,
                "t0": branch.t0,
                "t1": branch.t1,
                "status": branch.solution.status.value,
                "children": list(branch.children),
            }
            for branch in tree.branches
        ],
        "solutions": [
            {
                "branches": [branch.number for branch in path.branches],
                "modes": list(path.modes),
                "status": path.status.value,
                "message": path.message,
                "t_end": path.t_end,
                "x_end": dict(zip(states, path.x_end.tolist(), strict=True)),
                "end_mode": mode_text(path.end_mode),
                "events": [event_data(event, states) for event in path.events],
            }
            for path in tree.paths()
        ],
    }


def _words(path: Path) -> str:
    return " ".join(path.modes)


def _row(path: Path) -> list[Any]:
    numbers = " ".join(str(branch.number) for branch in path.branches)
    return [path.number, numbers, _words(path), path.status.value, path.t_end, *path.x_end.tolist()]
