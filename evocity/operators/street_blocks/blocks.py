"""The street blocks of a map."""

from dataclasses import dataclass, field
from weakref import WeakKeyDictionary

import numpy as np
import scipy

from evocity.citymap import CityMap
from evocity.pavement import Pavement
from evocity.views.buildings import CRUMB
from evocity.views.ground.distance import nearest_built


@dataclass(frozen=True, eq=False)
class StreetBlocks:
    """The street blocks of a map, on the cells of a grid ``(R, C)``.

    The ground is cut along the middle lines between built components: each cell belongs to the
    component nearest to it. Components that share a cell are one. So no building crosses the
    border of a block, and where a street runs, its middle line does. Components too small for a
    building (`CRUMB`) have no block; each lies in one block whole.

    labels : int32 ``(R, C)``: 1…n, the block of each cell; 0 everywhere if nothing is built.
    built : bool ``(R, C)``: whether anything is built in a cell, crumbs included.
    area, covered : int64 ``(n + 1,)``: of each block, how many cells it has, and how many its
        component.
    components : int32 ``(R, C)``: the block whose component stands in each cell, 0 on ground and
        where a crumb stands.
    rooms : what is known of its street blocks (`Room.of`).
    """

    labels: np.ndarray
    built: np.ndarray
    area: np.ndarray
    covered: np.ndarray
    components: np.ndarray
    rooms: dict = field(default_factory=dict)


_known: WeakKeyDictionary[CityMap, dict[int, StreetBlocks]] = WeakKeyDictionary()


def street_blocks(city: CityMap, grid: Pavement) -> StreetBlocks:
    """The `StreetBlocks` of ``city`` on the cells of ``grid``; kept as long as the map is. About
    4 ms at 256² with cells of 2 px."""
    known = _known.setdefault(city, {})
    if grid.block not in known:
        known[grid.block] = _found(city, grid)
    return known[grid.block]


def _found(city: CityMap, grid: Pavement) -> StreetBlocks:
    shape = grid.rows, grid.columns
    united = _united(city.labels, grid)
    cells = united[grid.blocks(city.labels).reshape(len(grid), -1)].max(axis=1).reshape(shape)
    # the component of a crumb is a street's litter, which goes with the block it lies in
    pixels = np.bincount(united[city.labels].ravel(), minlength=1)
    components = np.where((pixels * city.metres_per_pixel**2 < CRUMB)[cells], 0, cells)
    if not components.any():
        labels = np.zeros(shape, np.int32)
    else:
        _, (row, column) = nearest_built(components > 0)
        labels = components[row, column]
        crumbs = np.flatnonzero((cells > 0) & (components == 0))
        whole, first = np.unique(cells.flat[crumbs], return_index=True)
        owner = np.zeros(int(cells.max()) + 1, np.int32)
        owner[whole] = labels.flat[crumbs[first]]
        labels.flat[crumbs] = owner[cells.flat[crumbs]]
    count = int(labels.max()) + 1
    built = cells > 0
    return StreetBlocks(
        labels,
        built,
        area=np.bincount(labels.ravel(), minlength=count),
        covered=np.bincount(components.ravel(), minlength=count),
        components=components,
    )


def _united(labels: np.ndarray, grid: Pavement) -> np.ndarray:
    """For each built component of ``labels`` the number, from 1, of the group it is in: two that
    share a cell are in one. 0 for ground."""
    count = int(labels.max(initial=0)) + 1
    cells = grid.blocks(labels).reshape(len(grid), -1)
    most = np.repeat(cells.max(axis=1), cells.shape[1])
    apart = (cells.ravel() > 0) & (cells.ravel() != most)
    pairs = most[apart], cells.ravel()[apart]
    _, group = scipy.sparse.csgraph.connected_components(
        scipy.sparse.coo_array((np.ones(pairs[0].size), pairs), (count, count))
    )
    # numbered by the first component of each; ground, which nothing is united with, is 0
    return group.astype(np.int32)
