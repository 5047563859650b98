"""What a call did to the map it was given: views made writable, and what is not as it was."""

from collections.abc import Iterator
from dataclasses import is_dataclass

import numpy as np

from evocity.citymap import CityMap


def unlocked(city: CityMap) -> list[str]:
    """What of the heights and views somebody made writable, by name: ``city.buildings.area``. What
    a view keeps to itself may be writable from the first."""
    found = {}
    for name, held in vars(city).items():
        for path, one, _ in _paired(f"city.{name}", held, held, private=False):
            if isinstance(one, np.ndarray) and one.flags.writeable:
                found[path] = True
    return list(found)


def altered(city: CityMap, fresh: CityMap, *, views: bool) -> list[str]:
    """What ``city`` holds that differs by a bit from the same of a ``fresh`` map of the heights it
    had, by name; without ``views`` only the heights and what describes the map.

    Of the views, those are computed anew that ``city`` holds.
    """
    found = {}
    for name in {**vars(fresh), **(vars(city) if views else {})}:
        held, right = vars(city).get(name), getattr(fresh, name, None)
        for path, one, other in _paired(f"city.{name}", held, right):
            if not _equal(one, other):
                found[path] = True
    return list(found)


def _paired(
    path: str, held, right, *, private: bool = True
) -> Iterator[tuple[str, object, object]]:
    """What is ``held`` in the end, within tuples and tables such as `Buildings`, each with its
    path and with what stands there on the ``right`` map; ``private`` fields too, unless told."""
    if type(held) is type(right) and is_dataclass(held) and hasattr(held, "__dict__"):
        for name, one in vars(held).items():  # what is computed when first asked for too
            own = name.startswith("_")
            if private or not own:
                inner = path if own else f"{path}.{name}"
                yield from _paired(inner, one, getattr(right, name, None), private=private)
    elif _tuples(held, right):
        for one, other in zip(held, right, strict=True):
            yield from _paired(path, one, other, private=private)
    else:
        yield path, held, right


def _tuples(held, right) -> bool:
    """Whether both are tuples, as long as each other."""
    return isinstance(held, tuple) and isinstance(right, tuple) and len(held) == len(right)


def _equal(held, right) -> bool:
    if type(held) is not type(right):
        return False
    if isinstance(held, np.ndarray):
        same_kind = held.dtype == right.dtype and held.shape == right.shape
        return same_kind and held.tobytes() == right.tobytes()
    return held == right
