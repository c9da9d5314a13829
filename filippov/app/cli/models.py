"""filippov models: what is registered, and what one model is."""

from __future__ import annotations

from typing import Any

from filippov.app.cli.console import Console
from filippov.app.cli.described import clock_data, clock_line, field_data, surface_data, surface_lines
from filippov.app.cli.model import load_model
from filippov.base.errors import ModelError, UsageError
from filippov.models import registry


def run(settings: dict[str, Any], console: Console) -> int:
    """List the models, or describe one."""
    if settings["action"] == "describe":
        return _describe(settings["name"], console)
    if settings["name"] is not None:
        raise UsageError(f"models list takes no name; use: filippov models describe {settings['name']}")
    broken = registry.broken()
    found = []
    for name in registry.names():
        try:
            model = registry.get(name)
        except ModelError:  # a plug-in; it is listed as broken
            continue
        found.append({"name": name, "description": model.description, "source": model.source})
    width = max(len(entry["name"]) for entry in found)
    for entry in found:
        console.say(f"{entry['name']:<{width}}  {entry['description']}")
    for name, trace in broken.items():
        cause = trace.strip().splitlines()[-1]
        console.say(f"{name}: broken plug-in, {cause} (filippov doctor has the traceback)")
    console.result({"models": found, "broken": broken})
    return 0


def _describe(name: str | None, console: Console) -> int:
    if name is None:
        raise UsageError("which model? write filippov models describe NAME; filippov models lists them.")
    loaded = load_model(name)
    system, model = loaded.system, loaded.model
    items = [system.parameters[key] for key in system.parameters]
    data = {
        "name": loaded.name,
        "description": "" if model is None else model.description,
        "source": "" if model is None else model.source,
        "states": list(system.states),
        "field": field_data(system),
        "surfaces": [surface_data(system, i) for i in range(len(system.surfaces))],
        "time_events": clock_data(system),
        "parameters": [
            {
                "name": key, "default": item.default, "unit": item.unit, "lower": item.lower,
                "upper": item.upper, "description": item.description,
            }
            for key, item in zip(system.parameters, items, strict=True)
        ],
        "x0": None if loaded.x0 is None else [float(v) for v in loaded.x0],
        "t_span": None if loaded.t_span is None else list(loaded.t_span),
        "section": _section(model),
    }  # fmt: skip
    console.result(data)
    _tell(data, console)
    return 0


def _section(model: registry.Model | None) -> dict[str, Any] | None:
    section = getattr(model, "section", None)
    if section is None:
        return None
    names = ("surface", "kind", "coordinate", "parametrisation", "interval", "t_max")
    return {name: getattr(section, name, None) for name in names}


def _tell(data: dict[str, Any], console: Console) -> None:
    console.say(f"{data['name']}: {data['description']}".rstrip(": "))
    if data["source"]:
        console.say(f"source: {data['source']}")
    for name in data["states"]:
        console.say(f"  {name}' = {data['field'][name]}" if data["field"] else f"  state {name}")
    for surface in data["surfaces"]:
        for line in surface_lines(surface):
            console.say(f"  {line}")
    for clock in data["time_events"]:
        console.say(f"  {clock_line(clock)}")
    for item in data["parameters"]:
        low = "-inf" if item["lower"] is None else f"{item['lower']:g}"
        high = "inf" if item["upper"] is None else f"{item['upper']:g}"
        unit = f" {item['unit']}" if item["unit"] else ""
        what = f"  {item['description']}" if item["description"] else ""
        console.say(f"  parameter {item['name']} = {item['default']:g}{unit}  in [{low}, {high}]{what}")
    if data["x0"] is not None:
        console.say(f"  x0 = {data['x0']}, t_span = {data['t_span']}")
    if data["section"] is not None:
        console.say(f"  section: {data['section']['kind']} on {data['section']['surface']}")
