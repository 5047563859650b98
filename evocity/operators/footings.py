"""Which buildings, or built components, stand on which range blocks?"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy

from evocity.operators._kernels import tallied
from evocity.pavement import Pavement


class Footings(NamedTuple):
    """Which buildings of several maps on one pavement touch which blocks.

    Block b of map m is row m·n + b, n being the pavement's blocks; buildings are numbered from
    0 through all maps. They are those of the labels given: buildings told apart by gaps and
    steps, or whole built components.

    starts, labels, pixels : row r holds ``pixels[k]`` pixels of building ``labels[k]`` for each
        k in ``starts[r] : starts[r + 1]``.
    spans, places : building i touches blocks ``places[spans[i] : spans[i + 1]]`` of its map.
    whose, whole : the map of each building, and its pixels.
    """

    starts: np.ndarray
    labels: np.ndarray
    pixels: np.ndarray
    spans: np.ndarray
    places: np.ndarray
    whose: np.ndarray
    whole: np.ndarray


def footings_of(pavement: Pavement, maps: Sequence[np.ndarray]) -> Footings:
    """The `Footings` on ``pavement`` of ``maps``, given as labels: int32 ``(H, W)``, 0 on open
    ground, 1…n on n buildings (``CityMap.building_labels``) or components (``CityMap.labels``).
    """
    counts = [int(one.max()) for one in maps]
    whose = np.repeat(np.arange(len(maps)), counts)
    first = np.cumsum(counts) - counts
    rows = [
        pavement.blocks(np.where(one > 0, one + np.int32(start - 1), -1))
        for one, start in zip(maps, first, strict=True)
    ]
    starts, labels, pixels = tallied(np.concatenate(rows).reshape(len(rows) * len(pavement), -1))
    turned = scipy.sparse.csr_array(
        (pixels, labels, starts), shape=(starts.size - 1, whose.size)
    ).tocsc()
    return Footings(
        starts,
        labels,
        pixels,
        spans=turned.indptr.astype(np.int64),
        places=turned.indices.astype(np.int64) % len(pavement),
        whose=whose,
        whole=np.bincount(labels, pixels, whose.size).astype(np.int64),
    )
