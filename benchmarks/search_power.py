"""How much a search finds: python benchmarks/search_power.py --run [--minutes M] [--pair A B …]
[--seeds N] [--evaluations N] [--goals NAME] [--methods NAME …] [--ablations | --peers]

evocity's default search beside others, at equal evaluations: random fusions of the parents without
selection, textbook DEAP with and without evocity's repair, pymoo's and Optuna's NSGA-II on fields
that choose between the parents, with evocity's repair. All have the same parents, codes, measures
and guard, calibrated on them as `evocity recipe new` does. --ablations takes parts of the default
away in place of that, and tells how many times what the default reaches they reach in the same
case, in the median.

--peers compares a new recipe with other packages that have its operators: pymoo's NSGA-II, SMS-EMOA
and AGE-MOEA-II, DEAP's NSGA-II, and Optuna's choice of operators in a row. The unit of hypervolume
is then the front of all methods together, and the additive epsilon stands beside it.

What each method reached is kept in benchmarks/power, a file a case: with --run, whatever is missing
there is bred, until it is all there or --minutes are over; without, the tables of what is there are
printed, which takes no time. A method that is taken out of a file is bred again. --curves FILE.png
draws them.
"""

import argparse
import itertools
import json
import os
import sys
import time
from pathlib import Path

os.environ.update(OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1", MKL_NUM_THREADS="1")

import numpy as np
from _machine import description
from _peer_table import GOALS as PEER_GOALS
from _peer_table import run as run_peers
from _power_curves import Unit, curve, passed
from _power_methods import ABLATIONS, BLIND, METHODS, POPULATION, Case, Over

from evocity import fitness
from evocity.search.calibration.calibration import calibrate_recipe
from evocity.search.calibration.recipe_text import Goal, RecipeSettings

KEPT = Path(__file__).parent / "power"
PAIRS = (
    ("lyon-1er", "montpellier-pas-du-loup"),
    ("new-york-west-village", "cape-town-salt-river"),
    ("villeurbanne-gratte-ciel", "lyon-1er"),
)
GOALS = {
    "four": ("autosimilarity", "alignment", "salingaros", "crumbs"),
    "three": ("autosimilarity", "alignment", "crumbs"),
}
DEFINED = (
    "Archive hypervolume: what the births of a method dominate together up to a reference point,\n"
    "in units of the goals' ranges. The range of each goal is that of the default's first "
    f"{POPULATION}\nbirths of the case; the reference lies a tenth of it beyond the worse of the "
    "parents' codes.\nTold of births that keep the guard, and of all."
)


def main(asked: argparse.Namespace) -> None:
    print(description())
    pairs = [tuple(pair) for pair in asked.pair] or list(PAIRS)
    if asked.peers:
        run_peers(asked, pairs)
        return
    methods = ABLATIONS if asked.ablations else METHODS
    names = [name for name in methods if not asked.methods or name in asked.methods]
    names = ["default", *(name for name in names if name != "default")]
    goals = [name for name in GOALS if asked.goals in (None, name)]
    if asked.run:
        until = time.monotonic() + 60 * asked.minutes
        for seed, which, pair, name in itertools.product(range(asked.seeds), goals, pairs, names):
            if time.monotonic() > until:
                print("the minutes are over; the same command goes on", file=sys.stderr)
                break
            kept = Kept(pair, seed, asked.evaluations)
            if which not in kept.told.get("curves", {}).get(name, {}):
                breed(kept, which, name, until)
    for which in goals:
        show([Kept(*one, asked.evaluations) for one in cases(pairs, asked.seeds)], which, names)
        if asked.curves:
            draw(pairs, which, names, asked)


def cases(pairs, seeds: int):
    return itertools.product(pairs, range(seeds))


class Kept:
    """What is known of a case: ``told``, as its file has it, a mapping of its guard, its unit
    of hypervolume, and of each method and set of goals the curves and what they cost."""

    def __init__(self, pair: tuple[str, str], seed: int, evaluations: int):
        self.pair, self.seed, self.evaluations = pair, seed, evaluations
        folder = KEPT / "-x-".join(Path(one).stem for one in pair)
        self.path = folder / f"seed-{seed}-{evaluations}.json"
        self.told = json.loads(self.path.read_text()) if self.path.exists() else {}

    def add(self, name: str, goals: str, found: dict) -> None:
        """What a method reached, into the file, and whatever another process wrote there since."""
        if self.path.exists():
            self.told = json.loads(self.path.read_text())
        self.told["curves"].setdefault(name, {})[goals] = found
        self.path.parent.mkdir(parents=True, exist_ok=True)
        temporary = self.path.with_suffix(".part")
        temporary.write_text(json.dumps(self.told, indent=1) + "\n")
        temporary.rename(self.path)

    def begin(self) -> None:
        """Bounds of the guard, and the unit, which no later default changes."""
        words = RecipeSettings("power", [{"map": one} for one in self.pair])
        found = calibrate_recipe(
            words, [Goal(fitness.get("crumbs"))], Path("power.toml"), lambda text: None
        )
        self.told["guard"] = {one.measure.name: one.keys for one in found.bounds}
        parts = []
        METHODS["default"](self.case("four"), POPULATION, parts.append)
        first = self.losses(np.vstack(parts), "four")[0]
        unit = Unit.of(first, first[: len(self.pair)])
        self.told["unit"] = {
            name: {"worst": worst, "range": width}
            for name, worst, width in zip(GOALS["four"], unit.worst, unit.ranges, strict=True)
        }
        self.told["curves"] = {}

    def case(self, goals: str) -> Case:
        return Case(self.pair, GOALS[goals], self.told["guard"], self.seed)

    def losses(self, values: np.ndarray, goals: str) -> tuple[np.ndarray, np.ndarray]:
        """Losses ``(n, goals)``, NaN for what failed, and who keeps the guard; of ``values``
        (n, measures) of a case with these goals."""
        signs = [-1 if fitness.get(name).goal == "max" else 1 for name in GOALS[goals]]
        losses = values[:, : len(signs)] * signs
        keeps = ~np.isnan(losses).any(axis=1)
        for bound, of in zip(self.told["guard"].values(), values[:, len(signs) :].T, strict=True):
            keeps &= (of >= bound.get("min", -np.inf)) & (of <= bound.get("max", np.inf))
        return losses, keeps

    def unit(self, goals: str) -> Unit:
        found = [self.told["unit"][name] for name in GOALS[goals]]
        return Unit([one["worst"] for one in found], [one["range"] for one in found])


def breed(kept: Kept, goals: str, name: str, until: float) -> None:
    """The births of a method, and their curves into the file of the case. Blind methods are bred
    once, with all the goals there are."""
    if not kept.told:
        kept.begin()
    bred = "four" if name in BLIND else goals
    parts, start = [], time.perf_counter()

    def told(values: np.ndarray) -> None:
        parts.append(values)
        if time.monotonic() > until:
            raise Over

    try:
        {**METHODS, **ABLATIONS}[name](kept.case(bred), kept.evaluations, told)
    except Over:
        return
    spent = time.perf_counter() - start
    values = np.vstack(parts)[: kept.evaluations]
    losses, keeps = kept.losses(values, bred)
    for which in GOALS if name in BLIND else [goals]:
        chosen = [GOALS[bred].index(one) for one in GOALS[which]]
        counted = {"keeping": keeps, "all": ~np.isnan(losses).any(axis=1)}
        curves = {
            key: curve(kept.unit(which), losses[:, chosen], of, POPULATION)
            for key, of in counted.items()
        }
        short = {key: [float(f"{one:.5g}") for one in of] for key, of in curves.items()}
        share = round(float(keeps.mean()), 3)
        told_of = {"seconds": round(spent), "share keeping the guard": share, **short}
        kept.add(name, which, told_of)
    what = f"{' x '.join(kept.pair)}, {goals}, seed {kept.seed}, {name}"
    print(f"{what}: {len(values)} births in {spent:.0f} s", file=sys.stderr, flush=True)


def curves_of(kept: Kept, goals: str, name: str) -> dict | None:
    return kept.told.get("curves", {}).get(name, {}).get(goals)


def show(cases: list[Kept], goals: str, names: list[str]) -> None:
    """Tables of what is there."""
    begun = [one for one in cases if curves_of(one, goals, "default")]
    print(f"\n{', '.join(GOALS[goals])}: {len(begun)} cases of {len(cases)}")
    print(DEFINED)
    if not begun:
        print("nothing is kept yet: --run")
        return
    head = "cases   keeping the guard   (lowest … highest)     of all"
    print(f"\n{'':34}{head}   default leads   times the default's")
    for name in names:
        both = [(curves_of(one, goals, "default"), curves_of(one, goals, name)) for one in begun]
        both = [(ours, theirs) for ours, theirs in both if theirs]
        if not both:
            continue
        last = np.array([theirs["keeping"][-1] for _, theirs in both])
        every = np.array([theirs["all"][-1] for _, theirs in both])
        wins = sum(ours["keeping"][-1] > theirs["keeping"][-1] for ours, theirs in both)
        ratios = [theirs["keeping"][-1] / max(ours["keeping"][-1], 1e-9) for ours, theirs in both]
        lead = f"{wins:9} of {len(both)}{np.median(ratios):16.2f}" if name != "default" else ""
        print(
            f"{name:34}{len(both):5}{np.median(last):16.4g}      ({last.min():.4g} … "
            f"{last.max():.4g}){np.median(every):12.4g}{lead}"
        )
    shares = []
    for one in begun:
        others = [curves_of(one, goals, name) for name in names if name != "default"]
        if others and all(others):
            best = max(other["keeping"][-1] for other in others)
            shares.append(passed(curves_of(one, goals, "default")["keeping"], best))
    if shares:
        told = ", ".join("never" if np.isinf(one) else f"{one:.0%}" for one in shares)
        print(
            f"\nthe default passes the runner-up's last value after {np.median(shares):.0%} of its "
            f"evaluations (median of {len(shares)}: {told})"
        )


def draw(pairs, goals: str, names: list[str], asked) -> None:
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    found = [Kept(*one, asked.evaluations) for one in cases(pairs, asked.seeds)]
    figure, axes = pyplot.subplots(figsize=(8, 5), layout="constrained")
    for name in names:
        # each case in units of what the default has at its end
        curves = [
            np.array(own["keeping"]) / ours["keeping"][-1]
            for ours, own in (
                (curves_of(k, goals, "default"), curves_of(k, goals, name)) for k in found
            )
            if ours and own and ours["keeping"][-1] > 0
        ]
        if not curves:
            continue
        curves = np.array(curves)
        at = np.arange(1, curves.shape[1] + 1) * POPULATION
        (line,) = axes.plot(at, np.median(curves, axis=0), label=f"{name} ({len(curves)})")
        low, high = np.quantile(curves, [0.25, 0.75], axis=0)
        axes.fill_between(at, low, high, color=line.get_color(), alpha=0.15, linewidth=0)
    axes.set_xlabel("evaluations")
    axes.set_ylabel("archive hypervolume, the default's last value = 1")
    axes.set_title(f"{len(GOALS[goals])} goals: median and middle half of the cases", fontsize=10)
    axes.legend(fontsize=8)
    axes.set_ylim(bottom=0)
    path = Path(asked.curves)
    figure.savefig(path.with_stem(f"{path.stem}-{goals}"), dpi=110)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--run", action="store_true", help="breed what is missing")
    parser.add_argument("--minutes", type=float, default=np.inf)
    parser.add_argument("--pair", nargs=2, action="append", default=[], metavar="CITY")
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--evaluations", type=int, default=3000)
    parser.add_argument("--goals", choices=[*GOALS, *PEER_GOALS], metavar="NAME")
    parser.add_argument("--methods", nargs="*", default=[], metavar="NAME")
    parser.add_argument("--ablations", action="store_true")
    parser.add_argument("--peers", action="store_true")
    parser.add_argument("--curves", metavar="FILE.png")
    main(parser.parse_args())
