"""The guard of a first recipe: bounds that the parents' maps and codes decide."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from evocity import fitness
from evocity.fitness import Measure
from evocity.search.calibration.recipe_text import Bound
from evocity.search.preparation.constraints import round_bound

#: The measures that the guard bounds.
GUARD = (
    "integrity",
    "fabric_distance",
    "street_distance",
    "repetition",
    "smallest_share",
    "small_buildings",
    "slivers",
    "gsi",
    "fsi",
)
#: The measures that the guard bounds only if they are no goals.
BANDS = ("gsi", "fsi")
#: The measures of the guard that keep out heaps of cut buildings, and have a highest value.
OF_FABRIC = ("fabric_distance", "street_distance", "small_buildings", "slivers")
#: Least share of what is built that stands in whole buildings of the parents.
LEAST_INTEGRITY = 0.5
#: The least bound of the fabric distance; and how many times the codes' own distance it may be.
NEAR, TIMES_CODED = 0.15, 2.0
#: The least bound of the street distance.
NEAR_STREETS = 0.1
#: The least bound of the repetition.
TWICE = 0.01
#: How many times the small buildings of the map with most of them, if all codes keep that; the
#: least bound, 1/ha.
TIMES_SMALL, FEW_SMALL = 1.3, 0.1
#: By how much the share of slivers may exceed that of the code with most of them.
MORE_SLIVERS = 0.06
#: How far GSI and FSI may lie below the least and above the largest of the parents, as a share.
BAND = 0.1
#: A map with such a score has the law of Salingaros.
LAWFUL = 0.9

#: Values of the map and of the code of each parent, by its name.
Values = Mapping[str, tuple[float, float]]


def calibrate_bound(measure: Measure, values: Values) -> Bound | None:
    """Make the bound of the guard on a ``measure``; None if a parent lacks the value, and for the
    share of a lone parent."""
    maps, codes = zip(*values.values(), strict=True)
    if any(map(math.isnan, codes)):
        return None
    return _CALIBRATIONS[measure.name](measure, maps, codes)


def tighten_bound(bound: Bound, values: Values, heap: float) -> tuple[Bound, str]:
    """Return the ``bound`` of a measure of `OF_FABRIC` such that a ``heap`` of cut buildings breaks
    it and the codes keep it: halfway between both, if the usual bound is wider. If the heap is no
    worse than a code, return the bound, and a note that it bounds nothing."""
    most = max(code for _, code in values.values())
    if bound.max is None or math.isnan(heap) or heap > bound.max:
        return bound, ""
    halfway = round_bound((most + heap) / 2, up=True)
    if most <= halfway < heap:
        return replace(bound, max=halfway, relaxed=False, tightened=True), ""
    name = bound.measure.name
    return bound, (
        f"{name}: the bound {bound.max:g} bounds nothing, because a heap of cut buildings has "
        f"{heap:.3g}, and a parent's own code {most:.3g}; smaller pixels make codes truer"
    )


def parents_target(measure: Measure, values: Values) -> float:
    """Return the target of a usual goal: the mean of the parents' maps. If all maps have the law of
    Salingaros, the target of `salingaros_law` is 1. Codes replace undefined values of maps."""
    defined = [code if math.isnan(of_map) else of_map for of_map, code in values.values()]
    if measure.name == fitness.salingaros_law.name and min(defined) >= LAWFUL:
        return 1.0
    return float(f"{math.fsum(defined) / len(defined):.4g}")


def _integrity(measure: Measure, maps: Sequence[float], codes: Sequence[float]) -> Bound:
    return Bound(measure, min=min(LEAST_INTEGRITY, round_bound(max(codes), up=False)))


def _small_buildings(measure: Measure, maps: Sequence[float], codes: Sequence[float]) -> Bound:
    most = max(TIMES_SMALL * max(maps), FEW_SMALL)
    if max(codes) > most:
        return Bound(measure, max=round_bound(max(codes), up=True), relaxed=True)
    return Bound(measure, max=round_bound(most, up=False))


def _slivers(measure: Measure, maps: Sequence[float], codes: Sequence[float]) -> Bound:
    return Bound(measure, max=round_bound(max(codes) + MORE_SLIVERS, up=True))


def _smallest_share(
    measure: Measure, maps: Sequence[float], codes: Sequence[float]
) -> Bound | None:
    if len(codes) == 1:
        return None
    return Bound(measure, min=math.ceil(50 / len(codes)) / 100)


def _repetition(measure: Measure, maps: Sequence[float], codes: Sequence[float]) -> Bound:
    return Bound(measure, max=max(TWICE, round_bound(max(codes), up=True)))


def _band(measure: Measure, maps: Sequence[float], codes: Sequence[float]) -> Bound:
    low, high = min(*maps, *codes), max(*maps, *codes)
    most = min((1 + BAND) * high, measure.range[1])
    return Bound(
        measure,
        min=round_bound((1 - BAND) * low, up=False),
        max=round_bound(most, up=True),
    )


def _near(least: float) -> Callable[..., Bound]:
    def bound(measure: Measure, maps: Sequence[float], codes: Sequence[float]) -> Bound:
        coded = TIMES_CODED * max(codes)
        return Bound(measure, max=max(least, round_bound(coded, up=True)))

    return bound


_CALIBRATIONS: Mapping[str, Callable[..., Bound | None]] = {
    "integrity": _integrity,
    "fabric_distance": _near(NEAR),
    "street_distance": _near(NEAR_STREETS),
    "repetition": _repetition,
    "smallest_share": _smallest_share,
    "small_buildings": _small_buildings,
    "slivers": _slivers,
    "gsi": _band,
    "fsi": _band,
}
