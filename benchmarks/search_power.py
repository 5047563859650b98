"""How much a search finds: python benchmarks/search_power.py --run [--minutes M] [--pair A B …]
[--seeds N] [--evaluations N] [--goals four|three] [--methods NAME …] [--ablations]

evocity's default search beside others, at equal evaluations: random fusions of the parents without
selection, textbook DEAP with and without evocity's repair, pymoo's and Optuna's NSGA-II on fields
that choose between the parents, with evocity's repair. All have the same parents, codes, measures
and guard, calibrated on them as `evocity recipe new` does. --ablations takes parts of the default
away in place of that.

What is bred is kept in runs/power: with --run, whatever is missing there is bred, until it is all
there or --minutes are over; without, the tables are printed of what is there, which takes no time.
--curves FILE.png draws them.
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
from _power_curves import Unit, curve, passed
from _power_methods import ABLATIONS, BLIND, METHODS, POPULATION, Case, Over

from evocity import fitness
from evocity.search.calibration import begun
from evocity.search.recipe_text import Goal, Words

KEPT = Path("runs/power")
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
    methods = ABLATIONS if asked.ablations else METHODS
    names = [name for name in methods if not asked.methods or name in asked.methods]
    goals = [name for name in GOALS if asked.goals in (None, name)]
    if asked.run:
        until = time.monotonic() + 60 * asked.minutes
        cells = itertools.product(range(asked.seeds), goals, pairs, ["default", *names])
        for seed, which, pair, name in dict.fromkeys(cells):
            breed(pair, seed, which, name, {**METHODS, **ABLATIONS}[name], asked, until)
            if time.monotonic() > until:
                print("the minutes are over; the same command goes on", file=sys.stderr)
                break
    for which in goals:
        show(pairs, which, ["default", *(n for n in names if n != "default")], asked)


def place(pair: tuple[str, str], seed: int, goals: str, name: str, evaluations: int) -> Path:
    goals = "any" if name in BLIND else goals
    word = "".join(c if c.isalnum() else "-" for c in name)
    return KEPT / "-x-".join(pair) / f"{goals}-{word}-{seed}-{evaluations}.npz"


def guard_of(pair: tuple[str, str]) -> dict[str, dict[str, float]]:
    """Bounds of the guard, calibrated once."""
    path = KEPT / "-x-".join(pair) / "guard.json"
    if not path.exists():
        words = Words("power", [{"map": one} for one in pair])
        found = begun(words, [Goal(fitness.get("crumbs"))], Path("power.toml"), lambda text: None)
        bounds = {one.measure.name: one.keys for one in found.bounds}
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(bounds))
    return json.loads(path.read_text())


def breed(pair, seed, goals, name, method, asked, until) -> None:
    path = place(pair, seed, goals, name, asked.evaluations)
    if path.exists() or time.monotonic() > until:
        return
    every = GOALS["four"] if name in BLIND else GOALS[goals]
    case = Case(pair, every, guard_of(pair), seed)
    parts, start = [], time.perf_counter()

    def told(values: np.ndarray) -> None:
        parts.append(values)
        if time.monotonic() > until:
            raise Over

    try:
        method(case, asked.evaluations, told)
    except Over:
        return
    spent = time.perf_counter() - start
    values = np.vstack(parts)[: asked.evaluations]
    temporary = path.with_suffix(".part.npz")
    np.savez(temporary, values=values, measures=case.measures, seconds=spent)
    temporary.rename(path)
    what = f"{' x '.join(pair)}, {goals}, seed {seed}, {name}"
    print(f"{what}: {len(values)} births in {spent:.0f} s", file=sys.stderr, flush=True)


def losses_of(path: Path, pair, goals: str) -> tuple[np.ndarray, np.ndarray]:
    """Losses ``(n, goals)``, NaN for what failed, and who keeps the guard."""
    with np.load(path) as kept:
        values, measures = kept["values"], kept["measures"].tolist()
    sought = [measures.index(name) for name in GOALS[goals]]
    signs = np.array([-1 if fitness.get(name).goal == "max" else 1 for name in GOALS[goals]])
    keeps = ~np.isnan(values[:, sought]).any(axis=1)
    for name, bound in guard_of(pair).items():
        of = values[:, measures.index(name)]
        keeps &= (of >= bound.get("min", -np.inf)) & (of <= bound.get("max", np.inf))
    return values[:, sought] * signs, keeps


def show(pairs, goals: str, names: list[str], asked) -> None:
    """Tables of what is there."""
    found: dict[str, list] = {name: [] for name in names}
    cases = 0
    for pair, seed in itertools.product(pairs, range(asked.seeds)):
        paths = {name: place(pair, seed, goals, name, asked.evaluations) for name in names}
        if not paths["default"].exists():
            continue
        cases += 1
        first, _ = losses_of(paths["default"], pair, goals)
        unit = Unit(first[:POPULATION], first[: len(pair)])
        for name, path in paths.items():
            if path.exists():
                losses, keeps = losses_of(path, pair, goals)
                kept = curve(unit, losses, keeps, POPULATION)
                every = curve(unit, losses, ~np.isnan(losses).any(axis=1), POPULATION)
                found[name].append(((pair, seed), kept, every))
            else:
                found[name].append(None)
    print(f"\n{', '.join(GOALS[goals])}: {cases} cases of {len(pairs) * asked.seeds}")
    print(DEFINED)
    if not cases:
        print("nothing is kept yet: --run")
        return
    head = "cases   keeping the guard   (lowest … highest)     of all"
    print(f"\n{'':34}{head}   default leads")
    base = found["default"]
    for name in names:
        done = [one for one in found[name] if one is not None]
        if not done:
            continue
        kept = np.array([one[1][-1] for one in done])
        every = np.array([one[2][-1] for one in done])
        both = [(a, b) for a, b in zip(base, found[name], strict=True) if b is not None]
        wins = sum(a[1][-1] > b[1][-1] for a, b in both)
        lead = "" if name == "default" else f"{wins:9} of {len(both)}"
        print(
            f"{name:34}{len(done):5}{np.median(kept):16.4f}      ({kept.min():.4f} … "
            f"{kept.max():.4f}){np.median(every):12.4f}{lead}"
        )
    shares = []
    for number, case in enumerate(base):
        others = [found[n][number] for n in names if n != "default" and found[n][number]]
        if len(others) == len(names) - 1 and others:
            shares.append(passed(case[1], max(one[1][-1] for one in others)))
    if shares:
        told = ", ".join("never" if np.isinf(one) else f"{one:.0%}" for one in shares)
        print(
            f"\nthe default passes the runner-up's last value after {np.median(shares):.0%} of its "
            f"evaluations (median of {len(shares)}: {told})"
        )
    if asked.curves:
        draw(found, goals, asked)


def draw(found, goals: str, asked) -> None:
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(figsize=(8, 5), layout="constrained")
    for name, cases in found.items():
        done = [one for one in cases if one is not None]
        if not done:
            continue
        # each case in units of what the default has at its end
        ends = {one[0]: one[1][-1] for one in found["default"]}
        curves = [one[1] / ends[one[0]] for one in done if ends[one[0]] > 0]
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
    parser.add_argument("--goals", choices=GOALS)
    parser.add_argument("--methods", nargs="*", default=[], metavar="NAME")
    parser.add_argument("--ablations", action="store_true")
    parser.add_argument("--curves", metavar="FILE.png")
    main(parser.parse_args())
