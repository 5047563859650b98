"""`Scene`: solids of a map's buildings and other objects on their ground."""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely

from evocity import formats
from evocity.citymap import STOREY, CityMap
from evocity.errors import MapError, plain_text, spell
from evocity.formats import About, Group
from evocity.io.writers import check_place, open_output, save_picture, write_map
from evocity.scene.library import Library
from evocity.scene.picture import draw_scene, triangles
from evocity.scene.substitution import Substitution, substituted
from evocity.views.buildings import outlines
from evocity.views.classes import Classes, ClassTable
from evocity.views.connected_components import pieces
from evocity.views.walls import Walls, walls_of

if TYPE_CHECKING:
    from PIL import Image

_WRITERS: dict[str, Callable[[Sequence[Group], About], str | bytes]] = {
    ".city.json": formats.cityjson,
    ".glb": formats.glb,
    ".obj": formats.obj,
    ".wrl": formats.vrml97,
    ".x3d": formats.x3d,
}

#: Suffixes of scenes: CityJSON 2.0, binary glTF 2.0, Wavefront OBJ, VRML97 and X3D; footprints in a
#: GeoPackage; and a picture.
SUFFIXES = (*_WRITERS, ".gpkg", ".png")

#: The ground's colour and the streets', sRGB.
_GROUND, _STREETS = (0.86, 0.84, 0.79), (0.66, 0.69, 0.74)
#: CityJSON's types of objects of a class; all others are buildings.
_CITY_OBJECTS = {
    "furniture": "CityFurniture",
    "fountain": "CityFurniture",
    "post": "CityFurniture",
    "tree": "SolitaryVegetationObject",
    "ground": "OtherConstruction",
}
#: Names of classes that would equal those of the ground and the streets.
_NAMED = {"ground": "ground-levelled", "street": "street-object"}


@dataclass(frozen=True, eq=False)
class Scene:
    """A map in three dimensions.

    city : the map.
    walls : the fitted walls of the map's buildings.
    classes : the class of each building, and of each object lower than a building.
    streets : whether streets are separate surfaces.
    substitution : the `Substitution` of buildings by objects of a library, or None.
    measures : values of the map's measures by name; files of the scene include these values.
    storey : height of a storey, metres.

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
        """Solids by kind, in metres from the map's south-west corner: the ground and the streets as
        surfaces; buildings and other objects, a group for each class, with flat roofs."""
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
        """Make surfaces of the streets without overlaps, and the kind of each."""
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
        fields: dict[str, np.ndarray] = {"id": walls.buildings}
        laid = self.substitution
        if laid is not None:
            polygons, heights = laid.polygons, laid.heights
            fields["object"] = np.array([name or "" for name in laid.ids], dtype=object)
        polygons = self.local(polygons)
        fields["area"] = np.round(shapely.area(polygons), 3)
        storeys = np.floor(heights / self.storey + 0.5)
        fields["storeysAboveGround"] = np.maximum(storeys, 1).astype(int)
        groups = []
        low = self._low
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
        """Polygons, heights and classes of objects lower than buildings."""
        classes, city = self.classes, self.city
        count, first = len(classes), classes.buildings
        if count == first:
            return np.empty(0, object), np.empty(0), np.empty(0, np.uint8)
        labels = np.maximum(classes.labels - np.int32(first), np.int32(0))
        corner = (0.0, self._size[1])
        unknown = np.full(count - first, np.nan)
        heights = classes.height[first:]
        walls = walls_of(labels, heights, unknown, city.metres_per_pixel, corner, site=city.site)
        kinds = classes.classes[first:][walls.buildings - 1]
        return np.array(walls.polygons, dtype=object), walls.heights, kinds

    def local(self, polygons: np.ndarray) -> np.ndarray:
        """Convert polygons from the map's reference system to metres from the map's south-west
        corner."""
        return shapely.transform(polygons, lambda points: points - self._offset)

    @cached_property
    def about(self) -> About:
        """Name, attribution, place and measures."""
        from evocity.io.footprint_files import (
            coded_grid,
            placement,
        )  # GDAL takes a tenth of a second to load

        city = self.city
        crs, center = placement(city)
        window = (*center, city.metres_per_pixel)
        measures = {name: float(value) for name, value in self.measures.items()}
        credit = self._attribution
        return About(
            name=plain_text(city.name),
            attribution=credit,
            crs=crs,
            offset=self._offset,
            size=self._size,
            window=window,
            measures=measures,
            grid=coded_grid(city),
        )

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
        """The attribution of the map and of the objects on it."""
        lines = self.city.attribution.split("; ")
        if self.substitution is not None:
            lines += self.substitution.attribution.split("; ")
        return plain_text("; ".join(line for line in dict.fromkeys(lines) if line))

    def picture(self, **how: Any) -> "Image.Image":
        """Draw an axonometric picture with shadows. Parallel lines stay parallel, and the scale bar
        holds for lines that are horizontal in the picture.

        width : width of the picture in px, 16 to 8192; the height of the picture follows from the
            width.
        azimuth : direction in which the viewer looks, in degrees clockwise from north.
        tilt : angle of the viewer above the horizon, 1 to 90 degrees; 90 gives a plan.
        sun : direction of the sun in degrees clockwise from north, and the sun's angle above the
            horizon in degrees.
        shadows : whether objects cast shadows in the picture.
        colours : "heights" colours roofs by their height, on the scale of maps; "classes" colours
            objects by their class.
        highest : height in metres at which the colour scale ends; None means the scale of the map.
        legend : whether to add the map's name, colour scale, scale bar, north arrow, direction of
            the sun, and attribution. If the picture has no legend, show the attribution of the map
            beside the picture.

        Raises `MapError` for values out of range. Sources: Catmull 1974 describes the z-buffer, and
        Williams 1978 describes shadows by a second z-buffer from the sun. A picture of a dense map
        of 256 × 256 px takes about 0.2 s.
        """
        return draw_scene(self._credited_city, self.groups, **how)

    def triangles(
        self, colours: str = "heights", highest: float | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return all surfaces as triangles: their corners and their colours. Corners are float32
        ``(t, 3, 3)`` in metres from the south-west corner. The x axis runs to the east, the y axis
        to the north, and the z axis upwards. Seen from outside the solid, the corners of a triangle
        run counterclockwise. Colours are uint8 ``(t, 3)``. The parameters and errors are those of
        the method `picture`.
        """
        return triangles(self.city, self.groups, colours, highest)

    def write(self, path: str | os.PathLike, **how: Any) -> None:
        """Write the scene. The suffix of ``path`` chooses the format, one of
        `evocity.scene.SUFFIXES`. For a ``.png`` file, the argument ``how`` holds the options of the
        method `picture`.

        Raises `MapError` for a suffix outside `SUFFIXES`, a missing folder, or a file that cannot
        be written. If writing fails, no partial file remains, and a previous file stays unchanged.
        """
        path = Path(path)
        suffix = check_suffix(path)
        if suffix == ".gpkg":
            walls, more = self._footprints
            write_map(self._credited_city, path, streets=self.streets, walls=walls, columns=more)
        elif suffix == ".png":
            check_place(path)
            picture = self.picture(**how)
            with open_output(path) as temporary:
                save_picture(picture, self._credited_city, self.city.name, temporary)
        else:
            write(self.groups, self.about, path)

    @property
    def _credited_city(self) -> CityMap:
        """The map with the attribution of all objects on it."""
        city, credit = self.city, self._attribution
        return (
            city if credit == city.attribution else city.replace(city.heights, attribution=credit)
        )

    @property
    def _footprints(self) -> tuple[Walls, dict[str, np.ndarray]]:
        """The footprints as `write_map` takes them, with columns: class and object."""
        walls, classes = self.walls, self.classes
        names = np.array(classes.names, dtype=object)
        columns = {"class": names[classes.of_buildings[walls.buildings - 1]]}
        laid = self.substitution
        if laid is not None:
            polygons = tuple(laid.polygons)
            walls = replace(walls, polygons=polygons, heights=laid.heights)
            columns["object"] = np.array([name or "" for name in laid.ids], dtype=object)
        return walls, columns


def _parts(shape: shapely.Geometry) -> np.ndarray:
    """Return the polygons in a result of an overlay, without its points and lines."""
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
    """Make a scene of a map, with its ground, its buildings, and its objects lower than buildings.
    Each building is a solid with a floor, walls and a flat roof.

    classes : a table of classes and their colours, or the path of a TOML file with such a table. If
        ``classes`` is None, the scene has the seven default classes of evocity.
    library : a `Library` of objects, or the path of a folder that contains a library. If an object
        of the library fits a building, the object replaces the building. The generator ``rng``
        chooses between objects that fit equally well; None means a generator with the seed 0.
    streets : whether the streets are separate surfaces.
    measures : values of the map's measures by name; CityJSON files store these values as
        attributes.
    how : options of `CityMap.walled` for the walls: ``detail``, ``relative``, ``squared``,
        ``storeys`` and ``least_area``. Values out of range raise `MapError`.
    """
    if not isinstance(city, CityMap):
        raise MapError(
            f"a scene cannot be made of {spell(city)}",
            "an object of the class CityMap",
            "read a map with evocity.read_map(…), or decode a genome: evocity.decode(genome).city",
        )
    if isinstance(classes, str | os.PathLike):
        classes = ClassTable.read(classes)
    if isinstance(library, str | os.PathLike):
        library = Library.read(library)
    walls = city.walled(**how) if how else city.walls
    table = city.classes if classes is None else city.classified(classes)
    laid = None
    if library is not None:
        rng = np.random.default_rng(0) if rng is None else rng
        laid = substituted(city, library, rng, walls=walls, classes=table)
    storey = how.get("storeys") or STOREY
    return Scene(city, walls, table, streets, laid, measures or {}, storey)


def suffix_of(path: Path) -> str | None:
    """Return the suffix of a file name if it is a suffix of scene files, and otherwise None."""
    name = path.name.lower()
    return next((end for end in SUFFIXES if name.endswith(end) and name != end), None)


def check_suffix(path: Path) -> str:
    """Return the suffix of ``path``, if it is a suffix of scene files. Raises `MapError` for a
    ``path`` without a suffix of scene files."""
    suffix = suffix_of(path)
    if suffix is None:
        plain = "use .city.json, not .json; " if path.suffix.lower() == ".json" else ""
        raise MapError(
            f"{path.name}: scenes cannot be written to {path.suffix or 'a file without a suffix'}",
            f"a name that ends in {', '.join(SUFFIXES)}",
            f"{plain}choose .city.json for GIS, .glb for Blender and browsers, .obj for Rhino",
        )
    return suffix


def write(groups: Sequence[Group], about: About, path: str | os.PathLike) -> None:
    """Write groups of solids, as `Scene.write`."""
    path = Path(path)
    suffix = check_suffix(path)
    check_place(path)
    content = _WRITERS[suffix](groups, about)
    data = content if isinstance(content, bytes) else content.encode("utf-8")
    with open_output(path) as temporary:
        temporary.write_bytes(data)
