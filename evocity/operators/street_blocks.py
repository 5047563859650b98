"""Street blocks of a map, and where the buildings of another map fit into one."""

from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
from scipy import fft
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from evocity import isometries
from evocity.citymap import CityMap
from evocity.pavement import Pavement
from evocity.views.ground.distance import nearest_built


@dataclass(frozen=True, eq=False)
class StreetBlocks:
    """The street blocks of a map, on the cells of a grid ``(R, C)``.

    The ground is cut along the middle lines between built components: each cell belongs to the
    component nearest to it. Components that share a cell are one. So no building crosses the
    border of a block, and where a street runs, its middle line does.

    labels : int32 ``(R, C)``: 1…n, the block of each cell; 0 everywhere if nothing is built.
    built : bool ``(R, C)``: whether anything is built in a cell.
    area, covered : int64 ``(n + 1,)``: how many cells, and built cells, each block has.
    spectrum : complex64 ``(R, C)``: the Fourier transform of ``built``.
    """

    labels: np.ndarray
    built: np.ndarray
    area: np.ndarray
    covered: np.ndarray
    spectrum: np.ndarray


@dataclass(frozen=True)
class Fit:
    """A place of another map that is laid into a street block under the isometry ``iso``: its
    cells (top, left) to (top + tall, left + wide)."""

    iso: int
    top: int
    left: int
    tall: int
    wide: int


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
    built = cells > 0
    if not built.any():
        labels = np.zeros(shape, np.int32)
    else:
        _, (row, column) = nearest_built(built)
        labels = cells[row, column]
    count = int(labels.max()) + 1
    return StreetBlocks(
        labels,
        built,
        area=np.bincount(labels.ravel(), minlength=count),
        covered=np.bincount(labels[built], minlength=count),
        spectrum=fft.fft2(built.astype(np.complex64)),
    )


def _united(labels: np.ndarray, grid: Pavement) -> np.ndarray:
    """For each built component of ``labels`` the number, from 1, of the group it is in: two that
    share a cell are in one. 0 for ground."""
    count = int(labels.max(initial=0)) + 1
    cells = grid.blocks(labels).reshape(len(grid), -1)
    most = np.repeat(cells.max(axis=1), cells.shape[1])
    apart = (cells.ravel() > 0) & (cells.ravel() != most)
    pairs = most[apart], cells.ravel()[apart]
    _, group = connected_components(coo_array((np.ones(pairs[0].size), pairs), (count, count)))
    # numbered by the first component of each; ground, which nothing is united with, is 0
    return group.astype(np.int32)


def outline(block: np.ndarray, whole: np.ndarray) -> np.ndarray:
    """The cells of a street block, bool ``(r, c)``, beside cells of others; ``whole`` (r + 2,
    c + 2) is true on the block and beyond the map's border, where nothing is cut."""
    inner = whole[:-2, 1:-1] & whole[2:, 1:-1] & whole[1:-1, :-2] & whole[1:-1, 2:]
    return block & ~inner


def fits(
    block: np.ndarray,
    rim: np.ndarray,
    density: float,
    donor: StreetBlocks,
    spread: float,
    rng: np.random.Generator,
) -> list[Fit]:
    """Where the ``donor`` fits best into a street block, a place under each isometry under which
    it is large enough.

    Of all places of the donor: the share of the block that would be built, less twice the share of
    its outline that would be, less half of how far the former is from the block's own
    ``density``. One is drawn of those within ``spread`` of the isometry's best.

    block, rim : bool ``(r, c)``, the cells of the street block and of its outline.
    """
    rows, columns = donor.built.shape
    area, around = np.count_nonzero(block), max(np.count_nonzero(rim), 1)
    found = []
    for iso in range(isometries.COUNT):
        # the block is turned, not the donor; one transform tells both sums, as real and imaginary
        back = int(isometries.INVERSE[iso])
        turned = isometries.apply(back, block) + 1j * isometries.apply(back, rim)
        tall, wide = turned.shape
        if tall > rows or wide > columns:
            continue
        kernel = np.zeros((rows, columns), np.complex64)
        kernel[:tall, :wide] = turned
        sums = fft.ifft2(donor.spectrum * np.conj(fft.fft2(kernel)), overwrite_x=True)
        sums = sums[: rows - tall + 1, : columns - wide + 1]
        within = sums.real / np.float32(area)
        cut = -sums.imag / np.float32(around)  # the kernel was conjugated
        scores = within - 2 * cut - np.abs(within - np.float32(density)) / 2
        among = np.flatnonzero(scores >= scores.max() - np.float32(spread))
        k = int(among[rng.integers(among.size)])
        found.append(Fit(iso, *divmod(k, scores.shape[1]), tall, wide))
    return found
