"""What stands where: solids on straight walls, on their ground."""

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import shapely

from evocity.citymap import STOREY, CityMap
from evocity.formats import About, Group
from evocity.io.polygons import placing
from evocity.scene.writing import write
from evocity.views.walls import Walls

#: The blue grey of buildings (Marsault 2005 §3.1), and the ground's, sRGB.
_BUILDINGS = (0.56, 0.63, 0.70)
_GROUND = (0.86, 0.84, 0.79)


@dataclass(frozen=True, eq=False)
class Scene:
    """A map in three dimensions.

    city : the map. walls : its buildings, as they were fitted. measures : values of its measures,
    by name, which files keep.

    >>> import numpy as np, evocity
    >>> heights = np.zeros((32, 32))
    >>> heights[8:20, 10:24] = 9
    >>> scene = evocity.scene(evocity.CityMap(heights, 2.0))
    >>> [(group.name, len(group), len(group.mesh.triangles)) for group in scene.groups]
    [('ground', 1, 2), ('building', 1, 12)]
    """

    city: CityMap
    walls: Walls
    measures: Mapping[str, float] = field(default_factory=dict)

    @cached_property
    def groups(self) -> tuple[Group, ...]:
        """Solids by kind: the ground, a surface; the buildings, from the ground to flat roofs. In
        metres from the map's south-west corner."""
        return (self._ground, self._buildings)

    @property
    def _buildings(self) -> Group:
        walls = self.walls
        polygons = self.local(np.array(walls.polygons, dtype=object))
        attributes = {
            "id": walls.buildings.tolist(),
            "area": np.round(shapely.area(polygons), 3).tolist(),
            "storeysAboveGround": np.maximum(np.round(walls.heights / STOREY), 1)
            .astype(int)
            .tolist(),
        }
        return Group("building", _BUILDINGS, polygons, walls.heights, attributes)

    @property
    def _ground(self) -> Group:
        """The whole map, or its site."""
        city, pixel = self.city, self.city.metres_per_pixel
        wide, deep = self.about.size
        ground = np.array([shapely.box(0, 0, wide, deep)], dtype=object)
        if city.site is not None:
            rows, columns = np.nonzero(city.site)
            left, top = columns * pixel, deep - rows * pixel
            boxes = shapely.box(left, top - pixel, left + pixel, top)
            ground = shapely.get_parts(np.atleast_1d(shapely.union_all(boxes)))
        return Group("ground", _GROUND, ground, np.zeros(len(ground)), city_object="LandUse")

    def local(self, polygons: np.ndarray) -> np.ndarray:
        """``polygons`` of the map's reference system in metres from its south-west corner."""
        return shapely.transform(polygons, lambda points: points - self.about.offset)

    @cached_property
    def about(self) -> About:
        """Name, attribution, place and measures."""
        city = self.city
        deep, wide = (side * city.metres_per_pixel for side in city.shape)
        offset = (0.0, 0.0) if city.origin is None else (city.origin[0], city.origin[1] - deep)
        crs, center = placing(city)
        window = (*center, city.metres_per_pixel)
        measures = dict(self.measures)
        return About(city.name, city.attribution, crs, offset, (wide, deep), window, measures)

    def write(self, path: str | os.PathLike) -> None:
        """Write the scene; the end of ``path`` chooses the format: `evocity.scene.SUFFIXES`.

        Raises `MapError` for another end, no such folder, or where nothing can be written. Nothing
        half-written is left, and a file that was there stays as it was.
        """
        write(self.groups, self.about, path)


def scene(city: CityMap, *, measures: Mapping[str, float] | None = None, **how) -> Scene:
    """A map in three dimensions: its buildings as solids with floors, walls and flat roofs, and
    its ground.

    ``measures`` : values of the map's measures, by name, which CityJSON keeps as attributes.
    ``how`` the walls are fitted: ``detail``, ``relative``, ``squared``, ``storeys``, ``least_area``
    of `CityMap.walled`, which raises `MapError` for what they cannot be.
    """
    return Scene(city, city.walled(**how) if how else city.walls, measures or {})
