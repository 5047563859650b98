"""Side effects of a call on its map: views made writable, and changed values."""

from collections.abc import Iterator
from dataclasses import is_dataclass

import numpy as np

from evocity.citymap import CityMap


def list_writable(city: CityMap) -> list[str]:
    """List heights and views that are writable, by name: ``city.buildings.area``.

    Private fields of a view may be writable from the start, and do not count.
    """
    paths = {}
    for name, value in vars(city).items():
        for path, array, _ in _pairs(f"city.{name}", value, value, private=False):
            if isinstance(array, np.ndarray) and array.flags.writeable:
                paths[path] = True
    return list(paths)


def list_changes(city: CityMap, fresh: CityMap, *, views: bool) -> list[str]:
    """List the fields of ``city`` that differ in any bit from those of a ``fresh`` map with the
    original heights, by name.

    ``views`` also compares the views that ``city`` holds, which ``fresh`` computes again.
    """
    paths = {}
    for name in {**vars(fresh), **(vars(city) if views else {})}:
        held, right = vars(city).get(name), getattr(fresh, name, None)
        for path, value, other in _pairs(f"city.{name}", held, right):
            if not _equal(value, other):
                paths[path] = True
    return list(paths)


def _pairs(path: str, held, right, *, private: bool = True) -> Iterator[tuple[str, object, object]]:
    """Pair the values ``held`` with those of the ``right`` map, within tuples and tables such as
    `Buildings`, each with its path; ``private`` includes private fields."""
    if type(held) is type(right) and is_dataclass(held) and hasattr(held, "__dict__"):
        for name, value in vars(held).items():  # cached properties too
            hidden = name.startswith("_")
            if private or not hidden:
                inner = path if hidden else f"{path}.{name}"
                yield from _pairs(inner, value, getattr(right, name, None), private=private)
    elif isinstance(held, tuple) and isinstance(right, tuple) and len(held) == len(right):
        for value, other in zip(held, right, strict=True):
            yield from _pairs(path, value, other, private=private)
    else:
        yield path, held, right


def _equal(held, right) -> bool:
    if type(held) is not type(right):
        return False
    if isinstance(held, np.ndarray):
        same_kind = held.dtype == right.dtype and held.shape == right.shape
        return same_kind and held.tobytes() == right.tobytes()
    return held == right
