"""The distribution of building sizes: Salingaros' law, crumbs, small buildings and slivers."""

import math
from dataclasses import dataclass

import numpy as np

from evocity.citymap import CityMap
from evocity.errors import FitnessError
from evocity.fitness.measure import Undefined
from evocity.fitness.registry import fitness
from evocity.fitness.root_finding import root_between
from evocity.views.buildings import CRUMB

#: Bounds of the sizes that count, metres: from a garage (25 m²; below are `crumbs`), four
#: e-classes up, to the largest block (273 m). They are fixed, because a fit on the sample's own
#: maximum is biased.
SMALLEST = 5.0
LARGEST = SMALLEST * math.e**4
#: Fewest sizes that show a distribution.
FEWEST = 30

#: Area below which a building is a shed, a garage, or a piece of a building, m².
SMALL = 50.0

_STEEPEST = 700.0  # bound on |m| ln(b/a), near the end of the range of exp


@dataclass(frozen=True)
class SizeFit:
    """A truncated power law fitted to sizes, and how well the sizes follow it.

    m : exponent of Salingaros' law, p x^m = C for p items of size x.
    error : standard error of m, from the Fisher information.
    ks : Kolmogorov-Smirnov distance √n · max\\|F_empirical − F\\|, about 0.8 where the law holds.
    n : number of sizes within the bounds.
    span : ln(largest / smallest) of these sizes.
    occupancy : share of the e-classes [a, ae), [ae, ae²) … that hold at least one size, 0 to 1.
    """

    m: float
    error: float
    ks: float
    n: int
    span: float
    occupancy: float


def fit_sizes(sizes: np.ndarray, a: float = SMALLEST, b: float = LARGEST) -> SizeFit:
    """Fit Salingaros' universal distribution to linear sizes, by bounded maximum likelihood.

    The density of sizes is ∝ x^{−(m+1)} on [a, b]; its likelihood is greatest where
    1/m − L e^{−mL}/(1 − e^{−mL}) = mean ln(x/a), L = ln(b/a).

    Parameters
    ----------
    sizes : array of linear sizes (√area for footprints), metres. The fit leaves out sizes outside
        [a, b].
    a, b : the bounds, metres, 0 < a < b. They belong to the question, not to the sample.

    Raises
    ------
    FitnessError : the bounds are not an interval, or no size lies within them.

    Sources: Salingaros & West 1999 (EPB 26:909-923); Clauset, Shalizi & Newman 2009.
    """
    if not 0 < a < b < math.inf:
        raise FitnessError(
            f"the bounds a = {a} and b = {b} are invalid", "0 < a < b", "give a and b in metres"
        )
    sizes = np.asarray(sizes, dtype=np.float64).ravel()
    logs = np.sort(np.log(sizes[(sizes >= a) & (sizes <= b)] / a))
    n = logs.size
    if not n:
        raise FitnessError(
            f"none of the {sizes.size} sizes lies between {a:g} and {b:g} m",
            "at least one size",
            "widen the bounds, or give linear sizes in metres, not areas",
        )
    length = math.log(b / a)
    slope = _slope(float(logs.mean()) / length)
    below = np.arange(n) / n
    law = _law(slope, logs / length)
    ks = math.sqrt(n) * max((law - below).max(), (below + 1 / n - law).max())
    classes = np.minimum(logs.astype(int), math.ceil(length - 1e-9) - 1)
    return SizeFit(
        m=slope / length,
        error=1 / (length * math.sqrt(n * _variance(slope))),
        ks=float(ks),
        n=n,
        span=float(logs[-1] - logs[0]),
        occupancy=np.unique(classes).size / math.ceil(length - 1e-9),
    )


@fitness(goal="max", range=(0, 1), any_site=True)
def salingaros(city: CityMap) -> float:
    """How well the sizes of built components follow Salingaros' universal distribution.

    Formula: exp(−½ (d/0.25)²) · exp(−(KS√n/1.5)²) · min(1, span/3) · occupancy, from the
    exponent m of p x^m = C fitted to the sizes x = √area of the built components (see
    `fit_sizes`). d is the distance of m from [1, 2]. Sizes from 5 to 273 m (5 e⁴) count.
    Unit: none. Range: 0 to 1.
    Empty map: NaN, as on any map of fewer than 30 such components.
    Source: Salingaros & West 1999 (EPB 26:909-923). Real districts need not follow the law.

    >>> heights = np.zeros((64, 64))
    >>> salingaros(CityMap(heights, 2.0)).reason
    '0 built components of 5 to 273 m; fewer than 30 have no distribution'
    """
    return _law_score(city.areas, "built components")


@fitness(goal="max", range=(0, 1), any_site=True)
def salingaros_buildings(city: CityMap) -> float:
    """How well the sizes of buildings follow Salingaros' universal distribution.

    Formula: as for `salingaros`, with the sizes x = √area of buildings. Gaps and steps of height
    separate buildings (`CityMap.buildings`). In dense fabric a street block is one built component,
    and a map has too few of them; its houses still are many. Buildings less than 5 m wide (the
    short side of `Buildings.box`) do not count: the law asks for many small sizes, and a search
    would add strips of roofs. Marsault 2005 (§4.2) asks for the law and speaks of buildings.
    Unit: none. Range: 0 to 1.
    Empty map: NaN, as on any map of fewer than 30 such buildings of 5 to 273 m.
    Source: Salingaros & West 1999 (EPB 26:909-923); buildings as in `building_density`.

    >>> heights = np.zeros((64, 64))
    >>> salingaros_buildings(CityMap(heights, 2.0)).reason
    '0 buildings of 5 to 273 m; fewer than 30 have no distribution'
    """
    buildings = city.buildings
    return _law_score(buildings.area[buildings.box[:, 1] >= SMALLEST], "buildings")


def _law_score(areas: np.ndarray, what: str) -> float:
    """Score how well √``areas``, metres, follow the law; ``what`` names the objects."""
    sizes = np.sqrt(areas)
    count = np.count_nonzero((sizes >= SMALLEST) & (sizes <= LARGEST))
    if count < FEWEST:
        return Undefined(
            f"{count} {what} of {SMALLEST:.0f} to {LARGEST:.0f} m; "
            f"fewer than {FEWEST} have no distribution"
        )
    fit = fit_sizes(sizes)
    distance = max(1 - fit.m, 0.0, fit.m - 2)
    exponent = math.exp(-0.5 * (distance / 0.25) ** 2)
    agreement = math.exp(-((fit.ks / 1.5) ** 2))
    return exponent * agreement * min(1.0, fit.span / 3) * fit.occupancy


@fitness(goal="min", unit="/ha", range=(0, math.inf), any_site=True)
def crumbs(city: CityMap) -> float:
    """Number of crumbs, built components too small for a building, per hectare of built ground.

    Formula: number of built components of less than 24 m² (6 px at 2 m), divided by the area of
    all built components in hectares.
    Unit: 1/ha. Range: 0 upwards. Empty map: NaN (nothing is built).
    Source: ours, to see how far breeding crumbles a fabric.

    >>> heights = np.zeros((64, 64))
    >>> heights[:50, :49] = 9
    >>> heights[60, 60] = heights[60, 62] = 9
    >>> round(crumbs(CityMap(heights, 2.0)), 2)
    2.04
    """
    areas = city.areas
    if not areas.size:
        return Undefined("nothing is built")
    return np.count_nonzero(areas < CRUMB) / (areas.sum() / 1e4)


@fitness(goal="min", unit="/ha", range=(0, math.inf), any_site=True)
def small_buildings(city: CityMap) -> float:
    """Number of buildings of less than 50 m² per hectare: sheds, garages and pieces.

    `crumbs` counts footprints too small for a building. This measure counts small buildings too:
    a real fabric has few, and breeding leaves many where it cuts buildings.

    Formula: number of buildings of less than 50 m², divided by the area of the map in hectares.
    Gaps and steps of height separate buildings (`CityMap.buildings`).
    Unit: 1/ha. Range: 0 upwards. Empty map: 0.
    Source: ours; in the bundled districts 5 to 23 % of the buildings have less than 50 m².

    >>> heights = np.zeros((50, 50))
    >>> heights[10:13, 10:13] = heights[30:40, 10:20] = 9
    >>> small_buildings(CityMap(heights, 2.0))
    1.0
    """
    return np.count_nonzero(city.buildings.area < SMALL) / (city.area / 1e4)


@fitness(goal="min", range=(0, 1), any_site=True)
def slivers(city: CityMap) -> float:
    """Share of buildings that are less than 5 m wide: strips of roofs and pieces of buildings.

    A real fabric has some, and coding leaves more. A search for many small sizes collects slivers.

    Formula: number of buildings whose smallest rectangle (`Buildings.box`) has a short side under
    5 m, divided by the number of all buildings. Gaps and steps of height separate buildings.
    Unit: none. Range: 0 to 1. Empty map: NaN (nothing is built).
    Source: ours; the bundled districts have .04 to .22, and so have their codes.

    >>> heights = np.zeros((50, 50))
    >>> heights[10:12, 10:40] = heights[30:40, 10:20] = 9
    >>> slivers(CityMap(heights, 2.0))
    0.5
    """
    width = city.buildings.box[:, 1]
    if not width.size:
        return Undefined("nothing is built")
    return np.count_nonzero(width < SMALLEST) / width.size


def _slope(mean: float) -> float:
    """Find y = m L of the law on [0, 1] whose mean is ``mean``: 1/y − 1/(e^y − 1) = mean."""
    if _mean(_STEEPEST) >= mean:
        return _STEEPEST
    if _mean(-_STEEPEST) <= mean:
        return -_STEEPEST
    return float(root_between(lambda y: _mean(y) - mean, -_STEEPEST, _STEEPEST, 1e-10))


def _mean(y: float) -> float:
    if abs(y) < 1e-3:  # the two terms cancel; next in the series is y³/720
        return 0.5 - y / 12
    return 1 / y - 1 / math.expm1(y)


def _variance(y: float) -> float:
    if abs(y) < 1e-2:
        return 1 / 12 - y * y / 240
    return 1 / y**2 - 1 / (4 * math.sinh(y / 2) ** 2)


def _law(y: float, position: np.ndarray) -> np.ndarray:
    """Compute the cumulative distribution ∝ e^{−y t} on [0, 1], at ``position``."""
    if abs(y) < 1e-9:
        return position
    return np.expm1(-y * position) / math.expm1(-y)
