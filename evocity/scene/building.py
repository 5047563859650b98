"""What stands where: solids on straight walls, on their ground."""

import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely

from evocity.citymap import STOREY, CityMap
from evocity.errors import MapError, plain_text, shown
from evocity.formats import About, Group
from evocity.io.writing import save_picture, write_map
from evocity.scene.library import Library
from evocity.scene.picture import drawn, triangles
from evocity.scene.substitution import Substitution, substituted
from evocity.scene.writing import check_place, check_suffix, whole, write
from evocity.views.buildings import outlines
from evocity.views.classes import Classes, ClassTable
from evocity.views.pieces import pieces
from evocity.views.walls import Walls, walls_of

if TYPE_CHECKING:
    from PIL import Image

#: The ground's colour and the streets', sRGB.
_GROUND, _STREETS = (0.86, 0.84, 0.79), (0.66, 0.69, 0.74)
#: What CityJSON calls an object of a class; all others are buildings.
_CITY_OBJECTS = {
    "furniture": "CityFurniture",
    "fountain": "CityFurniture",
    "post": "CityFurniture",
    "tree": "SolitaryVegetationObject",
    "ground": "OtherConstruction",
}
#: Classes that share their name with the ground and the streets themselves.
_NAMED = {"ground": "ground-levelled", "street": "street-object"}


@dataclass(frozen=True, eq=False)
class Scene:
    """A map in three dimensions.

    city : the map. walls : its buildings, as they were fitted. classes : what each is, and what is
    lower than buildings. streets : whether they are surfaces of their own. substitution : objects
    of a library in place of buildings, or None. measures : values of the map's measures, by name,
    which files keep. storey : height by which storeys are counted, metres.

    >>> import numpy as np, evocity
    >>> heights = np.zeros((32, 32))
    >>> heights[8:20, 10:24] = 9
    >>> scene = evocity.scene(evocity.CityMap(heights, 2.0))
    >>> [(group.name, len(group), len(group.mesh.triangles)) for group in scene.groups]
    [('ground', 1, 2), ('building', 1, 12)]
    """

    city: CityMap
    walls: Walls
    classes: Classes
    streets: bool = False
    substitution: Substitution | None = None
    measures: Mapping[str, float] = field(default_factory=dict)
    storey: float = STOREY

    @cached_property
    def groups(self) -> tuple[Group, ...]:
        """Solids by kind: the ground and the streets, surfaces; buildings and whatever else stands
        there, a group a class, from the ground to flat roofs. In metres from the map's south-west
        corner."""
        ground = self._site
        flat = [("ground", _GROUND, ground, {}, "LandUse")]
        if self.streets:
            roads, kinds = self._roads(ground)
            left = shapely.difference(ground, shapely.union_all(roads))
            flat = [
                ("ground", _GROUND, _parts(left), {}, "LandUse"),
                ("street", _STREETS, roads, {"kind": kinds}, "Road"),
            ]
        surfaces = [
            Group(name, colour, polygons, np.zeros(len(polygons)), attributes, what)
            for name, colour, polygons, attributes, what in flat
        ]
        return (*surfaces, *self._objects)

    @property
    def _site(self) -> np.ndarray:
        """The whole map, or its site, as polygons."""
        city, pixel = self.city, self.city.metres_per_pixel
        wide, deep = self._size
        if city.site is None:
            return np.array([shapely.box(0, 0, wide, deep)], dtype=object)
        labels, _ = pieces(city.site)
        return np.array(outlines(labels, pixel, (0.0, deep)), dtype=object)

    def _roads(self, ground: np.ndarray) -> tuple[np.ndarray, list[str]]:
        """Surfaces of the streets that overlap nowhere, and the kind of each."""
        graph = self.city.street_graph
        standing = self.walls.polygons if self.substitution is None else self.substitution.polygons
        ribbons = self.local(np.array(graph.ribbons(standing), dtype=object))
        own, taken = shapely.union_all(ground), shapely.Polygon()
        roads, names = [], []
        for kind in dict.fromkeys(graph.kind.tolist()):
            surface = shapely.union_all(ribbons[graph.kind == kind])
            surface = shapely.difference(shapely.intersection(surface, own), taken)
            parts = _parts(shapely.set_precision(surface, 1e-3))
            taken = shapely.union(taken, surface)
            roads.append(parts)
            names += [kind] * len(parts)
        return np.concatenate([np.empty(0, object), *roads]), names

    @property
    def _objects(self) -> list[Group]:
        classes, walls = self.classes, self.walls
        polygons = np.array(walls.polygons, dtype=object)
        heights, which = walls.heights, classes.of_buildings[walls.buildings - 1]
        told: dict[str, np.ndarray] = {"id": walls.buildings}
        laid = self.substitution
        if laid is not None:
            polygons, heights = laid.polygons, laid.heights
            told["object"] = np.array([one or "" for one in laid.ids], dtype=object)
        polygons = self.local(polygons)
        told["area"] = np.round(shapely.area(polygons), 3)
        storeys = np.floor(heights / self.storey + 0.5)
        told["storeysAboveGround"] = np.maximum(storeys, 1).astype(int)
        groups = []
        low = self._low
        for number, name in enumerate(classes.names):
            own, lower = which == number, low[2] == number
            if not (own.any() or lower.any() or name == "building"):
                continue
            columns = {key: column[own].tolist() for key, column in told.items()}
            # objects lower than buildings have an area alone
            areas = np.round(shapely.area(low[0][lower]), 3).tolist()
            more = dict.fromkeys(columns, [None] * len(areas)) | {"area": areas}
            columns = {key: one + more[key] for key, one in columns.items()}
            kinds = [_CITY_OBJECTS.get(name, "Building")] * int(own.sum())
            kinds += [_CITY_OBJECTS.get(name, "OtherConstruction")] * len(areas)
            group = Group(
                _NAMED.get(name, name),
                tuple(float(c) / 255 for c in classes.table.rgb[number]),
                np.concatenate([polygons[own], low[0][lower]]),
                np.concatenate([heights[own], low[1][lower]]),
                columns,
                kinds,
                None if laid is None else laid.copies(self._offset, own, int(lower.sum())),
            )
            groups.append(group)
        return groups

    @property
    def _low(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Polygons, heights and classes of what is lower than buildings."""
        classes, city = self.classes, self.city
        count, first = len(classes), classes.buildings
        if count == first:
            return np.empty(0, object), np.empty(0), np.empty(0, np.uint8)
        labels = np.maximum(classes.labels - np.int32(first), np.int32(0))
        corner = (0.0, self._size[1])
        unknown = np.full(count - first, np.nan)
        heights = classes.height[first:]
        found = walls_of(labels, heights, unknown, city.metres_per_pixel, corner, site=city.site)
        kinds = classes.classes[first:][found.buildings - 1]
        return np.array(found.polygons, dtype=object), found.heights, kinds

    def local(self, polygons: np.ndarray) -> np.ndarray:
        """``polygons`` of the map's reference system in metres from its south-west corner."""
        return shapely.transform(polygons, lambda points: points - self._offset)

    @cached_property
    def about(self) -> About:
        """Name, attribution, place and measures."""
        from evocity.io.polygons import placing  # GDAL takes a tenth of a second to load

        city = self.city
        crs, center = placing(city)
        window = (*center, city.metres_per_pixel)
        measures = {name: float(value) for name, value in self.measures.items()}
        credit = self._attribution
        return About(plain_text(city.name), credit, crs, self._offset, self._size, window, measures)

    @property
    def _size(self) -> tuple[float, float]:
        """Metres along and down the map."""
        deep, wide = (side * self.city.metres_per_pixel for side in self.city.shape)
        return wide, deep

    @property
    def _offset(self) -> tuple[float, float]:
        """The map's south-west corner in its reference system, metres."""
        at = self.city.origin
        return (0.0, 0.0) if at is None else (at[0], at[1] - self._size[1])

    @property
    def _attribution(self) -> str:
        """Whom to thank for the map, and for the objects on it."""
        lines = self.city.attribution.split("; ")
        if self.substitution is not None:
            lines += self.substitution.attribution.split("; ")
        return plain_text("; ".join(line for line in dict.fromkeys(lines) if line))

    def picture(self, **how: Any) -> "Image.Image":
        """An axonometric picture, with shadows: parallel lines stay parallel, and lengths along the
        horizontal are true to the scale bar.

        width : px, of what is drawn, 16 to 8192; its height follows.
        azimuth, tilt : where one looks to, degrees clockwise from north, and from how many degrees
            above the horizon, 1 to 90, from where it is a plan.
        sun : where the sun stands, degrees clockwise from north and above the horizon.
        shadows : whether what stands in its light casts them.
        colours : "heights", of roofs, on the scale of maps; or "classes".
        highest : metres at which the colours of heights end; None for the map's own.
        legend : add name, colour scale, scale bar, north, the sun, and the attribution. Without it
            who shows the picture owes the attribution.

        Raises `MapError` for what these cannot be. Source: the z-buffer, Catmull 1974; shadows by a
        second one from the sun, Williams 1978. About .2 s for a dense map of 256².
        """
        return drawn(self._thanked, self.groups, **how)

    def triangles(
        self, colours: str = "heights", highest: float | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """All surfaces, to be drawn elsewhere: corners, float32 ``(t, 3, 3)``, metres from the
        south-west corner, x to the east, y to the north, z up, against the clock as seen from
        outside; and of each its colour, uint8 ``(t, 3)``. ``colours`` and ``highest`` as of
        `picture`, which raises the same errors.
        """
        return triangles(self.city, self.groups, colours, highest)

    def write(self, path: str | os.PathLike, **how: Any) -> None:
        """Write the scene; the end of ``path`` chooses the format: `evocity.scene.SUFFIXES`. A .png
        is drawn as ``how`` tells `picture`.

        Raises `MapError` for another end, no such folder, or where nothing can be written. Nothing
        half-written is left, and a file that was there stays as it was.
        """
        path = Path(path)
        suffix = check_suffix(path)
        if suffix == ".gpkg":
            walls, more = self._footprints
            write_map(self._thanked, path, streets=self.streets, walls=walls, columns=more)
        elif suffix == ".png":
            check_place(path)
            picture = self.picture(**how)
            with whole(path) as temporary:
                save_picture(picture, self._thanked, self.city.name, temporary)
        else:
            write(self.groups, self.about, path)

    @property
    def _thanked(self) -> CityMap:
        """The map with the attribution of all that stands on it."""
        credit = self._attribution
        return (
            self.city
            if credit == self.city.attribution
            else self.city.replace(self.city.heights, attribution=credit)
        )

    @property
    def _footprints(self) -> tuple[Walls, dict[str, np.ndarray]]:
        """What stands where, as `write_map` takes it, and columns of it: class and object."""
        walls, classes = self.walls, self.classes
        names = np.array(classes.names, dtype=object)
        columns = {"class": names[classes.of_buildings[walls.buildings - 1]]}
        laid = self.substitution
        if laid is not None:
            polygons = tuple(laid.polygons)
            walls = replace(walls, polygons=polygons, heights=laid.heights)
            columns["object"] = np.array([one or "" for one in laid.ids], dtype=object)
        return walls, columns


def _parts(shape: shapely.Geometry) -> np.ndarray:
    """The polygons of what was made of polygons: shared points and lines are left out."""
    parts = shapely.get_parts(np.atleast_1d(shape))
    parts = shapely.get_parts(parts)
    return parts[(shapely.get_type_id(parts) == 3) & (shapely.area(parts) > 1e-6)]


def scene(
    city: CityMap,
    *,
    classes: ClassTable | str | os.PathLike | None = None,
    library: Library | str | os.PathLike | None = None,
    rng: np.random.Generator | None = None,
    streets: bool = False,
    measures: Mapping[str, float] | None = None,
    **how: Any,
) -> Scene:
    """A map in three dimensions: its buildings as solids with floors, walls and flat roofs, what
    is lower than buildings, and its ground.

    classes : what is told apart, and in which colours, or the path of its TOML file; None for the
        seven of this package.
    library : objects that take the place of buildings where they fit, or their folder; which of
        several that fit alike, ``rng`` draws (None: of the seed 0).
    streets : whether the streets are surfaces of their own.
    measures : values of the map's measures, by name, which CityJSON keeps as attributes.
    ``how`` the walls are fitted: ``detail``, ``relative``, ``squared``, ``storeys``, ``least_area``
        of `CityMap.walled`, which raises `MapError` for what they cannot be.
    """
    if not isinstance(city, CityMap):
        raise MapError(
            f"a scene of {shown(city)}",
            "a CityMap",
            "read it first, with evocity.read_map(…), or evocity.decode(genome).city",
        )
    if isinstance(classes, str | os.PathLike):
        classes = ClassTable.read(classes)
    if isinstance(library, str | os.PathLike):
        library = Library.read(library)
    walls = city.walled(**how) if how else city.walls
    found = city.classes if classes is None else city.classified(classes)
    laid = None
    if library is not None:
        rng = np.random.default_rng(0) if rng is None else rng
        laid = substituted(city, library, rng, walls=walls, classes=found)
    storey = how.get("storeys") or STOREY
    return Scene(city, walls, found, streets, laid, measures or {}, storey)
