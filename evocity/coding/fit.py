"""Which σ and β bring the attractor itself, not the collage, closest to the map?

The search makes each lifs rebuild its range block from the map; decoding rebuilds it from the
attractor, where errors add up. The fit lowers the attractor's error, with the gradient through
the fixed point; domain blocks and isometries stay.
"""

from collections.abc import Callable

import numpy as np

from evocity.citymap import CityMap
from evocity.coding.decode import CollageMap, decode
from evocity.coding.fixed_point import fixed_point
from evocity.coding.optimising import minimise
from evocity.coding.quality import psnr
from evocity.errors import GenomeError
from evocity.genome import Genome

#: A fixed point is reached when a step changes no pixel by more than this share of the peak.
_TOLERANCE = 1e-5
#: A step beyond this many peaks is taken as proof of divergence.
_SKY = 1e9
#: Steps after which a fixed point is taken as out of reach.
_MOST_STEPS = 500


def fit_attractor(
    genome: Genome,
    city: CityMap,
    *,
    evaluations: int = 60,
    progress: Callable[[int, int], None] | None = None,
) -> Genome:
    """``genome`` with σ and β of all lifs refined to minimise ‖attractor − map‖².

    By NLopt's MMA (Svanberg 2002) with \\|σ\\| ≤ sigma_max and β free; uniform lifs keep
    σ = 0. What the genome's condensation covers stays as it is. The same arguments give the same
    genome, bit for bit.

    Parameters
    ----------
    genome : a code that decodes, such as `encode` makes of ``city``.
    city : the map to come close to, of the genome's size and pixel size.
    evaluations : attractors to try at most; each takes 5 to 15 ms at 256².
    progress : called with (attractors tried, ``evaluations``); what it raises ends the fit.

    Returns
    -------
    Genome : of higher PSNR than ``genome``, or ``genome`` itself where none was found. Its
        ``made`` holds under ``fit`` the attractors tried, and PSNR (dB) before and
        after, None for a perfect fit.

    Raises
    ------
    GenomeError : decoding the genome diverges, or ``evaluations`` is no whole number above 0.
    MapError : map and genome differ in size or pixel size.
    """
    if not 1 <= evaluations < np.inf or int(evaluations) != evaluations:
        raise GenomeError(
            f"evaluations = {evaluations}", "a whole number above 0", "use for example 60"
        )
    before = psnr(city, decode(genome).city)
    if not np.isfinite(before):  # no error to lower, or nothing built
        return genome
    sigma, beta, tried = _refined(genome, city, int(evaluations), progress)
    fitted = genome.replace(sigma=sigma, beta=beta)
    after = psnr(city, decode(fitted).city)
    if not after > before:
        return genome
    finite = after if np.isfinite(after) else None  # JSON, which keeps it, has no infinity
    fit = {"evaluations": tried, "psnr_before": before, "psnr_after": finite}
    return fitted.replace(made={**genome.made, "fit": fit})


class AttractorError:
    """E(σ, β) = ‖attractor − map‖², m², and its gradient by the adjoint of the fixed point.

    The attractor solves A = ΣSA + β: S lays every shrunk domain block on its range block, Σ
    and β are the σ and β of each pixel's lifs. How E answers to a push on each pixel solves
    the transposed equation λ = (ΣS)ᵀλ + 2(A − map); summed over a range block, λ·SA is its
    lifs' ∂E/∂σ and λ its ∂E/∂β. Both are iterated in float64, from where they ended last, until
    no pixel changes by more than the share ``tolerance`` of the map's peak.
    """

    def __init__(self, genome: Genome, city: CityMap, tolerance: float = _TOLERANCE):
        self._pavement = genome.pavement
        self._heights = city.heights.astype(np.float64)
        peak = float(city.heights.max())
        self._tolerance, self._sky = tolerance * peak, _SKY * peak
        self._collage = CollageMap(genome, dtype=np.float64)
        _ = self._collage.sources  # the same for all codes
        self._shrink = self._collage.recoded(~genome.uniform, np.zeros(len(genome)))
        self._attractor = self._heights.copy()
        self._adjoint = np.zeros_like(self._heights)
        kept = genome.condensation
        self._free = None if kept is None else ~kept.mask  # pixels that answer to σ and β

    def __call__(
        self, sigma: np.ndarray, beta: np.ndarray
    ) -> tuple[float, np.ndarray, np.ndarray] | None:
        """(E, ∂E/∂σ, ∂E/∂β) in m², m² and m; None where the fixed point is out of reach."""
        collage = self._collage.recoded(sigma, beta)
        attractor = self._fixed_point(collage.lay, self._attractor, collage.lay_again)
        if attractor is None:
            return None
        difference = attractor - self._heights
        twice = 2 * difference

        def push(before: np.ndarray, after: np.ndarray) -> None:
            np.add(collage.transposed(before), twice, out=after)

        adjoint = self._fixed_point(push, self._adjoint)
        if adjoint is None:
            return None
        self._attractor, self._adjoint = attractor, adjoint
        by_sigma = self._block_sums(adjoint * self._shrink(attractor))
        return float(np.sum(difference**2)), by_sigma, self._block_sums(adjoint)

    def _fixed_point(self, lay: Callable, start: np.ndarray, again=None) -> np.ndarray | None:
        limits = {"tolerance": self._tolerance, "most": _MOST_STEPS, "sky": self._sky}
        found = fixed_point(lay, start, **limits, again=again)
        return found.values if found.settled else None

    def _block_sums(self, values: np.ndarray) -> np.ndarray:
        free = values if self._free is None else values * self._free
        sums = np.empty(len(self._pavement))
        for side, which in self._pavement.levels.items():  # as numpy adds: codes keep their bits
            sums[which] = self._pavement.blocks(free, side).sum(axis=(1, 2))
        return sums


def _refined(
    genome: Genome, city: CityMap, evaluations: int, progress: Callable | None
) -> tuple[np.ndarray, np.ndarray, int]:
    """(σ, β, attractors tried) of the least error seen, the genome's own to begin with.

    The optimiser sees the β of all lifs, in units of the peak, then σ of those with domains.
    """
    count, busy = len(genome), np.flatnonzero(~genome.uniform)
    peak = float(city.heights.max())
    unit = city.heights.size * peak**2
    error = AttractorError(genome, city)
    start = np.concatenate([genome.beta.astype(np.float64) / peak, genome.sigma[busy]])
    tried = 0

    def code(point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        sigma = np.zeros(count)
        sigma[busy] = point[count:]
        return sigma, point[:count] * peak

    def value(point: np.ndarray, gradient: np.ndarray) -> float | None:
        nonlocal tried
        found = error(*code(point))
        tried += 1
        if progress is not None:
            progress(tried, evaluations)
        if found is None:
            return None
        lost, by_sigma, by_beta = found
        if gradient.size:  # filled in place: NLopt reads this very array
            gradient[:count] = by_beta * (peak / unit)
            gradient[count:] = by_sigma[busy] / unit
        return lost / unit

    bound = np.full(start.size, np.inf)
    bound[count:] = np.float32(genome.sigma_max)  # as the genome's own check rounds it
    least = minimise(value, start, algorithm="mma", most=evaluations, lower=-bound, upper=bound)
    return *code(least.point), tried
