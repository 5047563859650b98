"""Imported for its effect: loads every compiled kernel, on a toy city.

The fork server imports it once, so that a worker which replaces a dead one is ready at once;
elsewhere each worker does before its first job. Without it the first individual of every
worker would spend about two seconds of its deadline on loading.
"""

import contextlib

import numpy as np

from evocity import fitness
from evocity.citymap import CityMap
from evocity.coding import encode
from evocity.operators import OPERATORS
from evocity.search.worker import Evaluator, Setup
from evocity.store import Header


def _toy(seed: int) -> CityMap:
    lots = np.random.default_rng(seed).integers(0, 4, (16, 16)) * 6.0
    return CityMap(lots.repeat(4, 0).repeat(4, 1)[1:-3, 2:-2], 2.0, name=f"toy {seed}")


def _warm_up() -> None:
    genomes = [encode(_toy(seed), block=4, threads=1).genome for seed in (1, 2)]
    pavement, cities = genomes[0].pavement, ("toy 1", "toy 2")
    header = Header(
        pavement.height, pavement.width, 4, 2.0, 0.9, cities, "", None, None, 0, 2, "", ()
    )
    own = tuple((measure.name, None) for measure in fitness.measures() if _ours(measure))
    evaluator = Evaluator(Setup(header, own))
    for operator in OPERATORS.values():
        parents = genomes[: operator.parents[0]]
        evaluator.breed(operator(), parents, np.random.default_rng(0))
    evaluator.evaluate(genomes[0])


def _ours(measure: fitness.Measure) -> bool:
    return measure.function.__module__.startswith("evocity.")


# What cannot be warmed shows itself, with its text, in the first birth that needs it.
with contextlib.suppress(Exception):
    _warm_up()
