"""What a search under a guard leaves alive. python benchmarks/guarded.py [--out FOLDER]
[--generations N] [--pairs N] [--beside FOLDER]

Runs of the demo's measures on three pairs of districts, 256², default genome and mixture, 48
individuals, 3024 evaluations, with integrity, fabric distance and slivers bounded as in the bundled
recipes. Then, of the decoded maps of the last population: rank correlation of Salingaros' law (the
one bred for) with integrity; mean integrity; slivers, the share of buildings whose least box is
under 5 m wide, beside those of the parents' codes; mean fabric distance to the two cities, by what
of each is built; how many differ pairwise by more than 3 m in a fifth of the pixels; what share of
the built ground has its stone in its own place; and the hypervolume of the four measures. --beside
names a folder of runs of an older release, lyon-x-montpellier and so on, whose last populations are
measured too; hypervolumes then have one reference point, a tenth beyond the worst of both.
"""

import argparse
import os
import tempfile
import time
from pathlib import Path

os.environ.update(OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1", MKL_NUM_THREADS="1")

import moocore
import numpy as np
from _machine import description
from heredity import shown
from scipy.stats import spearmanr

import evocity
from evocity import fitness
from evocity.fitness import fabric_distance, slivers
from evocity.fitness.heredity import integrity_of
from evocity.fitness.reference import Reference

LYON, MONTPELLIER, NEW_YORK = "lyon-1er", "montpellier-pas-du-loup", "new-york-west-village"
PAIRS = {
    "lyon-x-montpellier": (LYON, MONTPELLIER),
    "lyon-x-new-york": (LYON, NEW_YORK),
    "montpellier-x-new-york": (MONTPELLIER, NEW_YORK),
}
#: The goals, and whether the most is the best.
GOALS = {"autosimilarity": True, "alignment": True, "salingaros": True, "crumbs": False}
RECIPE = """
[run]
seed = 7
population = 48
generations = {generations}
[map]
pixels = 256
metres_per_pixel = 2.0
[[parents]]
map = "{first}"
[[parents]]
map = "{second}"
{operators}
[[fitness]]
name = "autosimilarity"
[[fitness]]
name = "alignment"
[[fitness]]
name = "{law}"
[[fitness]]
name = "crumbs"
{guard}
"""
GUARD = """
[[fitness]]
name = "integrity"
min = 0.5
[[fitness]]
name = "fabric_distance"
reference = "parents"
max = 0.15
[[fitness]]
name = "slivers"
max = {slivers:.3f}
"""


def main(given) -> None:
    print(description())
    out = given.out or Path(tempfile.mkdtemp())
    for name, pair in list(PAIRS.items())[: given.pairs]:
        maps = [evocity.read_map(one) for one in pair]
        codes = [evocity.encode(one).genome for one in maps]
        worst = max(slivers(evocity.decode(one).city) for one in codes)
        runs = {"this one": bred(out / name, pair, worst, given)}
        if given.beside:
            runs = {"beside": given.beside / name} | runs
        last = {how: evocity.open_run(path) for how, path in runs.items()}
        genomes = {how: living(run) for how, run in last.items()}
        law_of = {"this one": given.law, "beside": "salingaros"}
        tables = {
            how: [measured(one, maps, law_of[how]) for one in found]
            for how, found in genomes.items()
        }
        losses = {how: np.array([row[-1] for row in table]) for how, table in tables.items()}
        every = np.concatenate(list(losses.values()))
        reference = every.max(axis=0) + 0.1 * np.ptp(every, axis=0)
        print(f"\n{name}: slivers of the codes at most {worst:.2f}")
        for how, table in tables.items():
            columns = [np.array(one) for one in zip(*(row[:-1] for row in table), strict=True)]
            law, whole, thin, apart, still = columns
            print(
                f"{how:9} correlation {correlation(law, whole)}, "
                f"integrity {whole.mean():.2f}, slivers {thin.mean():.2f}, "
                f"fabric distance {apart.mean():.3f}, in place {still.mean():.2f}, "
                f"different {different(genomes[how])} of {len(table)}, "
                f"hypervolume {moocore.hypervolume(losses[how], ref=reference):.4g}"
            )


def correlation(law, whole) -> str:
    """Of ranks; none where integrity, to the thousandth, is one for all."""
    whole = np.round(whole, 3)
    return "none" if np.ptp(whole) == 0 else f"{spearmanr(law, whole).statistic:.2f}"


def bred(folder: Path, pair, worst: float, given) -> Path:
    """The run in a ``folder``, bred if it is not there; ``worst``: the share of slivers of
    the parents' codes."""
    if not folder.exists():
        folder.parent.mkdir(parents=True, exist_ok=True)
        recipe = folder.with_suffix(".toml")
        recipe.write_text(
            RECIPE.format(
                generations=given.generations,
                first=pair[0],
                second=pair[1],
                law=given.law,
                operators=given.operators,
                guard="" if given.no_guard else GUARD.format(slivers=worst + 0.03),
            )
        )
        start = time.perf_counter()
        with evocity.Search(evocity.read_recipe(recipe), out=folder, workers=2) as search:
            for _ in search:
                pass
        print(f"\n{folder.name}: {time.perf_counter() - start:.0f} s")
    return folder


def living(run) -> list:
    return [run.genome(one) for one in run.members(run.generations[-1])["id"].to_pylist()]


def measured(genome, maps, law: str) -> tuple:
    city = evocity.decode(genome).city
    apart = fabric_distance(city, Reference.sources(maps), genome=genome)
    losses = [float(getattr(fitness, name)(city)) for name in GOALS]
    losses = [-one if most else one for one, most in zip(losses, GOALS.values(), strict=True)]
    return (
        float(getattr(fitness, law)(city)),
        integrity_of(genome, maps),
        float(slivers(city)),
        float(apart),
        shown(genome, city)[1],
        np.nan_to_num(losses, nan=1.0),
    )


def different(genomes) -> int:
    """How many differ pairwise: those that are like fewest others are chosen first."""
    maps = np.array([evocity.decode(one).city.heights for one in genomes])
    like = np.array([(np.abs(maps - one) > 3).mean(axis=(1, 2)) <= 0.2 for one in maps])
    left, chosen = np.ones(len(maps), bool), 0
    while left.any():
        among = np.flatnonzero(left)
        one = among[like[among][:, left].sum(axis=1).argmin()]
        left &= ~like[one]
        chosen += 1
    return chosen


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, help="folder of the runs, which are kept there")
    parser.add_argument("--beside", type=Path, help="folder of runs of an older release")
    parser.add_argument("--generations", type=int, default=62)
    parser.add_argument("--pairs", type=int, default=len(PAIRS), help="so many of the three")
    parser.add_argument("--law", default="salingaros_buildings", help="or salingaros")
    parser.add_argument("--operators", default="", help="[operators] as TOML; else the default")
    parser.add_argument("--no-guard", action="store_true")
    main(parser.parse_args())
