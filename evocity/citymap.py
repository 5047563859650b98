"""`CityMap`: a city district as a raster of building heights, and the views measures share."""

from collections.abc import Mapping
from functools import cached_property
from numbers import Real
from typing import TYPE_CHECKING, Any

import numpy as np

from evocity.displayed import Displayed
from evocity.errors import MapError, keyword, plain_text, setting
from evocity.views import ground
from evocity.views.buildings import STEP, Buildings, measured, outlines, told_apart, zones_of
from evocity.views.classes import Classes, ClassTable, classified
from evocity.views.pieces import pieces
from evocity.views.streets import StreetGraph, street_graph
from evocity.views.structure import gradients, nearest, structure
from evocity.views.walls import Walls, walls_of

if TYPE_CHECKING:
    import shapely

#: A pixel is built where it stands higher than this, metres: half a lowest storey. Decoded
#: maps leave traces of a few decimetres on the ground that are no buildings.
BUILT_ABOVE = 1.5

#: Height of a storey, metres: where floors are counted, and where storeys give a height.
STOREY = 3.0

#: Largest map that is read, coded or decoded: its side (corners of domain blocks are int16)
#: and its pixels in all (about 11 500²).
MAX_SIDE = 32_767
#: The side of a pixel, metres: what lies beyond is no city, and its square no number.
PIXEL_SIDES = (1e-6, 1e6)
MAX_PIXELS = 1 << 27


class CityMap(Displayed):
    """A 2D½ city: heights in metres on a square grid, row 0 in the north.

    Parameters
    ----------
    heights : array ``(H, W)``, metres above ground, finite, not negative, 0 = ground. Copied
        to float32 and made read-only.
    metres_per_pixel : side of a pixel, metres, greater than 0.
    name : what the map is called in pictures and tables; without control characters, see
        `evocity.errors.plain_text`.
    attribution : the line its source's licence asks for; it travels into every file and
        picture made from the map. Without control characters too.
    origin : (x, y) of the north-west corner in ``crs``, or None.
    crs : coordinate reference system in metres, as an authority code or WKT, or None.
    height_rules : how many buildings got their height by which rule, as the reader counted.
    taken : in words, what of its file was read; "" for a map that was not read from one.
    site : bool ``(H, W)``: which pixels are the map's own, of a part cut out of another that is no
        rectangle; the others are neither built nor open ground, and have height 0. None where
        all are. `within` makes such maps.
    corner : (row, column) of the map's first pixel on the map it was cut out of.

    Raises
    ------
    MapError : the array is not two-dimensional, or holds NaN, infinity or negative heights;
        or the pixel size is not positive; or the site has another shape, or no pixel.

    Views (`built`, `open_ground`, `labels`, `areas`, `building_labels`, `buildings`, `classes`,
    `outline`, `walls`, `gradients`, `structure`, `distance_to_built`, `open_space`, `streets`,
    `street_graph`) are computed when first asked for, once a map, and are read-only.
    """

    heights: np.ndarray
    metres_per_pixel: float
    name: str
    attribution: str
    origin: tuple[float, float] | None
    crs: str | None
    height_rules: dict[str, int]
    taken: str
    site: np.ndarray | None
    corner: tuple[int, int]

    def __init__(
        self,
        heights: np.ndarray,
        metres_per_pixel: float,
        *,
        name: str = "map",
        attribution: str = "",
        origin: tuple[float, float] | None = None,
        crs: str | None = None,
        height_rules: Mapping[str, int] | None = None,
        taken: str = "",
        site: np.ndarray | None = None,
        corner: tuple[int, int] = (0, 0),
    ):
        array = _checked_heights(heights, name)
        if site is not None:
            site = _checked_site(site, array.shape, name)
            array = _read_only(np.where(site, array, np.float32(0)))
        low, high = PIXEL_SIDES
        if not (isinstance(metres_per_pixel, Real) and low <= metres_per_pixel <= high):
            raise MapError(
                f"{name}: {setting('metres_per_pixel', metres_per_pixel)}",
                f"a positive number of metres, {low:g} to {high:g}",
                "give the side of a pixel in metres, for example 2.0",
            )
        self.__dict__.update(
            heights=array,
            metres_per_pixel=float(metres_per_pixel),
            name=plain_text(str(name)),
            attribution=plain_text(str(attribution)),
            origin=None if origin is None else (float(origin[0]), float(origin[1])),
            crs=crs,
            height_rules=dict(height_rules or {}),
            taken=str(taken),
            site=site,
            corner=(int(corner[0]), int(corner[1])),
        )

    def __setattr__(self, name: str, value) -> None:
        raise AttributeError(
            f"a CityMap does not change, so its {name} cannot be set; "
            "city.replace(heights) makes another map"
        )

    def __reduce__(self):  # heights alone travel, and stay read-only; views are computed anew
        described = {k: self.__dict__[k] for k in _DESCRIBED}
        return _made_again, (self.heights, self.metres_per_pixel, described)

    def __copy__(self) -> "CityMap":
        return self

    def __deepcopy__(self, memo) -> "CityMap":
        return self

    def __repr__(self) -> str:
        height, width = self.shape
        built = np.count_nonzero(self.built) / self.pixels
        return (
            f"CityMap({self.name!r}, {height} × {width} px at {self.metres_per_pixel:g} m, "
            f"built {built:.2f}, highest {self.heights.max(initial=0):.1f} m)"
        )

    @property
    def shape(self) -> tuple[int, int]:
        """(H, W) in pixels."""
        return self.heights.shape

    @property
    def pixels(self) -> int:
        """How many pixels are the map's own: all, but for what lies beyond its `site`."""
        return self.heights.size if self.site is None else int(np.count_nonzero(self.site))

    @property
    def area(self) -> float:
        """Ground covered by the whole map, or by its `site`, m²."""
        return self.pixels * self.metres_per_pixel**2

    def within(self, mask: np.ndarray) -> "CityMap":
        """The part of the map where ``mask``, bool ``(H, W)``, holds: what lies in the smallest
        rectangle about it, and unless it fills that, the mask there as the part's `site`. A
        building is cut where the part ends, as at a map's border.

        Raises `MapError` for a mask of another shape or without a pixel.
        """
        mask = _checked_site(mask, self.shape, self.name)
        rows, columns = (np.flatnonzero(mask.any(axis=axis)) for axis in (1, 0))
        window = slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)
        site = mask[window] if self.site is None else mask[window] & self.site[window]
        origin, pixel = self.origin, self.metres_per_pixel
        if origin is not None:
            origin = origin[0] + columns[0] * pixel, origin[1] - rows[0] * pixel
        return self.replace(
            self.heights[window],
            origin=origin,
            site=None if site.all() else site,
            corner=(self.corner[0] + rows[0], self.corner[1] + columns[0]),
        )

    def of_whole(self, array: np.ndarray) -> np.ndarray:
        """What an ``array`` ``(H, W)`` of the map that this one was cut out of, or of this one
        itself, has at the pixels of this one."""
        top, left = self.corner if array.shape != self.shape else (0, 0)
        height, width = self.shape
        return array[top : top + height, left : left + width]

    def replace(self, heights: np.ndarray, **changes: Any) -> "CityMap":
        """A new map with other ``heights``; what describes this one is kept unless changed."""
        described = {
            "metres_per_pixel": self.metres_per_pixel,
            "name": self.name,
            "attribution": self.attribution,
            "origin": self.origin,
            "crs": self.crs,
            "height_rules": self.height_rules,
            "taken": self.taken,
            "site": self.site,
            "corner": self.corner,
        }
        return CityMap(heights, **(described | changes))

    @cached_property
    def built(self) -> np.ndarray:
        """Bool ``(H, W)``: pixels higher than `BUILT_ABOVE`. About 10 µs at 256²."""
        return _read_only(self.heights > BUILT_ABOVE)

    @cached_property
    def open_ground(self) -> np.ndarray:
        """Bool ``(H, W)``: pixels of the map, within its `site`, that are not built."""
        return _read_only(~self.built if self.site is None else self.site & ~self.built)

    @cached_property
    def labels(self) -> np.ndarray:
        """Int32 ``(H, W)``: 0 on open ground, 1…n on the n built components, which touch by
        pixel sides (4 neighbours). About 0.4 ms at 256²."""
        return _read_only(pieces(self.built)[0])

    @cached_property
    def areas(self) -> np.ndarray:
        """Float64 ``(n,)``: footprint of each built component, m², in the order of `labels`."""
        counts = np.bincount(self.labels.ravel())[1:]
        return _read_only(counts * self.metres_per_pixel**2)

    @cached_property
    def building_labels(self) -> np.ndarray:
        """Int32 ``(H, W)``: 0 on open ground, 1…n on the n `buildings`, without the table. About
        1 ms at 256²; what a genome decodes to with settled roofs knows it already."""
        return _read_only(zones_of(self.heights, self.labels, self.metres_per_pixel))

    @cached_property
    def buildings(self) -> Buildings:
        """The buildings, told apart by gaps and by steps of height of more than half a storey:
        their labels and a table, whose courtyards are those that a building encloses alone; see
        open_space for others. `told_apart` takes another step. About 2 ms at 256²."""
        pixel, zones = self.metres_per_pixel, self.building_labels
        return measured(self.heights, self.labels, zones, pixel, self.site)

    def told_apart(self, step: float = STEP) -> Buildings:
        """The buildings, told apart by gaps and by steps of height of more than ``step`` metres:
        `evocity.views.buildings.told_apart`. Infinity tells them apart by gaps alone."""
        return told_apart(self.heights, self.labels, self.metres_per_pixel, step, site=self.site)

    @cached_property
    def classes(self) -> Classes:
        """What stands here by its class, buildings and what is lower: building, furniture, tree,
        ground, fountain, shelter, post. `classified` takes another table. About 1 ms at 256²."""
        return self.classified()

    def classified(self, table: ClassTable | None = None) -> Classes:
        """The classes by another ``table`` than this package's: `evocity.views.classes`."""
        pixel, site = self.metres_per_pixel, self.site
        return classified(self.heights, self.buildings, pixel, table, site)

    @cached_property
    def outline(self) -> "tuple[shapely.Polygon, ...]":
        """Polygons along the pixels' edges, courtyards as holes, one a building in the order of
        `buildings`: in ``crs`` if the map has an ``origin``; else in metres from its south-west
        corner, x to the east, y to the north. About 20 ms at 256²."""
        return outlines(self.building_labels, self.metres_per_pixel, self._north_west)

    @cached_property
    def walls(self) -> Walls:
        """The buildings as polygons with straight walls, a valid coverage, where `outline` has it.
        `walled` takes another scale of detail, or squares them. About 30 ms at 256²."""
        return self.walled()

    def walled(self, **how: Any) -> Walls:
        """The walls, fitted as told: ``detail`` and ``relative``, ``squared``, ``storeys``,
        ``least_area`` of `evocity.views.walls.walls_of`."""
        return walls_of(
            self.building_labels,
            self.buildings.height,
            self.buildings.direction,
            self.metres_per_pixel,
            self._north_west,
            site=self.site,
            **how,
        )

    @property
    def _north_west(self) -> tuple[float, float]:
        """(x, y) of that corner: without an origin, metres from the south-west one."""
        return self.origin or (0.0, self.shape[0] * self.metres_per_pixel)

    @cached_property
    def gradients(self) -> tuple[np.ndarray, np.ndarray]:
        """Float32 pair ``(d/dy, d/dx)`` of the heights, metres a metre, y to the south, by the
        Scharr operator, edges repeated. About 1 ms at 256²."""
        along_y, along_x = gradients(self._extended, self.metres_per_pixel)
        return _read_only(along_y), _read_only(along_x)

    @property
    def _extended(self) -> np.ndarray:
        """The heights; beyond the site those of its nearest pixel, as edges are repeated."""
        if self.site is None:
            return self.heights
        return np.ascontiguousarray(self.heights[nearest(self.site)])

    @cached_property
    def structure(self) -> np.ndarray:
        """Float32 ``(2, H, W)``: w cos 2θ and w sin 2θ, θ the direction of the gradient, square to
        the walls, from east towards south, w its square; smoothed, for a raster's façades are
        staircases (`evocity.views.structure`). About 1.2 ms at 256²."""
        return _read_only(structure(*self.gradients, self.site))

    @cached_property
    def distance_to_built(self) -> np.ndarray:
        """Float32 ``(H, W)``: metres from each pixel's centre to that of the nearest built pixel, 0
        on these, infinity if there is none. Exact. About 0.9 ms at 256²."""
        return _read_only(ground.distance_to_built(self.built, self.metres_per_pixel))

    @cached_property
    def open_space(self) -> ground.OpenSpace:
        """The pieces of open ground (8 neighbours): labels int32 ``(H, W)``, areas in m², and the
        built component each is a courtyard of. About 0.4 ms at 256², `labels` given."""
        return ground.open_space(self.labels, self.metres_per_pixel, self.site)

    @cached_property
    def streets(self) -> ground.Streets:
        """The lines streets run along: skeleton bool ``(H, W)``, widths in metres from wall to
        wall, lengths in metres. 3 to 5 ms at 256²."""
        return ground.streets(self.built, self.metres_per_pixel)

    @cached_property
    def street_graph(self) -> StreetGraph:
        """The streets as a graph with widths and kinds, places, and quarters of `buildings`, where
        `outline` has them. `street_graph_of` takes another city, open or closed. About 20 ms at
        256²."""
        return self.street_graph_of()

    def street_graph_of(self, **how: Any) -> StreetGraph:
        """The street graph, made as told: ``closed``, ``least_width``, ``spurs``, ``places``,
        ``courts``, ``kinds``, ``water`` of `evocity.views.streets.street_graph`."""
        return street_graph(
            self.open_ground,
            self.building_labels,
            self.metres_per_pixel,
            self._north_west,
            site=self.site,
            **how,
        )


def _checked_heights(heights: np.ndarray, name: str) -> np.ndarray:
    try:
        array = np.array(heights, dtype=np.float32, order="C")
    except (TypeError, ValueError):
        array = np.empty(0)
    if array.ndim != 2 or array.size == 0:
        raise MapError(
            f"{name}: heights of shape {array.shape}",
            "a non-empty array of two axes, rows from north to south",
            "pass one height in metres a pixel",
        )
    lowest = array.min()  # NaN if any is NaN
    if not (np.isfinite(lowest) and np.isfinite(array.max())):
        raise MapError(
            f"{name}: {np.count_nonzero(~np.isfinite(array))} heights are NaN or infinite",
            "finite heights in metres",
            "set unknown pixels to 0 (ground) or to a default height first",
        )
    if lowest < 0:
        raise MapError(
            f"{name}: {np.count_nonzero(array < 0)} heights below ground, lowest {lowest:g} m",
            "heights above ground, 0 or more",
            "subtract the terrain first, or set them to 0",
        )
    return _read_only(array)


def _checked_site(site: np.ndarray, shape: tuple[int, int], name: str) -> np.ndarray:
    array = np.asarray(site)
    if array.dtype != bool or array.shape != shape:
        raise MapError(
            f"{name}: a part of {array.dtype} and shape {array.shape}",
            f"booleans of shape {shape}, one a pixel of the map",
            "make it so, for example numbers > 0",
        )
    if not array.any():
        raise MapError(f"{name}: a part without a pixel", "at least one", "mark some pixels")
    return _read_only(array.copy())


def _read_only(array: np.ndarray) -> np.ndarray:
    array.setflags(write=False)
    return array


def same_grid(maps: "list[CityMap]") -> None:
    """Raise `MapError` unless all ``maps`` have one size and one pixel size."""
    first = maps[0]
    for other in maps[1:]:
        if other.shape != first.shape or other.metres_per_pixel != first.metres_per_pixel:
            raise MapError(
                f"{other.name} has {other.shape[0]} × {other.shape[1]} px of "
                f"{other.metres_per_pixel:g} m, {first.name} has "
                f"{first.shape[0]} × {first.shape[1]} px of {first.metres_per_pixel:g} m",
                "maps of one size to be bred together",
                f"read both with the same {keyword('pixels')} and {keyword('metres_per_pixel')}",
            )


#: What describes a map besides its heights and pixels.
_DESCRIBED = (
    "name",
    "attribution",
    "origin",
    "crs",
    "height_rules",
    "taken",
    "site",
    "corner",
)


def _made_again(heights: np.ndarray, metres_per_pixel: float, described: dict) -> CityMap:
    return CityMap(heights, metres_per_pixel, **described)


__all__ = ["BUILT_ABOVE", "MAX_PIXELS", "MAX_SIDE", "STOREY", "CityMap", "same_grid"]
