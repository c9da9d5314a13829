"""Sphinx configuration. `make docs` builds with warnings as errors; every example is executed on the way."""

from __future__ import annotations

import os
import re
import sys
import tempfile
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
# The checkout is what is documented, here and in the processes that run the examples.
sys.path.insert(0, str(ROOT))
os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, (str(ROOT), os.environ.get("PYTHONPATH"))))
os.environ.setdefault("PYDEVD_DISABLE_FILE_VALIDATION", "1")
# Matrices here are small, and pages are executed side by side.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# What a page executes warns of nothing; the kernel around it may.
_profile = tempfile.TemporaryDirectory(prefix="filippov-docs-")
_startup = Path(_profile.name) / "profile_default" / "startup" / "warnings_are_errors.py"
_startup.parent.mkdir(parents=True)
_startup.write_text(
    "import warnings as _warnings\n"
    "_warnings.simplefilter('error')\n"
    "_kernel = 'asyncio|comm|ipykernel|IPython|jupyter|matplotlib_inline|tornado|traitlets|zmq'\n"
    "_warnings.filterwarnings('ignore', module=_kernel)\n",
    encoding="utf-8",
)
os.environ["IPYTHONDIR"] = _profile.name

project = "filippov"
author = "The filippov developers"
project_copyright = "The filippov developers"
release = re.search(r'^version = "(.+)"$', (ROOT / "pyproject.toml").read_text("utf-8"), re.MULTILINE)[1]
version = release

extensions = ["myst_nb", "sphinx.ext.autodoc"]
source_suffix = {".md": "myst-nb"}
exclude_patterns = ["_build", "jupyter_execute"]
highlight_language = "none"

myst_enable_extensions = ["deflist", "fieldlist"]
myst_heading_anchors = 3
# Not cached: what a page prints depends on the package, not on the page alone.
nb_execution_mode = "force"
nb_execution_timeout = 300
nb_execution_raise_on_error = True
nb_execution_show_tb = True
nb_merge_streams = True
nb_ipywidgets_js: dict[str, Any] = {}

html_theme = "alabaster"
html_title = f"filippov {release}"
html_static_path = ["_static"]
html_css_files = ["page.css"]
html_show_sourcelink = False
html_theme_options = {
    "description": "Filippov differential inclusions: exact events, sliding modes, maps, stability.",
    "fixed_sidebar": True,
    "page_width": "1260px",
    "sidebar_width": "230px",
    "show_powered_by": False,
}
html_sidebars = {"**": ["about.html", "navigation.html", "searchfield.html"]}

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
python_maximum_signature_line_length = 88
python_use_unqualified_type_names = True
add_module_names = False


def _escaped(text: str) -> str:
    """Text that reads in reStructuredText as it is written, with `names` as literals."""
    pieces = re.split(r"`([^`]+)`", text)
    pieces[::2] = [re.sub(r"([\\*|_])", r"\\\1", piece) for piece in pieces[::2]]
    pieces[1::2] = [f"``{piece}``" for piece in pieces[1::2]]
    return "".join(pieces)


def _as_written(app: Any, what: str, name: str, thing: Any, options: Any, lines: list[str]) -> None:
    """Docstrings here are plain text with aligned columns: a first paragraph, then a block kept as it is."""
    del app, what, name, thing, options
    text = "\n".join(lines).strip("\n")
    if not text.strip():
        return
    first, _, rest = text.partition("\n\n")
    plain = not any(line.startswith("  ") for line in first.splitlines())
    made = [_escaped(" ".join(first.split())), ""] if plain else ["::", "", *_indented(first), ""]
    if rest.strip():
        made += ["::", "", *_indented(rest), ""]
    lines[:] = made


def _indented(text: str) -> list[str]:
    return [f"    {line}".rstrip() for line in text.splitlines()]


def setup(app: Any) -> dict[str, bool]:
    app.connect("autodoc-process-docstring", _as_written)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
