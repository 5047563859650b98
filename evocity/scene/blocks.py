"""Walls of merged buildings, for coarser levels of detail: parts of like height, and blocks."""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely

from evocity.citymap import CityMap, Walls
from evocity.errors import MapError, check_number
from evocity.scene.detail import Level
from evocity.views.buildings import Buildings, measured, zones_of
from evocity.views.connected_components import dilate, pieces
from evocity.views.walls import DETAIL, walls_of

#: LoD 1.2: touching parts whose roofs differ by at most a storey are one, metres; smaller parts
#: join a neighbour, m². Biljecki 2016 lets parts of 10 m² be missing; on a raster of 2 m, they are
#: a few pixels.
STEP_OF_PARTS, LEAST_PART = 3.0, 30.0
#: Rise of a tower above its block, metres, and its least area, cells.
TOWER, LEAST_TOWER = 15.0, 4
#: Longest detail of walls that `evocity.views.walls.walls_of` takes, metres.
_MOST_DETAIL = 20.0


@dataclass(frozen=True)
class _Blocks:
    """Blocks on a raster of cells.

    cell : side of a cell, metres.
    gaps : whether gaps of up to two cells close.
    hole, least, part : least areas of a court, of a block and of a part of it, cells.
    step : step of height between parts of a block, metres; infinity for no parts.
    detail : shortest run of a wall, cells.
    """

    cell: float
    gaps: bool
    hole: int
    least: int
    part: int
    step: float
    detail: float

    def doubled(self, times: int) -> "_Blocks":
        """Return the plan with cells twice as wide, ``times`` times."""
        cell, fewer = self.cell * 2**times, 4**times
        least, part = max(self.least // fewer, 1), self.part // fewer
        return dataclasses.replace(self, cell=cell, least=least, part=part)


# Biljecki 2016 lets LoD 1.0 leave out all below 6 m: here a block of less than 2 × 2 cells.
_LOD_1_0 = _Blocks(4.0, gaps=False, hole=6, least=4, part=0, step=np.inf, detail=2.2)
_AFAR = _Blocks(10.0, gaps=True, hole=16, least=8, part=60, step=6.0, detail=2.2)


def walls_at(
    city: CityMap,
    level: Level,
    how: Mapping[str, Any] | None = None,
    owners: np.ndarray | None = None,
) -> Walls:
    """Fit walls to the buildings of a map at a level of detail.

    The levels 2.2, 1.3 and 0 have the walls of `CityMap.walled`. LoD 1.2 has one height for
    touching parts whose roofs differ by at most `STEP_OF_PARTS`, and outlines of twice the
    tolerance. LoD 1.0 merges all buildings that touch, on cells of 4 m. "afar" closes streets of up
    to 20 m, and merges blocks of like height there, on cells of 10 m. A merged building keeps the
    id of its largest part, and has the mean height of all its pixels.

    how : options of `CityMap.walled`.
    owners : int ``(n,)``, the tile of each building; None for one tile. Buildings of different
        tiles stay apart at each level.

    Source of the levels: Biljecki, Ledoux & Stoter 2016 (Computers, Environment and Urban Systems
    59:25-37); "afar" and the limits are ours. Raises `MapError` as `CityMap.walled`.
    """
    how = dict(how or {})
    if level.name in ("2.2", "1.3", "0"):
        return city.walled(**how) if how else city.walls
    detail = how.pop("detail", DETAIL)
    check_number("detail", detail, 0, _MOST_DETAIL, "metres, 0 to 20", MapError)
    buildings = city.buildings
    if owners is None:
        owners = np.zeros(len(buildings), np.int64)
    if level.name != "1.2":
        plan = _LOD_1_0 if level.name == "1.0" else _AFAR
        plan = plan.doubled(level.coarser)
        return _block_walls(city, plan, how, owners)
    kept = np.concatenate([[0], merge_parts(buildings, owners) + 1]).astype(np.int32)
    labels, detail = kept[buildings.labels], 2 * detail
    walls = _fit(city, labels, city.metres_per_pixel, detail, **how)
    return _simplified(city, walls, detail / 2)


def _fit(
    city: CityMap, labels: np.ndarray, pixel: float, detail: float, heights=None, **how: Any
) -> Walls:
    """Fit walls to ``labels``, int32 ``(H, W)``, which may leave numbers out. ``heights``: those of
    the pixels, or None for those of the map."""
    own = city.heights if heights is None else heights
    used, dense = np.unique(labels, return_inverse=True)
    if used[0] != 0:
        used = np.concatenate([[0], used])
        dense = dense + 1
    dense = dense.reshape(labels.shape).astype(np.int32)
    site = city.site if labels.shape == city.shape else None
    table = measured(own, np.where(dense > 0, 1, 0).astype(np.int32), dense, pixel, site)
    found = walls_of(
        dense,
        table.height,
        table.direction,
        pixel,
        city.north_west,
        detail=min(detail, _MOST_DETAIL),
        site=site,
        **how,
    )
    return _numbered(found, used)


def _numbered(walls: Walls, used: np.ndarray) -> Walls:
    """Give the walls of the buildings 1…n their numbers ``used``."""
    numbers = used[walls.buildings].astype(np.int32)
    numbers.setflags(write=False)
    return dataclasses.replace(walls, buildings=numbers)


def neighbours(labels: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Find the pairs of ``labels``, int32 ``(H, W)``, that share sides of pixels: the smaller and
    the larger label of each pair, less 1, and the number of sides, int64 ``(pairs,)`` each."""
    one = np.concatenate([labels[1:].ravel(), labels[:, 1:].ravel()])
    other = np.concatenate([labels[:-1].ravel(), labels[:, :-1].ravel()])
    both = (one != other) & (one > 0) & (other > 0)
    low, high = np.minimum(one[both], other[both]), np.maximum(one[both], other[both])
    base = int(labels.max(initial=0)) + 1
    pairs, sides = np.unique(low.astype(np.int64) * base + high, return_counts=True)
    return pairs // base - 1, pairs % base - 1, sides


def merge_parts(buildings: Buildings, owners: np.ndarray) -> np.ndarray:
    """Merge touching parts of buildings with the same owner: those of like height, and small ones,
    to the neighbour with the longest shared wall. int64 ``(n,)``, the index of the largest building
    among those that become one."""
    one, other, sides = neighbours(buildings.labels)
    same = owners[one] == owners[other]
    one, other, sides = one[same], other[same], sides[same]
    step = np.abs(buildings.height[one] - buildings.height[other])
    parts = _Parts(buildings)
    for pair in np.lexsort((-sides, step)).tolist():
        a, b = parts.root(int(one[pair])), parts.root(int(other[pair]))
        if a != b and abs(parts.height(a) - parts.height(b)) <= STEP_OF_PARTS:
            parts.join(a, b)
    for pair in np.argsort(-sides, kind="stable").tolist():
        a, b = parts.root(int(one[pair])), parts.root(int(other[pair]))
        if a != b and min(parts.area[a], parts.area[b]) < LEAST_PART:
            parts.join(a, b)
    return parts.largest()


class _Parts:
    """Sets of buildings that become one: a forest, with area and volume of each set."""

    def __init__(self, buildings: Buildings):
        self.single = buildings.area
        self.area, self.volume = buildings.area.tolist(), buildings.volume.tolist()
        self.above = list(range(len(buildings)))

    def root(self, part: int) -> int:
        above = self.above
        while above[part] != part:
            above[part] = above[above[part]]
            part = above[part]
        return part

    def height(self, root: int) -> float:
        return self.volume[root] / self.area[root]

    def join(self, one: int, other: int) -> None:
        a, b = self.root(one), self.root(other)
        if a != b:
            a, b = min(a, b), max(a, b)
            self.above[b] = a
            self.area[a] += self.area[b]
            self.volume[a] += self.volume[b]

    def largest(self) -> np.ndarray:
        """Find the largest building of the set of each, the first of equal ones."""
        roots = np.array([self.root(part) for part in range(len(self.above))], np.int64)
        order = np.lexsort((-np.arange(len(roots)), self.single))
        best = np.empty(len(roots), np.int64)
        best[roots[order]] = order
        return best[roots]


def _block_walls(city: CityMap, plan: _Blocks, how: Mapping[str, Any], owners: np.ndarray) -> Walls:
    """Fit walls to blocks on the cells of a ``plan``."""
    buildings, pixel = city.buildings, city.metres_per_pixel
    side = max(1, round(plan.cell / pixel))
    built, volume, label = _pool(buildings.labels, city.heights, side)
    solid = 2 * built >= side**2
    heights = np.where(solid, volume / np.maximum(built, 1), 0.0)
    closed = _close(solid, plan.gaps, plan.hole)
    heights = _spread(heights, closed)
    owner = np.where(solid, np.append(owners, 0)[label - 1] + 2.0, 0.0)
    owner = _spread(owner, closed)
    # blocks of one tile, then parts of like height in them
    blocks = zones_of(owner.astype(np.float32), pieces(closed)[0], 1.0, 0.5, 0.0)
    blocks[(np.bincount(blocks.ravel()) < plan.least)[blocks]] = 0
    zones = _like_heights(blocks, heights, plan)
    label = np.where(solid, label, 0)
    numbers = _ids(zones, int(zones.max(initial=0)), label, owner, owners)
    labels = np.concatenate([[0], numbers]).astype(np.int32)[zones]
    how = {key: value for key, value in how.items() if key not in ("least_area", "relative")}
    walls = _fit(city, labels, side * pixel, plan.detail * side * pixel, heights, **how)
    return _simplified(city, walls, side * pixel / 2)


def _like_heights(blocks: np.ndarray, heights: np.ndarray, plan: _Blocks) -> np.ndarray:
    """Divide ``blocks``, labels, into zones of like height: labels."""
    if not np.isfinite(plan.step):
        return blocks
    bands = np.floor(heights / plan.step + 0.5).astype(np.float32)
    bands += 1000 * (blocks % 997)  # so far apart that no step joins blocks that touch
    zones = zones_of(bands, (blocks > 0).astype(np.int32), 1.0, 0.5, float(plan.part))
    # towers stay, however small
    size, total = np.bincount(zones.ravel()), np.bincount(zones.ravel(), heights.ravel())
    rise = heights - (total / np.maximum(size, 1))[zones]
    towers, _ = pieces((zones > 0) & (rise >= TOWER))
    towers[(np.bincount(towers.ravel()) < LEAST_TOWER)[towers]] = 0
    zones = np.where(towers > 0, towers + np.int32(len(size)), zones)
    # small parts may have joined another block, and a tower may divide a part
    both = zones.astype(np.int64) * (int(blocks.max(initial=0)) + 1) + blocks
    one = np.unique(np.where(blocks > 0, both, 0), return_inverse=True)[1].reshape(zones.shape)
    return zones_of(one.astype(np.float32), (blocks > 0).astype(np.int32), 1.0, 0.5, 0.0)


def _simplified(city: CityMap, walls: Walls, tolerance: float) -> Walls:
    """Simplify the coverage of walls, and keep it within the map."""
    if not len(walls):
        return walls
    west, north = city.north_west
    deep, wide = (side * city.metres_per_pixel for side in city.shape)
    least, most = (west, north - deep), (west + wide, north)
    polygons = shapely.coverage_simplify(np.array(walls.polygons, dtype=object), tolerance)
    # cells may reach beyond the map
    inside = shapely.transform(polygons, lambda points: np.clip(points, least, most))
    inside = shapely.remove_repeated_points(inside)
    if shapely.is_valid(inside).all() and shapely.coverage_is_valid(inside):
        polygons = inside
    return dataclasses.replace(walls, polygons=tuple(polygons))


def _pool(
    labels: np.ndarray, heights: np.ndarray, side: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pool squares of ``side`` × ``side`` pixels: number of built pixels, sum of their heights, and
    the label of the middle built pixel, in the order of labels; 0 for none."""
    high, wide = (-(-length // side) for length in labels.shape)
    pad = [(0, high * side - labels.shape[0]), (0, wide * side - labels.shape[1])]

    def squares(array: np.ndarray) -> np.ndarray:
        parts = np.pad(array, pad).reshape(high, side, wide, side)
        return parts.transpose(0, 2, 1, 3).reshape(high, wide, side * side)

    own = np.sort(squares(labels), axis=2)
    built = (own > 0).sum(axis=2)
    volume = squares(np.where(labels > 0, heights, 0.0)).sum(axis=2, dtype=np.float64)
    middle = np.minimum(side * side - 1 - built // 2, side * side - 1)
    return built, volume, np.take_along_axis(own, middle[:, :, None], axis=2)[:, :, 0]


def _close(cells: np.ndarray, gaps: bool, hole: int) -> np.ndarray:
    """Close ``gaps`` of up to two cells, and fill holes of less than ``hole`` cells."""
    if gaps:
        grown = dilate(np.pad(cells, 2), corners=True)
        cells = ~dilate(~grown, corners=True)[2:-2, 2:-2] | cells
    holes, _ = pieces(~cells)
    return cells | (np.bincount(holes.ravel()) < hole)[holes]


def _spread(values: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Fill ``cells`` whose value is 0 with the greatest value beside them."""
    values = values.copy()
    while True:
        bare = cells & (values == 0)
        around = np.pad(values, 1)
        sides = (around[:-2, 1:-1], around[2:, 1:-1], around[1:-1, :-2], around[1:-1, 2:])
        found = np.maximum.reduce(sides)
        if not (found[bare] > 0).any():
            return values
        values[bare] = found[bare]


def _ids(
    zones: np.ndarray, count: int, label: np.ndarray, owner: np.ndarray, owners: np.ndarray
) -> np.ndarray:
    """Choose a building for each zone, another for each: that with the most cells in it, or one of
    the same tile that no zone has. int64 ``(count,)``, labels of buildings, 0 for zones that get
    none."""
    base = len(owners) + 1
    inside = (zones > 0) & (label > 0)
    pairs, cells = np.unique(
        zones[inside].astype(np.int64) * base + label[inside], return_counts=True
    )
    tile = np.zeros(count + 1, np.int64)
    tile[zones] = owner.astype(np.int64) - 2
    numbers, taken = np.zeros(count, np.int64), np.zeros(base, bool)
    for pair in np.argsort(-cells, kind="stable").tolist():
        zone, own = divmod(int(pairs[pair]), base)
        if not (numbers[zone - 1] or taken[own]) and owners[own - 1] == tile[zone]:
            numbers[zone - 1], taken[own] = own, True
    for zone in np.flatnonzero(numbers == 0).tolist():
        free = np.flatnonzero(~taken[1:] & (owners == tile[zone + 1]))
        if len(free):
            numbers[zone], taken[free[0] + 1] = free[0] + 1, True
    return numbers
