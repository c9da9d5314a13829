"""Reset control: an integrator, or a first-order lag, that is set to 0 whenever its input e is 0.

Clegg 1958, AIEE Trans. 77, 41; Beker, Hollot, Chait, Han 2004, Automatica 40, 905.
"""

from __future__ import annotations

from filippov import Parameter, Surface, System, parameters, states
from filippov.models.registry import Model, register


def reset_control(r: float = 1.0, b: float = 1.0, k: float = 1.0, pole: float = 0.2) -> System:
    """Return the loop of the plant (s + 1)/(s (s + pole)) and the first-order reset element k/(s + b).

    r      wanted output; b   pole of the element [1/s], 0 for Clegg's integrator; k   its gain
    pole   of the plant [1/s]

    States: z, z' of the plant with output z + z', and u of the element, which is 0 after each zero of
    e = r - z - z'.
    """
    p = parameters(
        r=Parameter(r, "", description="wanted output"),
        b=Parameter(b, "1/s", 0, description="pole of the reset element"),
        k=Parameter(k, "", 0, description="gain of the reset element"),
        pole=Parameter(pole, "1/s", description="pole of the plant"),
    )
    z, w, u = states("z w u")
    e = p.r - z - w
    return System(
        {z: w, w: u - p.pole * w, u: p.k * e - p.b * u},
        surfaces=[Surface("error", e, reset={u: 0}, side="both")],
        parameters=p,
        labels={"t": "time [s]", "z": "output", "w": "rate of the output [1/s]", "u": "effort [1/s^2]"},
    )


MODEL = register(
    Model(
        "reset_control",
        reset_control,
        (0.0, 0.0, 0.0),
        (0.0, 10.0),
        "Step response of a loop with a first-order reset element.",
        "Beker, Hollot, Chait, Han 2004, Automatica 40, 905",
    )
)
