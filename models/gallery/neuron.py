"""The leaky integrate-and-fire neuron: the potential leaks, is driven, and is reset when it fires."""

from __future__ import annotations

from filippov import Parameter, Surface, System, parameters, states
from filippov.models.registry import Model, register


def neuron(
    tau: float = 10.0,
    rest: float = -65.0,
    drive: float = 20.0,
    threshold: float = -50.0,
    after: float = -70.0,
) -> System:
    """tau V' = rest - V + drive, V -> after where V = threshold.

    tau     time constant [ms]; rest, threshold, after   potentials [mV]
    drive   resistance times injected current [mV]

    It fires with the period tau ln((rest + drive - after)/(rest + drive - threshold)).
    """
    p = parameters(
        tau=Parameter(tau, "ms", 1e-12, description="time constant of the membrane"),
        rest=Parameter(rest, "mV", description="potential without input"),
        drive=Parameter(drive, "mV", description="resistance times injected current"),
        threshold=Parameter(threshold, "mV", description="potential at which it fires"),
        after=Parameter(after, "mV", description="potential after firing"),
    )
    (V,) = states("V")
    return System(
        {V: (p.rest - V + p.drive) / p.tau},
        surfaces=[Surface("threshold", p.threshold - V, reset={V: p.after})],
        parameters=p,
        labels={"t": "time [ms]", "V": "voltage [mV]"},
    )


MODEL = register(
    Model(
        "neuron",
        neuron,
        (-65.0,),
        (0.0, 100.0),
        "Leaky integrate-and-fire neuron: its period is 10 ln 5 ms.",
        "Lapicque 1907; numbers chosen here",
    )
)
