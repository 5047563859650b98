"""`Scene`: solids of a map's buildings and other objects on their ground."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely

from evocity.citymap import STOREY, CityMap
from evocity.errors import MapError, keyword, plain_text, spell
from evocity.formats import About, Group
from evocity.formats.trees import mesh_of
from evocity.io.writers import (
    TABLES,
    check_place,
    check_water,
    open_output,
    save_picture,
    write_map,
)
from evocity.scene.blocks import walls_at
from evocity.scene.detail import (
    check_budget,
    check_format,
    check_level,
    check_library,
    detailed,
    levels_from,
    too_many,
)
from evocity.scene.export import UNPLACED, check_options, check_suffix, write
from evocity.scene.ground import bare_ground, below_trees, paved_ground
from evocity.scene.library import Library
from evocity.scene.noding import join_nodes
from evocity.scene.objects import Objects, check_sources, group_objects
from evocity.scene.picture import draw_scene, triangles
from evocity.scene.roofs import (
    RoofSurface,
    check_curved,
    check_heights,
    check_roofs,
    heights_are_ridges,
    level_of,
    raise_roofs,
)
from evocity.scene.roofs.checks import StoredHeights
from evocity.scene.substitution import Substitution, substituted
from evocity.views.classes import Classes, ClassTable
from evocity.views.walls import Walls

if TYPE_CHECKING:
    from PIL import Image


@dataclass(frozen=True, eq=False)
class Scene:
    """A map in three dimensions.

    city : the map.
    walls : the fitted walls of the map's buildings.
    classes : the class of each building, and of each object lower than a building.
    streets : whether the ground is divided into streets, squares, courts and other surfaces.
    substitution : the `Substitution` of buildings by objects of a library, or None.
    measures : values of the map's measures by name; files of the scene include these values.
    storey : height of a storey, metres.
    sources : the name of the source city of each building, in the order of `CityMap.buildings`; an
        empty text means that it has none. If ``sources`` is empty, nothing is known about them.
    lod : level of detail, one of `evocity.scene.LEVELS`.
    fitting : the options of `CityMap.walled` for the walls.
    water : bool ``(H, W)``, open ground that is water; None for a map without water.
    given_roofs : int ``(n, 2)``, the roof of each building, as in the function `scene`; or None.
    credit : attribution of other files in the scene, such as that of the water.
    curved : the form of the roofs of wide buildings whose roofs are not pitched; None for flat
        roofs.

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
    sources: Sequence[str] = ()
    lod: str = "1.3"
    fitting: Mapping[str, Any] = field(default_factory=dict)
    water: np.ndarray | None = None
    given_roofs: np.ndarray | None = None
    credit: str = ""
    curved: RoofSurface | None = None

    @cached_property
    def groups(self) -> tuple[Group, ...]:
        """Solids by kind, in metres from the map's south-west corner: the ground and the streets as
        surfaces; buildings and other objects, a group for each class. Roofs are flat, except in LoD
        2.2."""
        walls, offset, laid = self.walls, self.city.south_west, self.substitution
        noded = None
        if self.streets and self.lod != "afar":
            standing = walls.polygons if laid is None else laid.polygons
            polygons = self.local(np.array(standing, dtype=object))
            roofs = self.lod == "2.2" and laid is None
            surfaces, local, plain = paved_ground(self.city, walls, polygons, self.water, roofs)
            if laid is None:  # library objects keep their shapes
                walls, noded, offset = plain, local, (0.0, 0.0)
        else:
            surfaces = bare_ground(self.city)
        more = (self.classes, laid, self.sources, self.storey, offset, self._size)
        objects = group_objects(Objects(self.city, walls, *more))
        if self.lod == "2.2":
            ridges = heights_are_ridges(self.city.height_rules, self.city.attribution)
            shapes = self.city.roof_shapes
            if shapes is not None:
                shapes = shapes - (*self.city.south_west, 0, 0)
            own = shapes, self.given_roofs, self.curved
            objects = raise_roofs(objects, self._size, self.storey, ridges, *own)
            if noded is not None:
                objects = join_nodes(objects, group_objects(Objects(self.city, noded, *more)))
        if self.streets and self.lod != "afar":
            surfaces = below_trees(surfaces, objects)
        return detailed((*surfaces, *objects), self.lod)

    @property
    def ridges(self) -> np.ndarray:
        """Bool ``(n,)``: whether the height of each of the `walls` measures to the ridge; otherwise
        it measures to the eaves."""
        if self.given_roofs is not None:
            return self.given_roofs[self.walls.buildings - 1, 1] > 0
        ridges = heights_are_ridges(self.city.height_rules, self.city.attribution)
        return np.full(len(self.walls), ridges)

    def local(self, polygons: np.ndarray) -> np.ndarray:
        """Convert polygons from the map's reference system to metres from the map's south-west
        corner."""
        return shapely.transform(polygons, lambda points: points - self.city.south_west)

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
            offset=self.city.south_west,
            size=self._size,
            window=window,
            measures=measures,
            grid=coded_grid(city),
            lod=self.lod,
        )

    @property
    def _size(self) -> tuple[float, float]:
        """Metres along and down the map."""
        deep, wide = (side * self.city.metres_per_pixel for side in self.city.shape)
        return wide, deep

    @property
    def _attribution(self) -> str:
        """The attribution of the map, of the objects on it, and of other files."""
        lines = [*self.city.attribution.split("; "), *self.credit.split("; ")]
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

    @property
    def triangle_counts(self) -> dict[str, int]:
        """Number of triangles of each group, as files draw them."""
        return {group.name: len(mesh_of(group).triangles) for group in self.groups}

    @property
    def triangle_count(self) -> int:
        """Number of triangles of all groups."""
        return sum(self.triangle_counts.values())

    def write(self, path: str | os.PathLike, *, crs: str | None = None, **how: Any) -> None:
        """Write the scene. The suffix of ``path`` chooses the format, one of
        `evocity.scene.SUFFIXES`. For a ``.png`` file, the argument ``how`` holds the options of the
        method `picture`. For a ``.glb`` file, ``how`` holds the options of
        `evocity.formats.glb`: ``merge`` and ``instances``. For ``.stl`` and ``.3mf`` files, ``how``
        holds ``side``, the longest side of the print in mm, 10 to 10 000. For an ``.obj`` file, the
        method also writes the materials, a file with the suffix ``.mtl``. Files with the suffixes
        ``.dxf`` and ``.3dm`` need the extra ``cad``.

        crs : reference system of the coordinates, a code such as ``"EPSG:2154"``; None keeps the
            map's own. Only files of footprints may have degrees.

        Raises `MapError` for options of another format, a suffix outside `SUFFIXES`, a missing
        folder, a ``crs`` that does not fit, or a file that cannot be written. If writing fails, no
        partial file remains, and a previous file stays unchanged.
        """
        path = Path(path)
        suffix = check_suffix(path)
        check_format(self.lod, suffix, self.streets)
        if suffix != ".png":
            check_options(path, how)
        if crs is not None and suffix in UNPLACED:
            raise MapError(
                f"{path.name}: a {suffix} file has no coordinates for {keyword('crs', crs)}",
                "a file with coordinates on Earth, for example .city.json, .glb or .gpkg",
                f"choose another suffix, or leave {keyword('crs')} out",
            )
        if suffix in TABLES:
            walls, more = self._footprints
            own = {"walls": walls, "columns": more, "classes": self.classes, "crs": crs}
            write_map(self._credited_city, path, streets=self.streets, water=self.water, **own)
        elif suffix == ".png":
            check_place(path)
            picture = self.picture(**how)
            with open_output(path) as temporary:
                save_picture(picture, self._credited_city, self.city.name, temporary)
        else:
            write(*self.placed(crs), path, **how)

    def placed(self, crs: str | None = None) -> tuple[tuple[Group, ...], About]:
        """Return the groups and their description in the reference system ``crs``, as `write`; None
        means the map's own. Raises `MapError` for a ``crs`` that does not fit."""
        if crs is None:
            return self.groups, self.about
        from evocity.io.export.reference_systems import export_system
        from evocity.scene.reprojection import reproject_scene

        target = export_system(self.city, crs, metres=True)
        assert target is not None
        return reproject_scene(self.groups, self.about, self.city, target)

    def about_in(self, crs: str | None, suffix: str = "") -> About:
        """Return the description of a file with ``suffix`` in ``crs``, as `write`. Raises
        `MapError` for a ``crs`` that does not fit."""
        from evocity.io.export.reference_systems import export_system
        from evocity.scene.reprojection import reproject_about

        target = export_system(self.city, crs, metres=suffix not in TABLES)
        return self.about if target is None else reproject_about(self.about, self.city, target)

    @property
    def _credited_city(self) -> CityMap:
        """The map with the attribution of all objects on it."""
        city, credit = self.city, self._attribution
        return (
            city if credit == city.attribution else city.replace(city.heights, attribution=credit)
        )

    @property
    def _footprints(self) -> tuple[Walls, dict[str, np.ndarray]]:
        """The footprints as `write_map` takes them, with columns: class, source and object."""
        walls, classes = self.walls, self.classes
        names = np.array(classes.names, dtype=object)
        columns = {"class": names[classes.of_buildings[walls.buildings - 1]]}
        if len(self.sources):
            columns["source"] = np.array(self.sources, dtype=object)[walls.buildings - 1]
        laid = self.substitution
        if laid is not None:
            polygons = tuple(laid.polygons)
            walls = replace(walls, polygons=polygons, heights=laid.heights)
            columns["object"] = np.array([name or "" for name in laid.ids], dtype=object)
        return walls, columns


def scene(
    city: CityMap,
    *,
    classes: ClassTable | str | os.PathLike | None = None,
    library: Library | str | os.PathLike | None = None,
    rng: np.random.Generator | None = None,
    streets: bool = False,
    water: np.ndarray | None = None,
    measures: Mapping[str, float] | None = None,
    lod: str | None = None,
    roofs: bool = False,
    triangles: int | None = None,
    sources: Sequence[str] = (),
    given_roofs: np.ndarray | None = None,
    roof_surface: StoredHeights | None = None,
    roof_rise: float | None = None,
    credit: str = "",
    **how: Any,
) -> Scene:
    """Make a scene of a map, with its ground, its buildings, and its objects lower than buildings.
    Each building is a solid with a floor, walls and a flat roof.

    classes : a table of classes and their colours, or the path of a TOML file with such a table. If
        ``classes`` is None, the scene has the seven default classes of evocity.
    library : a `Library` of objects, or the path of a folder that contains a library. If an object
        of the library fits a building, the object replaces the building. The generator ``rng``
        chooses between objects that fit equally well; None means a generator with the seed 0.
    streets : whether the ground is divided into carriageways, pavements, squares, courts, green and
        other ground, as one coverage with the buildings.
    water : bool ``(H, W)``, open ground that is water, with ``streets``; None means that the map
        has no water.
    measures : values of the map's measures by name; CityJSON files store these values as
        attributes.
    lod : level of detail, one of `evocity.scene.LEVELS`: "0" has footprints. "1.0" has blocks of
        all buildings that touch, and "afar" has blocks of like height across streets. "1.2" has one
        height for touching parts of like height, and walls of twice the tolerance. "1.3" has each
        building with its own height, and "2.2" has pitched roofs. None means "1.3", or "2.2" with
        ``roofs`` or
        ``roof_surface``.
    roofs : whether buildings have pitched roofs, as with LoD 2.2. Raises `MapError` for a map
        without heights, for heights above 1000 m, and for another level than 2.2.
    triangles : most triangles of the scene, 12 or more: the finest level from ``lod`` on that has
        no more. Raises `MapError` if no level has so few.
    sources : the name of the source city of each building, in the order of `CityMap.buildings`, and
        an empty text without one. `evocity.fitness.heredity.building_sources` returns these names.
    given_roofs : int ``(n, 2)``, the roof of each building, in the order of `CityMap.buildings`:
        the number of its shape in `evocity.scene.roofs.SHAPES`, or -1 for the rules of evocity; and
        1 if its height measures to the ridge, 0 if it measures to the eaves.
        `evocity.genome.building_roofs` returns the roofs of a bred map. None means the shapes and
        the meaning of heights that the map itself has.
    roof_surface : a `StoredSurface` whose shape, with its details, lies on the roofs of wide
        buildings, those with room for a circle of 12 m. With ``roofs`` or LoD 2.2, buildings with
        pitched roofs keep these; otherwise all other roofs are flat. The surface fills the least
        rectangle about each building, with its columns along the longer side, and is clipped at the
        outline. Raises `MapError` for a level surface, and for another level than 2.2. None means
        no such roofs.
    roof_rise : metres from the lowest to the highest height of ``roof_surface``, above 0 and at
        most 100. None means a fifth of the shorter side of the rectangle.
    credit : attribution of other files in the scene, such as that of the water. Files of the scene
        include it after that of the map.
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
    check_budget(triangles)
    check_water(city, water, streets)
    curved = check_curved(roof_surface, roof_rise, not roofs and lod is None)
    lod = level_of(lod, roofs, curved is not None)
    if roof_surface is not None:
        credit = "; ".join(filter(None, (credit, roof_surface.attribution)))
    if lod == "2.2":
        check_heights(city)
    if library is not None:
        check_library(check_level(lod))
    table = city.classes if classes is None else city.classified(classes)
    storey = how.get("storeys") or STOREY
    named, given = check_sources(city, sources), check_roofs(city, given_roofs)
    for level in levels_from(check_level(lod)):
        walls, laid = walls_at(city, level, how), None
        if library is not None:
            check_library(level.name)
            rng = np.random.default_rng(0) if rng is None else rng
            laid = substituted(city, library, rng, walls=walls, classes=table)
        parts = (
            streets,
            laid,
            measures or {},
            storey,
            named,
            level.name,
            how,
            water,
            given,
            credit,
            curved,
        )
        made = Scene(city, walls, table, *parts)
        kept = len(walls) or not len(city.buildings)  # the coarsest cells may hold no building
        if triangles is None or (kept and made.triangle_count <= triangles):
            return made
    raise too_many(made.triangle_count, triangles)
