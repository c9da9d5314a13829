"""The automaton of a system as an FMU for co-simulation, FMI 3.0: its Python module in pythonfmu3."""

from __future__ import annotations

import hashlib
import importlib
import re
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from filippov.base.errors import ModelError
from filippov.base.whole_file import write_whole
from filippov.io.automaton.equations import Equations
from filippov.io.automaton.python_text import python_module

# Names of the structured convention of FMI without dots and indices.
PLAIN = re.compile(r"[A-Za-z_][A-Za-z0-9_]*\Z")

SLAVE = '''

from pythonfmu3 import (
    DefaultExperiment, Fmi3Causality, Fmi3Initial, Fmi3Slave, Fmi3Variability, Float64, Int32,
)


class {name}(Fmi3Slave):
    """The automaton between communication points: states, outputs, mode and number of events go out."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.description = "The exact automaton of a system with switching surfaces"
        self.register_variable(Float64(
            "{time}", causality=Fmi3Causality.independent, variability=Fmi3Variability.continuous,
            getter=lambda: 0.0 if self.run is None else self.run.t,
        ))
        self.run, self.parameters, self.start = None, {{}}, list(Model.X0)
        for name, (default, _, _) in Model.PARAMETERS.items():
            self.parameters[name] = default
            self.register_variable(Float64(
                name, causality=Fmi3Causality.parameter, variability=Fmi3Variability.fixed,
                initial=Fmi3Initial.exact, getter=lambda name=name: self.parameters[name],
                setter=lambda value, name=name: self.parameters.update({{name: value}}),
            ))
        for i, name in enumerate(Model.STATES):
            self.register_variable(Float64(
                name, causality=Fmi3Causality.output, variability=Fmi3Variability.continuous,
                initial=Fmi3Initial.exact,
                getter=lambda i=i: self.start[i] if self.run is None else self.run.x[i],
                setter=lambda value, i=i: self.start.__setitem__(i, value),
            ))
        for i, name in enumerate(Model.OUTPUTS):
            self.register_variable(Float64(
                {shown}[i], causality=Fmi3Causality.output, variability=Fmi3Variability.continuous,
                initial=Fmi3Initial.calculated, description=name,
                getter=lambda i=i: 0.0 if self.run is None else self.run.outputs()[i],
            ))
        for i, surface in enumerate(Model.SURFACES):
            self.register_variable(Int32(
                "{mode}" + str(i + 1), causality=Fmi3Causality.output, variability=Fmi3Variability.discrete,
                initial=Fmi3Initial.calculated, description=surface,
                getter=lambda i=i: 0 if self.run is None else self.run.m[i],
            ))
        self.register_variable(Int32(
            "{count}", causality=Fmi3Causality.output, variability=Fmi3Variability.discrete,
            initial=Fmi3Initial.calculated,
            getter=lambda: 0 if self.run is None else len(self.run.result.events),
        ))
        {experiment}
        # Tools tell the start with the first step only; until then it is taken from the default experiment.
        self.first, self.begun = 0.0 if Model.T_SPAN is None else Model.T_SPAN[0], False

    def setup_experiment(self, start_time, *others):
        self.first = start_time

    def exit_initialization_mode(self):
        self.run, self.begun = Automaton(Model, self.start, self.first, self.parameters), False

    def do_step(self, current_time, step_size):
        if self.run is None or not (self.begun or current_time == self.run.t):
            self.run = Automaton(Model, self.start, current_time, self.parameters)
        self.begun = True
        if not abs(current_time - self.run.t) <= 1e-6 * step_size:
            raise RuntimeError(
                f"the step begins at {{current_time}}, expected {{self.run.t}}, where the last one ended: "
                "a run goes forwards only"
            )
        if self.run.advance(current_time + step_size):
            return True
        raise RuntimeError(self.run.result.status + ": " + self.run.result.message)
'''


def write_fmu(
    eq: Equations, values: Sequence[float], x0: Sequence[float], t_span: Sequence[float] | None, path: Path
) -> Path:
    """Write the FMU at path, whose stem is its name; ImportError without pythonfmu3 (extra `fmu`)."""
    try:
        builder: Any = importlib.import_module("pythonfmu3.builder")
    except ImportError:
        raise ImportError(
            "an FMU needs pythonfmu3, which is not installed: pip install filippov[fmu]"
        ) from None
    name = path.stem
    for word in (name, *eq.system.states, *eq.system.parameters.names):
        check_plain(word, "FMI")
    if not builder.FmuBuilder.has_binary():
        raise ModelError("pythonfmu3 has no library for this platform. Export to Python or C.")
    with tempfile.TemporaryDirectory() as folder:
        text = fmu_script(eq, values, x0, t_span, name)
        # A tool that holds several FMUs imports all of their modules into one interpreter, by name.
        script = Path(folder) / f"{name}_{hashlib.sha256(text.encode()).hexdigest()[:16]}.py"
        write_whole(script, text)
        made = builder.FmuBuilder.build_FMU(script, dest=folder)
        return write_whole(path, Path(made).read_bytes())


def fmu_script(
    eq: Equations, values: Sequence[float], x0: Sequence[float], t_span: Sequence[float] | None, name: str
) -> str:
    """The Python module with the class that pythonfmu3 calls."""
    shown = [q if PLAIN.match(q) else f"output_{k}" for k, q in enumerate(eq.system.outputs, 1)]
    taken = {*eq.system.states, *eq.system.parameters.names, *shown}
    clash = max((len(q) - len(q.rstrip("_")) for q in taken), default=0)
    end = "_" * (clash + 1) if taken & {"time", "events"} or any(q.startswith("mode_") for q in taken) else ""
    words = {"time": f"time{end}", "mode": f"mode_{end}", "count": f"events{end}", "shown": repr(shown)}
    experiment = "pass"
    if t_span is not None:
        start, stop = (float(q) for q in t_span)
        experiment = (
            f"self.default_experiment = DefaultExperiment(start_time={start!r}, stop_time={stop!r}, "
            f"step_size={(stop - start) / 100!r})"
        )
    return python_module(eq, values, x0, t_span) + SLAVE.format(name=name, experiment=experiment, **words)


def check_plain(word: str, language: str) -> None:
    """Raise ModelError for a name that has no plain ASCII form."""
    if not PLAIN.match(word):
        raise ModelError(
            f"the name {word!r} cannot be written in {language}, which has ASCII letters, digits and _ only. "
            "Rename it."
        )
