"""Classification of the objects on a map: labels, classes, counts, shares, and an image."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from evocity.views.buildings import Buildings, measured, zones_of
from evocity.views.classes.table import ClassTable, packaged
from evocity.views.connected_components import dilate, pieces
from evocity.views.limit_tables import read_only

#: Least height of an object, metres: less than a kerb. Ground on a raster may be a centimetre high
#: anywhere.
LOW = 0.1
#: Step of height between two low objects that touch, metres: a little more than a kerb.
LOW_STEP = 0.2
#: Height and area below which low ground is a trace, not an object: a seat, a parked car; metres,
#: m². In raw attractors nearly all free pieces of low ground are traces, in the bundled cities
#: none is.
TRACE = 0.3, 8.0
#: Greatest share of its outline with which an object connected to a building may face higher
#: ground; it must also hold a square of 2 × 2 pixels. Other pieces are feet of walls: mixed pixels
#: of a laser scan, or frayed eaves of a raw attractor. Bundled cities have 500 to 1150 pieces, and
#: keep 0 to 60. A terrace with a depth of half its width has a third.
FRINGE = 0.4
#: Pixels of the smallest building with a class of its own, a square of two by two. A raster does
#: not show the shape of fewer pixels: in bred maps they are traces, not posts or trees.
FEWEST = 4


@dataclass(frozen=True, eq=False)
class Classes:
    """The objects on a map, each of one class.

    labels : int32 ``(H, W)``: 0 on open ground; 1…n on the n buildings, as in
        `CityMap.building_labels`; from n + 1 on the objects lower than buildings.
    classes : uint8 ``(m,)``, the class of each object, as its number in ``table.names``.
    area, height, roundness : float64 ``(m,)``, of each object: m², mean height in metres, 0…1
        (`evocity.views.classes.classes.features`).
    buildings : n, the number of buildings, which come first.
    table : the classes, with their colours.

    Arrays are read-only.
    """

    labels: np.ndarray
    classes: np.ndarray
    area: np.ndarray
    height: np.ndarray
    roundness: np.ndarray
    buildings: int
    table: ClassTable

    def __len__(self) -> int:
        """Count the objects."""
        return self.classes.size

    @property
    def names(self) -> tuple[str, ...]:
        """The classes, in the order of the table."""
        return self.table.names

    @property
    def of_buildings(self) -> np.ndarray:
        """Uint8 ``(n,)``: the class of each building, in the order of `CityMap.buildings`."""
        return self.classes[: self.buildings]

    @cached_property
    def counts(self) -> dict[str, int]:
        """Number of objects of each class, by its name."""
        return self._by_name(np.bincount(self.classes, minlength=len(self.names)))

    @cached_property
    def areas(self) -> dict[str, float]:
        """Area that each class covers, by its name, m²."""
        return self._by_name(np.bincount(self.classes, self.area, minlength=len(self.names)))

    def _by_name(self, values: np.ndarray) -> dict:
        return dict(zip(self.names, values.tolist(), strict=True))

    @property
    def shares(self) -> dict[str, float]:
        """Share of each class in the ground that objects cover, by its name; together 1, or 0
        without objects."""
        whole = sum(self.areas.values())
        return {name: min(area / whole, 1.0) if whole else 0.0 for name, area in self.areas.items()}

    @cached_property
    def image(self) -> np.ndarray:
        """Uint8 ``(H, W)``: 0 on open ground, k + 1 on objects of class k."""
        colours = np.concatenate([[0], self.classes + np.uint8(1)]).astype(np.uint8)
        return read_only(colours[self.labels])


def classified(
    heights: np.ndarray,
    buildings: Buildings,
    metres_per_pixel: float,
    table: ClassTable | None = None,
    site: np.ndarray | None = None,
) -> Classes:
    """Classify each building and each lower object.

    heights : float32 ``(H, W)``, metres.
    buildings : those of the map (`CityMap.buildings`); the function finds the lower objects.
    table : the classes; None for those of this package.
    site : bool ``(H, W)``: the map's own pixels, None for all.

    A building of fewer than `FEWEST` pixels has the class of the table's last entry, whatever its
    shape.

    About .5 ms at 256² without low objects, 3 ms with many.

    Source: the seven classes and their two features, surface and height, then "some quick shape
    analysis", Marsault 2005 (001 §3.1, fig. 10), which gives no limits. The limits are ours."""
    table = packaged() if table is None else table
    labels, values = buildings.labels, features(buildings)
    low = low_objects(heights, labels > 0, metres_per_pixel, site)
    if low is not None:
        labels = np.where(low.labels > 0, low.labels + np.int32(len(buildings)), labels)
        values = np.concatenate([values, features(low)], axis=1)
    kinds = table.classified(values)
    few = buildings.area < (FEWEST - 0.5) * metres_per_pixel**2
    kinds[: len(buildings)][few] = table.names.index(table.entries[-1][0])
    columns = {
        "labels": labels,
        "classes": kinds,
        "area": values[0].copy(),
        "height": values[1].copy(),
        "roundness": values[2].copy(),
    }
    frozen = {name: read_only(column) for name, column in columns.items()}
    return Classes(**frozen, buildings=len(buildings), table=table)


def low_objects(
    heights: np.ndarray,
    built: np.ndarray,
    metres_per_pixel: float,
    site: np.ndarray | None = None,
) -> Buildings | None:
    """Find objects lower than buildings: pools, lawns, benches, basins.

    The pixels are those higher than `LOW` that are not ``built``, bool ``(H, W)``. Gaps and steps
    of height of more than `LOW_STEP` separate objects. Traces (`TRACE`) and feet of walls
    (`FRINGE`) do not count. Returns the table of the objects, None without any. Other parameters
    are those of `evocity.views.buildings.measured`.
    """
    low = (heights > LOW) & ~built
    if not low.any():
        return None
    labels, count = pieces(low)
    zones = zones_of(heights, labels, metres_per_pixel, LOW_STEP, 0.0)
    table = measured(heights, labels, zones, metres_per_pixel, site)
    kept = (table.height >= TRACE[0]) | (table.area >= TRACE[1])
    attached = np.zeros(count + 1, bool)
    attached[labels[low & dilate(built, corners=True)]] = True
    foot = _without_square(zones, len(table))
    foot |= _facing_higher(zones, built, table.height) > FRINGE * table.sides
    kept &= ~(attached[table.component + 1] & foot)
    if not kept.any():
        return None
    zones = np.concatenate([[0], np.where(kept, np.cumsum(kept), 0)]).astype(np.int32)[zones]
    return measured(heights, pieces(zones > 0)[0], zones, metres_per_pixel, site)


def _without_square(zones: np.ndarray, count: int) -> np.ndarray:
    """Select the zones that hold no square of 2 × 2 pixels: bool ``(count,)``."""
    first = zones[:-1, :-1]
    square = (first == zones[1:, :-1]) & (first == zones[:-1, 1:]) & (first == zones[1:, 1:])
    return np.bincount(first[square], minlength=count + 1)[1:] == 0


def _facing_higher(zones: np.ndarray, built: np.ndarray, heights: np.ndarray) -> np.ndarray:
    """Count the sides of pixels of each zone that face a higher zone or a ``built`` pixel: int64
    ``(count,)``; ``heights``, ``(count,)``, are those of the zones."""
    level = np.where(built, np.inf, np.concatenate([[0.0], heights])[zones])
    counts = np.zeros(len(heights) + 1, np.int64)
    for here, there in (
        (np.s_[1:], np.s_[:-1]),
        (np.s_[:-1], np.s_[1:]),
        (np.s_[:, 1:], np.s_[:, :-1]),
        (np.s_[:, :-1], np.s_[:, 1:]),
    ):
        counts += np.bincount(zones[here][level[there] > level[here]], minlength=len(counts))
    return counts[1:]


def features(table: Buildings) -> np.ndarray:
    """Compute the features of the n objects of a ``table`` that a table of classes may limit:
    float64 ``(4, n)``, rows as in `table.FEATURES`.

    Area in m². Mean height in m. Roundness: area divided by that of the smallest circle; the area
    counts at most π/4 of the smallest rectangle, as for a disc. A disc has 1, a regular hexagon
    .83, a square .5, a rectangle twice as long as wide .4. Slenderness: height divided by the root
    of the area. On a raster a disc of five pixels across or more has .6 and more; a smaller disc
    looks like a square.
    """
    long, short = table.box.T
    disc = np.minimum(table.area, np.pi / 4 * long * short)
    round_ = np.minimum(disc / (np.pi / 4 * table.circle**2), 1.0)
    return np.stack([table.area, table.height, round_, table.height / np.sqrt(table.area)])
