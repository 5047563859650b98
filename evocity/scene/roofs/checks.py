"""Levels of detail and maps that can have pitched roofs."""

import numpy as np

from evocity.citymap import CityMap
from evocity.errors import MapError, keyword, setting, spell
from evocity.io.roof_shapes import SHAPES

#: Most height of a building with a roof, metres.
TALLEST = 1000.0


def level_of(lod: str | None, roofs: bool) -> str:
    """Return the level of detail of a scene, or raise `MapError` for ``roofs`` at another level
    than 2.2."""
    if lod is None:
        return "2.2" if roofs else "1.3"
    if roofs and lod != "2.2":
        raise MapError(
            f"{setting('lod', lod)} has no pitched roofs",
            "LoD 2.2 for roofs",
            f"leave {keyword('lod')} or {keyword('roofs')} out",
        )
    return lod


def check_heights(city: CityMap) -> None:
    """Raise `MapError` for a map whose heights can have no roofs: 0, or above 1 km."""
    highest = float(city.heights.max())
    if highest <= 0:
        raise MapError(
            f"{city.name}: all heights are 0, so that no building can have a roof",
            "heights of buildings in metres",
            f"check the heights, or leave {keyword('roofs')} out",
        )
    if highest > TALLEST:
        raise MapError(
            f"{city.name}: the highest building has {highest:g} m",
            f"heights of at most {TALLEST:g} m for roofs, in metres",
            f"check the unit of the heights, or leave {keyword('roofs')} out",
        )


def check_roofs(city: CityMap, given: np.ndarray | None) -> np.ndarray | None:
    """Return the roofs ``given`` for the buildings of ``city``, as of `evocity.scene.scene`, as
    int64 ``(n, 2)``. Raises `MapError` for other arrays."""
    if given is None:
        return None
    count = len(city.buildings)
    try:
        array = np.asarray(given)
    except ValueError:  # lists of several lengths
        array = np.empty(0)
    legal = array.shape == (count, 2) and array.dtype.kind in "iu"
    if legal and count:
        (low, least), (high, most) = array.min(axis=0), array.max(axis=0)
        legal = low >= -1 and high < len(SHAPES) and least >= 0 and most <= 1
    if not legal:
        raise MapError(
            f"given_roofs = {spell(given)} for a map with {count} buildings",
            f"whole numbers ({count}, 2): the number of a shape, -1 to {len(SHAPES) - 1}; and 0 "
            "for eaves or 1 for ridges",
            "take them from evocity.genome.building_roofs(city, genome)",
        )
    return array.astype(np.int64)
