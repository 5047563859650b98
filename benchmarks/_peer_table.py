"""Peers with evocity's own operators: what `search_power.py --peers` breeds, keeps and prints.

The folder benchmarks/power keeps the births that entered each method's archive, a file for each
pair and seed. All measures of quality follow from these births when the table is printed: the unit
of hypervolume is the front of all methods together.
"""

import itertools
import json
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import moocore
import numpy as np
from _peer_methods import PEERS
from _power_curves import passed
from _power_methods import POPULATION, Case, Over

from evocity import fitness
from evocity.search.calibration.calibration import calibrate_recipe
from evocity.search.calibration.recipe_text import Goal, RecipeSettings

KEPT = Path(__file__).parent / "power"
GOALS = {
    "with": ("autosimilarity", "alignment", "salingaros_buildings", "crumbs"),
    "without": ("autosimilarity", "alignment", "crumbs"),
}
BASE = next(iter(PEERS))
#: The reference point, in ranges beyond the worst of the front of all methods.
MARGIN = 0.1


class PeerCase:
    """One pair and seed, and the file of its results: goals -> method -> births that entered."""

    def __init__(self, pair: tuple[str, str], seed: int, evaluations: int):
        self.pair, self.seed, self.evaluations = pair, seed, evaluations
        folder = KEPT / "-x-".join(Path(one).stem for one in pair)
        self.path = folder / f"peers-seed-{seed}-{evaluations}.json"
        self.known = json.loads(self.path.read_text()) if self.path.exists() else {}

    def results(self, goals: str) -> dict[str, dict]:
        return self.known.get("results", {}).get(goals, {})

    def save(self, goals: str, name: str, result: dict) -> None:
        """Write a result beside what another process wrote into the file since."""
        if self.path.exists():
            self.known = json.loads(self.path.read_text())
        self.known.setdefault("results", {}).setdefault(goals, {})[name] = result
        self.path.parent.mkdir(parents=True, exist_ok=True)
        temporary = self.path.with_suffix(".part")
        temporary.write_text(json.dumps(self.known) + "\n")
        temporary.rename(self.path)

    def case(self, goals: str) -> Case:
        """Make the case; the first call calibrates the guard."""
        if "guard" not in self.known:
            settings = RecipeSettings("peers", [{"map": one} for one in self.pair])
            goal = Goal(fitness.get("crumbs"))
            made = calibrate_recipe(settings, [goal], Path("peers.toml"), lambda text: None)
            self.known["guard"] = {one.measure.name: one.keys for one in made.bounds}
        return Case(self.pair, GOALS[goals], self.known["guard"], self.seed)


def breed(peers: PeerCase, goals: str, name: str, until: float) -> None:
    """Breed the births of a method, and save those that entered its archive."""
    case, parts, start = peers.case(goals), [], time.perf_counter()

    def tell(values: np.ndarray) -> None:
        parts.append(values)
        if time.monotonic() > until:
            raise Over

    try:
        PEERS[name](case, peers.evaluations, tell)
    except Over:
        return
    values, spent = np.vstack(parts)[: peers.evaluations], time.perf_counter() - start
    signs = [-1 if fitness.get(one).goal == "max" else 1 for one in case.goals]
    losses = values[:, : len(signs)] * signs
    keeps = ~np.isnan(losses).any(axis=1)
    for bound, of in zip(case.guard.values(), values[:, len(signs) :].T, strict=True):
        keeps &= (of >= bound.get("min", -np.inf)) & (of <= bound.get("max", np.inf))
    result = {
        "seconds": round(spent),
        "keeping the guard": round(float(keeps.mean()), 3),
        "entered": [
            [at, *(float(f"{loss:.6g}") for loss in losses[at])]
            for at in entered(losses, keeps).tolist()
        ],
    }
    peers.save(goals, name, result)
    what = f"{' x '.join(peers.pair)}, {goals}, seed {peers.seed}, {name}"
    print(f"{what}: {len(values)} births in {spent:.0f} s", file=sys.stderr, flush=True)


def entered(losses: np.ndarray, counted: np.ndarray) -> np.ndarray:
    """Return the rows of ``(n, m)`` losses that no earlier one of those ``counted`` dominates or
    equals."""
    front, rows = np.empty((0, losses.shape[1])), []
    for row in np.flatnonzero(counted):
        if (front <= losses[row]).all(axis=1).any():
            continue
        front = np.vstack([front[~(losses[row] <= front).all(axis=1)], losses[row]])
        rows.append(row)
    return np.array(rows, int)


class Union:
    """The front of all ``parts`` together, ``(n, m)`` losses each: the unit of hypervolume."""

    def __init__(self, parts: Sequence[np.ndarray]):
        points = np.vstack(parts)
        front = points[moocore.is_nondominated(points)]
        self._best, ranges = front.min(axis=0), np.ptp(front, axis=0)
        self._ranges = np.where(ranges > 0, ranges, 1.0)
        self.reference = np.full(front.shape[1], 1 + MARGIN)
        self.front = self(front)
        self.volume = moocore.hypervolume(self.front, ref=self.reference)

    def __call__(self, losses: np.ndarray) -> np.ndarray:
        """``(n, m)``: 0 is the best of the front, 1 its worst."""
        return (losses - self._best) / self._ranges

    def share(self, losses: np.ndarray) -> float:
        """Compute the hypervolume of ``(n, m)`` losses, as a share of that of the union."""
        inside = self(losses)
        inside = inside[(inside < self.reference).all(axis=1)]
        if not len(inside):
            return 0.0
        return float(moocore.hypervolume(inside, ref=self.reference) / self.volume)

    def epsilon(self, losses: np.ndarray) -> float:
        """Compute the additive ε: by how many ranges all of the ``losses`` must fall until they
        dominate the union. Infinite for no losses."""
        if not len(losses):
            return np.inf
        beyond = (self(losses)[None] - self.front[:, None]).max(axis=2)
        return float(beyond.min(axis=1).max())


def show(cases: Sequence[PeerCase], goals: str, names: Sequence[str]) -> None:
    """Print the table of a set of goals."""
    begun = [case for case in cases if BASE in case.results(goals)]
    print(f"\n{', '.join(GOALS[goals])}: {len(begun)} cases of {len(cases)}")
    print(
        "Share of the hypervolume of all methods' front together; additive epsilon to that front,\n"
        f"in its ranges. As soon: the share of its births after which {BASE!r} has the last\n"
        "value of a method."
    )
    print(f"\n{'':36}{'cases':>5}{'share':>8}{'lowest':>8}{'highest':>8}{'epsilon':>9}", end="")
    print(f"{'base leads':>12}{'times':>7}{'as soon':>9}")
    rows: dict[str, list[tuple]] = {name: [] for name in names}
    for case in begun:
        results = case.results(goals)
        found = {name: np.array(results[name]["entered"], float) for name in results}
        found = {name: one.reshape(-1, len(GOALS[goals]) + 1) for name, one in found.items()}
        union = Union([one[:, 1:] for one in found.values()])
        base = found[BASE]
        ends = range(POPULATION, case.evaluations + POPULATION, POPULATION)
        curve = [union.share(base[base[:, 0] < end, 1:]) for end in ends]
        for name in rows:
            if name in found:
                share, epsilon = (f(found[name][:, 1:]) for f in (union.share, union.epsilon))
                rows[name].append((share, epsilon, curve[-1], passed(curve, share)))
    for name, of in rows.items():
        if not of:
            continue
        shares, epsilons, bases, soon = np.array(of).T
        text = f"{name:36}{len(of):5}{np.median(shares):8.3f}{shares.min():8.3f}{shares.max():8.3f}"
        text += f"{np.median(epsilons):9.3f}"
        if name != BASE:
            times = np.median(bases / np.maximum(shares, 1e-9))
            text += f"{(bases > shares).sum():7} of {len(of):2}{times:7.2f}"
            text += f"{'never' if np.isinf(np.median(soon)) else f'{np.median(soon):.0%}':>9}"
        print(text)


def run(chosen, pairs: Sequence[tuple[str, str]]) -> None:
    """Breed what is missing, if so ``chosen``, and print the tables."""
    names = [name for name in PEERS if name == BASE or name in (chosen.methods or PEERS)]
    which = [name for name in GOALS if chosen.goals in (None, name)]
    cases = [
        PeerCase(pair, seed, chosen.evaluations)
        for seed, pair in itertools.product(range(chosen.seeds), pairs)
    ]
    if chosen.run:
        until = time.monotonic() + 60 * chosen.minutes
        for case, goals, name in itertools.product(cases, which, names):
            if time.monotonic() > until:
                print("the minutes are over; the same command goes on", file=sys.stderr)
                break
            if name not in case.results(goals):
                breed(case, goals, name, until)
    for goals in which:
        show(cases, goals, names)
