"""Forecasts of disk and time against ten short runs, one for each pair of bundled districts.

    python benchmarks/estimates.py [--population 12] [--generations 12] [--pixels 128]

Of each run it prints the forecast after the first generation, the true size and time, and whether
the range held. The last line counts how often the ranges held.
"""

import argparse
import itertools
import shutil
import tempfile
import time
from pathlib import Path

import evocity
from evocity.search.calibration.calibration import calibrate_recipe
from evocity.search.calibration.recipe_text import DURATIONS, RecipeSettings
from evocity.search.steering.estimate import SIZES, TIMES, estimate_of, first_representative
from evocity.search.steering.stop_rules import size_of

#: What is forecast: factors of the least and the most.
RANGES = {"size": SIZES, "time": TIMES, "duration": DURATIONS}
CITIES = (
    "lyon-1er",
    "montpellier-pas-du-loup",
    "new-york-west-village",
    "cape-town-salt-river",
    "villeurbanne-gratte-ciel",
)


def run(pair: tuple[str, str], seed: int, options: argparse.Namespace, folder: Path) -> dict:
    """Calibrate a recipe for a ``pair``, run it in ``folder``, and compare forecasts and truth."""
    parents = [{"map": name} for name in pair]
    settings = RecipeSettings(
        "estimates", parents, options.pixels, 2.0, options.population, options.generations, seed
    )
    calibrated = calibrate_recipe(settings, [], folder / "recipe.toml", lambda text: None)
    (folder / "recipe.toml").write_text(calibrated.text, encoding="utf-8")
    recipe = evocity.read_recipe(folder / "recipe.toml")
    began, found = time.perf_counter(), None
    with evocity.Search(recipe, out=folder / "run", workers=options.workers) as search:
        for generation in search:
            if found is None and generation.number == first_representative(recipe):
                found, at = estimate_of(folder / "run", recipe, generation), time.perf_counter()
    ended = time.perf_counter()
    return {
        "size": (found.size, size_of(folder / "run")),
        "time": (found.seconds, ended - at),
        "duration": (calibrated.duration, ended - began),
    }


def main() -> None:
    """Run all pairs, and print the comparisons."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--population", type=int, default=12)
    parser.add_argument("--generations", type=int, default=12)
    parser.add_argument("--pixels", type=int, default=128)
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    held = dict.fromkeys(RANGES, 0)
    for seed, pair in enumerate(itertools.combinations(CITIES, 2), 1):
        folder = Path(tempfile.mkdtemp(prefix="estimates-"))
        try:
            result = run(pair, seed, options, folder)
        finally:
            shutil.rmtree(folder)
        texts = [
            f"{name} {guess:.4g} → {true:.4g} ({true / guess:.2f})"
            for name, (guess, true) in result.items()
        ]
        print(f"{' × '.join(pair)}: {'; '.join(texts)}", flush=True)
        for name, (guess, true) in result.items():
            held[name] += RANGES[name][0] * guess <= true <= RANGES[name][1] * guess
    print("ranges that held: " + ", ".join(f"{name} {count}" for name, count in held.items()))


if __name__ == "__main__":
    main()
