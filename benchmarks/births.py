"""Births a second, searches side by side:
python benchmarks/births.py [--beside CHECKOUT] [--recipe FILE]

The demonstration's recipe with its leaves and with B = 4, two workers each. With --beside, the
demonstration of an older checkout of evocity runs in the same minutes (its own files are run, by
this interpreter). The searches take turns, a generation each, so that all of them meet the same
noise; the first generation, in which workers start, is not counted. All write their logs. With
--recipe, each checkout runs that recipe alone, with two workers.
"""

import argparse
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from statistics import median

from _machine import description

GENERATIONS = 15
ROOT = Path(__file__).resolve().parents[1]

#: Runs in a process of its own, in a checkout: a generation for each line that comes in.
_SEARCHER = """
import os, sys, time
from pathlib import Path

def processor():
    above, seconds = {}, {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = stat.read_text().rpartition(") ")[2].split()
        except OSError:  # it has ended
            continue
        pid = int(stat.parent.name)
        above[pid] = int(fields[1])
        seconds[pid] = (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    family, added = {os.getpid()}, True
    while added:
        added = {pid for pid, parent in above.items() if parent in family} - family
        family |= added
    return time.process_time(), sum(seconds.get(pid, 0.0) for pid in family)

def main():
    import evocity
    recipe, out = evocity.read_recipe(sys.argv[1]), sys.argv[1] + ".run"
    with evocity.Search(recipe, out=out, workers=2) as search:
        generations = iter(search)
        for _ in sys.stdin:
            start, before = time.perf_counter(), processor()
            done = next(generations)
            search.flush()
            took = [now - then for now, then in zip(processor(), before)]
            print(time.perf_counter() - start, done.births, done.failures, *took, flush=True)

if __name__ == "__main__":
    main()
"""


class Searching:
    """A search in a process of its own, a generation when asked."""

    def __init__(self, script: Path, checkout: Path, recipe: Path):
        words = [sys.executable, str(script), str(recipe)]
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
        # before evocity took BLAS out of the workers' way, it had to be told
        one = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
        environment = os.environ | one | {"PYTHONPATH": str(checkout)}
        self._process = subprocess.Popen(words, cwd=checkout, env=environment, **pipes)
        self.seconds: list[float] = []
        self.failures = 0
        self._births = 0
        self.rates: list[float] = []
        self.processor: list[tuple[float, float]] = []

    def step(self) -> None:
        self._process.stdin.write("\n")
        self._process.stdin.flush()
        spent, births, failures, *took = self._process.stdout.readline().split()
        self.seconds.append(float(spent))
        self.rates.append((int(births) - self._births) / float(spent))
        own = [1e3 * float(one) / (int(births) - self._births) for one in took]
        self.processor.append((own[0], own[1]))
        self._births, self.failures = int(births), int(failures)

    def close(self) -> None:
        self._process.communicate()


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--beside", type=Path, help="folder of another checkout of evocity")
    options.add_argument("--recipe", type=Path, help="recipe that each checkout runs")
    options.add_argument("--generations", type=int, default=GENERATIONS)
    told = options.parse_args()
    print(description())
    demo = (ROOT / "evocity/data/recipes/demo.toml").read_text(encoding="utf-8")
    with tempfile.TemporaryDirectory() as folder:
        script = Path(folder, "searcher.py")
        script.write_text(_SEARCHER, encoding="utf-8")

        def begun(name, checkout, recipe):
            path = Path(folder, f"{name}.toml")
            path.write_text(recipe, encoding="utf-8")
            return Searching(script, checkout, path)

        if told.recipe:
            demo = told.recipe.read_text(encoding="utf-8")
            searches = {"this": begun("this", ROOT, demo)}
        else:
            uniform = demo.replace('block = "2-16"', "block = 4")
            searches = {
                "leaves of 2…16 px": begun("leaves", ROOT, demo),
                "B = 4": begun("uniform", ROOT, uniform),
            }
        if told.beside:
            recipe = told.recipe or told.beside / "evocity/data/recipes/demo.toml"
            older = begun("beside", told.beside.resolve(), recipe.read_text(encoding="utf-8"))
            searches = {"beside": older} | searches
        for _ in range(told.generations + 1):
            for search in searches.values():
                search.step()
        for search in searches.values():
            search.close()
    first = next(iter(searches.values()))
    print(f"\nbirths a second over {told.generations} generations: all in all, and the median")
    print(
        f"generation's; ratios are medians of generation for generation, to {next(iter(searches))}"
    )
    print("ms: processor time of a birth, that of the main process, and of all its processes")
    for name, search in searches.items():
        rates = search.rates[1:]
        ratio = median(one / other for one, other in zip(rates, first.rates[1:], strict=True))
        own, all_ = (median(column) for column in zip(*search.processor[1:], strict=True))
        births = sum(r * s for r, s in zip(rates, search.seconds[1:], strict=True))
        print(
            f"  {name:20}{births / sum(search.seconds[1:]):7.1f}{median(rates):7.1f}"
            f"{ratio:8.2f} x   failed {search.failures}   {own:5.1f} and {all_:5.1f} ms"
        )


if __name__ == "__main__":
    main()
