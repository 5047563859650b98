"""Which cities look alike: compared cell by cell, as one sees two maps laid side by side."""

from collections.abc import Sequence

import numpy as np

from evocity.citymap import CityMap
from evocity.search._kernels import first_apart, resembles

#: Cells are compared along each axis at most.
SIDE = 64
#: Heights differ if they differ by more than this, metres: a storey.
STOREY = 3.0
# What shares of a distance are asked for in turn.
_SHARES = (1.0, 0.8, 0.6, 0.4, 0.2)
# Looks are kept in decimetres.
_UNIT = 0.1


def look_of(city: CityMap) -> np.ndarray:
    """How a city looks: its heights at every so many pixels, at most `SIDE` along each axis, in
    decimetres, uint16 ``(n,)``; above 6553 m all is alike."""
    height, width = city.shape
    seen = city.heights[:: -(-height // SIDE), :: -(-width // SIDE)]
    return np.clip(np.rint(seen / _UNIT), 0, 65535).astype(np.uint16).ravel()


def alike(look: np.ndarray, others: np.ndarray, apart: float) -> bool:
    """Whether a ``look`` (n,) differs from one of the ``others`` (k, n) by more than a storey in no
    more than the share ``apart`` of the cells."""
    return resembles(look, others, round(STOREY / _UNIT), int(apart * look.size))


def distinct_first(looks: Sequence[np.ndarray], apart: float, count: int) -> np.ndarray:
    """Indices of all ``looks``, given best first: ``count`` of them come first that are pairwise
    more than ``apart`` from each other, each the best that is. If there are not so many, those
    follow that are more than .8, .6, .4 and .2 of it from all before them. The others come last,
    best first."""
    looks = np.asarray(looks)
    if not len(looks):
        return np.empty(0, np.intp)
    mosts = [int(share * apart * looks[0].size) for share in _SHARES]
    chosen = first_apart(looks, round(STOREY / _UNIT), np.array(mosts), count)
    return np.concatenate([chosen, np.setdiff1d(np.arange(len(looks)), chosen)]).astype(np.intp)
