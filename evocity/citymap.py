"""`CityMap`: a city district as a raster of building heights, with cached views for measures."""

from collections.abc import Mapping
from functools import cached_property
from numbers import Real
from typing import TYPE_CHECKING, Any

import numpy as np

from evocity.errors import MapError, keyword, plain_text, setting
from evocity.html_display import Displayed
from evocity.views import ground, local_density
from evocity.views.buildings import (
    STEP,
    Buildings,
    measured,
    outlines,
    separate_buildings,
    zones_of,
)
from evocity.views.classes import Classes, ClassTable, classified
from evocity.views.connected_components import pieces
from evocity.views.limit_tables import read_only
from evocity.views.map_arrays import check_heights, check_site
from evocity.views.orientation import gradients, nearest, structure
from evocity.views.streets import ALLEY_WIDTH, StreetGraph, street_graph
from evocity.views.walls import Walls, walls_of

if TYPE_CHECKING:
    import shapely

    from evocity.views.surfaces import GroundCover

#: The height, metres, above which a pixel is built: half a lowest storey. Decoded maps leave traces
#: of a few decimetres on the ground, which are not buildings.
BUILT_ABOVE = 1.5

#: Height of a storey, metres: for counts of floors, and for heights from storeys.
STOREY = 3.0

#: The largest map: its side (corners of domain blocks are int16) and its pixels (about 11 500²).
MAX_SIDE, MAX_PIXELS = 32_767, 1 << 27
#: The range of a pixel's side, metres; its square stays a finite number.
PIXEL_SIDES = (1e-6, 1e6)
#: Letters of an attribution, at most; hundreds of sources take less.
MOST_ATTRIBUTION = 1 << 16


class CityMap(Displayed):
    """A city as a raster of building heights in metres, with square pixels and row 0 in the north.

    Parameters
    ----------
    heights : array ``(H, W)`` of finite heights above ground, metres, 0 or more. Pixels of open
        ground have the height 0. The map keeps a read-only copy of the array in float32.
    metres_per_pixel : length of a pixel's side in metres, greater than 0.
    name : name of the map in pictures and tables. The function `evocity.errors.plain_text` removes
        control characters from the name.
    attribution : one line of text that the licence of the source requires; it contains no control
        characters. Every file and every picture of the map contains the attribution.
    origin : coordinates ``(x, y)`` of the north-west corner in ``crs``; None for a map without a
        place on Earth.
    crs : coordinate reference system in metres, as an authority code or WKT; None if the system is
        unknown.
    height_rules : mapping from the name of each height rule to the number of buildings that got
        their height from this rule. While reading a file, evocity counts how many buildings each
        height rule applies to.
    taken : description of the part of the file that the map shows; ``""`` for a map without a file.
    site : array of bool ``(H, W)``, true in the pixels that belong to the map; needed only for a
        map that is not a rectangle. Pixels outside the site have the height 0, and count neither as
        built nor as open ground. If the `site` is None, all pixels belong to the map. The method
        `within` makes maps with a site.
    corner : ``(row, column)`` of the map's north-west pixel in the larger map from which this map
        was cut.
    roof_shapes : shapes of roofs from the source, for scenes: float64 ``(n, 4)`` or None. Columns
        are x and y in ``crs``, the number in `evocity.io.roof_shapes.SHAPES`, and the area in m².

    Raises
    ------
    MapError : the heights are not a two-dimensional array of finite numbers that are 0 or more. A
        pixel size that is not positive raises MapError. A `site` raises MapError if no pixel of the
        site is true, or if site and heights differ in shape.

    The views (`built`, `open_ground`, `labels`, `areas`, `building_labels`, `buildings`, `classes`,
    `outline`, `walls`, `gradients`, `structure`, `distance_to_built`, `open_space`, `streets`,
    `street_graph`, `alley_graph`, `floors`) are read-only. The attributes of the map compute each
    view only once, at first access.
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
    roof_shapes: np.ndarray | None

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
        roof_shapes: np.ndarray | None = None,
    ):
        array = check_heights(heights, name)
        if site is not None:
            site = check_site(site, array.shape, name)
            array = read_only(np.where(site, array, np.float32(0)))
        low, high = PIXEL_SIDES
        if not (isinstance(metres_per_pixel, Real) and low <= metres_per_pixel <= high):
            raise MapError(
                f"{name}: {setting('metres_per_pixel', metres_per_pixel)}",
                f"a number of metres from {low:g} to {high:g}",
                "set the side of a pixel in metres, for example 2.0",
            )
        attribution = plain_text(str(attribution))
        if len(attribution) > MOST_ATTRIBUTION:
            raise MapError(
                f"{name}: the attribution has {len(attribution)} characters",
                f"an attribution of at most {MOST_ATTRIBUTION} characters",
                "shorten the attribution, for example to a link",
            )
        self.__dict__.update(
            heights=array,
            metres_per_pixel=float(metres_per_pixel),
            name=plain_text(str(name)),
            attribution=attribution,
            origin=None if origin is None else (float(origin[0]), float(origin[1])),
            crs=crs,
            height_rules=dict(height_rules or {}),
            taken=str(taken),
            site=site,
            corner=(int(corner[0]), int(corner[1])),
            roof_shapes=None if roof_shapes is None else read_only(np.array(roof_shapes, float)),
        )

    def __setattr__(self, name: str, value) -> None:
        raise AttributeError(
            f"a CityMap is immutable, so its {name} cannot be set; "
            "city.replace(heights) makes another map"
        )

    def __reduce__(self):  # only heights are sent; views are computed again
        described = {k: self.__dict__[k] for k in _DESCRIBED}
        return _rebuild, (self.heights, self.metres_per_pixel, described)

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
        """Size of the map in pixels: (H, W)."""
        return self.heights.shape

    @property
    def pixels(self) -> int:
        """Number of pixels that belong to the map: those of the site, or all without a site."""
        return self.heights.size if self.site is None else int(np.count_nonzero(self.site))

    @property
    def area(self) -> float:
        """Area of the map, m². In a map with a site, only the pixels of the site count."""
        return self.pixels * self.metres_per_pixel**2

    def within(self, mask: np.ndarray) -> "CityMap":
        """Cut out the part of the map where ``mask``, bool ``(H, W)``, is true.

        The result is the smallest rectangular map that contains all true pixels of the mask. The
        result has the mask as its site, unless all pixels of the rectangle are true. The border of
        the mask may cut buildings, like the border of any map.

        Raises `MapError` if the mask differs in shape from the map, or has no true pixel.
        """
        mask = check_site(mask, self.shape, self.name)
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
        """Cut an ``array`` ``(H, W)`` of the larger map, from which this map was cut, to this map.
        An array that has the size of this map stays unchanged."""
        top, left = self.corner if array.shape != self.shape else (0, 0)
        height, width = self.shape
        return array[top : top + height, left : left + width]

    def replace(self, heights: np.ndarray, **changes: Any) -> "CityMap":
        """Make a copy of the map with new heights; the keyword arguments ``changes`` replace other
        fields of the map."""
        described = {name: self.__dict__[name] for name in ("metres_per_pixel", *_DESCRIBED)}
        return CityMap(heights, **(described | changes))

    @cached_property
    def built(self) -> np.ndarray:
        """Bool ``(H, W)``: pixels higher than `BUILT_ABOVE`. About 10 µs at 256²."""
        return read_only(self.heights > BUILT_ABOVE)

    @cached_property
    def open_ground(self) -> np.ndarray:
        """Bool ``(H, W)``: pixels of the map, within its `site`, that are not built."""
        return read_only(~self.built if self.site is None else self.site & ~self.built)

    @cached_property
    def labels(self) -> np.ndarray:
        """Int32 ``(H, W)``: 0 on open ground, 1…n on the n built components, which touch by
        pixel sides (4 neighbours). About 0.4 ms at 256²."""
        return read_only(pieces(self.built)[0])

    @cached_property
    def areas(self) -> np.ndarray:
        """Float64 ``(n,)``: footprint of each built component, m², in the order of `labels`."""
        counts = np.bincount(self.labels.ravel())[1:]
        return read_only(counts * self.metres_per_pixel**2)

    @cached_property
    def building_labels(self) -> np.ndarray:
        """Int32 ``(H, W)``: 0 on open ground, 1…n on the n `buildings`, without the table. About 1
        ms at 256²; maps decoded with settled roofs have it already."""
        return read_only(zones_of(self.heights, self.labels, self.metres_per_pixel))

    @cached_property
    def buildings(self) -> Buildings:
        """The buildings, separated by gaps and by differences in height of more than half a storey:
        their labels and a table. Its courtyards are those that a single building encloses;
        `open_space` has the others. `separate_buildings` takes another step. About 2 ms at 256²."""
        pixel, zones = self.metres_per_pixel, self.building_labels
        return measured(self.heights, self.labels, zones, pixel, self.site)

    def told_apart(self, step: float = STEP) -> Buildings:
        """Separate buildings at gaps, and at places where the height changes by more than ``step``
        metres. If ``step`` is infinite, only gaps separate buildings. See
        `evocity.views.buildings.separate_buildings`."""
        return separate_buildings(
            self.heights, self.labels, self.metres_per_pixel, step, site=self.site
        )

    @cached_property
    def classes(self) -> Classes:
        """The objects by class, buildings and lower ones: building, furniture, tree, ground,
        fountain, shelter, post. `classified` takes another table. About 1 ms at 256²."""
        return self.classified()

    def classified(self, table: ClassTable | None = None) -> Classes:
        """Classify the objects on the map by the table of classes `table`; None uses the default
        table of evocity. See `evocity.views.classes`."""
        pixel, site = self.metres_per_pixel, self.site
        return classified(self.heights, self.buildings, pixel, table, site)

    @cached_property
    def outline(self) -> "tuple[shapely.Polygon, ...]":
        """Polygons along the pixels' edges, courtyards as holes, one for each of the `buildings` in
        their order: in ``crs`` if the map has an ``origin``; else in metres from its south-west
        corner, x to the east, y to the north. About 20 ms at 256²."""
        return outlines(self.building_labels, self.metres_per_pixel, self.north_west)

    @cached_property
    def walls(self) -> Walls:
        """The buildings as polygons with straight walls, a valid coverage, in the coordinates of
        `outline`. `walled` takes other options. About 30 ms at 256²."""
        return self.walled()

    def walled(self, **how: Any) -> Walls:
        """Fit straight walls to the buildings, with the options of `evocity.views.walls.walls_of`:
        ``detail``, ``relative``, ``squared``, ``storeys`` and ``least_area``."""
        return walls_of(
            self.building_labels,
            self.buildings.height,
            self.buildings.direction,
            self.metres_per_pixel,
            self.north_west,
            site=self.site,
            **how,
        )

    @property
    def north_west(self) -> tuple[float, float]:
        """Coordinates ``(x, y)`` of the north-west corner; south-west is (0, 0) by default."""
        return self.origin or (0.0, self.shape[0] * self.metres_per_pixel)

    @property
    def south_west(self) -> tuple[float, float]:
        """Coordinates ``(x, y)`` of the south-west corner; (0, 0) by default."""
        left, top = self.north_west
        return left, top - self.shape[0] * self.metres_per_pixel

    @cached_property
    def gradients(self) -> tuple[np.ndarray, np.ndarray]:
        """Float32 pair ``(d/dy, d/dx)`` of the heights, metres a metre, y to the south, by the
        Scharr operator, edges repeated. About 1 ms at 256²."""
        along_y, along_x = gradients(self._extended_heights, self.metres_per_pixel)
        return read_only(along_y), read_only(along_x)

    @property
    def _extended_heights(self) -> np.ndarray:
        """The heights; beyond the site those of its nearest pixel."""
        if self.site is None:
            return self.heights
        return np.ascontiguousarray(self.heights[nearest(self.site)])

    @cached_property
    def structure(self) -> np.ndarray:
        """Float32 ``(2, H, W)``: w cos 2θ and w sin 2θ, with the direction θ of the gradient,
        normal to the walls, from east towards south, and its square w; smoothed, since façades in a
        raster are staircases (`evocity.views.orientation`). About 1.2 ms at 256²."""
        return read_only(structure(*self.gradients, self.site))

    @cached_property
    def distance_to_built(self) -> np.ndarray:
        """Float32 ``(H, W)``: metres from each pixel's centre to the centre of the nearest built
        pixel, 0 on built pixels, infinity without any. Exact. About 0.9 ms at 256²."""
        return read_only(ground.distance_to_built(self.built, self.metres_per_pixel))

    @cached_property
    def open_space(self) -> ground.OpenSpace:
        """The pieces of open ground (8 neighbours): labels int32 ``(H, W)``, areas in m², and the
        built component of each courtyard. About 0.4 ms at 256², with `labels`."""
        return ground.open_space(self.labels, self.metres_per_pixel, self.site)

    @cached_property
    def streets(self) -> ground.Streets:
        """The axes of streets: skeleton bool ``(H, W)``, widths in metres from wall to wall,
        lengths in metres. 3 to 5 ms at 256²."""
        return ground.streets(self.built, self.metres_per_pixel)

    @cached_property
    def street_graph(self) -> StreetGraph:
        """The streets as a graph with widths and kinds, places, and quarters of `buildings`, in the
        coordinates of `outline`. `street_graph_of` takes other options. About 20 ms at 256²."""
        return self.street_graph_of()

    @cached_property
    def alley_graph(self) -> StreetGraph:
        """The street graph with alleys too: edges of 4 m and more, where `street_graph` has those
        of 8 m and more. About 20 ms at 256²."""
        return self.street_graph_of(least_width=ALLEY_WIDTH)

    @cached_property
    def floors(self) -> np.ndarray:
        """Int64 ``(H, W)``: floors of each built pixel, its height divided by 3 m, rounded, halves
        up; 0 on open ground. About 0.3 ms at 256²."""
        return read_only(local_density.count_floors(self.heights, self.built, STOREY))

    def local_density(self, radius: float = 100.0) -> local_density.LocalDensity:
        """Compute GSI and FSI of the ground within ``radius`` metres around each pixel. See
        `evocity.views.local_density.density_around_pixels`."""
        return local_density.density_around_pixels(self, radius)

    def local_density_at(
        self, places: np.ndarray, radius: float = 100.0
    ) -> tuple[np.ndarray, np.ndarray]:
        """Compute GSI and FSI of the ground within ``radius`` metres around ``places``, pairs
        (x, y) in the coordinates of `outline`. See
        `evocity.views.local_density.density_around_places`."""
        return local_density.density_around_places(self, places, radius)

    def ground_cover(self, buildings: Any = None, water: Any = None) -> "GroundCover":
        """Make one coverage of buildings, streets, squares and other ground, in metres from the
        south-west corner; parameters as of `evocity.views.surfaces.cover_map`."""
        from evocity.views.surfaces import cover_map  # shapely is slow to load

        return cover_map(self, buildings, water)

    def street_graph_of(self, **how: Any) -> StreetGraph:
        """Make the street graph with the options of `evocity.views.streets.street_graph`."""
        ground, labels, pixel = self.open_ground, self.building_labels, self.metres_per_pixel
        place = {"site": self.site, "density": self.local_density_at}
        return street_graph(ground, labels, pixel, self.north_west, **place, **how)


def same_grid(maps: "list[CityMap]") -> None:
    """Raise `MapError` unless all maps have the same number and size of pixels."""
    first = maps[0]
    for other in maps[1:]:
        if other.shape != first.shape or other.metres_per_pixel != first.metres_per_pixel:
            raise MapError(
                f"{other.name} has {other.shape[0]} × {other.shape[1]} px of "
                f"{other.metres_per_pixel:g} m, but {first.name} has "
                f"{first.shape[0]} × {first.shape[1]} px of {first.metres_per_pixel:g} m",
                "maps with the same number and size of pixels, so that they can be bred together",
                f"read both maps with the same {keyword('pixels')} and "
                f"{keyword('metres_per_pixel')}",
            )


#: Description of a map besides its heights and pixels.
_PLACE = ("name", "attribution", "origin", "crs", "height_rules", "taken", "site", "corner")
_DESCRIBED = (*_PLACE, "roof_shapes")


def _rebuild(heights: np.ndarray, metres_per_pixel: float, described: dict) -> CityMap:
    return CityMap(heights, metres_per_pixel, **described)


__all__ = ["BUILT_ABOVE", "MAX_PIXELS", "MAX_SIDE", "STOREY", "CityMap", "same_grid"]
