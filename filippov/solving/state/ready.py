"""Runs that wait for the next problem of their system: machine, records and arrays, made once.

A run that is under way is in nobody else's hands: it is taken off the list, also by another thread and by a
`solve` inside of another one, and put back when its solution is made, of which nothing lies in its arrays.
"""

from __future__ import annotations

from filippov.base.arrays import Array
from filippov.kernel.codegen.interpreted import current
from filippov.model.surface import Surface
from filippov.model.system import System
from filippov.solving.state.machine import Machine
from filippov.solving.state.options import Options
from filippov.solving.state.run import Run

# Runs of one system and method that wait, and the largest ones that do: 1 MiB of dense output.
_MOST, _LARGEST = 4, 1 << 20


def ready(
    system: System, p: Array, x0: Array, span: tuple[float, float], options: Options,
    events: tuple[Surface, ...] = (),
) -> Run:  # fmt: skip
    """A run at its start; events: of the user."""
    if system.runs and not events:
        waiting: list[Run] = system.runs.get((options.stepper, options.sliding, current()), [])
        try:
            run = waiting.pop()
        except IndexError:  # none yet, or all at work
            pass
        else:
            run.machine.system = system
            run.again(p, x0, span, options)
            return run
    machine = Machine(system, options.stepper, p, events, options.sliding, options.compile)
    return Run(machine, x0, span, options)


def put_back(run: Run) -> None:
    """Let a run wait for the next one, if all that it knows of its problem is in its arrays."""
    machine = run.own
    if machine.events or not machine.formulas:
        return
    if machine.compiled.plain or run.coef.nbytes + machine.w.array.nbytes > _LARGEST:
        return
    if run.machine is not machine:
        # Where the solution slid to higher order the run went on with another one.
        run.attach(machine)
    key = run.options.stepper, machine.sliding, current()
    waiting = machine.system.runs.setdefault(key, [])
    # A run that waits must not keep its system alive, nor what it has made.
    machine.__dict__.pop("local", None)
    del machine.system, run.options, run.events, run.steps
    if len(waiting) < _MOST:
        waiting.append(run)
