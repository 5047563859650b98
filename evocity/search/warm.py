"""Loads every compiled kernel, on a toy city.

Each worker does before its first job: the first individual of every worker would else spend
seconds of its deadline on loading. The fork server does once for all workers, see `warmed`.
"""

import contextlib
from functools import cache

import numpy as np

from evocity import fitness
from evocity.citymap import CityMap
from evocity.coding import encode
from evocity.operators import OPERATORS
from evocity.search.evaluator import Evaluator, Setup
from evocity.store import Header

#: The block of most recipes, px.
USUAL_BLOCK = 4


@cache
def warm_up(block: int) -> None:
    """Load every kernel that breeding and evaluation with range blocks of ``block`` px call.

    Never raises: what cannot be warmed shows itself, with its text, in the first birth that
    needs it.
    """
    with contextlib.suppress(Exception):
        _breed_toys(block)


def _toy(seed: int, block: int) -> CityMap:
    """Of 15 × 15 range blocks, fewer large ones, with lots that do not lie on their grid."""
    blocks = min(15, max(3, 96 // block))
    side = blocks * block
    lots = np.random.default_rng(seed).integers(0, 4, (side // 4 + 2, side // 4 + 2)) * 6.0
    heights = lots.repeat(4, 0).repeat(4, 1)[1 : 1 + side, 2 : 2 + side]
    return CityMap(heights, 2.0, name=f"toy {seed}")


def _breed_toys(block: int) -> None:
    genomes = [
        encode(_toy(seed, block), block=block, reach=2 * block, threads=1).genome for seed in (1, 2)
    ]
    pavement, cities = genomes[0].pavement, ("toy 1", "toy 2")
    header = Header(
        pavement.height, pavement.width, block, 2.0, 0.9, cities, "", None, None, 0, 2, "", ()
    )
    own = tuple((measure.name, None) for measure in fitness.measures() if _ours(measure))
    evaluator = Evaluator(Setup(header, own))
    for operator in OPERATORS.values():
        parents = genomes[: operator.parents[0]]
        evaluator.breed(operator(), parents, np.random.default_rng(0))
    evaluator.evaluate(genomes[0])


def _ours(measure: fitness.Measure) -> bool:
    return measure.function.__module__.startswith("evocity.")
