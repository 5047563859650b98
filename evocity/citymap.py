"""`CityMap`: a city district as a raster of building heights, and the views measures share."""

from collections.abc import Mapping
from functools import cached_property
from numbers import Real
from typing import TYPE_CHECKING

import numpy as np
from scipy import ndimage

from evocity.errors import MapError, keyword, setting
from evocity.views import ground
from evocity.views.buildings import STEP, Buildings, measured, outlines, told_apart, zones_of
from evocity.views.structure import gradients, structure

if TYPE_CHECKING:
    import shapely

#: A pixel is built where it stands higher than this, metres: half a lowest storey. Decoded
#: maps leave traces of a few decimetres on the ground that are no buildings.
BUILT_ABOVE = 1.5

#: Largest map that is read, coded or decoded: its side (corners of domain blocks are int16)
#: and its pixels in all (about 11 500²).
MAX_SIDE = 32_767
MAX_PIXELS = 1 << 27


class CityMap:
    """A 2D½ city: heights in metres on a square grid, row 0 in the north.

    Parameters
    ----------
    heights : array ``(H, W)``, metres above ground, finite, not negative, 0 = ground. Copied
        to float32 and made read-only.
    metres_per_pixel : side of a pixel, metres, greater than 0.
    name : what the map is called in pictures and tables.
    attribution : the line its source's licence asks for; it travels into every file and
        picture made from the map.
    origin : (x, y) of the north-west corner in ``crs``, or None.
    crs : coordinate reference system in metres, as an authority code or WKT, or None.
    height_rules : how many buildings got their height by which rule, as the reader counted.
    taken : in words, what of its file was read; "" for a map that was not read from one.

    Raises
    ------
    MapError : the array is not two-dimensional, or holds NaN, infinity or negative heights;
        or the pixel size is not positive.

    Views (`built`, `labels`, `areas`, `building_labels`, `buildings`, `outline`, `gradients`,
    `structure`, `distance_to_built`, `open_space`, `streets`) are computed when first asked for,
    once a map, and are read-only.
    """

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
    ):
        array = _checked_heights(heights, name)
        if not (isinstance(metres_per_pixel, Real) and 0 < metres_per_pixel < np.inf):
            raise MapError(
                f"{name}: {setting('metres_per_pixel', metres_per_pixel)}",
                "a positive number of metres",
                "give the side of a pixel in metres, for example 2.0",
            )
        self.__dict__.update(
            heights=array,
            metres_per_pixel=float(metres_per_pixel),
            name=str(name),
            attribution=str(attribution),
            origin=None if origin is None else (float(origin[0]), float(origin[1])),
            crs=crs,
            height_rules=dict(height_rules or {}),
            taken=str(taken),
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
        return (
            f"CityMap({self.name!r}, {height} × {width} px at {self.metres_per_pixel:g} m, "
            f"built {self.built.mean():.2f}, highest {self.heights.max(initial=0):.1f} m)"
        )

    @property
    def shape(self) -> tuple[int, int]:
        """(H, W) in pixels."""
        return self.heights.shape

    @property
    def area(self) -> float:
        """Ground covered by the whole map, m²."""
        return self.heights.size * self.metres_per_pixel**2

    def replace(self, heights: np.ndarray, **changes) -> "CityMap":
        """A new map with other ``heights``; what describes this one is kept unless changed."""
        described = {
            "metres_per_pixel": self.metres_per_pixel,
            "name": self.name,
            "attribution": self.attribution,
            "origin": self.origin,
            "crs": self.crs,
            "height_rules": self.height_rules,
            "taken": self.taken,
        }
        return CityMap(heights, **(described | changes))

    @cached_property
    def built(self) -> np.ndarray:
        """Bool ``(H, W)``: pixels higher than `BUILT_ABOVE`. About 10 µs at 256²."""
        return _read_only(self.heights > BUILT_ABOVE)

    @cached_property
    def labels(self) -> np.ndarray:
        """Int32 ``(H, W)``: 0 on open ground, 1…n on the n built components, which touch by
        pixel sides (4 neighbours). About 0.4 ms at 256²."""
        labels, _ = ndimage.label(self.built)
        return _read_only(labels.astype(np.int32, copy=False))

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
        their labels and a table. `told_apart` takes another step. About 2 ms at 256²."""
        return measured(self.heights, self.labels, self.building_labels, self.metres_per_pixel)

    def told_apart(self, step: float = STEP) -> Buildings:
        """The buildings, told apart by gaps and by steps of height of more than ``step`` metres:
        `evocity.views.buildings.told_apart`. Infinity tells them apart by gaps alone."""
        return told_apart(self.heights, self.labels, self.metres_per_pixel, step)

    @cached_property
    def outline(self) -> "tuple[shapely.Polygon, ...]":
        """Polygons along the pixels' edges, courtyards as holes, one a building in the order of
        `buildings`: in ``crs`` if the map has an ``origin``; else in metres from its south-west
        corner, x to the east, y to the north. About 20 ms at 256²."""
        corner = self.origin or (0.0, self.shape[0] * self.metres_per_pixel)
        return outlines(self.building_labels, self.metres_per_pixel, corner)

    @cached_property
    def gradients(self) -> tuple[np.ndarray, np.ndarray]:
        """Float32 pair ``(d/dy, d/dx)`` of the heights, metres a metre, y to the south, by the
        Scharr operator, edges repeated. About 1 ms at 256²."""
        along_y, along_x = gradients(self.heights, self.metres_per_pixel)
        return _read_only(along_y), _read_only(along_x)

    @cached_property
    def structure(self) -> np.ndarray:
        """Float32 ``(2, H, W)``: w cos 2θ and w sin 2θ, θ the direction of the gradient, square to
        the walls, from east towards south, w its square; smoothed, for a raster's façades are
        staircases (`evocity.views.structure`). About 1.2 ms at 256²."""
        return _read_only(structure(*self.gradients))

    @cached_property
    def distance_to_built(self) -> np.ndarray:
        """Float32 ``(H, W)``: metres from each pixel's centre to that of the nearest built pixel, 0
        on these, infinity if there is none. Exact. About 0.9 ms at 256²."""
        return _read_only(ground.distance_to_built(self.built, self.metres_per_pixel))

    @cached_property
    def open_space(self) -> ground.OpenSpace:
        """The pieces of open ground (8 neighbours): labels int32 ``(H, W)``, areas in m², and the
        built component each is a courtyard of. About 0.4 ms at 256², `labels` given."""
        return ground.open_space(self.labels, self.metres_per_pixel)

    @cached_property
    def streets(self) -> ground.Streets:
        """The lines streets run along: skeleton bool ``(H, W)``, widths in metres from wall to
        wall, lengths in metres. 3 to 5 ms at 256²."""
        return ground.streets(self.built, self.metres_per_pixel)


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
_DESCRIBED = ("name", "attribution", "origin", "crs", "height_rules", "taken")


def _made_again(heights: np.ndarray, metres_per_pixel: float, described: dict) -> CityMap:
    return CityMap(heights, metres_per_pixel, **described)


__all__ = ["BUILT_ABOVE", "MAX_PIXELS", "MAX_SIDE", "CityMap", "same_grid"]
