"""The objects of a scene: buildings and lower objects by class, with their properties."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import shapely

from evocity.citymap import CityMap
from evocity.errors import MapError, plain_text, spell
from evocity.formats import Group
from evocity.formats.materials import GROUND
from evocity.scene.substitution import Substitution
from evocity.views.classes import Classes
from evocity.views.walls import Walls, walls_of

#: CityJSON's types of objects of a class; all others are buildings.
_CITY_OBJECTS = {
    "furniture": "CityFurniture",
    "fountain": "CityFurniture",
    "post": "CityFurniture",
    "tree": "SolitaryVegetationObject",
    "ground": "OtherConstruction",
}
#: Names of classes that would equal those of parts of the ground.
_NAMED = {kind: f"{kind}-object" for kind in GROUND} | {"ground": "ground-levelled"}


class Objects(NamedTuple):
    """What stands on a map: the map, its walls and classes, library objects or None, and the source
    city of each building, which may be empty.

    storey : height of a storey, metres.
    offset, size : the south-west corner in the map's reference system, and the map's width and
        depth; metres.
    """

    city: CityMap
    walls: Walls
    classes: Classes
    substitution: Substitution | None
    sources: Sequence[str]
    storey: float
    offset: tuple[float, float]
    size: tuple[float, float]


def group_objects(objects: Objects) -> list[Group]:
    """Return a group of solids for each class: buildings, and objects lower than buildings. Each
    building has its id, its area in m², its storeys, and its source city."""
    classes, walls, offset = objects.classes, objects.walls, objects.offset
    polygons = np.array(walls.polygons, dtype=object)
    heights, which = walls.heights, classes.of_buildings[walls.buildings - 1]
    fields: dict[str, np.ndarray] = {"id": walls.buildings}
    laid = objects.substitution
    if laid is not None:
        polygons, heights = laid.polygons, laid.heights
        fields["object"] = np.array([name or "" for name in laid.ids], dtype=object)
    if len(objects.sources):
        fields["source"] = np.array(objects.sources, dtype=object)[walls.buildings - 1]
    polygons = shapely.transform(polygons, lambda points: points - offset)
    fields["area"] = np.round(shapely.area(polygons), 3)
    storeys = np.floor(heights / objects.storey + 0.5)
    fields["storeysAboveGround"] = np.maximum(storeys, 1).astype(int)
    groups = []
    low = _low_objects(objects)
    for number, name in enumerate(classes.names):
        own, lower = which == number, low[2] == number
        if not (own.any() or lower.any() or name == "building"):
            continue
        columns = {key: column[own].tolist() for key, column in fields.items()}
        # objects lower than buildings only have an area
        areas = np.round(shapely.area(low[0][lower]), 3).tolist()
        more = dict.fromkeys(columns, [None] * len(areas)) | {"area": areas}
        columns = {key: values + more[key] for key, values in columns.items()}
        kinds = [_CITY_OBJECTS.get(name, "Building")] * int(own.sum())
        kinds += [_CITY_OBJECTS.get(name, "OtherConstruction")] * len(areas)
        red, green, blue = (float(c) / 255 for c in classes.table.rgb[number])
        group = Group(
            _NAMED.get(name, name),
            (red, green, blue),
            np.concatenate([polygons[own], low[0][lower]]),
            np.concatenate([heights[own], low[1][lower]]),
            columns,
            kinds,
            None if laid is None else laid.copies(offset, own, int(lower.sum())),
        )
        groups.append(group)
    return groups


def _low_objects(objects: Objects) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return polygons, heights and classes of objects lower than buildings."""
    classes, city = objects.classes, objects.city
    count, first = len(classes), classes.buildings
    if count == first:
        return np.empty(0, object), np.empty(0), np.empty(0, np.uint8)
    labels = np.maximum(classes.labels - np.int32(first), np.int32(0))
    corner = (0.0, objects.size[1])
    unknown = np.full(count - first, np.nan)
    heights = classes.height[first:]
    walls = walls_of(labels, heights, unknown, city.metres_per_pixel, corner, site=city.site)
    kinds = classes.classes[first:][walls.buildings - 1]
    return np.array(walls.polygons, dtype=object), walls.heights, kinds


def check_sources(city: CityMap, sources: Sequence[str]) -> tuple[str, ...]:
    """Return the names of the source cities as a tuple. Raises `MapError` unless ``sources`` has a
    name for each building of ``city``, or is empty."""
    count = len(city.buildings)
    if isinstance(sources, str) or len(sources) not in (0, count):
        raise MapError(
            f"sources = {spell(sources)} for a map with {count} buildings",
            "a name for each building of the map, or no names",
            "take them from evocity.fitness.heredity.building_sources(city, genome)",
        )
    return tuple(plain_text(str(name)) for name in sources)
