"""A library of objects: footprints with heights, to stand where generated buildings are."""

import math
import os
import warnings
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pyogrio
import shapely
from pyogrio.errors import DataLayerError, DataSourceError, FeatureError, GeometryError
from pyproj import CRS
from pyproj.exceptions import CRSError

from evocity.citymap import CityMap, ClassTable
from evocity.errors import MapError, keyword, shown, with_near_miss
from evocity.files import whole_file
from evocity.io.computed import check_views
from evocity.io.sources import content_of
from evocity.views.walls.coverage import pinched

#: The table of a library's folder, and its layer.
TABLE, LAYER = "objects.gpkg", "objects"
#: What the table tells of each object besides its footprint; the last two may be left out.
COLUMNS = ("id", "class", "height", "atmosphere", "licence", "attribution", "attached")
#: No object is higher, metres: as `read_map` has it.
TALLEST = 1000.0
#: Footprints under this area, m², are no objects: as `evocity.views.buildings.CRUMB`.
LEAST = 24.0

_NEEDED = ("id", "class", "height", "atmosphere", "licence")
_TROUBLE = (DataSourceError, DataLayerError, FeatureError, GeometryError, CRSError, OSError)
# Metres that lie nowhere on Earth.
_METRES = (
    'ENGCRS["metres of a library of objects",EDATUM["none"],CS[Cartesian,2],'
    'AXIS["x",east],AXIS["y",north],LENGTHUNIT["metre",1]]'
)
# Metres left between objects where the table lays them out beside each other.
_APART = 5.0


@dataclass(frozen=True, eq=False)
class Library:
    """Objects that may stand where generated buildings are.

    ids : of each object, n texts, none twice.
    classes : of each, its class, as `CityMap.classes` names it.
    polygons : objects ``(n,)``, valid shapely polygons, metres about their centroids, x to the
        east, y to the north.
    heights : float64 ``(n,)``, metres.
    atmospheres : what kind of place each is of, in words; "" for none.
    licences, attributions : under which licence each may be used, and the line that it asks for;
        that may be "".
    attached : bool ``(n,)``: whether it stands wall to wall with others.

    >>> import numpy as np, evocity
    >>> from evocity.scene.library import Library
    >>> heights = np.zeros((32, 32))
    >>> heights[8:20, 10:24] = 9
    >>> library = Library.of(evocity.CityMap(heights, 2.0, name="drawn"), licence="CC0-1.0")
    >>> library.ids, library.classes, library.heights.tolist()
    (('drawn-1',), ('building',), [9.0])
    """

    ids: tuple[str, ...]
    classes: tuple[str, ...]
    polygons: np.ndarray
    heights: np.ndarray
    atmospheres: tuple[str, ...]
    licences: tuple[str, ...]
    attributions: tuple[str, ...]
    attached: np.ndarray

    def __len__(self) -> int:
        return len(self.ids)

    @classmethod
    def of(
        cls,
        city: CityMap,
        *,
        licence: str,
        atmosphere: str = "",
        attribution: str | None = None,
        attached: bool = True,
        table: ClassTable | None = None,
    ) -> "Library":
        """The buildings of a map as objects, named by the map's name and their number there.

        Their footprints are those of `CityMap.walls`, their classes those of `CityMap.classes`, or
        by another ``table``. Left out are those under `LEAST` m², and what the map's border cuts.

        Parameters
        ----------
        licence : under which the map may be used, such as ``ODbL-1.0``.
        attribution : the line it asks for; None for the map's own.
        attached : whether those that stand wall to wall are taken too.

        Raises `MapError` without a licence.
        """
        if not licence.strip():
            raise MapError(
                f"{city.name} without a licence",
                "the licence that its source gives it",
                f'name it with {keyword("licence")}, such as "ODbL-1.0" or "CC0-1.0"',
            )
        walls, classes = city.walls, city.classified(table)
        polygons = np.array(walls.polygons, dtype=object)
        beside = np.zeros(len(polygons), bool)
        one, other = shapely.STRtree(polygons).query(polygons, predicate="intersects")
        beside[one[one != other]] = True
        kept = (shapely.area(polygons) >= LEAST) & ~_cut(city, polygons)
        _, first, twice = np.unique(walls.buildings, return_index=True, return_counts=True)
        kept[np.setdiff1d(np.arange(len(polygons)), first[twice == 1])] = False
        if not attached:
            kept &= ~beside
        chosen = np.flatnonzero(kept)
        count, numbers = len(chosen), walls.buildings[chosen]
        credit = city.attribution if attribution is None else attribution
        return cls(
            tuple(f"{city.name}-{number}" for number in numbers),
            tuple(classes.names[k] for k in classes.of_buildings[numbers - 1]),
            _centred(polygons[chosen]),
            np.round(walls.heights[chosen], 3),
            (atmosphere,) * count,
            (licence.strip(),) * count,
            (credit,) * count,
            beside[chosen],
        )

    @classmethod
    def joined(cls, libraries: "Iterable[Library]") -> "Library":
        """All objects of several libraries. Raises `MapError` where an id is there twice."""
        every = list(libraries)
        ids = [one for library in every for one in library.ids]
        _check_ids(ids, "libraries to be joined")

        def texts(name: str) -> tuple[str, ...]:
            return tuple(text for library in every for text in getattr(library, name))

        def arrays(name: str, kind) -> np.ndarray:
            return np.concatenate([np.empty(0, kind), *(getattr(one, name) for one in every)])

        return cls(
            tuple(ids),
            texts("classes"),
            arrays("polygons", object),
            arrays("heights", np.float64),
            texts("atmospheres"),
            texts("licences"),
            texts("attributions"),
            arrays("attached", bool),
        )

    def only(self, chosen: Sequence[int] | np.ndarray) -> "Library":
        """Some of the objects: numbers, or bool ``(n,)``."""
        at = np.arange(len(self))[np.asarray(chosen)]

        def texts(column: tuple[str, ...]) -> tuple[str, ...]:
            return tuple(column[k] for k in at)

        return replace(
            self,
            ids=texts(self.ids),
            classes=texts(self.classes),
            polygons=self.polygons[at],
            heights=self.heights[at],
            atmospheres=texts(self.atmospheres),
            licences=texts(self.licences),
            attributions=texts(self.attributions),
            attached=self.attached[at],
        )

    def of_atmosphere(self, atmosphere: str) -> "Library":
        """The objects of one ``atmosphere``. Raises `MapError` where none has it."""
        chosen = [k for k, own in enumerate(self.atmospheres) if own == atmosphere]
        if not chosen:
            known = ", ".join(sorted(map(shown, set(self.atmospheres))))
            raise MapError(
                with_near_miss(
                    f"no object of the atmosphere {shown(atmosphere)}", atmosphere, self.atmospheres
                ),
                f"one of {known}",
                "choose one of them, or leave it out",
            )
        return self.only(chosen)

    @classmethod
    def read(cls, folder: str | os.PathLike) -> "Library":
        """The library in a ``folder``: the layer `LAYER` of its `TABLE`, a GeoPackage.

        Footprints are polygons in metres, wherever they lie; the columns are `COLUMNS`.

        Raises `MapError`, naming the object, if there is no such folder, table, layer or column;
        for an id that is missing or there twice; a footprint that is open, invalid or in degrees; a
        height that is none of up to `TALLEST` metres; a class or licence that is missing; a column
        ``path`` that names a mesh, wherever it lies.
        """
        folder = Path(folder)
        path = folder / TABLE
        shapes, fields, crs = _table(folder, path)
        _check_metres(path, crs)
        missing = [name for name in _NEEDED if name not in fields]
        if missing:
            raise MapError(
                f"{path}: no column {', '.join(missing)}",
                f"the columns {', '.join(_NEEDED)}",
                "add what is missing; evocity library new makes such a table",
            )
        ids = _texts(fields["id"])
        _check_ids(ids, str(path))
        count = len(ids)
        names = [f"{path}: object {one}" for one in ids]
        empty = np.full(count, "", dtype=object)
        _check_no_meshes(fields.get("path", empty), names)
        return cls(
            tuple(ids),
            _told(fields["class"], names, "class", "building, or another class"),
            _centred(_checked(shapes, names)),
            _heights(fields["height"], names),
            tuple(_texts(fields["atmosphere"])),
            _told(fields["licence"], names, "licence", "the licence it may be used under"),
            tuple(_texts(fields.get("attribution", empty))),
            np.array(
                [one in (True, 1) for one in fields.get("attached", np.zeros(count, bool))], bool
            ),
        )

    def write(self, folder: str | os.PathLike) -> Path:
        """Write the table into a ``folder``, which is made if its own folder is there; a table that
        is there is written over. Objects lie beside each other, to be looked at in a GIS. Returns
        the table's path; raises `MapError` where it cannot be written."""
        folder = Path(folder)
        try:
            folder.mkdir(exist_ok=True)
            with whole_file(folder / TABLE) as temporary, warnings.catch_warnings():
                warnings.simplefilter("ignore")  # GDAL's, of an empty layer
                pyogrio.raw.write(
                    temporary,
                    geometry=shapely.to_wkb(_laid_out(self.polygons)),
                    field_data=self._columns(),
                    fields=list(COLUMNS),
                    layer=LAYER,
                    driver="GPKG",
                    geometry_type="Polygon",
                    crs=_METRES,
                    layer_options={"DESCRIPTION": "; ".join(sorted(set(self.attributions) - {""}))},
                )
        except _TROUBLE as error:
            raise MapError(
                f"{str(folder / TABLE)!r} cannot be written: {error}",
                "a folder this user may write to, in one that is there",
                "check the path, permissions and free space, or choose another place",
            ) from error
        return folder / TABLE

    def _columns(self) -> list[np.ndarray]:
        told = (self.ids, self.classes, self.heights, self.atmospheres, self.licences)
        told += (self.attributions, self.attached)
        kinds = (object, object, float, object, object, object, bool)
        return [np.array(one, dtype=kind) for one, kind in zip(told, kinds, strict=True)]


def _cut(city: CityMap, polygons: np.ndarray) -> np.ndarray:
    """Bool ``(n,)``: which polygons the border of a map, or of its site, cuts."""
    side, grain = city.metres_per_pixel, 1e-6
    if city.site is not None:
        from scipy import ndimage

        inner = ndimage.binary_erosion(city.site)
        labels = np.unique(city.building_labels[~inner])
        return np.isin(city.walls.buildings, labels)
    left, top = city.origin or (0.0, city.shape[0] * side)
    right, bottom = left + city.shape[1] * side, top - city.shape[0] * side
    west, south, east, north = shapely.bounds(polygons).reshape(-1, 4).T
    within = (west > left + grain) & (east < right - grain)
    return ~(within & (south > bottom + grain) & (north < top - grain))


def _centred(polygons: np.ndarray) -> np.ndarray:
    """The polygons about their centroids, to the millimetre, as valid as they were."""
    moved = np.empty(len(polygons), object)
    for k, polygon in enumerate(polygons):
        x, y = np.round(shapely.get_coordinates(shapely.centroid(polygon))[0], 3)
        moved[k] = shapely.transform(polygon, lambda points, at=(x, y): points - at)
    return moved


def _laid_out(polygons: np.ndarray) -> np.ndarray:
    """The polygons beside each other in rows, in their order."""
    laid = np.empty(len(polygons), object)
    if not len(polygons):
        return laid
    west, south, east, north = shapely.bounds(polygons).T
    wide = east - west + _APART
    row = math.sqrt(float((wide * (north - south + _APART)).sum())) * 1.2
    x = y = deep = 0.0
    for k, polygon in enumerate(polygons):
        if x and x + wide[k] > row:
            x, y, deep = 0.0, y - deep - _APART, 0.0
        at = np.round([x - west[k], y - north[k]], 3)
        laid[k] = shapely.transform(polygon, lambda points, at=at: points + at)
        x, deep = x + wide[k], max(deep, north[k] - south[k])
    return laid


def _table(folder: Path, path: Path) -> tuple[np.ndarray, dict[str, np.ndarray], str | None]:
    """Footprints as WKB, columns by name, and the reference system."""
    if not path.is_file():
        what = "no table in it" if folder.is_dir() else "no such folder"
        raise MapError(
            f"{str(folder)!r}: {what}",
            f"the folder of a library, with {TABLE} in it",
            "make one with: evocity library new MAP… -o FOLDER",
        )
    try:
        with open(path, "rb") as file:
            content = content_of(file.read(1024))
        if content != "SQLite (GeoPackage)":
            raise MapError(
                f"{path} holds {content}", "a GeoPackage", "export the table again as one"
            )
        check_views(path)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            if LAYER not in [str(name) for name, _ in pyogrio.list_layers(path)]:
                raise MapError(f"{path}: no layer {LAYER}", f"a layer {LAYER}", "rename the layer")
            meta, _, shapes, columns = pyogrio.raw.read(path, layer=LAYER, force_2d=True)
    except (*_TROUBLE, UnicodeDecodeError) as error:
        raise MapError(
            f"{path} cannot be read: {[*str(error).splitlines(), 'it is damaged'][0][:200]}",
            "a whole GeoPackage",
            "make or export it again; it may have been cut off",
        ) from error
    if shapes is None:
        raise MapError(
            f"{path}: no footprints in its layer {LAYER}",
            "a polygon for each object",
            "export the table again, with its geometry",
        )
    return shapes, dict(zip(map(str, meta["fields"]), columns, strict=True)), meta["crs"]


def _check_metres(path: Path, crs: str | None) -> None:
    """Raise if a table says that it is in other units than metres."""
    if crs is None:
        return
    try:
        axes = CRS.from_user_input(crs).axis_info
    except CRSError:
        axes = []
    if any(not math.isclose(axis.unit_conversion_factor, 1.0) for axis in axes[:2]):
        raise MapError(
            f"{path}: footprints in {axes[0].unit_name}",
            "footprints in metres",
            "project them to a system of metres first",
        )


def _check_ids(ids: Sequence[str], where: str) -> None:
    seen = set()
    for number, one in enumerate(ids, 1):
        if not one:
            raise MapError(f"{where}: row {number} without an id", "an id each", "give it one")
        if one in seen:
            raise MapError(
                f"{where}: id {one} twice", "an id of its own each", "rename one of them"
            )
        seen.add(one)


def _checked(shapes: np.ndarray, names: Sequence[str]) -> np.ndarray:
    """Valid polygons of WKB."""
    polygons = shapely.from_wkb(shapes, on_invalid="ignore")
    wanted = "a closed polygon that does not cross itself, metres"
    for polygon, name in zip(polygons, names, strict=True):
        if polygon is not None and polygon.geom_type == "MultiPolygon" and len(polygon.geoms) == 1:
            polygon = polygon.geoms[0]
        kind = "ring that is open" if polygon is None else polygon.geom_type
        if kind != "Polygon":
            raise MapError(f"{name}: a {kind}", wanted, "close it, or make one object of each part")
        if not (polygon.is_valid and polygon.area > 0 and np.isfinite(polygon.bounds).all()):
            reason = shapely.is_valid_reason(polygon) if polygon.area > 0 else "no area"
            raise MapError(f"{name}: an invalid footprint, {reason}", wanted, "repair it")
        if pinched(np.array([polygon]))[0]:
            raise MapError(
                f"{name}: a footprint that comes to one point twice, as where a courtyard touches "
                "a wall",
                "one whose walls stand apart, of which a solid can be made",
                "move that corner by some centimetres, or open the courtyard",
            )
    parts = [one.geoms[0] if one.geom_type == "MultiPolygon" else one for one in polygons]
    found = np.empty(len(parts), object)
    found[:] = parts
    return found


def _heights(column: np.ndarray, names: Sequence[str]) -> np.ndarray:
    heights = np.array([_number(told) for told in column.tolist()], dtype=np.float64)
    for height, told, name in zip(heights, column, names, strict=True):
        if not 0 < height <= TALLEST:
            raise MapError(
                f"{name}: a height of {told}", f"metres, above 0, at most {TALLEST:g}", "correct it"
            )
    return heights


def _number(told: object) -> float:
    try:
        return float(told)
    except (TypeError, ValueError):
        return math.nan


def _texts(column: np.ndarray) -> list[str]:
    """A column as texts; "" where it has nothing."""
    return ["" if one is None or one != one else str(one).strip() for one in column.tolist()]


def _told(column: np.ndarray, names: Sequence[str], what: str, expected: str) -> tuple[str, ...]:
    texts = _texts(column)
    for text, name in zip(texts, names, strict=True):
        if not text:
            raise MapError(f"{name} without a {what}", expected, f"tell it in the column {what}")
    return tuple(texts)


def _check_no_meshes(column: np.ndarray, names: Sequence[str]) -> None:
    """Raise where a column ``path`` names a mesh: nothing would come of it."""
    for told, name in zip(_texts(column), names, strict=True):
        if told:
            raise MapError(
                f"{name}: a mesh in the path {told!r}",
                "a footprint with a height: no file beside the table is opened",
                "leave the column path out",
            )


__all__ = ["COLUMNS", "LAYER", "LEAST", "TABLE", "TALLEST", "Library"]
