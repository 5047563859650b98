"""Settings of a search compared at equal births: python benchmarks/search_settings.py --run
[--minutes M] [--pair A B …] [--seeds N] [--births N] [--workers N] [--settings NAME …]

The base is the recipe that `evocity recipe new` writes for a pair of cities. Each setting changes
keys of its sections [run] and [search], or weights of its operators. All settings of a pair and
seed have the same founders, guard, and unit of hypervolume.

The folder benchmarks/settings keeps the results, a file for each pair and seed. With --run, the
script breeds what is missing there, seed by seed, until everything is there or --minutes are over;
the same command goes on later. Without --run, the script prints the table of what is there.
"""

import argparse
import itertools
import json
import os
import sys
import time
import tomllib
from pathlib import Path

os.environ.update(OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1", MKL_NUM_THREADS="1")

import numpy as np
import tomli_w
from _machine import description
from _power_curves import Unit, curve, passed

from evocity.recipe.reader import recipe_of
from evocity.recipe.recipe import Recipe
from evocity.search import Observer, Search
from evocity.search.calibration.calibration import calibrate_recipe
from evocity.search.calibration.recipe_text import RecipeSettings
from evocity.search.preparation.preparation import aims_of

KEPT = Path(__file__).parent / "settings"
PAIRS = (
    ("lyon-1er", "montpellier-pas-du-loup"),
    ("new-york-west-village", "cape-town-salt-river"),
    ("villeurbanne-gratte-ciel", "lyon-1er"),
)
#: Births between two points of a curve.
STEP = 48
#: Changes of the base, section -> key -> value.
SETTINGS: dict[str, dict[str, dict]] = {
    "base": {},
    "population 48": {"run": {"population": 48}},
    "tournament 4": {"search": {"tournament": 4}},
    "adapt, hypervolume": {"search": {"adapt": True, "credit": "hypervolume"}},
    "births 12": {"search": {"births": 12}},
    "population 48, tournament 4": {"run": {"population": 48}, "search": {"tournament": 4}},
    "population 48, births 12": {"run": {"population": 48}, "search": {"births": 12}},
    "population 48, adapt, hypervolume": {
        "run": {"population": 48},
        "search": {"adapt": True, "credit": "hypervolume"},
    },
}


class Over(BaseException):
    """The minutes are over; no observer catches it."""


class Values(Observer):
    """Values of all births of a search, as they come."""

    def __init__(self, until: float):
        self.births: list[dict[str, float]] = []
        self._until = until

    def generation(self, generation, births, members):
        self.births += [dict(born.values) if born.ok else {} for born in births]
        if time.monotonic() > self._until:
            raise Over


class Case:
    """One pair and seed: the file of its results, and the recipe that all settings start from."""

    def __init__(self, pair: tuple[str, str], seed: int, births: int):
        self.pair, self.seed, self.births = pair, seed, births
        folder = KEPT / "-x-".join(Path(one).stem for one in pair)
        self.path = folder / f"seed-{seed}-{births}.json"
        self.known = json.loads(self.path.read_text()) if self.path.exists() else {}

    @property
    def results(self) -> dict[str, dict]:
        return self.known.get("settings", {})

    def save(self, name: str, result: dict) -> None:
        """Write a result into the file, beside what another process wrote there since."""
        if self.path.exists():
            self.known = json.loads(self.path.read_text())
        self.known.setdefault("settings", {})[name] = result
        self.path.parent.mkdir(parents=True, exist_ok=True)
        temporary = self.path.with_suffix(".part")
        temporary.write_text(json.dumps(self.known, indent=1) + "\n")
        temporary.rename(self.path)

    def recipe(self, name: str) -> Recipe:
        """Make the recipe of a setting; the first call calibrates the guard."""
        if "recipe" not in self.known:
            settings = RecipeSettings(
                "settings", [{"map": one} for one in self.pair], seed=self.seed
            )
            made = calibrate_recipe(settings, [], Path("settings.toml"), lambda text: None)
            self.known["recipe"] = tomllib.loads(made.text)
        raw = json.loads(json.dumps(self.known["recipe"]))
        for section, keys in SETTINGS[name].items():
            raw.setdefault(section, {}).update(keys)
        size = raw.get("search", {}).get("births") or raw["run"]["population"]
        raw["run"] |= {"seed": self.seed, "generations": -(-self.births // size) - 1}
        return recipe_of(tomli_w.dumps(raw), Path(), {}, "the recipe")


def breed(case: Case, name: str, workers: int, until: float) -> None:
    """Breed the births of a setting, and save what they reached."""
    recipe = case.recipe(name)
    values, start, spent = Values(until), time.perf_counter(), os.times()
    try:
        with Search(recipe, workers=workers, observers=[values]) as search:
            for _ in search:
                pass
    except Over:
        return
    seconds = time.perf_counter() - start
    used = sum(os.times()[:4]) - sum(spent[:4])
    births, aims = values.births[: case.births], aims_of(recipe)
    complete = [bool(one) and aims.complete(one) for one in births]
    losses = np.full((len(births), len(aims.names)), np.nan)
    for row, (one, whole) in enumerate(zip(births, complete, strict=True)):
        if whole:
            losses[row] = aims.losses(one)
    keeps = np.array(
        [w and not aims.violation(one) for one, w in zip(births, complete, strict=True)]
    )
    if "unit" not in case.known:  # the base is bred first
        unit = Unit.of(losses[:STEP], losses[: len(case.pair)])
        case.known["unit"] = {"worst": unit.worst, "ranges": unit.ranges}
    unit = Unit(**case.known["unit"])
    reached = curve(unit, losses, keeps, STEP)
    whole = [one.get("integrity", np.nan) for one, kept in zip(births, keeps, strict=True) if kept]
    result = {
        "hypervolume": [float(f"{one:.5g}") for one in reached],
        "keeping the guard": round(float(keeps.mean()), 3),
        "integrity": round(float(np.nanmean(whole)), 3) if whole else None,
        "seconds": round(seconds),
        "CPU seconds": round(used),
    }
    case.save(name, result)
    print(
        f"{' x '.join(case.pair)}, seed {case.seed}, {name}: {reached[-1]:.4g} "
        f"after {len(births)} births in {seconds:.0f} s",
        file=sys.stderr,
        flush=True,
    )


def show(cases: list[Case], names: list[str]) -> None:
    """Print the table: each setting against the base of the same pair and seed."""
    print(
        "\nArchive hypervolume of the births that keep the guard. Ratios are to the base of the\n"
        'same pair and seed; "as soon": the share of its births after which a setting exceeds\n'
        "the base's last value."
    )
    head = f"{'':34}{'cases':>6}{'ratio':>8}{'lowest':>8}{'highest':>8}{'better':>8}{'as soon':>9}"
    print(f"{head}{'integrity':>11}{'CPU ms':>8}")
    for name in names:
        pairs = [
            (c, c.results["base"], c.results[name])
            for c in cases
            if {"base", name} <= c.results.keys()
        ]
        if not pairs:
            continue
        ratios = [
            own["hypervolume"][-1] / max(base["hypervolume"][-1], 1e-9) for _, base, own in pairs
        ]
        soon = [passed(own["hypervolume"], base["hypervolume"][-1]) for _, base, own in pairs]
        whole = [own["integrity"] or np.nan for *_, own in pairs]
        cost = [1000 * own["CPU seconds"] / c.births for c, _, own in pairs]
        better = "" if name == "base" else f"{sum(r > 1 for r in ratios)} of {len(ratios)}"
        median = np.median(soon)
        print(
            f"{name:34}{len(pairs):6}{np.median(ratios):8.2f}{min(ratios):8.2f}{max(ratios):8.2f}"
            f"{better:>8}{'never' if np.isinf(median) else f'{median:.0%}':>9}"
            f"{np.nanmean(whole):11.3f}{np.median(cost):8.0f}"
        )
    for pair in dict.fromkeys(case.pair for case in cases):
        print(f"\n{' x '.join(pair)}: the ratio of each seed")
        for name in names[1:]:
            own = [c for c in cases if c.pair == pair and {"base", name} <= c.results.keys()]
            ratios = (
                c.results[name]["hypervolume"][-1] / max(c.results["base"]["hypervolume"][-1], 1e-9)
                for c in own
            )
            if own:
                print(f"{name:34}" + "".join(f"{ratio:8.2f}" for ratio in ratios))


def main(chosen: argparse.Namespace) -> None:
    print(description())
    pairs = [tuple(pair) for pair in chosen.pair] or list(PAIRS)
    names = [name for name in SETTINGS if name == "base" or name in (chosen.settings or SETTINGS)]
    cases = [
        Case(pair, seed, chosen.births)
        for seed, pair in itertools.product(range(chosen.seeds), pairs)
    ]
    if chosen.run:
        until = time.monotonic() + 60 * chosen.minutes
        for case, name in itertools.product(cases, names):
            if time.monotonic() > until:
                print("the minutes are over; the same command goes on", file=sys.stderr)
                break
            if name not in case.results:
                breed(case, name, chosen.workers, until)
    show(cases, names)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--run", action="store_true", help="breed what is missing")
    parser.add_argument("--minutes", type=float, default=np.inf)
    parser.add_argument("--pair", nargs=2, action="append", default=[], metavar="CITY")
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--births", type=int, default=3000)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--settings", nargs="*", default=[], choices=list(SETTINGS), metavar="NAME")
    main(parser.parse_args())
