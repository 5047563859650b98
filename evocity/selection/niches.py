"""Niches: which individuals live, by the plans of their streets, and which births are twins."""

import math
from collections import Counter
from collections.abc import Callable, Sequence

import numpy as np

from evocity.citymap import CityMap
from evocity.selection.individual import Individual
from evocity.selection.thumbprints import alike, decimetres

#: Most pixels of maps that stay in memory while births are compared.
_MOST_PIXELS = 1 << 24


def choose_by_plan(
    candidates: Sequence[Individual], count: int, most: int, share: float
) -> list[int]:
    """Select at most ``count`` of the ``candidates``, given best first, by their indices.

    First, each plan of a source city gets its best candidates, up to its part of the ``share`` of
    all places. Then the best of the others follow, but at most ``most`` with one changed plan; 0
    means no limit. Unknown plans have no limit.
    """
    names = dict.fromkeys(
        one.plan for one in candidates if one.plan is not None and not one.changed
    )
    places = max(1, int(share * count / len(names))) if share and names else 0
    chosen: list[int] = []
    for name in names:
        own = [at for at, one in enumerate(candidates) if one.plan == name and not one.changed]
        chosen += own[:places]
    chosen = sorted(chosen)[:count]
    taken = set(chosen)
    lives: Counter[str | None] = Counter()
    for at, one in enumerate(candidates):
        if len(chosen) == count:
            break
        if at in taken or (most and one.changed and lives[one.plan] == most):
            continue
        lives[one.plan] += 1
        chosen.append(at)
    return sorted(chosen)


class Twins:
    """Comparison of maps: two are twins if their heights differ by more than a storey in less than
    a ``share`` of the pixels. Heights count in whole decimetres. The functions ``look`` and
    ``city`` return the thumbprint and the map of an individual."""

    def __init__(
        self,
        share: float,
        look: Callable[[Individual], np.ndarray],
        city: Callable[[Individual], CityMap],
    ):
        self._share, self._look, self._city = share, look, city
        self._maps: dict[int, np.ndarray] = {}

    def sift(self, births: Sequence[Individual], living: Sequence[Individual]) -> list[Individual]:
        """Return the ``living`` individuals and the ``births`` without twins among them and among
        earlier births. If a birth breaks constraints less than its twins, it replaces them."""
        entered = list(living)
        for one in births:
            twins = [other for other in entered if self._are_twins(one, other)]
            if all(other.violation > one.violation for other in twins):
                entered = [other for other in entered if other not in twins]
                entered.append(one)
        return entered

    def _are_twins(self, one: Individual, other: Individual) -> bool:
        first, second = self._look(one), self._look(other)
        pixels = self._pixels(one).size
        most = math.ceil(self._share * pixels) - 1
        # the cells of a thumbprint are pixels of its map: too many of them decide
        if most < first.size and not alike(first, second[None], (most + 0.5) / first.size):
            return False
        return alike(self._pixels(one), self._pixels(other)[None], (most + 0.5) / pixels)

    def _pixels(self, one: Individual) -> np.ndarray:
        if one.id not in self._maps:
            pixels = decimetres(self._city(one).heights).ravel()
            if sum(known.size for known in self._maps.values()) + pixels.size > _MOST_PIXELS:
                self._maps.clear()
            self._maps[one.id] = pixels
        return self._maps[one.id]
