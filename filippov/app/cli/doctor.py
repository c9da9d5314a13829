"""filippov doctor: versions, the cache folder, plug-ins that cannot be loaded."""

from __future__ import annotations

import os
import platform
import sys
from typing import Any

from filippov.app.cli.console import Console
from filippov.base.version import CHECKOUT, installed
from filippov.models import registry

REQUIRED = ("numpy", "scipy", "sympy", "networkx", "numba", "llvmlite", "filelock")
OPTIONAL = ("matplotlib", "rich", "xarray", "h5netcdf")


def run(settings: dict[str, Any], console: Console) -> int:
    """Look at the installation; 1 where something is wrong."""
    del settings
    packages = {name: installed(name) for name in ("filippov", *REQUIRED, *OPTIONAL)}
    packages["filippov"] = packages["filippov"] or CHECKOUT
    missing = [name for name in REQUIRED if packages[name] is None]
    cache = _cache() if not missing else {}
    broken = registry.broken()
    healthy = not missing and not broken and cache.get("writable", False)
    console.result({
        "python": platform.python_version(), "executable": sys.executable, "platform": platform.platform(),
        "cores": os.cpu_count(), "packages": packages, "missing": missing, "cache": cache, "broken": broken,
        "healthy": healthy,
    })  # fmt: skip
    console.say(f"Python {platform.python_version()} ({sys.executable}) on {platform.platform()}")
    for name, found in packages.items():
        absent = "missing, required" if name in REQUIRED else "not installed"
        console.say(f"  {name:<12} {found or absent}")
    if cache:
        kept = f"{cache['folder']} ({cache['files']} files, {cache['bytes'] / 1e6:.1f} MB)"
        console.say(f"cache: {kept if cache['writable'] else 'none'}")
        if cache["reason"]:
            console.warn(f"the cache is not where it was meant to be: {cache['reason']}")
        if not cache["writable"]:
            console.warn("no cache can be written, so every process compiles its models anew")
    for name in missing:
        console.warn(f"{name} is missing: pip install {name}")
    for name, trace in broken.items():
        console.warn(f"the plug-in {name} cannot be loaded:\n{trace}")
    console.say("all is well" if healthy else "something is wrong, see above")
    return 0 if healthy else 1


def _cache() -> dict[str, Any]:
    from filippov.kernel.codegen.cache import place

    found = place()
    folder = found.folder
    files = [] if folder is None else list(folder.glob("*.unit"))
    return {
        "folder": None if folder is None else str(folder), "files": len(files),
        "meant": None if found.meant is None else str(found.meant), "reason": found.reason,
        "bytes": sum(path.stat().st_size for path in files), "writable": folder is not None,
    }  # fmt: skip
