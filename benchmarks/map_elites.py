"""How much of a grid MAP-Elites fills, beside NSGA-II. python benchmarks/map_elites.py
[--pair A B] [--seeds 1 2 3] [--evaluations N] [--without-many] [--out FOLDER]

Searches of 256² maps, default genome and operators, whose parameters are drawn at each birth, 48
births a generation, no guard: by map_elites over GSI and alignment, 20 × 20 cells, with
autosimilarity as the one goal; by nsga2 with the same goal; and by nsga2 with four goals,
autosimilarity, alignment, salingaros and crumbs, which keep its births apart. A seed has the same
first generation in all three. All births are binned in one grid, whose ranges are those of
map_elites: what the parents' codes have, half as far again on either side, within what the measures
declare. Values beyond a range lie in the cell at its end. Printed are, of each search,

  cells     how many cells hold a birth;
  QD-score  sum over these of how far the best birth's loss (- autosimilarity) lies below the
            reference, a tenth beyond the worst of the first generation, in units of that
            generation's range, and never below 0;

then their ratios, map_elites to nsga2, and whether the medians over seeds are at least 1.4. With
--out the runs are kept there, and taken up again where they were stopped.
"""

import argparse
import tempfile
from pathlib import Path
from statistics import median

from _machine import description

import evocity
from evocity.errors import RunError
from evocity.search.record.grid import binned, grid_of_run

POPULATION = 48
WANTED = 1.4
QUALITY = "autosimilarity"
#: Method -> algorithm, and its goals.
METHODS = {
    "map_elites": ("map_elites", [QUALITY]),
    "nsga2": ("nsga2", [QUALITY]),
    "nsga2many": ("nsga2", [QUALITY, "alignment", "salingaros", "crumbs"]),
}
RECIPE = """
[run]
seed = {seed}
population = {population}
generations = {generations}
record = {recorded}
[map]
pixels = 256
metres_per_pixel = 2.0
[[parents]]
map = "{first}"
[[parents]]
map = "{second}"
{fitness}
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
    print("seed  method      cells  ratio  QD-score  ratio")
    out = given.out or Path(tempfile.mkdtemp())
    others = [name for name in METHODS if name != "map_elites"][: 1 if given.without_many else None]
    ratios: dict[str, list[tuple[float, float]]] = {name: [] for name in others}
    for seed in given.seeds:
        run = bred(out, "map_elites", seed, generations, given)
        grid = grid_of_run(run)
        own = binned(run, grid, generations)
        print(f"{seed:<6}{'map_elites':11}{len(own):6}{own.qd_score:17.1f}", flush=True)
        for name in others:
            beside = bred(out, name, seed, generations, given)
            found = binned(beside, grid, generations, goal=QUALITY)
            cells = len(own) / max(len(found), 1)
            score = own.qd_score / max(found.qd_score, 1e-12)
            ratios[name].append((cells, score))
            row = f"{len(found):6}{cells:7.2f}{found.qd_score:10.1f}{score:7.2f}"
            print(f"{'':6}{name:11}{row}", flush=True)
    for name, found in ratios.items():
        cells, score = (median(column) for column in zip(*found, strict=True))
        reached = "reached" if min(cells, score) >= WANTED else "not reached"
        print(f"to {name}, median: cells {cells:.2f}, QD-score {score:.2f}; {WANTED} is {reached}")
    for name, ends in zip(grid.descriptors, grid.ranges, strict=True):
        print(f"{name} {ends[0]:.3f} to {ends[1]:.3f}")


def bred(out: Path, method: str, seed: int, generations: int, given):
    """The run of so many generations in a folder of ``out``, bred or taken up again."""
    folder = out / f"{'-x-'.join(given.pair)}-{method}-{seed}"
    algorithm, goals = METHODS[method]
    search = None
    if not folder.exists():
        out.mkdir(parents=True, exist_ok=True)
        recipe = folder.with_suffix(".toml")
        recipe.write_text(
            RECIPE.format(
                seed=seed,
                population=POPULATION,
                generations=generations,
                recorded=[name for name in ("gsi", "alignment") if name not in goals],
                first=given.pair[0],
                second=given.pair[1],
                fitness="\n".join(f'[[fitness]]\nname = "{goal}"' for goal in goals),
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
    parser.add_argument("--without-many", action="store_true", help="no nsga2 with four goals")
    parser.add_argument("--out", type=Path, help="folder of the runs, which are kept there")
    try:
        main(parser.parse_args())
    except RunError as error:
        raise SystemExit(str(error)) from None
