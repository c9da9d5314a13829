"""The commands and their settings, as data: what `filippov --help` shows. Nothing heavy is imported here."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from filippov.app.cli.compare import APPROXIMATIONS
from filippov.app.cli.configuration import Option
from filippov.app.cli.values import (
    destination,
    formulas,
    named_numbers,
    named_ranges,
    names,
    number,
    number_or_formula,
    one_of,
    pair,
    policy,
    releases,
    state,
    switch,
    text,
    texts,
    tolerance,
    varied,
    whole,
    whole_or_zero,
    words,
)
from filippov.models.offered import EXAMPLES, LAW, LAWS
from filippov.models.studies import study_names

# As in `filippov.solving.state.options`, which is not imported for a help text.
METHODS = ("DOP853", "DP5", "Radau")
RULES = ("filippov", "moments", "utkin")


def _choice(name: str, help_text: str, *known: str, default: str | None = None) -> Option:
    return Option(name, help_text, one_of(*known), metavar="{" + ",".join(known) + "}", default=default)


@dataclass(frozen=True)
class Command:
    """A command of the tool.

    module, function   what does it: function(settings, console) -> exit code
    needs              module without which it is not offered
    """

    name: str
    help: str
    module: str
    options: tuple[Option, ...]
    example: str
    function: str = "run"
    needs: str = ""

    @property
    def offered(self) -> bool:
        """Whether its module is there."""
        try:
            return not self.needs or importlib.util.find_spec(self.needs) is not None
        except ModuleNotFoundError:
            return False

    @property
    def settings(self) -> tuple[Option, ...]:
        """All its options: its own, and the common ones that it has none of its own for."""
        own = {option.name for option in self.options}
        return (*self.options, *(option for option in COMMON if option.name not in own))

    def load(self) -> Callable[..., int]:
        """Import what does it."""
        function: Any = getattr(importlib.import_module(f"filippov.app.cli.{self.module}"), self.function)
        return function  # type: ignore[no-any-return]


MODEL = Option(
    "model", "a registered name (see: filippov models) or path/to/file.py:name, where name is a System, "
    "a Problem or a function that returns a System", text, metavar="MODEL", flags=("model",),
)  # fmt: skip
PARAMETERS = Option(
    "parameters", "value of a parameter, a number or a formula such as pi/2; can be repeated", named_numbers,
    metavar="NAME=VALUE", flags=("-p",), repeat=True, default={},
)  # fmt: skip
COMMON = (
    Option("config", "TOML file with settings by name; flags go before it", text, metavar="FILE.toml"),
    Option("output", "folder for the files, made if missing", text, metavar="DIR", flags=("-o", "--output")),
    Option("json", "write the result to stdout as one JSON document", switch, default=False),
    Option("quiet", "no text on stderr but errors", switch, default=False),
    Option("traceback", "show where an error arose", switch, default=False),
)
TOLERANCES = (
    Option("rtol", "relative tolerance of a step", number, metavar="R"),
    Option("atol", "absolute tolerance: one number, or one a state with commas", tolerance, metavar="A"),
    _choice("method", "order 8 (the default), order 5, or order 5 for stiff fields", *METHODS),
)
START = (
    Option("x0", "initial state: x=0.1,v=0 (the others as in the model) or all in order: 0.1,0,0", state,
           metavar="X0"),
    Option("t_span", "first and last time", pair, metavar=("T0", "T1"), count=2),
    Option("backward", "run backwards in time: --t-span 1 0 needs it", switch, default=False),
    Option("max_step", "longest step", number, metavar="DT"),
    Option("first_step", "first step", number, metavar="DT"),
    Option("max_steps", "budget of steps", whole, metavar="N"),
    Option("max_events", "budget of events", whole, metavar="N"),
    Option("max_time", "budget of wall-clock seconds", number, metavar="SECONDS"),
    Option("nonunique", "where several modes can follow: raise (end), stick, slip, or modes with commas of "
           "which the first that can follow is taken: +,0; simulate also: branch (follow all)", policy,
           metavar="POLICY"),
    _choice("sliding", "rule of the field while sliding", "filippov", "moments", "utkin"),
    _choice("zeno", "at an accumulation of events: end, or go on in the limit mode", "stop", "continue"),
    _choice("simultaneous", "resets at one instant that depend on their order: end, one after the other, or "
            "the generalised Newton law", "raise", "sequential", "generalised Newton"),
    Option("stop", "end at an event: SURFACE, SURFACE:KIND or SURFACE:KIND:COUNT; can be repeated", texts,
           metavar="EVENT", repeat=True),
)  # fmt: skip
TREE = (
    Option("max_branches", "with --nonunique branch: most solutions", whole, metavar="N"),
    Option("max_depth", "with --nonunique branch: most decisions along one", whole, metavar="N"),
    Option("release_times", "with --nonunique branch: departures from sliding that can be left at any time, "
           "one whole number or times with commas", releases, metavar="N|T,T,..."),
)  # fmt: skip
SECTION = (
    Option("surface", "surface of the section, where the model proposes none; several with commas", text,
           metavar="NAME"),
    Option("event", "kind of event that ends a turn, such as 'sliding entry'", text, metavar="KIND"),
    Option("after", "mode after the event, such as 0 or +0, with * for any sign: other events do not end a "
           "turn", text, metavar="MODE"),
    Option("coordinate", "what is read on the section: a state or a formula in states", text,
           metavar="STATE"),
    Option("lift", "where a turn starts, a formula in d and parameters for each state: x=d,v=0", formulas,
           metavar="FORMULAS"),
    Option("t_max", "longest time of a turn", number, metavar="T"),
)  # fmt: skip
X_AXIS = Option("x", "horizontal axis: name with its first and last value", named_ranges,
                metavar="NAME=LOW:HIGH", default={})  # fmt: skip
Y_AXIS = Option("y", "vertical axis", named_ranges, metavar="NAME=LOW:HIGH", default={})
CELLS = Option("cells", "cells along each axis", whole, metavar="N", default=60)
INTERVAL = Option("interval", "interval of the section's coordinate", pair, metavar=("LO", "HI"), count=2)
VARY = (
    Option("vary", "values of a parameter, or of an initial state as x0.NAME; LOW:HIGH:COUNT, LOW:HIGH for "
           "samples that are drawn, or lists in the file; can be repeated", varied,
           metavar="NAME=LOW:HIGH:COUNT", repeat=True, default={}),
    _choice("samples", "every combination, the values pair by pair, or n points drawn between the ends",
            "grid", "list", "latin_hypercube", "sobol", default="grid"),
    Option("n", "number of points that are drawn", whole, metavar="N", flags=("-n", "--n")),
    Option("seed", "seed of points that are drawn", whole_or_zero, metavar="N", default=0),
)  # fmt: skip
ENGINE = (
    Option("jobs", "worker processes; default: all cores", whole, metavar="N", flags=("-j", "--jobs")),
    _choice("executor", "where points are computed", "processes", "dask", default="processes"),
    Option("scheduler", "address of dask's scheduler; default: a cluster of -j processes here", text,
           metavar="ADDRESS"),
    Option("resume", "go on with what the folder holds", switch, default=False),
    Option("fresh", "remove what the sweep in the folder has written", switch, default=False),
    Option("trust", "resume although functions read what cannot be seen: none of it has changed", switch,
           default=False),
    Option("chunk", "points in a chunk; default: about a second's work", whole, metavar="N"),
    Option("max_memory", "bytes of address space of a worker", whole, metavar="BYTES"),
)  # fmt: skip

_ALL = (
    Command(
        "simulate", "solve a model: events.csv, trajectory.csv, solution.npz, summary.json, response.png",
        "simulate",
        (MODEL, PARAMETERS, *START, *TOLERANCES,
         Option("points", "equally spaced rows of trajectory.csv; default: the ends of the steps", whole,
                metavar="N"),
         Option("events", "roots to watch: FORMULA, FORMULA:up, down or both, or FORMULA:up:N to end at the "
                "N-th; in t, states and parameters; can be repeated", texts, metavar="ROOT", repeat=True),
         _choice("backend", "what runs the event loop: machine code, or Python from the same sources (slow; "
                 "for a debugger)", "compiled", "python"),
         _choice("on_graze", "at a touching of a surface: go on, or end", "continue", "error"),
         _choice("save_events", "keep every event, or count them: memory does not grow, the tables have the "
                 "last few only", "all", "count"),
         *TREE),
        EXAMPLES["simulate"],
    ),
    Command(
        "sweep", "measures over many points: results.csv, results.nc, summary.json; can be resumed", "sweep",
        (MODEL, PARAMETERS, *VARY,
         Option("measure", "what is measured, such as end(x), events(surface), amplitude(x), or "
                "path/to/file.py:name; can be repeated", texts, metavar="MEASURE", repeat=True,
                default=["end", "t_end"]),
         Option("tail", "part of the time over which extrema and periods are taken", number, metavar="SHARE",
                default=0.5),
         Option("reduce", "summary of every column: mean, min, max, median, std, count", words,
                metavar="NAME,NAME,..."),
         *ENGINE, *START, *TOLERANCES),
        EXAMPLES["sweep"],
    ),
    Command(
        "ensemble", "where many trajectories end, in one process: ends.csv, ends.npz, summary.json", "sweep",
        (MODEL, PARAMETERS, *VARY,
         Option("jobs", "threads; default: all cores", whole, metavar="N", flags=("-j", "--jobs")),
         *(option for option in START if option.name != "max_time"), *TOLERANCES),
        EXAMPLES["ensemble"],
        function="run_ensemble",
    ),
    Command(
        "event-map", "the event map of a section and its fixed points: map.csv, fixed_points.json, map.png",
        "maps",
        (MODEL, PARAMETERS, INTERVAL, *SECTION, *TOLERANCES,
         Option("points", "samples of the map", whole, metavar="N", default=400),
         Option("order", "iterate of the map that is taken", whole, metavar="K", default=1),
         Option("start", "coordinate where an orbit starts", number, metavar="D"),
         Option("iterates", "length of that orbit", whole, metavar="N", default=30)),
        EXAMPLES["event-map"],
        function="run_event_map", needs="filippov.analysis.maps.event_map",
    ),
    Command(
        "bifurcation", "fixed points over a parameter: bifurcation.csv, .json, .png", "maps",
        (MODEL, PARAMETERS,
         Option("parameter", "parameter that is varied", text, metavar="NAME"),
         Option("values", "its first and last value", pair, metavar=("LO", "HI"), count=2),
         Option("count", "number of its values", whole, metavar="N", default=22),
         Option("points", "points of the search at each value", whole, metavar="N", default=400),
         Option("order", "iterate of the map that is taken", whole, metavar="K", default=2),
         INTERVAL, *SECTION, *TOLERANCES[:2], *ENGINE),
        EXAMPLES["bifurcation"],
        function="run_bifurcation", needs="filippov.analysis.diagrams.bifurcation",
    ),
    Command(
        "orbit", "a periodic orbit, stable or not, with its Floquet multipliers: orbit.json, .csv, .png",
        "orbit",
        (MODEL, PARAMETERS, START[0],
         Option("period", "autonomous: guess of the period; forced: the period, a number or a formula such "
                "as 2*pi/omega", number_or_formula, metavar="T"),
         _choice("symmetry", "odd: solve for half of an orbit with x(t + T/2) = -x(t)", "odd"),
         Option("nodes", "points of multiple shooting", whole, metavar="N"),
         Option("transient", "time to run before the search", number, metavar="T"),
         Option("t_max", "longest time of the search", number, metavar="T"), *TOLERANCES[:1],
         Option("atol", "absolute tolerance", number, metavar="A"),
         _choice("method", "integration method (order 8 is the default), or collocation on an adapted mesh "
                 "for orbits that repel strongly", *METHODS, "collocation")),
        EXAMPLES["orbit"], needs="filippov.analysis.orbits.orbit_search",
    ),
    Command(
        "homoclinic", "the homoclinic orbit of a saddle, and the parameter value at which there is one: "
        "homoclinic.json, .csv, .png", "orbit",
        (MODEL, PARAMETERS, START[0],
         Option("free", "the parameter that is solved for, from its value in -p", text, metavar="NAME"),
         Option("mode", "mode of the saddle, such as +0 (0: it slides); default: that of --x0", text,
                metavar="MODE"),
         Option("side", "1 or -1: the way along the unstable direction; 0: the one that comes back nearer",
                whole, metavar="S"),
         Option("t_max", "longest time until the motion is back", number, metavar="T"), *TOLERANCES[:1],
         Option("atol", "absolute tolerance", number, metavar="A")),
        "filippov homoclinic model.py:system --x0 0.01,0 --free mu",
        function="run_homoclinic", needs="filippov.analysis.orbits.homoclinic",
    ),
    Command(
        "continue", "follow a cycle or an equilibrium over a parameter: branch.json, .csv, .png",
        "continuation",
        (MODEL, PARAMETERS,
         Option("parameter", "parameter that is varied", text, metavar="NAME"),
         Option("from", "its value at the start", number, metavar="VALUE"),
         Option("to", "its last value", number, metavar="VALUE"),
         Option("start", "coordinate of a fixed point of the section's second iterate, in place of an orbit",
                number, metavar="D"),
         Option("mode", "mode of an equilibrium near --x0, such as +0, in place of an orbit", text,
                metavar="MODE"),
         START[0], *SECTION,
         Option("step", "first step along the branch", number, metavar="S"),
         Option("max_step", "longest step", number, metavar="S"),
         Option("max_points", "budget of points", whole, metavar="N"),
         Option("max_time", "budget of wall-clock seconds", number, metavar="SECONDS"),
         Option("switch", "follow also the branches that leave at branch points, period doublings and "
                "symmetry breaking: branch-1.json, ...", switch, default=False),
         Option("curve", "second parameter, over which every special point is followed: curve-1.json, "
                "..., curves.png", named_ranges, metavar="NAME=LOW:HIGH", default={}),
         Option("resume", "branch.json of a run that was interrupted", text, metavar="FILE")),
        EXAMPLES["continue"],
        needs="filippov.analysis.bifurcations.continuation",
    ),
    Command(
        "stability", "every equilibrium and equilibrium set: report.txt, .md, .tex, .json", "stability",
        (MODEL, PARAMETERS,
         Option("solve_for", "parameter for which the conditions are solved", text, metavar="NAME"),
         Option("certify", "certificates also where the linear part decides: certificates.json", switch,
                default=False),
         Option("budget", "work, in millions of calls (a second each)", number, metavar="N", default=30.0)),
        EXAMPLES["stability"],
        needs="filippov.analysis.local_stability.stability",
    ),
    Command(
        "describing-function", "cycles that harmonic balance predicts: prediction.json, .csv, .png",
        "describing",
        (MODEL, PARAMETERS,
         Option("surface", "surface whose h is the input of the nonlinear terms", text, metavar="NAME"),
         Option("amplitudes", "range of the input's amplitude", pair, metavar=("LOW", "HIGH"), count=2)),
        EXAMPLES["describing-function"],
        needs="filippov.analysis.harmonic.describing_function",
    ),
    Command(
        "regions", "number and stability of cycles over two parameters: regions.json, .csv, .png", "regions",
        (MODEL, PARAMETERS, X_AXIS, Y_AXIS, CELLS, INTERVAL, *SECTION,
         Option("order", "turns after which a cycle closes", whole, metavar="K", default=2),
         Option("points", "coordinates that are tried in a cell", whole, metavar="N", default=40),
         Option("rtol", "relative tolerance of a step", number, metavar="R", default=1e-8),
         _choice("borders", "the fold of cycles and the change of stability of the set as exact curves",
                 "exact"),
         *ENGINE),
        EXAMPLES["regions"],
        function="run_regions", needs="filippov.analysis.diagrams.regions",
    ),
    Command(
        "basin", "basins of attraction in a plane of initial states: basin.json, .npz, .png", "regions",
        (MODEL, PARAMETERS, X_AXIS, Y_AXIS, CELLS,
         Option("at", "value of another state; can be repeated", named_numbers, metavar="STATE=VALUE",
                repeat=True, default={}),
         INTERVAL, *SECTION,
         Option("order", "iterate of the map whose fixed points are the attractors", whole, metavar="K",
                default=2),
         Option("rtol", "relative tolerance of a step", number, metavar="R", default=1e-8),
         *ENGINE),
        EXAMPLES["basin"],
        function="run_basin", needs="filippov.analysis.diagrams.basin",
    ),
    Command(
        "attractors", "all attractors in a box of states, and the share that goes to each: attractors.json, "
        ".csv, .png", "attractors",
        (MODEL, PARAMETERS,
         Option("box", "least and greatest value of a state; can be repeated, one for each", named_ranges,
                metavar="STATE=LOW:HIGH", repeat=True, default={}),
         Option("plane", "two states, with a comma, over which a picture of basins is made", names,
                metavar="STATE,STATE"),
         Option("at", "value of another state in the plane; can be repeated", named_numbers,
                metavar="STATE=VALUE", repeat=True, default={}),
         Option("resolution", "initial states along each axis of the plane", whole, metavar="N", default=40),
         Option("samples", "states that are drawn from the box", whole, metavar="N", default=400),
         Option("seed", "seed of the states that are drawn", whole_or_zero, metavar="N", default=0),
         Option("period", "of a forced system: a number or a formula such as 2*pi/omega", number_or_formula,
                metavar="T"),
         Option("step", "of an autonomous system: time between looks", number, metavar="DT"),
         Option("cells", "cells of the grid along each edge of the box", whole, metavar="N", default=60),
         Option("recurrences", "iterates in a row on cells met before, after which a motion is looked at",
                whole, metavar="N", default=40),
         Option("most", "iterates, after which the rest is undecided", whole, metavar="N", default=2000),
         Option("reach", "distance from an attractor, in parts of the box, that makes a motion its own",
                number, metavar="R", default=1e-3),
         Option("escape", "distance, in parts of the box, beyond which a motion has escaped", number,
                metavar="R", default=100.0),
         Option("store", "file that keeps the search: one that was ended goes on from there", text,
                metavar="FILE"),
         *SECTION,
         Option("rtol", "relative tolerance of a step", number, metavar="R", default=1e-8)),
        EXAMPLES["attractors"],
        function="run_attractors", needs="filippov.analysis.invariant_sets.attractors",
    ),
    Command(
        "manifold", "stable and unstable manifolds of a saddle or of an orbit: manifold.json, .csv, .png",
        "attractors",
        (MODEL, PARAMETERS, START[0],
         _choice("side", "which of them", "unstable", "stable", "both", default="both"),
         Option("length", "arclength of every branch", number, metavar="L"),
         Option("mode", "mode of the saddle near --x0, such as 0 for a pseudo-saddle", text, metavar="MODE"),
         Option("orbit", "of the periodic orbit near --x0, in place of a saddle", switch, default=False),
         Option("period", "period of that orbit, as in `filippov orbit`", number_or_formula, metavar="T"),
         Option("spacing", "largest distance of neighbouring points", number, metavar="D"),
         Option("offset", "where a branch begins, in parts of its length", number, metavar="E"),
         Option("plane", "two states, with a comma, of the picture", names, metavar="STATE,STATE"),
         *SECTION,
         Option("rtol", "relative tolerance of a step", number, metavar="R")),
        "filippov manifold my.py:duffing --x0 x=0,v=0 --length 3 -o results/manifold",
        function="run_manifold", needs="filippov.analysis.invariant_sets.manifold",
    ),
    Command(
        "lyapunov", "Lyapunov exponents of a motion, through its events: exponents.json, .csv, .png", "chaos",
        (MODEL, PARAMETERS, START[0],
         Option("duration", "time over which they are taken", number, metavar="T"),
         Option("stretch", "time between two decompositions; of a forced system a multiple of the period",
                number, metavar="T"),
         Option("transient", "time to run before", number, metavar="T", default=0.0),
         Option("number", "how many, the largest ones; default: all", whole, metavar="K"),
         Option("rtol", "relative tolerance of a step", number, metavar="R"),
         Option("atol", "absolute tolerance", number, metavar="A")),
        EXAMPLES["lyapunov"],
        function="run_lyapunov", needs="filippov.analysis.sensitivity.lyapunov",
    ),
    Command(
        "diagram", "iterates of the event map over a parameter, chaos included: diagram.json, .csv, .png",
        "chaos",
        (MODEL, PARAMETERS,
         Option("parameter", "parameter that is varied", text, metavar="NAME"),
         Option("values", "its first and last value", pair, metavar=("LO", "HI"), count=2),
         Option("count", "number of its values", whole, metavar="N", default=200),
         Option("start", "coordinate of the first turn; default: the middle of the interval", number,
                metavar="D"),
         Option("transient", "turns that are dropped", whole, metavar="N", default=200),
         Option("keep", "turns that are kept", whole, metavar="N", default=64),
         Option("follow", "start each value where the one before it ended", switch, default=False),
         INTERVAL, *SECTION,
         Option("rtol", "relative tolerance of a step", number, metavar="R", default=1e-8)),
        EXAMPLES["diagram"],
        function="run_diagram", needs="filippov.analysis.diagrams.brute_force",
    ),
    Command(
        "tune", "controller gains without limit cycles: tuning.json, samples.csv, tuning.png", "tune",
        (MODEL, PARAMETERS,
         Option("ranges", "lowest and highest value of a gain; can be repeated", named_ranges,
                metavar="NAME=LOW:HIGH", repeat=True, default={}),
         Option("band", "range of a parameter that has to be free of cycles at both ends; can be repeated",
                named_ranges, metavar="NAME=LOW:HIGH", repeat=True, default={}),
         Option("identified", "identified.json of `filippov identify`: values and confidence region",
                text, metavar="FILE"),
         Option("samples", "samples of the ranges", whole, metavar="N", default=256),
         Option("seed", "seed of the samples", whole, metavar="N", default=1),
         Option("grid", "values of each gain in the picture", whole, metavar="N", default=24),
         INTERVAL, *SECTION),
        EXAMPLES["tune"],
        needs="filippov.analysis.gains.tuning",
    ),
    Command(
        "identify", "friction parameters from measurements: identified.json, fit.csv, fit.png", "identify",
        (Option("data", "CSV file with t, x and u (control effort) or force; or with v and friction", text,
                metavar="DATA.csv", flags=("data",)),
         _choice("law", "the friction law", *LAWS, default=LAW),
         Option("free", "parameters that are estimated, with commas; default: those of the law", names,
                metavar="NAME,NAME,..."),
         Option("fixed", "value of a parameter that is known, such as m=1; can be repeated", named_numbers,
                metavar="NAME=VALUE", repeat=True, default={}),
         Option("start", "initial guess of a parameter; can be repeated", named_numbers, metavar="NAME=VALUE",
                repeat=True, default={}),
         Option("windows", "windows with initial states of their own; default: one in 200 samples", whole,
                metavar="N"),
         _choice("hold", "the force between samples: smooth with kinks, linear, held, or by the residuals",
                 "auto", "cubic", "first", "zero", default="auto"),
         Option("level", "confidence level of the intervals", number, metavar="L", default=0.95)),
        EXAMPLES["identify"],
        needs="filippov.analysis.estimation.identification",
    ),
    Command(
        "compare", "the exact inclusion against its approximations, over a section or along a motion (--x0, "
        "--t-span, --against): comparison.csv, .json, .txt, .png", "compare",
        (MODEL, PARAMETERS, *APPROXIMATIONS, *START[:2], *TOLERANCES[:2], *SECTION),
        EXAMPLES["compare"],
        needs="filippov.analysis.comparisons.comparison",
    ),
    Command(
        "graph", "the modes and transitions of a model: graph.dot, .graphml, .json, .png", "graph",
        (MODEL, PARAMETERS,
         _choice("kind", "what the model can do, or what a solution does", "possible", "observed",
                 default="possible"),
         Option("recurrent", "only the part that is not left again", switch, default=False),
         Option("numbers", "put the parameters' values into the formulas", switch, default=False),
         *START, *TOLERANCES),
        EXAMPLES["graph"],
    ),
    Command(
        "bank", "run a file of cases with reference values, or put it to reference solvers", "bank",
        (Option("action", "run, compare with reference solvers, migrate an earlier form, print the schema",
                one_of("run", "compare", "migrate", "schema"), metavar="{run,compare,migrate,schema}",
                flags=("action",)),
         Option("file", "the cases, a JSON file (not for schema)", text, metavar="FILE", flags=("file",)),
         Option("json", "write the rows (bank, schema) as JSON to a file, to stdout without one", destination,
                metavar="OUT", count="?"),
         Option("only", "ids of cases, or the part of them before the first _", texts, metavar="ID",
                count="+"),
         *TOLERANCES,
         Option("max_time", "seconds for each case", number, metavar="SECONDS"),
         Option("jobs", "processes", whole, metavar="N", flags=("-j", "--jobs"), default=1),
         Option("peers", "compare: the reference solvers, with commas", words, metavar="NAME,NAME,...")),
        "filippov bank run cases.json --json rows.json",
    ),
    Command(
        "models", "list the registered models, or describe one", "models",
        (Option("action", "what to do", one_of("list", "describe"), metavar="{list,describe}",
                flags=("action",), default="list"),
         Option("name", "the model to describe, as MODEL elsewhere", text, metavar="NAME", flags=("name",))),
        EXAMPLES["models"],
    ),
    Command(
        "study", "a whole study with its report", "study",
        (Option("name", "the study", one_of(*study_names()), flags=("name",),
                metavar="{" + ",".join(study_names()) + "}"),
         Option("quick", "coarser, to see whether it works", switch, default=False),
         Option("resolution", "factor of the number of points in maps and searches, 0.1 to 20", number,
                metavar="F", default=1.0)),
        EXAMPLES["study"], needs="filippov.app.report",
    ),
    Command(
        "doctor", "versions, the cache folder, broken plug-ins with their tracebacks", "doctor", (),
        "filippov doctor",
    ),
)  # fmt: skip


def commands() -> dict[str, Command]:
    """The commands whose modules are there, by name."""
    return {command.name: command for command in _ALL if command.offered}
