"""The layout of the project: floors, sizes, forbidden calls, packages."""

import ast
import importlib
import os
import re
import subprocess
import sys
import tomllib
from functools import cache
from pathlib import Path

import pytest

import filippov
import filippov.models.registry
from filippov import models
from filippov.base.delegates import delegate
from filippov.base.moved import MOVED

ROOT = Path(__file__).resolve().parent.parent
FOLDERS = {"filippov": "filippov", "filippov.models": "models", "filippov.analysis": "analysis"}

# The floors from the bottom up, each with its rooms in order: a module imports only from its own room and
# from those before it. `filippov` is the package itself, which names what it exports.
FLOORS: tuple[tuple[str, ...], ...] = (
    ("filippov.base",),
    ("filippov.model",),
    (
        "filippov.kernel", "filippov.kernel.tables", "filippov.kernel.language", "filippov.kernel.loop",
        "filippov.kernel.methods", "filippov.kernel.lanes", "filippov.kernel.derivative",
        "filippov.kernel.codegen",
    ),
    ("filippov.solving.state", "filippov.solving.selection", "filippov.solving.resets", "filippov.solving"),
    ("filippov.graphs", "filippov.interop", "filippov.io", "filippov.plot"),
    ("filippov.sweep",),
    ("filippov",),
    ("filippov.models",),
    (
        "filippov.analysis.algebra", "filippov.analysis.steady", "filippov.analysis.sensitivity",
        "filippov.analysis.local_stability", "filippov.analysis.maps", "filippov.analysis.orbits",
        "filippov.analysis.bifurcations", "filippov.analysis.invariant_sets", "filippov.analysis.diagrams",
        "filippov.analysis.gains", "filippov.analysis.harmonic", "filippov.analysis.estimation",
        "filippov.analysis.comparisons", "filippov.analysis.programs", "filippov.analysis",
    ),
    ("filippov.app.bank", "filippov.app.report", "filippov.app.cli", "filippov.app.explorer", "filippov.app"),
    ("filippov.__main__",),
)  # fmt: skip
ROOMS = tuple(room for rooms in FLOORS for room in rooms)
MOST_MODULES = 30

# A table of what is imported when it is first asked for; models are files that a registry names.
BY_TEXT = {
    "filippov", "filippov.base.delegates", "filippov.base.exports", "filippov.base.moved",
    "filippov.models",
    "filippov.models.registry", "filippov.models.studies", "filippov.app.cli.configuration",
    "filippov.app.bank.reference.process", "filippov.sweep.dependence",
}  # fmt: skip
BUILTINS = {"eval", "exec", "compile", "__import__"}
PARSERS = {"sympify", "parse_expr"}
FORBIDDEN_MODULES = {"pickle", "cPickle", "dill", "cloudpickle", "joblib", "shelve", "marshal", "yaml"}
EXCEPTIONS: set[tuple[str, str]] = {
    ("filippov.model.check", "sympify"),  # of numbers only, after an isinstance test
    ("filippov.model.system", "pickle"),  # a parcel in what is pickled for a worker
}


def module_name(path: Path) -> str:
    for package, folder in FOLDERS.items():
        if path.is_relative_to(ROOT / folder):
            parts = path.relative_to(ROOT / folder).with_suffix("").parts
            return ".".join((package, *(parts[:-1] if parts[-1] == "__init__" else parts)))
    raise AssertionError(path)


SOURCES = {module_name(path): path for folder in FOLDERS.values() for path in (ROOT / folder).rglob("*.py")}
PACKAGES = sorted(name for name, path in SOURCES.items() if path.name == "__init__.py")


@cache
def tree(module: str) -> ast.Module:
    return ast.parse(SOURCES[module].read_text(encoding="utf-8"), str(SOURCES[module]))


@cache
def nodes(module: str) -> tuple[ast.AST, ...]:
    """Every node of a file: read once for all rules, and when a rule asks."""
    return tuple(ast.walk(tree(module)))


def room(module: str) -> int:
    """The number of a module's room: that of the nearest package that is one."""
    name = module
    while name not in ROOMS:
        name = name.rpartition(".")[0]
    assert name != "filippov" or module == name, f"{module} stands in no room: put it into one of {ROOMS}"
    return ROOMS.index(name)


@cache
def imported(module: str) -> list[tuple[str, int, bool]]:
    """(project module, line, inside a function) for every import in the file."""
    late = {
        id(inner)
        for outer in nodes(module)
        if isinstance(outer, ast.FunctionDef | ast.AsyncFunctionDef)
        for inner in ast.walk(outer)
    }
    found = []
    for node in nodes(module):
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


def test_13_1_imports_point_downwards() -> None:
    assert not [
        f"{module}:{line} in room {ROOMS[room(module)]} imports {name} from above"
        for module in SOURCES
        for name, line, _ in imported(module)
        if room(name) > room(module)
    ]


def test_13_1_a_room_says_what_it_holds_and_is_not_crowded() -> None:
    silent = [name for name in PACKAGES if len((ast.get_docstring(tree(name)) or "").split()) < 5]
    assert not silent, "these do not say what they hold"
    held = {name: len(list(SOURCES[name].parent.glob("*.py"))) - 1 for name in PACKAGES}
    assert not {name: count for name, count in held.items() if count > MOST_MODULES}, "divide these"


def test_13_1_old_paths_name_modules_that_are_there() -> None:
    assert set(MOVED.values()) <= set(SOURCES)
    assert not set(MOVED) & set(SOURCES), "an old path is taken by a new module"


def test_13_1_an_old_path_gives_the_same_module() -> None:
    code = (
        "import importlib, sys\nfrom filippov.base.moved import MOVED\n"
        "inside = ['filippov.bank.case', 'filippov.report.study', 'filippov.commands.simulate']\n"
        "names = sorted(MOVED) + inside\n"
        "for name in names:\n"
        "    old = importlib.import_module(name)\n"
        "    assert old is sys.modules[old.__name__] and old.__spec__.name == old.__name__ != name, name\n"
        "files = [m.__file__ for m in {id(m): m for m in sys.modules.values()}.values() if "
        "getattr(m, '__name__', '').startswith('filippov') and m.__file__]\n"
        "assert len(files) == len(set(files)), 'a file was imported twice'\n"
        "from filippov.solver import solve\nimport filippov\nassert filippov.solve is solve\n"
    )
    path = os.pathsep.join(filter(None, (str(ROOT), os.environ.get("PYTHONPATH"))))
    environment = {**os.environ, "PYTHONPATH": path, "MPLBACKEND": "Agg"}
    command = [sys.executable, "-W", "error", "-c", code]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("package", ["filippov.analysis", "filippov.graphs", "filippov.plot"])
def test_13_1_short_names_lead_to_what_a_room_defines(package: str) -> None:
    holder = importlib.import_module(package)
    for name in holder.__all__:
        thing = getattr(holder, name)
        assert thing.__module__ == f"{package}.{holder.EXPORTS[name]}"


EXPORTING = [name for name in PACKAGES if hasattr(importlib.import_module(name), "EXPORTS")]


@pytest.mark.parametrize("package", EXPORTING)
def test_13_4_short_names_are_given_by_one_rule(package: str) -> None:
    holder = importlib.import_module(package)
    assert all(getattr(holder, name) is not None and name in dir(holder) for name in holder.__all__)
    with pytest.raises(AttributeError, match=f"module '{package}' has no attribute 'no_such'"):
        holder.no_such  # noqa: B018


@pytest.mark.parametrize(
    ("package", "name", "said"),
    [
        ("filippov", "compare", "write from filippov.analysis import compare"),
        ("filippov", "from_statespace", "write from filippov.interop import from_statespace"),
        ("filippov", "Explorer", "write from filippov.app import Explorer"),
        ("filippov.analysis", "solve", "write from filippov import solve"),
        ("filippov", "solv", "did you mean 'solve'"),
    ],
)
def test_16_4_a_name_that_another_package_has_is_answered_with_where(
    package: str, name: str, said: str
) -> None:
    holder = importlib.import_module(package)
    assert not hasattr(holder, name)
    with pytest.raises(AttributeError, match=said):
        getattr(holder, name)
    with pytest.raises(ImportError, match=said):
        exec(f"from {package} import {name}", {})  # noqa: S102  # the statement itself is tried


def test_13_1_a_short_name_outlives_an_old_path_that_ends_like_it() -> None:
    from filippov.analysis import lyapunov

    module = importlib.import_module("filippov.analysis.lyapunov")
    assert filippov.analysis.lyapunov is lyapunov is module.lyapunov


def test_models_and_analysis_know_only_filippov() -> None:
    one, other = "filippov.models", "filippov.analysis"
    assert not [
        f"{module}:{line} imports {name}"
        for own, foreign in ((one, other), (other, one))
        for module in SOURCES
        if module.startswith(own)
        for name, line, _ in imported(module)
        if name.startswith(foreign)
    ]


def test_13_1_no_model_is_named_outside_models() -> None:
    """Names that are words of their own (a belt, a chain) stand for a model only as a whole text."""
    names = set(models.registry.BUILT_IN) - {"relay"}  # also a kind of comparator
    telling = {name for name in names if "_" in name and name != "sliding_mode"} | {"hunting"}
    for module in SOURCES:
        if module.startswith(("filippov.models", "filippov.app.bank")):
            continue
        for node in nodes(module):
            told = node.value if isinstance(node, ast.Constant) and isinstance(node.value, str) else ""
            words = set(re.findall(r"\w+", told.lower()))
            where = f"{module}:{getattr(node, 'lineno', 0)}"
            assert told not in names, f"{where} names {told}: have the model declare it"
            assert not words & telling, f"{where} names {words & telling}: have the model declare it"


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


def test_13_3_no_function_is_long() -> None:
    """100 lines of a kernel; elsewhere docstrings are not counted."""
    for module in SOURCES:
        for node in nodes(module):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                lines = (node.end_lineno or 0) - node.lineno + 1
                if not module.startswith("filippov.kernel"):
                    lines -= len((ast.get_docstring(node) or "").splitlines())
                assert lines <= 100, f"{module}:{node.lineno} {node.name} has {lines} lines; do one thing"


@pytest.mark.parametrize("noun", ["Branch", "Table", "Basin", "Case", "Curve", "Outcome", "Settings", "Run"])
def test_13_7_a_noun_has_one_meaning(noun: str) -> None:
    places = [
        f"{module}:{node.lineno}"
        for module in SOURCES
        for node in tree(module).body
        if isinstance(node, ast.ClassDef) and node.name == noun
    ]
    assert len(places) == 1, f"{noun} is a class in {places}; name the others for what they are"


@pytest.mark.parametrize("method", sorted(filippov.METHODS))
def test_a_delegated_method_has_its_function(method: str) -> None:
    name, _, member = method.partition(".")
    assert callable(getattr(getattr(filippov, name), member))
    assert delegate(method).__module__ == filippov.METHODS[method].partition(":")[0]


def test_modules_are_not_imported_by_text() -> None:
    found = []
    for module in SOURCES.keys() - BY_TEXT:
        for node in nodes(module):
            if isinstance(node, ast.Call) and ast.unparse(node.func).endswith("import_module"):
                name = node.args[0]
                if not isinstance(name, ast.Constant) or str(name.value).startswith("filippov"):
                    found.append(f"{module}:{node.lineno} imports {ast.unparse(name)}; write an import")
    assert not found


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


MATRICES = ["solve", "inv", "pinv", "lstsq", "svd", "eig", "eigh", "eigvals", "eigvalsh", "cholesky"]
MATRICES += ["null_space"]
RAW = {"np.roots", *(f"{library}.linalg.{name}" for library in ("np", "scipy") for name in MATRICES)}


def test_13_4_matrices_of_the_analysis_fail_by_name() -> None:
    found = []
    for module in SOURCES:
        if module.startswith("filippov.analysis.") and module != "filippov.analysis.algebra.linalg":
            used = {ast.unparse(node) for node in nodes(module) if isinstance(node, ast.Attribute)}
            found += [f"{module}: take {name} from filippov.analysis.algebra.linalg" for name in used & RAW]
    assert not found


WRITERS = {"mkstemp", "NamedTemporaryFile", "write_text", "write_bytes"}
OWN_WRITING = {"filippov.base.whole_file", "filippov.kernel.codegen.cache"}


def test_13_4_files_are_written_whole_by_one_function() -> None:
    calls = (
        (module, node)
        for module in SOURCES.keys() - OWN_WRITING
        for node in nodes(module)
        if isinstance(node, ast.Call)
    )
    found = []
    for module, node in calls:
        called = ast.unparse(node.func).rpartition(".")[2]
        texts = {value.value for value in (*node.args, *(k.value for k in node.keywords))
                 if isinstance(value, ast.Constant) and isinstance(value.value, str)}  # fmt: skip
        modes = called == "open" and bool(texts & {"w", "wb", "a", "ab", "x", "xb", "r+", "r+b", "w+b"})
        if called in WRITERS or (modes and ast.unparse(node.func) != "archive.open"):
            found.append(f"{module}:{node.lineno} calls {called}; write by filippov.base.whole_file")
    assert not found


def test_nothing_evaluates_text_as_code() -> None:
    assert not [
        f"{module}:{getattr(node, 'lineno', 0)} uses {name}: text is never evaluated"
        for module in SOURCES
        for node in nodes(module)
        for name in evaluators(node)
        if (module, name) not in EXCEPTIONS
    ]


def test_packages_listed_are_the_folders() -> None:
    with (ROOT / "pyproject.toml").open("rb") as file:
        settings = tomllib.load(file)["tool"]["setuptools"]
    found = {name for name, path in SOURCES.items() if path.name == "__init__.py"}
    assert set(settings["packages"]) == found
    assert len(settings["packages"]) == len(found)
    assert settings["package-dir"] == FOLDERS
    without = {path.parent for path in SOURCES.values()} - {SOURCES[name].parent for name in found}
    assert not without, f"folders with Python files and no __init__.py: {sorted(map(str, without))}"
