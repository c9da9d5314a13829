"""The layout of the project: floors, sizes, forbidden calls, packages."""

import ast
import tomllib
from pathlib import Path

import pytest

import filippov
from filippov.delegates import delegate

ROOT = Path(__file__).resolve().parent.parent
FOLDERS = {"filippov": "filippov", "filippov.models": "models", "filippov.analysis": "analysis"}

# A module imports only from lower floors. A package in TOGETHER stands for all its modules.
FLOORS: dict[str, float] = {
    "filippov.delegates": 0,
    "filippov.errors": 0, "filippov.progress": 0, "filippov.status": 0, "filippov.symbolic_value": 0,
    "filippov.version": 0, "filippov.whole_file": 0, "filippov.escape": -1, "filippov.csv_text": 0,
    "filippov.json_text": 0,
    "filippov.failure": 0.1, "filippov.names": 0.1, "filippov.size": 0.1, "filippov.interpolant": 0.1,
    "filippov.symbols": 0.2, "filippov.parameter": 0.2, "filippov.check": 0.2, "filippov.events": 0.2,
    "filippov.expression": 0.3, "filippov.parameter_symbol": 0.3,
    "filippov.surface": 1, "filippov.time_event": 1.01, "filippov.user_event": 1.01,
    "filippov.comparator": 1,
    "filippov.symbolic": 1.1,
    "filippov.table": 1.2,
    "filippov.contact": 1.3, "filippov.spelling": 1.3, "filippov.hysteresis": 1.3,
    "filippov.extract": 1.3, "filippov.kinds": 1.3,
    "filippov.assemble": 1.4, "filippov.equations": 1.4, "filippov.regularize": 1.4,
    "filippov.system": 1.5,
    "filippov._kernels": 2,
    "filippov.event_log": 2.1, "filippov.machine": 2.1, "filippov.options": 2.1,
    "filippov.point": 2.2, "filippov.leading": 2.3, "filippov.attraction": 3.2,
    "filippov.complementarity": 0.1, "filippov.candidate": 3, "filippov.corner": 3.01, "filippov.modes": 3.02,
    "filippov.batch": 3, "filippov.change": 2.2, "filippov.problem": 3, "filippov.run": 3,
    "filippov.gradients": 2.2, "filippov.scale": 4.07,
    "filippov.clocks": 3, "filippov.watched": 3.1, "filippov.ambiguity": 3.1, "filippov.diagnosis": 3.1,
    "filippov.rates": 3.9, "filippov.impact_law": 3.95, "filippov.stiffness": 3.9,
    "filippov.reduction": 2, "filippov.higher_order": 3.05, "filippov.patience": 4.01,
    "filippov.settling": 4.055,
    "filippov.zeno": 3.96, "filippov.slow_spiral": 3.97, "filippov.jumps": 4, "filippov.solution": 4,
    "filippov.reset_cycle": 4.01,
    "filippov.two_fold": 3.01, "filippov.slide_again": 3.15, "filippov.fold_point": 3.2,
    "filippov.solution_tree": 4.05,
    "filippov.loop": 4.06, "filippov.branching": 4.07, "filippov.solver": 4.1,
    "filippov.ensemble": 4.2,
    "filippov.guards": 4.9, "filippov.tree": 4.9, "filippov.archive": 4.9, "filippov.graph_io": 4.9,
    "filippov.stored_system": 4.95, "filippov.reset_guards": 4.95, "filippov.passed": 4.01,
    "filippov.graph": 5, "filippov.word": 5, "filippov.storage": 5, "filippov.export": 5,
    "filippov.tree_storage": 5.1,
    "filippov.user_file": 0.3,
    "filippov.sweep": 6,
    "filippov.style": 6.9, "filippov.plot_graph": 6.95,
    "filippov.plotting": 7, "filippov.plot_maps": 7, "filippov.plot_comparison": 7,
    "filippov.plot_describing": 7, "filippov.plot_identification": 7, "filippov.plot_tuning": 7,
    "filippov.plot_regions": 7, "filippov.plot_lyapunov": 7,
    "filippov.plot_orbits": 7, "filippov.plot_branch": 7,
    "filippov.plot_tree": 7, "filippov.plot_attractors": 7, "filippov.plot_manifold": 7,
    "filippov": 8,
    "filippov.models": 9,
    "filippov.analysis.budget": 9, "filippov.analysis.polynomial": 9, "filippov.analysis.section": 9,
    "filippov.analysis.inequalities": 9.01, "filippov.analysis.routh_array": 9.01,
    "filippov.analysis.routh_result": 9.02, "filippov.analysis.routh_text": 9.03,
    "filippov.analysis.deadline": 9.01, "filippov.analysis.equilibrium": 9.01,
    "filippov.analysis.rest_map": 9.01, "filippov.analysis.drift_map": 9.02,
    "filippov.analysis.exponents": 9.01,
    "filippov.analysis.routh_hurwitz": 9.1, "filippov.analysis.branches": 9.1,
    "filippov.analysis.plain_variation": 9.05, "filippov.analysis.variation": 9.1,
    "filippov.analysis.existence": 9.11, "filippov.analysis.equilibria_numeric": 9.12,
    "filippov.analysis.equilibria": 9.13, "filippov.analysis.linearisation": 9.13,
    "filippov.analysis.forcing": 9.06, "filippov.analysis.orbit_file": 9.06,
    "filippov.analysis.reset_slopes": 9.1,
    "filippov.analysis.gauss_step": 9.2, "filippov.analysis.arcs": 9.25,
    "filippov.analysis.collocation": 9.27, "filippov.analysis.orbit_collocation": 9.28,
    "filippov.analysis.collocation_search": 9.41, "filippov.analysis.search_start": 9.41,
    "filippov.analysis.homoclinic_saddle": 9.26, "filippov.analysis.homoclinic": 9.42,
    "filippov.analysis.saltation": 9.2,
    "filippov.analysis.scalar_map": 9.3, "filippov.analysis.event_map": 9.397, "filippov.analysis.turn": 9.25,
    "filippov.analysis.shooting": 9.25, "filippov.analysis.floquet": 9.26, "filippov.analysis.margin": 9.26,
    "filippov.analysis.oddness": 9.26, "filippov.analysis.orbit": 9.4, "filippov.analysis.orbit_search": 9.42,
    "filippov.analysis.branch": 9.07, "filippov.analysis.branch_problem": 9.43,
    "filippov.analysis.equilibrium_branch": 9.43, "filippov.analysis.special_points": 9.43,
    "filippov.analysis.branch_point": 9.42, "filippov.analysis.corrector": 9.43,
    "filippov.analysis.crossing": 9.44,
    "filippov.analysis.continuation": 9.45, "filippov.analysis.curve": 9.46,
    "filippov.analysis.held_surface": 9.05, "filippov.analysis.touching": 9.42,
    "filippov.analysis.jets": 9.01,
    "filippov.analysis.return_jets": 9.435, "filippov.analysis.smooth_normal_form": 9.436,
    "filippov.analysis.boundary_normal_form": 9.437, "filippov.analysis.border_normal_form": 9.437,
    "filippov.analysis.normal_form": 9.438, "filippov.analysis.codim2": 9.438,
    "filippov.analysis.curve_switch": 9.47,
    "filippov.analysis.discontinuity_map": 9.1, "filippov.analysis.sliding_border": 9.43,
    "filippov.analysis.switch": 9.46,
    "filippov.analysis.stability_result": 9.34, "filippov.analysis.stability_context": 9.35,
    "filippov.analysis.stability_text": 9.35, "filippov.analysis.sliding_stability": 9.36,
    "filippov.analysis.set_stability": 9.37, "filippov.analysis.contact_stability": 9.37,
    "filippov.analysis.clocks": 9.12, "filippov.analysis.planar_cone": 9.01,
    "filippov.analysis.kink_stability": 9.36, "filippov.analysis.smooth_stability": 9.37,
    "filippov.analysis.periodic_sliding": 9.355,
    "filippov.analysis.periodic_stability": 9.36, "filippov.analysis.set_parts": 9.36,
    "filippov.analysis.set_slope": 9.39, "filippov.analysis.time_bounds": 9.05,
    "filippov.analysis.exact_form": 9.05, "filippov.analysis.number_text": 9.01,
    "filippov.analysis.stick_parts": 9.36,
    "filippov.analysis.certificates": 9.5, "filippov.analysis.certificates.certificate": 9.38,
    "filippov.analysis.certificates.local": 9.38, "filippov.analysis.certificates.homogeneous": 9.381,
    "filippov.analysis.certificates.line": 9.385, "filippov.analysis.certificates.planar": 9.385,
    "filippov.analysis.certificates.energy": 9.385, "filippov.analysis.certificates.masses": 9.385,
    "filippov.analysis.certificates.characteristic": 9.38,
    "filippov.analysis.certificates.positive_real": 9.38,
    "filippov.analysis.certificates.matrix_inequality": 9.38,
    "filippov.analysis.certificates.feedbacks": 9.385, "filippov.analysis.certificates.held_sets": 9.386,
    "filippov.analysis.certificates.quadratic": 9.385, "filippov.analysis.certificates.resets": 9.385,
    "filippov.analysis.certificates.lure_form": 9.381, "filippov.analysis.certificates.absolute": 9.385,
    "filippov.analysis.certificates.centre": 9.385, "filippov.analysis.certificates.relay_order": 9.385,
    "filippov.analysis.certificates.relays": 9.385, "filippov.analysis.certificates.cones": 9.385,
    "filippov.analysis.certificates.stopping": 9.385, "filippov.analysis.certificates.timed": 9.385,
    "filippov.analysis.certificates.clocked": 9.386, "filippov.analysis.certificates.decide": 9.39,
    "filippov.analysis.linear_turn": 9.38,
    "filippov.analysis.fixed_points": 9.395, "filippov.analysis.stability": 9.4,
    "filippov.analysis.map_rows": 9.35, "filippov.analysis.contraction": 9.4,
    "filippov.analysis.gain_map": 9.5, "filippov.analysis.tuning": 9.5, "filippov.analysis.regions": 9.5,
    "filippov.analysis.borders": 9.48,
    "filippov.analysis.cells": 9.41, "filippov.analysis.cell_work": 9.45,
    "filippov.analysis.basin": 9.5,
    "filippov.analysis.lyapunov": 9.5, "filippov.analysis.brute_force": 9.5,
    "filippov.analysis.bifurcation": 9.6,
    "filippov.analysis.state_map": 9.3, "filippov.analysis.recurrence": 9.01,
    "filippov.analysis.attractor": 9.41, "filippov.analysis.rest_set": 9.31,
    "filippov.analysis.identify_attractor": 9.51, "filippov.analysis.attractor_search": 9.52,
    "filippov.analysis.attractors": 9.53,
    "filippov.analysis.saddle": 9.3, "filippov.analysis.return_map": 9.41,
    "filippov.analysis.manifold_of_map": 9.42, "filippov.analysis.manifold": 9.43,
    "filippov.analysis.record": 9.01, "filippov.analysis.driven_run": 9.01,
    "filippov.analysis.residual_noise": 9.01, "filippov.analysis.force_input": 9.02,
    "filippov.analysis.identify_fit": 9.03, "filippov.analysis.misfit": 9.04,
    "filippov.analysis.identification": 9.05, "filippov.analysis.friction_curve": 9.06,
    "filippov.analysis.quasi_linear": 9.01, "filippov.analysis.static_cycle": 9.01,
    "filippov.analysis.control_link": 9.02, "filippov.analysis.describing_function": 9.02,
    "filippov.analysis.band_model": 9.65, "filippov.analysis.comparison_result": 9.65,
    "filippov.analysis.comparison_run": 9.66, "filippov.analysis.comparison": 9.7,
    "filippov.analysis": 9.9,
    "filippov.report.independent": 10, "filippov.report.effort": 10, "filippov.report.findings": 10,
    "filippov.report.results": 10.02, "filippov.report.finding_facts": 10.03,
    "filippov.report.compute": 10.1, "filippov.report.facts": 10.1,
    "filippov.report.finding_figures": 10.05, "filippov.report.figures": 10.1,
    "filippov.report.files": 10.1, "filippov.report.cycles": 10.2, "filippov.report.answers": 10.2,
    "filippov.report.relative": 10.2, "filippov.report.questions": 10.25, "filippov.report.tables": 10.2,
    "filippov.report.html": 10.3,
    "filippov.report.finding_tables": 10.3, "filippov.report.finding_sections": 10.35,
    "filippov.report.content": 10.4, "filippov.report.study": 10.45, "filippov.report": 10.46,
    "filippov.bank": 10.4,
    "filippov.configuration": 10, "filippov.commands": 10.5,
    "filippov.cli": 11, "filippov.__main__": 12,
}  # fmt: skip

# Packages whose modules may import each other: the order among them is their own affair, circles are not.
TOGETHER = ("filippov._kernels", "filippov.models", "filippov.bank", "filippov.sweep", "filippov.commands")

# A table of what is imported when it is first asked for; models are files that a registry names.
BY_TEXT = {
    "filippov", "filippov.delegates", "filippov.models",
    "filippov.models.registry", "filippov.models.studies", "filippov.commands.catalogue",
    "filippov.bank.peer_process", "filippov.sweep.dependence",
}  # fmt: skip
BUILTINS = {"eval", "exec", "compile", "__import__"}
PARSERS = {"sympify", "parse_expr"}
FORBIDDEN_MODULES = {"pickle", "cPickle", "dill", "cloudpickle", "joblib", "shelve", "marshal", "yaml"}
EXCEPTIONS: set[tuple[str, str]] = {
    ("filippov.check", "sympify"),  # of numbers only, after an isinstance test
    ("filippov.system", "pickle"),  # a parcel inside what is pickled there anyway, on its way to a worker
}


def module_name(path: Path) -> str:
    for package, folder in FOLDERS.items():
        if path.is_relative_to(ROOT / folder):
            parts = path.relative_to(ROOT / folder).with_suffix("").parts
            return ".".join((package, *(parts[:-1] if parts[-1] == "__init__" else parts)))
    raise AssertionError(path)


SOURCES = {module_name(path): path for folder in FOLDERS.values() for path in (ROOT / folder).rglob("*.py")}
TREES = {name: ast.parse(path.read_text(encoding="utf-8"), str(path)) for name, path in SOURCES.items()}
EVERY_MODULE = pytest.mark.parametrize("module", sorted(SOURCES))


def floor(module: str) -> float:
    name = module
    while name not in FLOORS or (name == "filippov" and module != "filippov"):
        name = name.rpartition(".")[0]
        assert name, f"{module} stands on no floor: add it to FLOORS in tests/test_layout.py"
    if name != module:  # an unlisted module must belong to a package whose modules share a floor
        assert name in TOGETHER, f"{module} stands on no floor: add it to FLOORS in tests/test_layout.py"
    return FLOORS[name]


def imported(module: str) -> list[tuple[str, int, bool]]:
    """(project module, line, inside a function) for every import in the file."""
    late = {
        id(inner)
        for outer in ast.walk(TREES[module])
        if isinstance(outer, ast.FunctionDef | ast.AsyncFunctionDef)
        for inner in ast.walk(outer)
    }
    found = []
    for node in ast.walk(TREES[module]):
        names: list[str] = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                package = module if SOURCES[module].name == "__init__.py" else module.rpartition(".")[0]
                parents = package.split(".")[: len(package.split(".")) - node.level + 1]
                base = ".".join([*parents, *([base] if base else [])])
            names = [f"{base}.{a.name}" if f"{base}.{a.name}" in SOURCES else base for a in node.names]
        for name in names:
            if name.split(".")[0] in {"models", "analysis"}:
                pytest.fail(f"{module}:{node.lineno} imports the bare name {name}; write filippov.{name}")
            if name.split(".")[0] == "filippov":
                found.append((name, node.lineno, id(node) in late))
    return found


@EVERY_MODULE
def test_imports_only_from_lower_floors(module: str) -> None:
    for name, line, _ in imported(module):
        same = any(module.startswith(p) and name.startswith(p) for p in TOGETHER)
        allowed = same or floor(name) < floor(module)
        assert allowed, f"{module}:{line} (floor {floor(module)}) imports {name} (floor {floor(name)})"


@EVERY_MODULE
def test_models_and_analysis_know_only_filippov(module: str) -> None:
    own = next((p for p in ("filippov.models", "filippov.analysis") if module.startswith(p)), None)
    other = {"filippov.models": "filippov.analysis", "filippov.analysis": "filippov.models"}
    for name, line, _ in imported(module) if own else []:
        assert not name.startswith(other[own or ""]), f"{module}:{line} imports {name}"


def test_no_import_circle() -> None:
    done: set[str] = set()

    def visit(module: str, path: tuple[str, ...]) -> None:
        assert module not in path, f"import circle: {' -> '.join((*path[path.index(module) :], module))}"
        if module in done:
            return
        for name, _, _ in imported(module):
            if name in SOURCES and name != "filippov":
                visit(name, (*path, module))
        done.add(module)

    for module in SOURCES:
        visit(module, ())


@pytest.mark.parametrize("folder", ["filippov", "models", "analysis", "tests", "docs"])
def test_no_file_over_500_lines(folder: str) -> None:
    for path in (ROOT / folder).rglob("*.py"):
        lines = len(path.read_text(encoding="utf-8").splitlines())
        assert lines <= 500, f"{path.relative_to(ROOT)} has {lines} lines; split it, one noun a file"


@pytest.mark.parametrize("method", sorted(filippov.METHODS))
def test_a_delegated_method_has_its_function(method: str) -> None:
    name, _, member = method.partition(".")
    assert callable(getattr(getattr(filippov, name), member))
    assert delegate(method).__module__ == filippov.METHODS[method].partition(":")[0]


@EVERY_MODULE
def test_modules_are_not_imported_by_text(module: str) -> None:
    for node in ast.walk(TREES[module]):
        if isinstance(node, ast.Call) and ast.unparse(node.func).endswith("import_module"):
            text = ast.unparse(node.args[0]).strip("f'\"")
            named = text.startswith("filippov.") or not isinstance(node.args[0], ast.Constant)
            assert not named or module in BY_TEXT, f"{module}:{node.lineno} imports {text}; write an import"


def evaluators(node: ast.AST) -> list[str]:
    """Names in this node that turn text or files into code."""
    if isinstance(node, ast.Call):
        if isinstance(node.func, ast.Name):
            return [node.func.id] if node.func.id in BUILTINS | PARSERS else []
        return [node.func.attr] if isinstance(node.func, ast.Attribute) and node.func.attr in PARSERS else []
    if isinstance(node, ast.Import):
        return [alias.name for alias in node.names if alias.name.split(".")[0] in FORBIDDEN_MODULES]
    if isinstance(node, ast.ImportFrom):
        module = node.module or ""
        names = [alias.name for alias in node.names if alias.name in PARSERS]
        return [*names, module] if module.split(".")[0] in FORBIDDEN_MODULES else names
    return []


@EVERY_MODULE
def test_nothing_evaluates_text_as_code(module: str) -> None:
    for node in ast.walk(TREES[module]):
        for name in evaluators(node):
            line = getattr(node, "lineno", 0)
            assert (module, name) in EXCEPTIONS, f"{module}:{line} uses {name}: text is never evaluated"


def test_packages_listed_are_the_folders() -> None:
    with (ROOT / "pyproject.toml").open("rb") as file:
        settings = tomllib.load(file)["tool"]["setuptools"]
    found = {name for name, path in SOURCES.items() if path.name == "__init__.py"}
    assert set(settings["packages"]) == found
    assert len(settings["packages"]) == len(found)
    assert settings["package-dir"] == FOLDERS
    without = {path.parent for path in SOURCES.values()} - {SOURCES[name].parent for name in found}
    assert not without, f"folders with Python files and no __init__.py: {sorted(map(str, without))}"
