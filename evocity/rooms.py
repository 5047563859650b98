"""A room's names, each loaded with its module when it is first used.

A room that is loaded as a whole brings every library that any of its modules needs: who asks for
the names of the bundled districts would wait for what reads rasters.
"""

import sys
from collections.abc import Callable, Mapping, Sequence
from importlib import import_module


def lazily(
    room: str, modules: Mapping[str, Sequence[str]]
) -> tuple[Callable[[str], object], Callable[[], list[str]], list[str]]:
    """What a ``room``'s ``__init__`` calls ``__getattr__``, ``__dir__`` and ``__all__``, for the
    names that its ``modules`` hold. No name may be a module's of the room: once that is loaded, it
    would stand in its place."""
    homes = {name: f"{room}.{module}" for module, names in modules.items() for name in names}
    every = sorted(homes)

    def load(name: str):
        if name not in homes:
            raise AttributeError(f"module {room!r} has no attribute {name!r}")
        found = getattr(import_module(homes[name]), name)
        setattr(sys.modules[room], name, found)
        return found

    return load, lambda: every, every
