"""Lazy imports: a room loads each of its names with the name's module, at first use.

A whole room brings all libraries of its modules: the names of the bundled districts would wait for
the libraries that read rasters. The room's stub, ``__init__.pyi``, says which module defines which
name; type checkers read it too. Optional libraries load at first use, too.
"""

import ast
import sys
from collections.abc import Callable, Mapping
from importlib import import_module
from pathlib import Path
from types import ModuleType

TYPE_CHECKING = False  # type checkers take it as true; `typing` takes 2 ms to load
if TYPE_CHECKING:
    from typing import Any

    import pandas as pd


def lazy_names(
    room: str, file: str, homes: Mapping[str, str] | None = None
) -> tuple[Callable[[str], object], Callable[[], list[str]], list[str]]:
    """Make the ``__getattr__``, ``__dir__`` and ``__all__`` of a ``room``.

    file : the room's ``__init__``.
    homes : the module of each name; those that the room's stub imports, if it is None. No name may
        be that of a module in the room: the loaded module would replace it.
    """
    homes = _homes(room, Path(file).with_suffix(".pyi")) if homes is None else homes
    names = sorted(homes)

    def load(name: str):
        if name not in homes:
            raise AttributeError(f"module {room!r} has no attribute {name!r}")
        value = getattr(import_module(homes[name]), name)
        setattr(sys.modules[room], name, value)
        return value

    return load, lambda: names, names


def _homes(room: str, stub: Path) -> dict[str, str]:
    lines = ast.parse(stub.read_text(encoding="utf-8")).body
    homes: dict[str, str] = {}
    for node in lines:
        if isinstance(node, ast.ImportFrom) and node.module:
            home = f"{room}.{node.module}" if node.level else node.module
            if home.startswith("evocity."):
                homes |= {alias.name: home for alias in node.names}
    return homes


def library(name: str, what: str, extra: str = "notebook") -> ModuleType:
    """Import the library ``name``, which ``what`` needs and the ``extra`` installs."""
    try:
        return import_module(name)
    except ImportError:
        from evocity.errors import EvocityError  # `import evocity` loads no texts of errors

        raise EvocityError(
            f"{what} needs {name}, which is not installed",
            f"evocity, installed with the extra '{extra}'",
            f"run pip install 'evocity[{extra}]'",
        ) from None


def frame_of(
    columns: "Any", index: "Any", name: str, heads: list[str] | None = None
) -> "pd.DataFrame":
    """Return a pandas frame with the ``index`` of this ``name``. Raises as `library`."""
    pandas = library("pandas", f"a table by {name}")
    return pandas.DataFrame(columns, pandas.Index(index, name=name), heads)
