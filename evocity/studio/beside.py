"""A birth beside others: what it has more and less than one that is pinned, and how its buildings
are distributed beside those of its parents and cities."""

import numpy as np

from evocity.analysis.distributions import QUANTITIES, Distribution, distributions
from evocity.analysis.individual import Individual
from evocity.pictures import Change, render_change
from evocity.studio.one import png_of
from evocity.studio.watched import Moment

#: Points of a distribution that the page is told.
MOST_POINTS = 256


def difference_of(moment: Moment, identifier: int, other: int) -> tuple[dict, bytes]:
    """What a birth has more and less than an ``other``: the share of the map ``apart`` by over a
    storey, the mean of what is ``more``, metres; a picture as PNG. Raises `RunError` where one of
    them has no map."""
    first, second = (Individual(moment.run.told, one) for one in (other, identifier))
    change = Change(first.city, second.city)
    about = {"apart": change.apart, "more": float(change.metres.mean(dtype=float))}
    return about, png_of(render_change(change))


def buildings_of(moment: Moment, identifier: int, of: str, other: int | None) -> dict:
    """How one of `QUANTITIES` is distributed over the buildings of a birth, of those it was bred
    from, of an ``other`` that is pinned, and of the run's cities: of each its name, what it is
    (``role``), its colour if it has one, the number of its buildings, their quartiles, and at most
    `MOST_POINTS` of their values, rising, each with the share that is not above it. Raises
    `RunError` where one of them has no map."""
    told = moment.run.told
    one = Individual(told, identifier)
    sources, references = moment.cities
    found = distributions(one, of, sources=sources, references=references)
    if other is not None and other not in (identifier, *one.birth.parents):
        pinned = distributions(Individual(told, other), of, False, (), ())[-1]
        found.insert(-1, Distribution(f"birth {other}", "pinned", pinned.values))
    what, unit, powers = QUANTITIES[of]
    return {"what": what, "unit": unit, "powers": powers, "listed": [_listed(d) for d in found]}


def _listed(one: Distribution) -> dict:
    values = one.values.astype(float)
    count = len(values)
    places = np.unique(np.ceil(np.linspace(1, count, min(count, MOST_POINTS))).astype(int))
    return {
        "name": one.name,
        "role": one.role,
        "colour": one.colour,
        "count": count,
        "quartiles": np.quantile(values, [0.25, 0.5, 0.75]).tolist() if count else [],
        "values": values[places - 1].tolist() if count else [],
        "shares": (places / count).tolist() if count else [],
    }


__all__ = ["MOST_POINTS", "QUANTITIES", "buildings_of", "difference_of"]
