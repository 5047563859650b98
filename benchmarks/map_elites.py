"""How much of a grid MAP-Elites fills, beside NSGA-II. python benchmarks/map_elites.py
[--pair A B] [--seeds 1 2 3] [--evaluations N] [--out FOLDER]

Searches of 256² maps, default genome, operators and ranges of parameters drawn at each birth, 48
births a generation, autosimilarity as the one goal, no guard: by map_elites over GSI and alignment,
20 × 20 cells, and by nsga2 with the same seed, operators and first generation. All births
of both are binned in the same grid, whose ranges are those of map_elites: what the parents' codes
have, half as far again on either side, within what the measures declare. Values beyond a range lie
in the cell at its end. Printed are

  cells     how many cells hold a birth;
  QD-score  sum over these of how far the best birth's loss (- autosimilarity) lies below the
            reference, a tenth beyond the worst of the first generation, in units of that
            generation's range, and never below 0;

of both, their ratios for each seed, and whether both are at least 1.4 in the median. With --out the
runs are kept there, and taken up again where they were stopped.
"""

import argparse
import tempfile
from pathlib import Path
from statistics import median

from _machine import description

import evocity
from evocity.errors import RunError
from evocity.search.binning import binned, grid_of_run

POPULATION = 48
WANTED = 1.4
RECIPE = """
[run]
seed = {seed}
population = {population}
generations = {generations}
record = ["gsi", "alignment"]
[map]
pixels = 256
metres_per_pixel = 2.0
[[parents]]
map = "{first}"
[[parents]]
map = "{second}"
[[fitness]]
name = "autosimilarity"
[search]
algorithm = "{algorithm}"
"""


def main(given) -> None:
    print(description())
    print(__doc__.split("\n\n", 1)[1])
    generations = -(-given.evaluations // POPULATION) - 1
    print(
        f"{' × '.join(given.pair)}, seeds {' '.join(map(str, given.seeds))}, "
        f"{(generations + 1) * POPULATION} evaluations each, {given.workers} workers\n"
    )
    print(f"{'':6}{'cells':>24}{'QD-score':>26}")
    print(f"{'seed':6}" + f"{'map_elites':>11}{'nsga2':>7}{'ratio':>7} " * 2)
    out = given.out or Path(tempfile.mkdtemp())
    ratios = []
    for seed in given.seeds:
        run = bred(out, "map_elites", seed, generations, given)
        other = bred(out, "nsga2", seed, generations, given)
        grid = grid_of_run(run)
        one, beside = binned(run, grid, generations), binned(other, grid, generations)
        cells = len(one) / max(len(beside), 1)
        score = one.qd_score / max(beside.qd_score, 1e-12)
        ratios.append((cells, score))
        print(
            f"{seed:<6}{len(one):11}{len(beside):7}{cells:7.2f} "
            f"{one.qd_score:11.1f}{beside.qd_score:7.1f}{score:7.2f}",
            flush=True,
        )
    middle = [median(column) for column in zip(*ratios, strict=True)]
    reached = "reached" if min(middle) >= WANTED else "not reached"
    print(f"\nmedian ratio: cells {middle[0]:.2f}, QD-score {middle[1]:.2f}; {WANTED} is {reached}")
    for name, ends in zip(grid.descriptors, grid.ranges, strict=True):
        print(f"{name} {ends[0]:.3f} to {ends[1]:.3f}")


def bred(out: Path, algorithm: str, seed: int, generations: int, given) -> evocity.store.Run:
    """The run of so many generations in a folder of ``out``, bred or taken up again."""
    folder = out / f"{'-x-'.join(given.pair)}-{algorithm}-{seed}"
    search = None
    if not folder.exists():
        out.mkdir(parents=True, exist_ok=True)
        recipe = folder.with_suffix(".toml")
        recipe.write_text(
            RECIPE.format(
                seed=seed,
                population=POPULATION,
                generations=generations,
                first=given.pair[0],
                second=given.pair[1],
                algorithm=algorithm,
            )
        )
        search = evocity.Search(evocity.read_recipe(recipe), out=folder, workers=given.workers)
    elif len(evocity.open_run(folder).generations) <= generations:
        search = evocity.Search.resume(folder, generations=generations, workers=given.workers)
    if search is not None:
        with search:
            for _ in search:
                pass
    return evocity.open_run(folder)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--pair", nargs=2, default=["lyon-1er", "montpellier-pas-du-loup"])
    parser.add_argument("--seeds", nargs="+", type=int, default=[1, 2, 3])
    parser.add_argument("--evaluations", type=int, default=2400)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--out", type=Path, help="folder of the runs, which are kept there")
    try:
        main(parser.parse_args())
    except RunError as error:
        raise SystemExit(str(error)) from None
