"""Niches: which individuals live, by the plans of their streets, and which births are twins."""

import math
from collections import Counter
from collections.abc import Callable, Sequence

import numpy as np

from evocity.citymap import CityMap
from evocity.selection.individual import Individual
from evocity.selection.thumbprints import MOST_COMPARED, alike, decimetres, differences

#: Most pixels of maps that stay in memory while births are compared.
_MOST_PIXELS = 1 << 24


def choose_by_plan(
    candidates: Sequence[Individual],
    count: int,
    most: int,
    share: float,
    looks: Sequence[np.ndarray] | None = None,
) -> list[int]:
    """Select at most ``count`` of the ``candidates``, given best first, by their indices.

    Each source city gets an equal part of the ``share`` of all places. Half of this part is for the
    plan of the city itself, the other half for all its plans, changed or not. Places go to
    candidates that keep all constraints; with ``looks``, to candidates that differ (`thin_out`).
    The best of all others follow, but at most ``most`` with one changed plan; 0 means no limit.
    Unknown plans have no limit.

    If no candidate with the plan of a city keeps the constraints, the source city itself has one
    place, or else the best candidate with this plan. If no changed plan of this city keeps them
    either, the source city and the best candidates that break constraints have the places of the
    plan.
    """
    names = dict.fromkeys(name for name in map(source_of, candidates) if name is not None)
    places = max(1, int(share * count / len(names))) if share and names else 0
    chosen: list[int] = []
    for name in names if places else ():
        own = [at for at, one in enumerate(candidates) if source_of(one) == name]
        chosen += _choose_of_city(candidates, own, places, most, looks)
    chosen = sorted(chosen)[:count]
    taken = set(chosen)
    lives = Counter(candidates[at].plan for at in chosen if candidates[at].changed)
    for at, one in enumerate(candidates):
        if len(chosen) == count:
            break
        if at in taken or (most and one.changed and lives[one.plan] == most):
            continue
        lives[one.plan] += 1
        chosen.append(at)
    return sorted(chosen)


def source_of(one: Individual) -> str | None:
    """Return the name of the source city whose plan an individual has, changed or not."""
    return one.plan.rpartition("+")[0] if one.plan is not None and one.changed else one.plan


def _choose_of_city(
    candidates: Sequence[Individual],
    own: Sequence[int],
    places: int,
    most: int,
    looks: Sequence[np.ndarray] | None,
) -> list[int]:
    """Select among the candidates ``own`` of one source city for its ``places``."""
    half = -(-places // 2)
    plain = [at for at in own if not candidates[at].changed]
    keepers = [at for at in own if not candidates[at].violation]
    kept = [at for at in plain if not candidates[at].violation]
    founder = [at for at in plain if candidates[at].founder][:1]
    if kept:
        chosen = thin_out(kept, half, looks)
    elif keepers:
        chosen = founder or plain[:1]
    else:
        return founder + [at for at in plain if at not in founder][: half - len(founder)]
    lives: Counter[str | None] = Counter()
    others = []
    for at in keepers:
        one = candidates[at]
        lives[one.plan] += 1
        if at not in chosen and not (most and one.changed and lives[one.plan] > most):
            others.append(at)
    return chosen + thin_out(others, places - len(chosen), looks)


def thin_out(
    pool: Sequence[int], places: int, looks: Sequence[np.ndarray] | None = None
) -> list[int]:
    """Select at most ``places`` of a ``pool`` of indices, best first, that differ from each other.

    The best half always stays. Of the two most similar others, the worse leaves, again and again.
    Two differ by the number of cells of their ``looks`` that differ by a storey. Without looks, and
    for a pool of more than `MOST_COMPARED`, the best stay.
    """
    surplus = len(pool) - places
    if min(surplus, places) <= 0 or looks is None or len(pool) > MOST_COMPARED:
        return list(pool)[: max(places, 0)]
    safe = -(-places // 2)
    apart = differences(np.stack([looks[at] for at in pool])).astype(float)
    apart[np.tril_indices(len(pool))] = np.inf
    apart[:safe, :safe] = np.inf
    stays = np.ones(len(pool), bool)
    for _ in range(surplus):
        worse = int(apart.argmin()) % len(pool)
        stays[worse] = False
        apart[worse], apart[:, worse] = np.inf, np.inf
    return [at for at, stay in zip(pool, stays.tolist(), strict=True) if stay]


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
        earlier births. If a birth has the plan of its twins, and breaks constraints less than all
        of them, it replaces them: the last individual with a plan leaves no place to another plan.
        """
        entered = list(living)
        for one in births:
            twins = [other for other in entered if self._are_twins(one, other)]
            if all(other.violation > one.violation and other.plan == one.plan for other in twins):
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
