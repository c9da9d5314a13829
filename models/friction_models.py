"""One plant under one friction law, exact and under the friction models derived from it."""

from __future__ import annotations

from collections.abc import Callable

from filippov import ModelError, Parameter, Smooth, System, parameters
from filippov.base.keywords import keywords
from filippov.model.bristles import MODELS
from filippov.model.friction_model import with_friction_model
from filippov.models.friction import SMALLEST, FrictionLaw
from filippov.models.mass import controlled_mass


@keywords("keyword", error=ModelError)
def friction_models(
    law: FrictionLaw, plant: Callable[[FrictionLaw], System] = controlled_mass, width: float = 1e-4
) -> dict[str, System]:
    """Return the plant by name: "exact", "tanh", and the models of `filippov.model.bristles`.

    law     begins at its static level, as Coulomb's and Stribeck's do: for a law with a jump there are no
            such models
    plant   law -> System with one friction surface: controlled_mass, pendulum, belt, or one of your own
    width   the parameter `width` of all but the exact one: what it is depends on the model

    Raises ModelError for another law or plant.
    """
    exact = plant(law)
    p = parameters(width=Parameter(width, lower=SMALLEST, description="width of the friction model"))
    made = {name: with_friction_model(exact, name, p.width) for name in MODELS}
    return {"exact": exact, "tanh": exact.with_comparator(Smooth(p.width)), **made}
