"""A room's names, each loaded with its module when it is first used.

A room that is loaded as a whole brings every library that any of its modules needs: who asks for
the names of the bundled districts would wait for what reads rasters. Which module holds which name
stands in the room's stub, ``__init__.pyi``, where checkers of types read it too.
"""

import ast
import sys
from collections.abc import Callable, Mapping
from importlib import import_module
from pathlib import Path


def lazily(
    room: str, file: str, homes: Mapping[str, str] | None = None
) -> tuple[Callable[[str], object], Callable[[], list[str]], list[str]]:
    """What a ``room``'s ``__init__``, which is ``file``, calls ``__getattr__``, ``__dir__`` and
    ``__all__``: for the names that its stub takes from the room's modules, or for those of
    ``homes``, the module of each. No name may be a module's of the room: once that is loaded, it
    would stand in its place."""
    homes = _homes(room, Path(file).with_suffix(".pyi")) if homes is None else homes
    every = sorted(homes)

    def load(name: str):
        if name not in homes:
            raise AttributeError(f"module {room!r} has no attribute {name!r}")
        found = getattr(import_module(homes[name]), name)
        setattr(sys.modules[room], name, found)
        return found

    return load, lambda: every, every


def _homes(room: str, stub: Path) -> dict[str, str]:
    lines = ast.parse(stub.read_text(encoding="utf-8")).body
    taken = [node for node in lines if isinstance(node, ast.ImportFrom) and node.level == 1]
    return {one.name: f"{room}.{node.module}" for node in taken for one in node.names}


__all__ = ["lazily"]
