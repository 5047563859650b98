"""Likeness of pictures: gradients and local patterns of patches, beside those of other cities."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from evocity.citymap import CityMap
from evocity.fitness.energy import mean_distance
from evocity.fitness.measure import Undefined, keep_result
from evocity.fitness.reference import Reference
from evocity.fitness.registry import fitness
from evocity.genome import Genome

#: Sides of a cell and of a patch, px; patches lie half a patch apart.
CELL, PATCH = 16, 64
#: Fewest patches with buildings that show a distribution.
FEWEST = 9
#: Numbers of `picture_likeness`.
NUMBERS = ("picture_likeness", "floor")

_ORIENTATIONS, _BLOCK, _CLIP, _EPS = 8, 2, 0.2, 1e-5
_CELLS = PATCH // CELL
_BLOCKS = (_CELLS - _BLOCK + 1) ** 2 * _BLOCK**2 * _ORIENTATIONS
_PATTERNS = 59
#: Widths of the groups of features of a patch: gradients of built ground and of heights, patterns
#: of built ground and of heights.
GROUPS = (_BLOCKS, _BLOCKS, _PATTERNS, _PATTERNS)
_ENDS = np.array([sum(GROUPS)])


@fitness(goal="min", range=(-1, math.inf), numbers=NUMBERS)
def picture_likeness(
    city: CityMap, reference: Reference, genome: Genome | None = None
) -> Mapping[str, float]:
    """Distance between pictures of the map and of other cities; about 0 for maps that look alike.

    The function compares patches of 64 px that lie 32 px apart, as they look to a viewer of the
    map. Each patch with buildings has four groups of features: histograms of oriented gradients and
    local binary patterns, each for built ground and for heights. The heights are rounded to whole
    metres. The gradients have 8 orientations, cells of 16 px, and blocks of 2 × 2 cells. The
    patterns have 8 neighbours, at a radius of 2 px for the built ground, and of 1 px for heights.
    Each group of features is divided by its standard deviation in the reference, so all groups
    count equally.

    The reference is one city, or several cities with weights, as for `fabric_distance`. For the
    source cities of a run, the genome gives the weight of each city. The number
    `picture_likeness.floor` compares halves of the reference: it is the mean of two distances, west
    half to east half and north half to south half. A map looks like the reference if its distance
    is near `picture_likeness.floor`.

    Formula: 2 E\\|X − Y\\| − E\\|X − X′\\| − E\\|Y − Y′\\|, with E the mean over pairs, X and X′
    two different patches of the city, and Y and Y′ two different patches of the reference.
    Unit: none; features count in standard deviations of the reference.
    Range: from slightly below 0 upwards.
    Empty map: NaN. The distance is NaN if the map or the reference has fewer than 9 patches with
    buildings, or if their pixels have different sizes.
    Source: our own; gradients, Dalal & Triggs 2005 (CVPR 886-893); patterns, Ojala, Pietikäinen &
    Mäenpää 2002 (IEEE TPAMI 24:971-987), both as in scikit-image; energy distance, Székely & Rizzo
    2013 (Journal of Statistical Planning and Inference 143:1249-1272).

    >>> lyon = evocity.read_map("lyon-1er")
    >>> far = picture_likeness(evocity.read_map("montpellier-pas-du-loup"), reference=lyon)
    >>> far > picture_likeness(lyon, reference=lyon) + 0.2
    True
    """
    scaled = _scaled_reference(reference)
    if isinstance(scaled, Undefined):
        return dict.fromkeys(NUMBERS, scaled)
    shares = reference.shares(city, genome)
    own = patches(city)[0]
    reason = _too_few(city.name, len(own))
    if not reason and city.metres_per_pixel != reference.cities[0].metres_per_pixel:
        reason = f"the pixels of {city.name} and of the reference have different sizes"
    if not reason and not (shares * scaled.counts).any():
        reason = f"nothing built in {city.name} comes from a city of the reference"
    if reason:
        return dict.fromkeys(NUMBERS, Undefined(reason))
    shares = shares * (scaled.counts > 0)
    shares = shares / shares.sum()
    rows = scaled.scale(own)
    between = np.array([mean_distance(rows, other, _ENDS)[0] for other in scaled.patches])
    distance = (
        2 * np.einsum("k,k", shares, between)
        - mean_distance(rows, rows, _ENDS)[0]
        - np.einsum("k,l,kl", shares, shares, scaled.within)
    )
    known = shares > 0
    floor = float(np.einsum("k,k", shares[known], scaled.floors[known]))
    return dict(zip(NUMBERS, (float(distance), floor), strict=True))


@keep_result
def patches(city: CityMap) -> tuple[np.ndarray, np.ndarray]:
    """Compute the features of the n patches with buildings: float32 ``(n, F)`` by `GROUPS`, and
    their rows and columns among all patches, int64 ``(n, 2)``. About 30 ms at 256²."""
    heights = np.round(city.heights).astype(np.float64)
    built = city.built.astype(np.float64)
    side, step = _CELLS, _CELLS // 2
    counts = [max((extent // CELL - side) // step + 1, 0) for extent in city.shape]
    if not all(counts):
        return np.empty((0, sum(GROUPS)), np.float32), np.empty((0, 2), np.int64)
    at = np.indices(counts).reshape(2, -1)
    parts = []
    for image in (built, heights):
        blocks = oriented_gradients(image)
        view = np.lib.stride_tricks.sliding_window_view(blocks, (side - 1, side - 1), (0, 1))
        parts.append(view[step * at[0], step * at[1]].reshape(at.shape[1], -1))
    for image, radius in ((built, 2), (heights, 1)):
        shares = _histograms(local_patterns(image, radius))
        view = np.lib.stride_tricks.sliding_window_view(shares, (side, side), (0, 1))
        parts.append(view[step * at[0], step * at[1]].mean(axis=(2, 3)))
    there = _means(built)
    view = np.lib.stride_tricks.sliding_window_view(there, (side, side), (0, 1))
    filled = view[step * at[0], step * at[1]].any(axis=(1, 2))
    return np.concatenate(parts, axis=1).astype(np.float32)[filled], at.T[filled]


def _means(image: np.ndarray) -> np.ndarray:
    """Average an image over cells: ``(h, w)``."""
    rows, columns = (side // CELL for side in image.shape)
    cut = image[: rows * CELL, : columns * CELL]
    return cut.reshape(rows, CELL, columns, CELL).mean(axis=(1, 3))


def oriented_gradients(image: np.ndarray) -> np.ndarray:
    """Compute the histograms of oriented gradients of an ``image`` ``(H, W)``: float64 ``(h − 1,
    w − 1, 2, 2, 8)`` for blocks of 2 × 2 among the h × w cells, normalised by L2-Hys, as
    `skimage.feature.hog` does."""
    down, along = np.zeros((2, *image.shape))
    down[1:-1] = image[2:] - image[:-2]
    along[:, 1:-1] = image[:, 2:] - image[:, :-2]
    size = np.hypot(down, along)
    turn = np.rad2deg(np.arctan2(down, along)) % 180
    bins = np.minimum(turn * (_ORIENTATIONS / 180), _ORIENTATIONS - 0.5).astype(np.int64)
    cells = _sums_by(bins, size, _ORIENTATIONS) / CELL**2
    view = np.lib.stride_tricks.sliding_window_view(cells, (_BLOCK, _BLOCK), (0, 1))
    blocks = view.transpose(0, 1, 3, 4, 2)
    axes = (2, 3, 4)
    blocks = blocks / np.sqrt((blocks**2).sum(axis=axes, keepdims=True) + _EPS**2)
    blocks = np.minimum(blocks, _CLIP)
    return blocks / np.sqrt((blocks**2).sum(axis=axes, keepdims=True) + _EPS**2)


def local_patterns(image: np.ndarray, radius: int) -> np.ndarray:
    """Compute the local binary patterns of 8 neighbours at a ``radius``, px, of an ``image`` of
    whole numbers: int64 ``(H, W)``, 0…58, by `skimage.feature.local_binary_pattern`."""
    from skimage.feature import local_binary_pattern

    whole = image.astype(np.int64)
    return local_binary_pattern(whole, 8, radius, "nri_uniform").astype(np.int64)


def _histograms(patterns: np.ndarray) -> np.ndarray:
    """Compute the shares of the patterns in each cell: ``(h, w, 59)``."""
    return _sums_by(patterns, None, _PATTERNS) / CELL**2


def _sums_by(numbers: np.ndarray, values: np.ndarray | None, count: int) -> np.ndarray:
    """Sum ``values``, or count, by the ``numbers`` 0…count − 1 in each cell: ``(h, w, count)``."""
    rows, columns = (side // CELL for side in numbers.shape)
    cut = np.s_[: rows * CELL, : columns * CELL]
    cell = np.arange(rows * CELL)[:, None] // CELL * columns + np.arange(columns * CELL) // CELL
    index = (cell * count + numbers[cut]).ravel()
    weights = None if values is None else values[cut].ravel()
    return np.bincount(index, weights, rows * columns * count).reshape(rows, columns, count)


@dataclass(frozen=True, eq=False)
class _Scaled:
    """The patches of a reference in units of its deviations, and the distances among them.

    deviation : (F,). patches : float32 (F, n) of each city; counts : (k,). within : (k, k).
    floors : (k,), distance between halves of each city.
    """

    deviation: np.ndarray
    patches: list[np.ndarray]
    counts: np.ndarray
    within: np.ndarray
    floors: np.ndarray

    def scale(self, rows: np.ndarray) -> np.ndarray:
        return np.ascontiguousarray((rows / self.deviation).T, dtype=np.float32)


@keep_result
def _scaled_reference(reference: Reference) -> _Scaled | Undefined:
    found = [patches(city) for city in reference.cities]
    tables, places = [rows for rows, _ in found], [at for _, at in found]
    if reason := _too_few("the reference", sum(map(len, tables))):
        return Undefined(reason)
    if len({city.metres_per_pixel for city in reference.cities}) > 1:
        return Undefined("the pixels of the cities of the reference have different sizes")
    filled = [rows.astype(np.float64) for rows in tables if len(rows)]
    centre = np.mean([rows.mean(axis=0) for rows in filled], axis=0)
    variance = np.mean([((rows - centre) ** 2).mean(axis=0) for rows in filled], axis=0)
    groups = np.repeat(np.arange(len(GROUPS)), GROUPS)
    total = np.sqrt(np.bincount(groups, variance))
    scaled = _Scaled(
        # a group without any variance does not count
        deviation=np.where(total > _EPS, total, np.inf)[groups],
        patches=[],
        counts=np.array([len(rows) for rows in tables]),
        within=np.zeros((len(tables), len(tables))),
        floors=np.zeros(len(tables)),
    )
    scaled.patches.extend(map(scaled.scale, tables))
    for k, one in enumerate(scaled.patches):
        for m, other in enumerate(scaled.patches[: k + 1]):
            scaled.within[k, m] = scaled.within[m, k] = mean_distance(one, other, _ENDS)[0]
    scaled.floors[:] = [_halves(*pair) for pair in zip(scaled.patches, places, strict=True)]
    return scaled


def _halves(rows: np.ndarray, at: np.ndarray) -> float:
    """Average the distances of the halves of a city, whose patches have no pixel in common; NaN
    where a half has fewer than two patches."""
    found = []
    for axis in range(2):
        middle = at[:, axis].max(initial=0) / 2
        one, other = (rows[:, at[:, axis] < middle], rows[:, at[:, axis] > middle])
        if min(one.shape[1], other.shape[1]) > 1:
            one, other = np.ascontiguousarray(one), np.ascontiguousarray(other)
            between = 2 * mean_distance(one, other, _ENDS)[0]
            within = mean_distance(one, one, _ENDS)[0] + mean_distance(other, other, _ENDS)[0]
            found.append(between - within)
    return float(np.mean(found)) if found else math.nan


def _too_few(where: str, count: int) -> str:
    if count >= FEWEST:
        return ""
    return f"{count} patches with buildings in {where}; the comparison needs {FEWEST}"
