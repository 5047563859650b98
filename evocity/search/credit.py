"""Which operators earn their births: weights that follow what survives and what enters the archive.

Adaptive pursuit by probability matching (Goldberg 1990, see Fialho et al. 2010), over a window of
generations.
"""

from collections import deque
from collections.abc import Collection, Mapping, Sequence

import numpy as np

from evocity.fitness import Aims
from evocity.search.commands import STEERING, Standing
from evocity.search.fronts import not_dominated
from evocity.search.judging import by_generation, every_generation
from evocity.store import Birth, Run

#: Generations that count.
WINDOW = 8
#: A weight is at least 1/MOST of the recipe's, and at most MOST times it.
MOST = 4.0
# So many births of the average operator are added to those of each: few births tell little.
_PRIOR = 8.0


class Credit:
    """What operators have earned of late: a birth that lives on earns one half, and one half more
    if no birth of the run before, or of its generation, dominates it; of equal ones the first."""

    def __init__(self):
        self._generations: deque[dict[str, tuple[int, float]]] = deque(maxlen=WINDOW)
        self._front: np.ndarray | None = None

    def forget_front(self) -> None:
        """Compare births with later ones alone: losses are counted otherwise from now on."""
        self._front = None

    def learn(self, births: Sequence[Birth], aims: Aims, living: Collection[int]) -> None:
        """Take in the ``births`` of a generation, and the ids of those who live after it."""
        kept = [born for born in births if born.ok and not aims.violation(born.values)]
        losses = [aims.losses(born.values) for born in kept]
        entered = self._enter(losses) if losses else []
        archived = {born.id for born, new in zip(kept, entered, strict=True) if new}
        earned: dict[str, tuple[int, float]] = {}
        for born in births:
            count, sum_ = earned.get(born.operator, (0, 0.0))
            gain = 0.5 * (born.id in living) + 0.5 * (born.id in archived)
            earned[born.operator] = count + 1, sum_ + gain
        self._generations.append(earned)

    def factors(self, names: Sequence[str]) -> dict[str, float]:
        """By how much the weights of operators of these ``names`` are multiplied: what a birth of
        each earns, of what one of all of them does; 1 while nobody earns anything."""
        told = [one for generation in self._generations for one in generation.items()]
        of = {name: [earned for other, earned in told if other == name] for name in names}
        counts = {name: sum(count for count, _ in one) for name, one in of.items()}
        sums = {name: sum(gain for _, gain in one) for name, one in of.items()}
        mean = sum(sums.values()) / max(1, sum(counts.values()))
        if mean == 0:
            return dict.fromkeys(names, 1.0)
        rates = {n: (sums[n] + _PRIOR * mean) / (counts[n] + _PRIOR) / mean for n in names}
        return {name: float(np.clip(rate, 1 / MOST, MOST)) for name, rate in rates.items()}

    def _enter(self, losses: Sequence[Sequence[float]]) -> list[bool]:
        """Which of these enter the front of all so far."""
        new = np.array(losses, np.float64)
        front = new if self._front is None else np.vstack([self._front, new])
        among = not_dominated(front)
        self._front = front[among]
        return among[len(front) - len(new) :].tolist()


def credit_of(run: Run, aims: Aims, events: Sequence[Mapping], island: str | None = None) -> Credit:
    """What a ``run`` that is taken up again, or one ``island`` of it, has earned so far; ``aims``
    with the recipe's weights, ``events`` of the run tell those that commands have set."""
    credit, weights = Credit(), {}
    # adaptation tells an event a generation, all of which are gone through for each generation
    events = [one for one in events if one.get("event") in STEERING]
    if not run.generations:
        return credit
    every = every_generation(run), by_generation(run.members())
    for generation, (born, lived) in enumerate(zip(*every, strict=False)):
        now = Standing.of(events, generation).weights
        if now != weights:
            credit.forget_front()
            weights = now
        births = [one for one in born if one.island == island]
        living = {one["id"] for one in lived.to_pylist() if one.get("island") == island}
        credit.learn(births, aims.reweighted(weights), living)
    if Standing.of(events, len(run.generations)).weights != weights:
        credit.forget_front()
    return credit


__all__ = ["MOST", "WINDOW", "Credit", "credit_of"]
