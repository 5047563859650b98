"""`Library`: objects, as footprints with heights, that may replace generated buildings."""

import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields
from itertools import chain
from pathlib import Path

import numpy as np
import scipy
import shapely

from evocity.citymap import CityMap, ClassTable
from evocity.errors import MapError, add_near_miss, keyword, spell
from evocity.scene.library_table import COLUMNS, check_ids, read_table, write_table

#: The least area of an object, m²: as `evocity.views.buildings.CRUMB`.
LEAST = 24.0
# The columns of a library that are arrays; the others are tuples of texts.
_ARRAYS = {"polygons": object, "heights": np.float64, "attached": bool}


@dataclass(frozen=True, eq=False)
class Library:
    """Objects that may replace generated buildings.

    ids : a text for each of the n objects; no text occurs twice.
    classes : the class of each object, as in `CityMap.classes`.
    polygons : the footprints as valid shapely polygons, an object array ``(n,)``. Coordinates are
        metres from the centroid of each object, x to the east and y to the north.
    heights : the height of each object in metres, float64 ``(n,)``.
    atmospheres : the kind of urban place that each object suits, as text; "" for an object that
        suits every place.
    licences : the licence of each object.
    attributions : the attribution line that each licence requires; "" if the licence requires none.
    attached : bool ``(n,)``: whether the object touches neighbouring buildings wall to wall.

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
        """Make one object from each building of a map. The id of an object is the map's name and
        the building's number.

        The footprints are the polygons of `CityMap.walls`. The classes are those of
        `CityMap.classes`, or those of your own ``table``. Buildings of less than `LEAST` m² are
        left out, and so are buildings that the map's border cuts.

        Parameters
        ----------
        licence : the licence of the map, for example ``ODbL-1.0``.
        attribution : the attribution line that the licence requires; None means the line of the
            map.
        attached : whether to include buildings that stand wall to wall.

        Raises `MapError` if ``licence`` is an empty text.
        """
        if not licence.strip():
            raise MapError(
                f"{city.name} has no licence",
                "the licence under which the map was published",
                f'give the licence with {keyword("licence")}, for example "ODbL-1.0" or "CC0-1.0"',
            )
        walls, classes = city.walls, city.classified(table)
        polygons = np.array(walls.polygons, dtype=object)
        beside = np.zeros(len(polygons), bool)
        one, other = shapely.STRtree(polygons).query(polygons, predicate="intersects")
        beside[one[one != other]] = True
        kept = (shapely.area(polygons) >= LEAST) & ~_cut_by_border(city, polygons)
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
            _center(polygons[chosen]),
            np.round(walls.heights[chosen], 3),
            (atmosphere,) * count,
            (licence.strip(),) * count,
            (credit,) * count,
            beside[chosen],
        )

    @classmethod
    def joined(cls, libraries: "Iterable[Library]") -> "Library":
        """Join several libraries. Raises `MapError` if an id occurs twice."""
        every = list(libraries)
        check_ids([name for library in every for name in library.ids], "libraries to be joined")
        columns = []
        for column in fields(cls):
            parts = [getattr(library, column.name) for library in every]
            kind = _ARRAYS.get(column.name)
            joined = np.concatenate([np.empty(0, kind), *parts]) if kind else tuple(chain(*parts))
            columns.append(joined)
        return cls(*columns)

    def only(self, chosen: Sequence[int] | np.ndarray) -> "Library":
        """Select objects by their numbers, or by a mask, bool ``(n,)``."""
        at = np.arange(len(self))[np.asarray(chosen)]
        columns = (getattr(self, column.name) for column in fields(self))
        return Library(
            *(
                column[at] if isinstance(column, np.ndarray) else tuple(column[k] for k in at)
                for column in columns
            )
        )

    def of_atmosphere(self, atmosphere: str) -> "Library":
        """Select the objects that suit the given ``atmosphere``, a kind of urban place. Raises
        `MapError` if no object has the given atmosphere."""
        chosen = [k for k, own in enumerate(self.atmospheres) if own == atmosphere]
        if not chosen:
            known = ", ".join(sorted(map(spell, set(self.atmospheres))))
            raise MapError(
                add_near_miss(
                    f"no object of the atmosphere {spell(atmosphere)}",
                    atmosphere,
                    self.atmospheres,
                ),
                f"one of {known}",
                "choose one of them, or leave it out",
            )
        return self.only(chosen)

    @classmethod
    def read(cls, folder: str | os.PathLike) -> "Library":
        """Read the library in a folder, from the layer `LAYER` of its GeoPackage `TABLE`.

        Footprints are polygons in metres, at any place. The table has the columns of the list
        `COLUMNS`.

        Raises `MapError`, which names the faulty object, for a missing folder, table, layer,
        column, class or licence. The method raises `MapError` for an id that is missing or
        repeated, and for a footprint that is open, invalid or in degrees. The method raises
        `MapError` for a height outside 0 to `TALLEST` metres, and for a column ``path`` that names
        a mesh.
        """
        polygons, columns = read_table(Path(folder))
        return cls(
            tuple(columns["id"]),
            tuple(columns["class"]),
            _center(polygons),
            columns["height"],
            tuple(columns["atmosphere"]),
            tuple(columns["licence"]),
            tuple(columns["attribution"]),
            columns["attached"],
        )

    def write(self, folder: str | os.PathLike) -> Path:
        """Write the library's table into a folder, and return the path of the table. The method
        creates the folder if its parent folder exists, and overwrites a table in the folder. The
        table places the objects next to each other, so that a GIS shows all of them. Raises
        `MapError` if the table cannot be written."""
        values = (self.ids, self.classes, self.heights, self.atmospheres, self.licences)
        values += (self.attributions, self.attached)
        return write_table(Path(folder), self.polygons, dict(zip(COLUMNS, values, strict=True)))


def _cut_by_border(city: CityMap, polygons: np.ndarray) -> np.ndarray:
    """Tell, bool ``(n,)``, which polygons the border of a map, or of its site, cuts."""
    side, grain = city.metres_per_pixel, 1e-6
    if city.site is not None:
        inner = scipy.ndimage.binary_erosion(city.site)
        labels = np.unique(city.building_labels[~inner])
        return np.isin(city.walls.buildings, labels)
    left, top = city.north_west
    right, bottom = left + city.shape[1] * side, top - city.shape[0] * side
    west, south, east, north = shapely.bounds(polygons).reshape(-1, 4).T
    within = (west > left + grain) & (east < right - grain)
    return ~(within & (south > bottom + grain) & (north < top - grain))


def _center(polygons: np.ndarray) -> np.ndarray:
    """Move polygons to their centroids, to the millimetre, so that they stay valid."""
    moved = np.empty(len(polygons), object)
    for k, polygon in enumerate(polygons):
        x, y = np.round(shapely.get_coordinates(shapely.centroid(polygon))[0], 3)
        moved[k] = shapely.transform(polygon, lambda points, at=(x, y): points - at)
    return moved
