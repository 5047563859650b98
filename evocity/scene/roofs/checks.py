"""Levels of detail, maps and surfaces that can have, or be, roofs."""

from typing import Any, Protocol

import numpy as np

from evocity.citymap import CityMap
from evocity.errors import MapError, is_number, keyword, setting, spell
from evocity.io.roof_shapes import SHAPES
from evocity.scene.roofs.curved import RoofSurface

#: Most height of a building with a roof, metres.
TALLEST = 1000.0
#: Most rise of a curved roof, metres.
HIGHEST_RISE = 100.0


class HeightGrid(Protocol):
    """Heights on a grid, as `evocity.shapes.DetailedSurface`."""

    def heights(self) -> np.ndarray:
        """Compute heights, float64 ``(R, C)``."""


class StoredHeights(Protocol):
    """A grid of heights with its credit, as `evocity.shapes.StoredSurface`."""

    @property
    def surface(self) -> HeightGrid: ...
    @property
    def attribution(self) -> str: ...


def level_of(lod: str | None, roofs: bool, is_curved: bool = False) -> str:
    """Return the level of detail of a scene, or raise `MapError` for ``roofs``, or for a surface on
    roofs (``is_curved``), at another level than 2.2."""
    if lod is None:
        return "2.2" if roofs or is_curved else "1.3"
    if (roofs or is_curved) and lod != "2.2":
        found, name = ("pitched roofs", "roofs") if roofs else ("curved roofs", "roof_surface")
        raise MapError(
            f"{setting('lod', lod)} has no {found}",
            "LoD 2.2 for roofs",
            f"leave {keyword('lod')} or {keyword(name)} out",
        )
    return lod


def check_curved(
    surface: StoredHeights | None, rise: Any, is_alone: bool = False
) -> RoofSurface | None:
    """Return the form of curved roofs, of the shape of ``surface`` and with a ``rise`` in metres,
    as of `evocity.scene.scene`; ``is_alone`` as of `RoofSurface`.

    Raises `MapError` for a level surface, for a ``rise`` out of range, and for a ``rise`` without a
    surface.
    """
    if surface is None:
        if rise is None:
            return None
        raise MapError(
            f"{setting('roof_rise', rise)} without {keyword('roof_surface')}",
            "a surface whose rise it is",
            f"add {keyword('roof_surface')}, or leave {keyword('roof_rise')} out",
        )
    if rise is not None and not (is_number(rise) and 0 < rise <= HIGHEST_RISE):
        raise MapError(
            f"{setting('roof_rise', rise)} is out of range",
            f"a number of metres above 0, and at most {HIGHEST_RISE:g}",
            f"choose for example 4, or leave {keyword('roof_rise')} out for a fifth of the width",
        )
    try:
        heights = np.asarray(surface.surface.heights(), np.float64)
    except (AttributeError, TypeError, ValueError):
        raise MapError(
            f"{setting('roof_surface', surface)} is not a surface",
            "a StoredSurface",
            "read one with evocity.shapes.read_surface(…)",
        ) from None
    low, high = float(heights.min()), float(heights.max())
    if high - low <= 1e-9 * max(abs(low), abs(high), 1e-9):
        raise MapError(
            f"the surface for roofs is level: all its heights are {low:g} m",
            "a surface with a form, such as a vault",
            "make one: evocity surface make vault -o vault.json",
        )
    shares = (heights - low) / (high - low)
    return RoofSurface(shares, None if rise is None else float(rise), is_alone)


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
