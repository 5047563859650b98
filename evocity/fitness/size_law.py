"""Salingaros' law on a map's own range of sizes: range and exponent are fitted together."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from evocity.citymap import CityMap
from evocity.errors import FitnessError, check_word
from evocity.fitness._kernels import fit_ranges
from evocity.fitness.measure import Undefined
from evocity.fitness.registry import fitness
from evocity.fitness.sizes import FEWEST, SMALLEST

#: Names of the numbers of `salingaros_law`.
NUMBERS = ("salingaros_law", "exponent", "sizes", "share", "smallest", "largest", "p")

#: Logarithm of the range that counts in full: two of Salingaros' classes, so three scales.
FULL = 2.0
#: Exponents of the law, Salingaros & West 1999.
LAW = (1.0, 2.0)
#: Deviation of the exponent, beyond its standard error, that lowers the score by 40 %.
SPREAD = 0.5
#: Kolmogorov-Smirnov distance times √n that chance explains: one law in 18 has more.
CHANCE = 1.0
#: Distance beyond chance that lowers the score by 63 %.
TOLERANCE = 0.03

#: Fewest pixels of a building that counts; 24 m² at 2 m per pixel, as for `crumbs`.
FEWEST_PIXELS = 6
#: Elongation from which a building of less than `SMALLEST` is a strip of roof; 3 and rounding.
STRIP = 3.001

#: How `fit_size_law` may choose the range.
CHOICES = ("score", "distance")

#: Most lower ends of a range that the fit tries.
_LOWER_ENDS = 24
#: Distances times √n, and the probability that a law of m = 1.5 on a tenfold range has more:
#: 60 000 draws of 300 sizes, each with its own fitted ends and exponent.
_DISTANCES = (0.443, 0.533, 0.577, 0.619, 0.661, 0.706, 0.759, 0.825, 0.927, 1.016, 1.202, 1.446)
_CHANCES = (0.95, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3, 0.2, 0.1, 0.05, 0.01, 0.001)


@dataclass(frozen=True)
class SizeLaw:
    """Range of sizes that follows Salingaros' law best, with the fitted exponent and the quality of
    the fit.

    score : how well the sizes follow the law, 0 to 1; the formula is that of `salingaros_law`.
    m : exponent m of Salingaros' law p x^m = C on the range, for p items of size x and a constant
        C.
    error : standard error of the exponent m, computed from the Fisher information.
    smallest, largest : ends of the range, in the unit of the sizes.
    n : number of sizes within the fitted range.
    share : number of sizes within the range, divided by the number of all sizes; 0 to 1.
    ks : Kolmogorov-Smirnov distance √n · max\\|F_empirical − F\\| between the n sizes on the range
        and the distribution F of the law.
    p : probability, .001 to 1, that sizes drawn from the law have a larger distance `ks` than the
        fitted sizes.
    """

    score: float
    m: float
    error: float
    smallest: float
    largest: float
    n: int
    share: float
    ks: float
    p: float


def fit_size_law(sizes: np.ndarray, step: float = 0.0, choose: str = "score") -> SizeLaw:
    """Fit Salingaros' universal distribution to linear sizes; the fit chooses the range of sizes
    and the exponent.

    For each candidate range, the function fits the exponent m by maximum likelihood, with the
    density ∝ x^{−(m+1)} of sizes x between the ends of the range. The ends of the range lie beyond
    its smallest and its largest size. The law expects half a size between an end and the nearest
    size; the ratio between the end and this size is at most e. Because the ends lie beyond the
    extreme sizes, the fitted exponent is nearly unbiased. A range has at least 30 sizes.

    Parameters
    ----------
    sizes : array of linear sizes (√area for footprints), above 0, in any unit and order.
    step : side of a pixel, in the unit of the sizes, for sizes that are measured on a map. With a
        `step`, each size becomes an interval: half a `step` below and above the size, but at most
        halfway to the next size. A size fits the law if any length in the interval of the size
        fits. The default `step` is 0, for exact sizes.
    choose : rule that chooses the range of sizes, "score" or "distance". With `choose` = "score",
        the function returns the range with the highest score. The rule "score" tries 24 lower ends,
        evenly spaced by rank, and leaves out 0, 1, 2, 4, 8 … of the largest sizes, up to an eighth
        of all sizes. With "distance", the function tries every lower end, as Clauset et al. do, and
        returns the range with the smallest distance. The distance max\\|F_empirical − F\\| compares
        the sizes with the distribution F of the law. With "distance", the range is often short, and
        in some cities small changes of the sizes shift the range far.

    Raises
    ------
    FitnessError : one of: fewer than 30 sizes; sizes that are all alike; a size that is not a
        positive finite number; a negative `step`; an unknown value of `choose`.

    The value `p` is right for a range that is chosen in advance; a range that the function chooses
    fits better by chance. In tests with a range given in advance, `p` was below .1 for 6 to 13 % of
    the samples from the law. The samples of these tests had 100 to 1000 sizes, exponents from 1 to
    2, and ranges with a ratio of 10 to 20 between the ends. With few sizes or a narrow range, `p`
    is below .1 less often than with many sizes on a wide range.

    Sources: Salingaros & West 1999 (EPB 26:909-923); Clauset, Shalizi & Newman 2009 (SIAM Review
    51:661-703); Corral & Deluca 2013 (Acta Geophysica 61:1351-1394), who choose the widest range
    that fits.

    >>> ranks = (np.arange(200) + 0.5) / 200
    >>> exact = 8 / (1 - 0.9 * ranks)  # the law with m = 1, from 8 to 80
    >>> law = fit_size_law(exact)
    >>> [round(value, 2) for value in (law.score, law.m, law.smallest, law.largest)]
    [1.0, 1.0, 8.0, 80.0]
    """
    sizes = np.asarray(sizes, dtype=np.float64).ravel()
    right = bool(np.all((sizes > 0) & (sizes < math.inf)))
    if sizes.size < FEWEST or not right or not 0 <= step < math.inf:
        raise FitnessError(
            f"no law can be fitted to {sizes.size} sizes with the step {step!r}",
            f"at least {FEWEST} sizes, all finite and above 0; and a step of at least 0",
            "give linear sizes in metres, and the side of a pixel as the step",
        )
    check_word("choose", choose, CHOICES, "leave it out for the highest score", FitnessError)
    law = _fit(np.sort(sizes), step, choose)
    if law is None:
        raise FitnessError(
            f"all {sizes.size} sizes are {sizes[0]:g}",
            "at least two sizes that differ",
            "count these sizes instead; one size has no distribution",
        )
    return law


@fitness(
    goal={"salingaros_law": "max"},
    unit={"smallest": "m", "largest": "m"},
    range={
        name: (0, 1 if name in ("salingaros_law", "share", "p") else math.inf) for name in NUMBERS
    }
    | {"exponent": (-math.inf, math.inf)},
    numbers=NUMBERS,
    any_site=True,
)
def salingaros_law(city: CityMap) -> Mapping[str, float]:
    """How well the sizes of buildings follow Salingaros' law on the range of sizes that suits the
    map best.

    The measures `salingaros` and `salingaros_buildings` fit the exponent on the fixed range from 5
    to 273 m, and have values near 0 for real cities. The measure `salingaros_law` fits the range of
    sizes and the exponent together (`fit_size_law`). Besides the score, the function returns six
    numbers that describe the fit.

    - `salingaros_law.exponent` is the exponent m of the law on the fitted range of sizes.
    - `salingaros_law.sizes` is the number of buildings within the fitted range of sizes.
    - `salingaros_law.share` is the number of buildings within the range, divided by the number of
      all buildings that count.
    - `salingaros_law.smallest` and `salingaros_law.largest` are the ends of the range of sizes, in
      metres.
    - `salingaros_law.p` is a test of fit: the probability that sizes drawn from the law lie farther
      from the law than the map's sizes. A value of `salingaros_law.p` below .1 speaks against the
      law.

    Buildings of fewer than 6 pixels do not count. Strips of roofs do not count: they are less than
    5 m wide, and more than 3 times as long as wide. The measure does not depend on the unit of
    length, except for strips and for the rules that separate buildings. Compare maps of equal pixel
    size, with similar numbers of buildings. Coarse pixels merge buildings and leave out small
    buildings, and a few sizes can lie far from the law by chance.

    Formula: the highest product of four factors (exponent, agreement, width and share), over all
    ranges [a, b] of sizes. The factor exponent is exp(−½ (d/0.5)²), with d the distance of the
    fitted exponent m from the interval [1, 2], less the standard error of m. The factor agreement
    is exp(−(e/0.03)²), with e = max\\|F_empirical − F\\| − 1/√n, but at least 0. The error e is the
    distance of n sizes from the law's distribution F that chance does not explain. The factor width
    is min(1, ln(b/a)/2), with a and b the ends of the range. The factor share is n / N, with N the
    number of buildings, and n the number of buildings within the range. The size of a building is x
    = √area, the square root of its footprint. Unit: none, but metres for the ends `smallest` and
    `largest` of the range. Range: 0 to 1; sizes drawn exactly from the law on a tenfold range have
    1, and sizes that are all alike have 0. Empty map: NaN, like every map of fewer than 30
    buildings that count. If all sizes are alike, the numbers `exponent`, `smallest`, `largest` and
    `p` are NaN. Source: Salingaros & West 1999 (EPB 26:909-923); Clauset, Shalizi & Newman 2009
    (SIAM Review 51:661-703); Corral & Deluca 2013 (Acta Geophysica 61:1351-1394). The formula of
    the score is evocity's own.

    >>> round(salingaros_law(evocity.read_map("montpellier-pas-du-loup")), 2)
    0.89
    >>> round(salingaros_law(evocity.read_map("villeurbanne-gratte-ciel")), 2)
    0.37
    """
    sizes = counted_sizes(city)
    if sizes.size < FEWEST:
        reason = f"{sizes.size} buildings count; fewer than {FEWEST} have no distribution"
        return dict.fromkeys(NUMBERS, Undefined(reason))
    law = _fit(sizes, city.metres_per_pixel)
    if law is None:
        alike = Undefined(f"all {sizes.size} buildings that count have the same area")
        return dict.fromkeys(NUMBERS, alike) | {"salingaros_law": 0.0, "sizes": 0, "share": 0.0}
    values = (law.score, law.m, law.n, law.share, law.smallest, law.largest, law.p)
    return dict(zip(NUMBERS, values, strict=True))


def counted_sizes(city: CityMap) -> np.ndarray:
    """List the sizes √area of the buildings that count for `salingaros_law`, sorted, metres."""
    table = city.buildings
    long, wide = table.box.T
    strip = (wide < SMALLEST) & (long > STRIP * wide)
    large = table.area > (FEWEST_PIXELS - 0.5) * city.metres_per_pixel**2
    return np.sqrt(np.sort(table.area[large & ~strip]))


def _fit(sizes: np.ndarray, step: float, choose: str = "score") -> SizeLaw | None:
    """Fit the law to sorted ``sizes``; None if these are all alike."""
    logs = np.log(sizes)
    halfway = np.concatenate([[-math.inf], np.diff(logs) / 2 + logs[:-1], [math.inf]])
    first = np.searchsorted(logs, logs)  # of the sizes that are equal
    last = np.searchsorted(logs, logs, side="right")
    below = np.maximum(np.log(np.maximum(sizes - step / 2, sizes / 2)), halfway[first])
    above = np.minimum(np.log(sizes + step / 2), halfway[last])
    starts, stops = _candidates(logs, choose)
    fits = np.empty((5, starts.size, stops.size))
    fit_ranges(logs, below, above, starts, stops, FEWEST, fits)
    scores = _score(fits, stops - starts[:, None], logs.size)
    if np.isnan(scores).all():
        return None
    best = np.nanargmax(scores) if choose == "score" else np.nanargmin(fits[4])
    i, j = np.unravel_index(best, scores.shape)
    m, error, low, high, distance = fits[:, i, j].tolist()
    n = int(stops[j] - starts[i])
    ks = math.sqrt(n) * distance
    return SizeLaw(
        score=float(scores[i, j]),
        m=m,
        error=error,
        smallest=math.exp(low),
        largest=math.exp(high),
        n=n,
        share=n / logs.size,
        ks=ks,
        p=float(np.exp(np.interp(ks, (0, *_DISTANCES), np.log((1, *_CHANCES))))),
    )


def _score(fits: np.ndarray, counts: np.ndarray, total: int) -> np.ndarray:
    """Score the ``fits`` (5, I, J) of ranges with ``counts`` (I, J) of ``total`` sizes."""
    m, error, low, high, distance = fits
    off = np.maximum(np.maximum(LAW[0] - m, m - LAW[1]) - error, 0)
    unexplained = np.maximum(distance - CHANCE / np.sqrt(np.maximum(counts, 1)), 0)
    agreement = np.exp(-((unexplained / TOLERANCE) ** 2))
    width = np.minimum((high - low) / FULL, 1)
    return np.exp(-0.5 * (off / SPREAD) ** 2) * agreement * width * counts / total


def _candidates(logs: np.ndarray, choose: str) -> tuple[np.ndarray, np.ndarray]:
    """List where ranges of sorted ``logs`` may begin, and where they may stop (exclusive)."""
    first = np.flatnonzero(np.diff(logs, prepend=-math.inf) > 0)
    starts = first[logs.size - first >= FEWEST]
    if choose == "distance":
        return starts, np.array([logs.size])
    if starts.size > _LOWER_ENDS:
        starts = starts[np.linspace(0, starts.size - 1, _LOWER_ENDS).round().astype(int)]
    left_out = [0, *(2**k for k in range(logs.size.bit_length()) if 2**k <= logs.size / 8)]
    last = logs[logs.size - 1 - np.array(left_out)]
    return starts, np.unique(np.searchsorted(logs, last, side="right"))
