"""Warm-up of the compiled kernels that a search calls: part by part, on toy cities.

The fork server imports it with the parts to load in `VARIABLE`, so that a worker which replaces a
dead one is ready at once. Elsewhere each worker warms up before its first job. Without warm-up the
first individual of every worker would spend seconds of its deadline on loading.
"""

import contextlib
import os
from collections.abc import Sequence
from functools import cache

import numpy as np

from evocity import fitness
from evocity.citymap import CityMap
from evocity.coding import decode, encode
from evocity.operators import OPERATORS
from evocity.pavement import read_sides

#: Environment variable: the side of the range blocks in px, and parts, separated by commas.
VARIABLE = "EVOCITY_WARM"

#: The parts by name: the search nearby, and of the whole map; decoding; the fit; the labels of
#: buildings, and all views of a map; selection, which workers do not call. There is also a part for
#: each operator, ``operator:NAME``, and for each measure, ``measure:NAME``.
SEARCH, EVERYWHERE, DECODE, FIT = "search", "search everywhere", "decode", "fit"
BUILDINGS, VIEWS, SELECTION = "buildings", "views", "selection"
_VIEWS = ("buildings", "outline", "structure", "distance_to_built", "open_space", "streets")


def every_part() -> list[str]:
    """List all parts, for all operators and measures of this package."""
    operators = [f"operator:{name}" for name in OPERATORS]
    measures = [f"measure:{one.name}" for one in fitness.measures() if one.origin == "evocity"]
    return [SEARCH, EVERYWHERE, DECODE, FIT, *operators, VIEWS, SELECTION, *measures]


def needs_genomes(part: str) -> bool:
    """Whether a ``part`` works on genomes, which `SEARCH` must encode first."""
    kind, _, name = part.partition(":")
    if kind == "measure":
        return bool(fitness.get(name).needs) or name == "autosimilarity"
    return kind == "operator" or part in (DECODE, FIT)


def write_sides(sides: int | tuple[int, int]) -> str:
    """Write sides of range blocks as `read_sides` reads them: "4", or "2-16"."""
    return str(sides) if isinstance(sides, int) else "-".join(map(str, sides))


def warm_up(sides: int | tuple[int, int], parts: Sequence[str]) -> None:
    """Load every kernel that ``parts`` call with range blocks of these ``sides``; never raises."""
    for part in parts:
        _load(sides, part)


@cache
def _load(block: int | tuple[int, int], part: str) -> None:
    kind, _, name = part.partition(":")
    with contextlib.suppress(Exception):
        if part == SEARCH:
            _genomes(block)
        elif part == EVERYWHERE:
            _coded(1, block, reach=None)
        elif part == FIT:
            _coded(1, block, fit=True)
        elif part == DECODE:
            for settle in (True, "roofs"):
                _ = decode(_genomes(block)[0], settle=settle).city
        elif part == BUILDINGS:
            _ = _toy(1, block).building_labels
        elif part == VIEWS:
            for view in _VIEWS:
                getattr(_toy(1, block), view)
        elif part == SELECTION:
            from evocity.selection.backends.moocore import least_first
            from evocity.selection.thumbprints import differences, distinct_first

            distinct_first(np.zeros((2, 4), np.uint16), 0.25, 1)
            differences(np.zeros((2, 4), np.uint16))
            least_first(np.eye(2), np.full(2, 1.1), 1)
        elif kind == "operator":
            operator = OPERATORS[name]
            operator()(_genomes(block)[: operator.parents[0]], np.random.default_rng(0))
        elif kind == "measure":
            measure = fitness.get(name)
            toys = [_toy(1, block), _toy(2, block)]
            genome = _genomes(block)[0] if needs_genomes(part) else None
            beside = [_toy(1, 16), _toy(2, 16)]  # with enough streets to compare
            given = {"genome": genome, "parents": (genome,), "sources": toys, "reference": beside}
            measure(toys[0], **{key: value for key, value in given.items() if key in measure.takes})


def _coded(seed: int, block, **how):
    """Encode a toy city; by default with the search nearby, one thread and no fit."""
    plain = {"reach": 8, "threads": 1, "fit": False}
    return encode(_toy(seed, block), block=block, **plain | how).genome


@cache
def _genomes(block: int | tuple[int, int]) -> list:
    return [_coded(seed, block) for seed in (1, 2)]


@cache
def _toy(seed: int, block: int | tuple[int, int]) -> CityMap:
    """Make a toy city of 15 × 15 range blocks, or fewer large ones, with lots off their grid."""
    block = block if isinstance(block, int) else block[1]
    blocks = min(15, max(3, 96 // block))
    side = blocks * block
    lots = np.random.default_rng(seed).integers(0, 4, (side // 4 + 2, side // 4 + 2)) * 6.0
    heights = lots.repeat(4, 0).repeat(4, 1)[1 : 1 + side, 2 : 2 + side]
    return CityMap(heights, 2.0, name=f"toy {seed}")


if os.environ.get(VARIABLE):
    _side, *_named = os.environ[VARIABLE].split(",")
    warm_up(read_sides(_side), _named)
