"""The page as one ES module: what asks for a module gets no others beside it."""

import re
from functools import cache
from pathlib import Path

PAGE = Path(__file__).parent / "page"
#: In the order in which they need each other.
MODULES = (
    *(
        "births",
        "density",
        "made",
        "tiles",
        "axis",
        "parallel",
        "scatter",
        "cells",
        "gallery",
        "viewer",
    ),
)

_IMPORT = re.compile(r'^import \{[^}]*\} from "\./(\w+)\.js";\n', re.M)


@cache
def module() -> str:
    """All modules of the page in one, which needs no other; its default export has `render`."""
    return "\n".join(_IMPORT.sub("", text(f"{name}.js")) for name in MODULES)


@cache
def text(file: str) -> str:
    """One file of the page."""
    return (PAGE / file).read_text(encoding="utf-8")


__all__ = ["MODULES", "PAGE", "module", "text"]
