"""What a log takes that leaves genomes out: python benchmarks/left_out.py

The night's run, Lyon × Montpellier at 256², for a few generations: bytes a birth, of births and
membership, by what `[log] genomes` keeps, of all generations and of the last; the share of births
that are left out; processor time, in seconds, to have one that is left out, with the reading of it
and of its ancestors, of so many drawn evenly, and of all who live in the last generation, as a run
that goes on reads them. One search; its births are written down in each way.
"""

import argparse
import os
import statistics
import tempfile
import time
from dataclasses import replace
from pathlib import Path

os.environ.update(OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1", MKL_NUM_THREADS="1")

from _machine import description

import evocity
from evocity.search import Observer
from evocity.search.breeding.omitted_genomes import OmittedGenomes
from evocity.search.steering.stop_rules import size_of
from evocity.store import GENOMES, RunWriter

RUN = Path(__file__).parent.parent / "runs" / "lyon-x-montpellier.toml"


class Written(Observer):
    """The births of a search, written down by ``genomes`` into ``out``."""

    def __init__(self, search: evocity.Search, out: Path, genomes: str):
        self._search, self._leaving, self._genomes = search, OmittedGenomes(genomes), genomes
        self._writer, self.out, self.last = None, out, 0

    def generation(self, generation, births, members) -> None:
        if self._writer is None:
            made = self._search._prepared
            header = replace(made.header, genomes=self._genomes)
            self._writer = RunWriter.create(self.out, "", {}, header, made.sources)
        before = self.size
        births = self._leaving.omit_from(births, members)
        self._writer.write_generation(generation.number, births, members, {})
        self.last = self.size - before

    def close(self) -> None:
        """Others may read it, and this writes no more."""
        self._writer.close()

    @property
    def size(self) -> int:
        return sum(size_of(self.out / kind) for kind in ("births", "membership"))


def clocked(path: Path, ids: list[int]) -> float:
    start = time.process_time()
    evocity.open_run(path).individuals(ids)
    return time.process_time() - start


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--generations", type=int, default=20)
    parser.add_argument("--timed", type=int, default=40, help="individuals that are clocked")
    told = parser.parse_args()
    print(description())
    recipe = evocity.read_recipe(RUN, generations=told.generations)
    # all but the log is the same: what tells how births are bred again is drawn up for "front"
    recipe = recipe.model_copy(update={"log": type(recipe.log)(genomes="front")})
    with tempfile.TemporaryDirectory() as folder:
        search = evocity.Search(recipe, workers=0)
        logs = {one: Written(search, Path(folder) / one, one) for one in GENOMES}
        for log in logs.values():
            search.observe(log)
        with search:
            for generation in search:
                print(f"generation {generation.number}", end="\r", flush=True)
        for log in logs.values():
            log.close()
        size = recipe.run.population
        births = size * (told.generations + 1)
        print(f"{births} births   kB a birth   of the last   left out   s for one   worst   living")
        for name, log in logs.items():
            sizes = f"{log.size / births / 1e3:10.2f} {log.last / size / 1e3:13.2f}"
            run = evocity.open_run(log.out)
            if name == "all":
                print(f"{name:12} {sizes}")
                continue
            breedings = run.births(columns=["breedings"])["breedings"].to_pylist()
            left = [one for one, count in enumerate(breedings) if count]
            run.genome(left[-1])  # compiled
            drawn = left[:: max(1, len(left) // told.timed)]
            took = [clocked(log.out, [one]) for one in drawn]
            living = run.members(told.generations)["id"].to_pylist()
            alive = clocked(log.out, living)
            print(
                f"{name:12} {sizes} {len(left) / births:10.0%} {statistics.median(took):11.3f}"
                f" {max(took):7.3f} {alive:8.2f}"
            )


if __name__ == "__main__":
    main()
