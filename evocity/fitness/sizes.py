"""The distribution of building sizes: Salingaros' law, crumbs, small buildings and slivers."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from evocity.citymap import CityMap
from evocity.errors import FitnessError
from evocity.fitness.measure import Undefined
from evocity.fitness.registry import fitness
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

#: Tolerance of a root besides ``within``, as a share of the root.
_SHARE = 4 * float(np.finfo(float).eps)


@dataclass(frozen=True)
class SizeFit:
    """A truncated power law that is fitted to sizes, with the quality of the fit.

    m : exponent m of Salingaros' law p x^m = C, for p items of size x and a constant C.
    error : standard error of the exponent m, computed from the Fisher information.
    ks : Kolmogorov-Smirnov distance √n · max\\|F_empirical − F\\| between n sizes and the
        distribution F of the law; about 0.8 if the law holds.
    n : number of sizes within the bounds of the fit.
    span : ln(largest / smallest) of the sizes within the bounds.
    occupancy : share, 0 to 1, of the size classes that hold at least one size; the classes are [a,
        ae), [ae, ae²) … from the smallest size a upwards.
    """

    m: float
    error: float
    ks: float
    n: int
    span: float
    occupancy: float


def fit_sizes(sizes: np.ndarray, a: float = SMALLEST, b: float = LARGEST) -> SizeFit:
    """Fit Salingaros' universal distribution to linear sizes, by bounded maximum likelihood.

    The density of sizes x between the bounds a and b is proportional to x^{−(m+1)}, with m the
    exponent. The likelihood of the exponent m is greatest if 1/m − L e^{−mL}/(1 − e^{−mL}) = mean
    ln(x/a), with x the sizes, a and b their bounds, and L = ln(b/a).

    Parameters
    ----------
    sizes : array of linear sizes (√area for footprints), metres. The fit leaves out sizes outside
        the bounds a and b.
    a, b : smallest and largest size that count, metres, 0 < a < b. Choose the bounds in advance,
        because bounds that come from the sample make the fit biased.

    Raises
    ------
    FitnessError : the bounds are not an interval, or no size lies within the bounds.

    Sources: Salingaros & West 1999 (EPB 26:909-923); Clauset, Shalizi & Newman 2009.
    """
    if not 0 < a < b < math.inf:
        raise FitnessError(
            f"the bounds a = {a} and b = {b} are invalid",
            "two bounds with 0 < a < b",
            "give two lengths in metres, with a below b",
        )
    sizes = np.asarray(sizes, dtype=np.float64).ravel()
    logs = np.sort(np.log(sizes[(sizes >= a) & (sizes <= b)] / a))
    n = logs.size
    if not n:
        raise FitnessError(
            f"all {sizes.size} sizes lie outside the bounds of {a:g} and {b:g} m",
            "at least one size between these bounds",
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

    Formula: exp(−½ (d/0.25)²) · exp(−(ks/1.5)²) · min(1, span/3) · occupancy, with d the distance
    of the exponent m from the interval [1, 2]; the function `fit_sizes` computes m, ks, span and
    occupancy. The function `fit_sizes` fits the law p x^m = C to the p built components of size x =
    √area, with C a constant and m the exponent. Only sizes from 5 to 273 m (5 e⁴) count. Unit:
    none. Range: 0 to 1. Empty map: NaN, like every map of fewer than 30 built components of 5 to
    273 m. Source: Salingaros & West 1999 (EPB 26:909-923). Real districts do not always follow
    Salingaros' law.

    >>> heights = np.zeros((64, 64))
    >>> salingaros(CityMap(heights, 2.0)).reason
    '0 built components of 5 to 273 m; fewer than 30 have no distribution'
    """
    return _law_score(city.areas, "built components")


@fitness(goal="max", range=(0, 1), any_site=True)
def salingaros_buildings(city: CityMap) -> float:
    """How well the sizes of buildings follow Salingaros' universal distribution.

    Formula: that of `salingaros`, with x = √area the size of a building. Gaps and differences in
    height separate buildings (`CityMap.buildings`). In a dense district, a whole street block is
    one built component. A map of a dense district has too few built components for a fit, but
    enough buildings. Buildings less than 5 m wide (the short side of `Buildings.box`) do not count,
    because a search would otherwise add narrow strips of roofs. Marsault 2005 (§4.2) applies
    Salingaros' law to buildings. Unit: none. Range: 0 to 1. Empty map: NaN, like every map of fewer
    than 30 buildings of 5 to 273 m. Source: Salingaros & West 1999 (EPB 26:909-923); buildings are
    separated as in `building_density`.

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
    """Number of crumbs per hectare of built ground; crumbs are built components too small for a
    building.

    Formula: number of built components of less than 24 m² (6 px at 2 m), divided by the area of
    all built components in hectares.
    Unit: 1/ha. Range: 0 upwards. Empty map: NaN (nothing is built).
    Source: our own measure, which shows how much breeding breaks buildings into small pieces.

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
    """Number of buildings of less than 50 m² per hectare: sheds, garages and fragments of
    buildings.

    The measure `crumbs` counts only footprints that are too small for a building. Real districts
    have few small buildings, but breeding adds many small buildings where it cuts larger buildings.

    Formula: number of buildings of less than 50 m², divided by the area of the map in hectares.
    Gaps and differences in height separate buildings (`CityMap.buildings`).
    Unit: 1/ha. Range: 0 upwards. Empty map: 0.
    Source: our own. In the bundled districts, 5 to 23 % of the buildings have less than 50 m².

    >>> heights = np.zeros((50, 50))
    >>> heights[10:13, 10:13] = heights[30:40, 10:20] = 9
    >>> small_buildings(CityMap(heights, 2.0))
    1.0
    """
    return np.count_nonzero(city.buildings.area < SMALL) / (city.area / 1e4)


@fitness(goal="min", range=(0, 1), any_site=True)
def slivers(city: CityMap) -> float:
    """Share of buildings that are less than 5 m wide: strips of roofs and fragments of buildings.

    Real districts have some slivers, and fractal coding adds more. A search that rewards many small
    sizes collects slivers.

    Formula: number of buildings whose smallest rectangle (`Buildings.box`) has a short side of less
    than 5 m, divided by the number of all buildings. Gaps and differences in height separate
    buildings.
    Unit: none. Range: 0 to 1. Empty map: NaN (nothing is built). Source: our own. The bundled
    districts, and the maps decoded from their genomes, have values from .04 to .22.

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


def root_between(
    function: Callable[[float], float], low: float, high: float, within: float
) -> float:
    """Find where ``function`` is 0 between two numbers at which its signs differ, to ``within``.

    The function is Brent's method (Brent 1973 §4) with the steps of `scipy.optimize.brentq`, equal
    to the bit. It saves loading scipy.optimize for one number.
    """
    before, here, other = low, high, 0.0
    f_before, f_here, f_other = function(before), function(here), 0.0
    if f_before == 0:
        return before
    last = step = 0.0
    while f_here != 0:
        if f_before != 0 and (f_before < 0) != (f_here < 0):  # the root lies between these two
            other, f_other = before, f_before
            last = step = here - before
        if abs(f_other) < abs(f_here):
            before, here, other = here, other, here
            f_before, f_here, f_other = f_here, f_other, f_here
        least = (within + _SHARE * abs(here)) / 2
        half = (other - here) / 2
        if f_here == 0 or abs(half) < least:
            break
        tried = np.inf
        if abs(last) > least and abs(f_here) < abs(f_before):
            if before == other:  # a line through two points, or a parabola through three
                tried = -f_here * (here - before) / (f_here - f_before)
            else:
                one = (f_before - f_here) / (before - here)
                two = (f_other - f_here) / (other - here)
                tried = -f_here * (f_other * two - f_before * one)
                tried /= two * one * (f_other - f_before)
        if 2 * abs(tried) < min(abs(last), 3 * abs(half) - least):
            last, step = step, tried
        else:
            last = step = half
        before, f_before = here, f_here
        here += step if abs(step) > least else (least if half > 0 else -least)
        f_here = function(here)
    return here
