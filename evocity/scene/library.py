"""A library of objects: footprints with heights, to stand where generated buildings are."""

import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import scipy
import shapely

from evocity.citymap import CityMap, ClassTable
from evocity.errors import MapError, keyword, shown, with_near_miss
from evocity.scene.library_table import (
    COLUMNS,
    LAYER,
    TABLE,
    TALLEST,
    check_ids,
    read_table,
    write_table,
)

#: Footprints under this area, m², are no objects: as `evocity.views.buildings.CRUMB`.
LEAST = 24.0


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
        check_ids(ids, "libraries to be joined")

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
        polygons, columns = read_table(Path(folder))
        return cls(
            tuple(columns["id"]),
            tuple(columns["class"]),
            _centred(polygons),
            columns["height"],
            tuple(columns["atmosphere"]),
            tuple(columns["licence"]),
            tuple(columns["attribution"]),
            columns["attached"],
        )

    def write(self, folder: str | os.PathLike) -> Path:
        """Write the table into a ``folder``, which is made if its own folder is there; a table that
        is there is written over. Objects lie beside each other, to be looked at in a GIS. Returns
        the table's path; raises `MapError` where it cannot be written."""
        told = (self.ids, self.classes, self.heights, self.atmospheres, self.licences)
        told += (self.attributions, self.attached)
        return write_table(Path(folder), self.polygons, dict(zip(COLUMNS, told, strict=True)))


def _cut(city: CityMap, polygons: np.ndarray) -> np.ndarray:
    """Bool ``(n,)``: which polygons the border of a map, or of its site, cuts."""
    side, grain = city.metres_per_pixel, 1e-6
    if city.site is not None:
        inner = scipy.ndimage.binary_erosion(city.site)
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


__all__ = ["COLUMNS", "LAYER", "LEAST", "TABLE", "TALLEST", "Library"]
