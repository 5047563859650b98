"""Credit of operators: weights that follow what births add to the hypervolume of the archive.

Adaptive pursuit by probability matching (Goldberg 1990, see Fialho et al. 2010), over a window of
generations.
"""

from collections import deque
from collections.abc import Collection, Mapping, Sequence

import numpy as np

from evocity.fitness import Aims
from evocity.search.record.aims import iterate_generations, split_generations
from evocity.search.record.commands import STEERING, StandingOrders
from evocity.selection.fronts import Gain, not_dominated, volumes_are_quick
from evocity.store import Birth, RunLog

#: Generations that count.
WINDOW = 8
#: A weight is at least 1/MOST of the recipe's, and at most MOST times it.
MOST = 4.0
# So many births of the average operator are added to those of each: few births say little.
_PRIOR = 8.0


class Credit:
    """Earnings of operators in the last `WINDOW` generations.

    by : what a birth is paid for. With "hypervolume" it earns the square root of what it adds to
        the hypervolume of all earlier generations, in units of the ranges of the first births. With
        "archive" it earns one half if it lives on, and one half if it is the first that no earlier
        birth and none of its generation dominates.

    Only births that keep the constraints add to the hypervolume and enter the archive. Where exact
    hypervolumes take too long, a birth adds 1 if it enters the archive.
    """

    def __init__(self, by: str = "hypervolume"):
        self._by = by
        self._generations: deque[dict[str, tuple[int, float]]] = deque(maxlen=WINDOW)
        self._front: np.ndarray | None = None
        self._gain: Gain | None = None

    def forget_front(self) -> None:
        """Compare births only with later ones: losses are counted in another way from now on."""
        self._front = self._gain = None

    def learn(self, births: Sequence[Birth], aims: Aims, living: Collection[int]) -> None:
        """Add the ``births`` of a generation; ``living``: the ids of those who live after it."""
        kept = [birth for birth in births if birth.ok and not aims.violation(birth.values)]
        losses = [aims.losses(birth.values) for birth in kept]
        if self._by == "hypervolume":
            pays = self._root_gains(births, aims, losses) if losses else []
            paid = {birth.id: pay for birth, pay in zip(kept, pays, strict=True)}
        else:
            entered = self._enter(losses) if losses else []
            archived = {birth.id for birth, enters in zip(kept, entered, strict=True) if enters}
            paid = {one.id: 0.5 * (one.id in living) + 0.5 * (one.id in archived) for one in births}
        earned: dict[str, tuple[int, float]] = {}
        for birth in births:
            count, total = earned.get(birth.operator, (0, 0.0))
            earned[birth.operator] = count + 1, total + paid.get(birth.id, 0.0)
        self._generations.append(earned)

    def factors(self, names: Sequence[str]) -> dict[str, float]:
        """Return by how much the weights of the operators ``names`` are multiplied: what a birth of
        each earns, over the mean of all of them; 1 while nothing is earned."""
        counts = {
            name: sum(one.get(name, (0, 0))[0] for one in self._generations) for name in names
        }
        sums = {
            name: sum(one[name][1] for one in self._generations if name in one) for name in names
        }
        mean = sum(sums.values()) / max(1, sum(counts.values()))
        if mean == 0:
            return dict.fromkeys(names, 1.0)
        rates = {n: (sums[n] + _PRIOR * mean) / (counts[n] + _PRIOR) / mean for n in names}
        return {name: float(np.clip(rate, 1 / MOST, MOST)) for name, rate in rates.items()}

    def _root_gains(
        self, births: Sequence[Birth], aims: Aims, losses: Sequence[Sequence[float]]
    ) -> list[float]:
        """Return the square root of what each of the ``losses`` adds to the front so far. The
        ``births`` of the first generation give the unit."""
        if self._gain is None:
            first = [one for one in births if one.ok and aims.complete(one.values)]
            self._gain = Gain(np.array([aims.losses(one.values) for one in first], np.float64))
        new = np.array(losses, np.float64)
        front = np.empty((0, new.shape[1])) if self._front is None else self._front
        entered = self._enter(losses)
        if not volumes_are_quick(len(front) + 1, new.shape[1]):
            return [float(enters) for enters in entered]
        return [self._gain(front, one) ** 0.5 for one in new]

    def _enter(self, losses: Sequence[Sequence[float]]) -> list[bool]:
        new = np.array(losses, np.float64)
        front = new if self._front is None else np.vstack([self._front, new])
        among = not_dominated(front)
        self._front = front[among]
        return among[len(front) - len(new) :].tolist()


def credit_of(
    run: RunLog,
    aims: Aims,
    events: Sequence[Mapping],
    island: str | None = None,
    by: str = "hypervolume",
) -> Credit:
    """Compute the credit of a ``run`` so far, or of one ``island`` of it, from its log. ``aims``
    have the recipe's weights; the ``events`` of the run hold those that commands set. ``by``: as in
    `Credit`."""
    credit, weights = Credit(by), {}
    # adaptation adds an event a generation, and each generation goes through all events
    events = [event for event in events if event.get("event") in STEERING]
    if not run.generations:
        return credit
    every = iterate_generations(run), split_generations(run.members())
    for generation, (births, members) in enumerate(zip(*every, strict=False)):
        now = StandingOrders.of(events, generation).weights
        if now != weights:
            credit.forget_front()
            weights = now
        births = [birth for birth in births if birth.island == island]
        living = {row["id"] for row in members.to_pylist() if row.get("island") == island}
        credit.learn(births, aims.reweighted(weights), living)
    if StandingOrders.of(events, len(run.generations)).weights != weights:
        credit.forget_front()
    return credit
