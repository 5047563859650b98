"""Thousands of generations in one process, and what their log costs to read: benchmarks/soak.py

    python benchmarks/soak.py --generations 5000            # bred: hours
    python benchmarks/soak.py --generations 5000 --drawn    # written alone, of random genomes
    python benchmarks/soak.py --read FOLDER                 # a run that there is

Generations of 64 at 64². Printed: resident memory, at a tenth of the generations and at the end;
files of the log and their bytes; then processor seconds of each way of reading it, by a `Run` that
was opened anew, the least of three.
"""

import argparse
import os
import tempfile
from collections.abc import Callable
from pathlib import Path

os.environ.update(OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1", MKL_NUM_THREADS="1")

import numpy as np
from _machine import description, seconds

import evocity
from evocity import operators
from evocity.search import archive
from evocity.store import Birth, Header, Member, RunWriter, Source

SIZE = 64
RECIPE = """
[run]
name = "soak"
seed = 3
population = 64
generations = {generations}
[map]
pixels = 64
metres_per_pixel = 8.0
[genome]
block = 8
fit = false
reach = 8
[[parents]]
map = "lyon-1er"
[[parents]]
map = "montpellier-pas-du-loup"
[operators]
pavement_fusion = 1
lambda_crossover = 1
[[fitness]]
name = "gsi"
goal = "max"
[[fitness]]
name = "mean_height"
goal = "min"
[evaluation]
workers = 0
"""


def resident() -> float:
    """MiB of this process."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20


def bred(folder: Path, generations: int) -> tuple[Path, dict[int, float]]:
    """A search of so many generations, and its memory at a tenth of them and at the end."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "soak.toml").write_text(RECIPE.format(generations=generations))
    memory = {}
    with evocity.Search(evocity.read_recipe(folder / "soak.toml"), out=folder / "run") as search:
        for generation in search:
            if generation.number in (generations // 10, generations):
                memory[generation.number] = resident()
    return folder / "run", memory


def drawn(folder: Path, generations: int, size: int = SIZE) -> Path:
    """A log of births that nobody bred: some 200 genomes, a pedigree of the generation before, and
    measures that get slowly better."""
    rng = np.random.default_rng(1)
    names = ("lyon-1er", "montpellier-pas-du-loup")
    cities = [evocity.read_map(name, pixels=64, metres_per_pixel=8.0) for name in names]
    coded = [evocity.encode(city, block=8, fit=False, reach=8).genome for city in cities]
    first, measures = coded[0], ("gsi", "mean_height")
    header = Header(
        64, 64, 8.0, first.sigma_max, names, "", None, None, 3, size, "drawn", measures,
        marks=("contribution",), settle=first.settle,
    )  # fmt: skip
    kind = header.chromosome
    coded = [kind.adopt(one, header, None) for one in coded]
    mutate = operators.make("mutation", repair=None)
    genomes = [kind.adopt(mutate([coded[k % 2]], rng), header, None) for k in range(200)]
    wanted = [{"name": "gsi", "goal": "max"}, {"name": "mean_height", "goal": "min"}]
    sources = [Source(city, one) for city, one in zip(cities, coded, strict=True)]
    writer = RunWriter.create(folder / "run", "", {"fitness": wanted}, header, sources)
    writer.event("start")
    failed = 0
    for number in range(generations + 1):
        births, better = [], number / (generations + 1)
        for slot in range(size):
            ids = rng.integers(max(0, number - 1) * size, max(1, number * size), 2).tolist()
            lies, ok = rng.random(), rng.random() < 0.98
            failed += not ok
            births.append(
                Birth(
                    number,
                    number * size + slot,
                    tuple(ids) if number else (),
                    "mutation" if number else "source",
                    "ok" if ok else "error",
                    None if ok else "ValueError: of no use",
                    0.01,
                    {"gsi": lies * (0.5 + better), "mean_height": 30 * lies**2 + rng.random()}
                    if ok
                    else {},
                    genomes[int(rng.integers(len(genomes)))],
                    {"operator": "mutation"},
                )
            )
        members = [Member(k, one.id, 0, {"contribution": 0.1}) for k, one in enumerate(births)]
        told = {"births": (number + 1) * size, "failures": failed, "hypervolume": 1 + better}
        told |= {"best": {"gsi": 0.5, "mean_height": 1.0}, "evaluations_per_second": 9.0}
        writer.write_generation(number, births, members, told)
    writer.event("finish")
    writer.close()
    return folder / "run"


def files_of(path: Path) -> list[Path]:
    return [one for kind in ("births", "membership") for one in (path / kind).iterdir()]


def ways(path: Path) -> dict[str, Callable]:
    """What reads the run at ``path``, by name."""
    run = evocity.open_run(path)
    last = run.members(run.generations[-1])["id"][0].as_py()
    scores = ["generation", "id", "operator", "status", "feasible"]
    scores += [f"fitness.{name}" for name in run.header.columns]
    return {
        "open_run": lambda: evocity.open_run(path),
        "status": lambda: evocity.open_run(path).status(),
        "history": lambda: evocity.open_run(path).history(),
        "births(id, status)": lambda: evocity.open_run(path).births(columns=["id", "status"]),
        "scores of all births": lambda: evocity.open_run(path).births(columns=scores).to_pandas(),
        "archive": lambda: archive(evocity.open_run(path)),
        "ancestors": lambda: evocity.open_run(path).ancestors(last),
        "genome": lambda: evocity.open_run(path).genome(last),
    }


def main(asked: argparse.Namespace) -> None:
    print(description())
    with tempfile.TemporaryDirectory() as folder:
        place, memory = asked.keep or Path(folder), {}
        if asked.read is not None:
            path = asked.read
        elif asked.drawn:
            path = drawn(place, asked.generations)
        else:
            path, memory = bred(place, asked.generations)
        for number, size in memory.items():
            print(f"{size:.1f} MiB at generation {number}, x {size / min(memory.values()):.3f}")
        size = sum(one.stat().st_size for one in files_of(path)) / 2**20
        whole = len(evocity.open_run(path).generations)
        print(f"{whole} generations in {len(files_of(path))} files of {size:.1f} MiB")
        for name, read in ways(path).items():
            print(f"{name:20} {seconds(read):7.3f} s", flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--generations", type=int, default=500)
    parser.add_argument("--drawn", action="store_true", help="breed nothing: draw genomes")
    parser.add_argument("--read", type=Path, help="a run folder; nothing is bred")
    parser.add_argument("--keep", type=Path, help="a folder where the run is left, as run/")
    main(parser.parse_args())
