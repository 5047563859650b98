"""Trial maps for measures: the bundled districts, towns drawn by a rule, bred children."""

from dataclasses import replace
from functools import cache

import evocity

#: Parents of the bred maps, as in the demonstration; the first is typical.
PARENTS = ("lyon-1er", "montpellier-pas-du-loup")
#: Operators of the bred maps: three that keep buildings whole, and two that cut them.
OPERATORS = (
    "quarter_fusion",
    "quarter_refill",
    "height_scaling",
    "pavement_fusion",
    "lambda_crossover",
)


@cache
def trial_cases() -> tuple:
    """All `Case`, 256 × 256 px at 2 m, always the same: every bundled district; a town by each
    rule; the decoded codes of two districts, and a child of these by each of `OPERATORS`.

    All kernels are loaded, so that later calls take only the time of a measure.
    """
    import numpy as np

    from evocity.evaluation import kernel_warmup
    from evocity.fitness.check import Case
    from evocity.operators import make
    from evocity.pavement.levels import USUAL
    from evocity.towns import PATTERNS

    kernel_warmup.warm_up(USUAL, kernel_warmup.every_part())
    names = [*PARENTS, *(name for name in evocity.cities() if name not in PARENTS)]
    districts = [evocity.read_map(name, pixels=256, metres_per_pixel=2.0) for name in names]
    towns = [
        draw(256, 2.0, rng=np.random.default_rng(seed))
        for seed, draw in enumerate(PATTERNS.values())
    ]
    cases = [Case(city) for city in (*districts, *towns)]
    genomes = [evocity.encode(district).genome for district in districts[: len(PARENTS)]]
    cases += [
        replace(bred_case(f"{name}, decoded", genome, [genome], districts), code_of=name)
        for name, genome in zip(PARENTS, genomes, strict=True)
    ]
    for seed, name in enumerate(OPERATORS):
        operator = make(name)
        parents = genomes[: operator.parents[0]]
        child = operator(parents, np.random.default_rng(seed))
        cases.append(bred_case(f"child by {name}", child, parents, districts))
    return tuple(cases)


def bred_case(name: str, genome, parents, sources):
    """The `Case` of a ``genome``, its ``parents``, and the maps of its ``sources``."""
    from evocity.fitness.check import Case

    city = evocity.decode(genome).city
    return Case(city.replace(city.heights, name=name), genome, tuple(parents), sources=sources)
