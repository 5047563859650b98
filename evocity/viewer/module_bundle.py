"""The bundle of the page's modules: one ES module for hosts that load a single file."""

import re
from functools import cache
from pathlib import Path

PAGE = Path(__file__).parent / "page"
#: The modules, each after those that it imports.
MODULES = (
    *("births", "density", "elements", "tiles", "axis"),
    *("parallel", "scatter", "cells", "gallery", "viewer"),
)

_IMPORT = re.compile(r'^import \{[^}]*\} from "\./(\w+)\.js";\n', re.M)


@cache
def module() -> str:
    """Return all modules of the page as one; its default export has `render`."""
    return "\n".join(_IMPORT.sub("", text(f"{name}.js")) for name in MODULES)


@cache
def text(file: str) -> str:
    """Return the text of one file of the page."""
    return (PAGE / file).read_text(encoding="utf-8")
