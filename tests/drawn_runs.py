"""Run folders with drawn values: what is tested is what is said of a run, not the search."""

import numpy as np
from codes import uniformly

from evocity.citymap import CityMap
from evocity.store import Birth, Header, Member, RunWriter, Source, environment

SIDE, BLOCK = 32, 4
HOSTILE = '<script src="http://evil.example/x.js">alert(1)</script>&"\''


def city(seed: int, name: str) -> CityMap:
    rng = np.random.default_rng(seed)
    heights = np.kron(rng.integers(0, 5, (SIDE // 8, SIDE // 8)) * 6.0, np.ones((8, 8)))
    return CityMap(heights, 2.0, name=name, attribution=f"© the people of {name}")


def make_run(
    folder, *, measures=("gsi", "fsi"), generations=3, population=6, names=("A", "B"), **o
):
    """A run folder with drawn values: what is tested is the telling, not the search."""
    rng = np.random.default_rng(7)
    maps = [city(seed, name) for seed, name in enumerate(names)]
    header = Header(
        SIDE, SIDE, 2.0, 0.9, (*names, *o.get("also", ())), "; ".join(m.attribution for m in maps),
        None, None, 7, population, "hash", tuple(measures),
    )  # fmt: skip
    genomes = [header.chromosome.adopt(uniformly(m).genome, header, None) for m in maps]
    sources = [Source(m, g) for m, g in zip(maps, genomes, strict=True)]
    recipe = o.get("recipe", '[run]\nname = "a run"\n')
    provenance = environment() | o.get("provenance", {})
    writer = RunWriter.create(folder, recipe, provenance, header, sources)
    for generation in range(generations):
        births = [
            _birth(generation, slot, population, genomes, measures, rng, o)
            for slot in range(population)
        ]
        alive = [birth for birth in births if birth.ok]
        members = [Member(n, b.id, n % 2, {"crowding": float(n)}) for n, b in enumerate(alive)]
        best = {m: max((b.values[m] for b in alive), default=0.0) for m in measures}
        writer.write_generation(
            generation,
            births,
            members,
            {
                "births": (generation + 1) * population,
                "failures": generation,
                "hypervolume": 1.0 + generation,
                "best": best,
                "evaluations_per_second": 5.0,
            },
        )
    writer.close()
    return folder


def _birth(generation, slot, population, genomes, measures, rng, options):
    first = generation == 0 and slot < len(genomes)
    values = {name: float(rng.uniform(0, 1)) for name in measures}
    fails = options.get("fails", lambda generation, slot: False)(generation, slot)
    return Birth(
        generation=generation,
        id=generation * population + slot,
        parents=() if first else (0, max(0, (generation - 1) * population)),
        operator="source" if first else options.get("operator", "mutation"),
        status="error" if fails else "ok",
        error=options.get("error", "gsi raised") if fails else None,
        seconds=0.1,
        values={} if fails else values,
        genome=options.get("bred", _source)(generation, slot, genomes),
    )


def _source(generation, slot, genomes):
    return genomes[slot % len(genomes)]


def told_run(folder, **options):
    goals = [{"name": "gsi", "goal": "max"}, {"name": "fsi", "goal": "min"}]
    return make_run(folder, provenance={"fitness": goals}, **options)
