"""Fit of σ and β that brings the attractor, not the collage, closest to the map; PSNR.

Decoding rebuilds range blocks from the attractor, where errors of the search add up. The fit lowers
the attractor's error, with the gradient through the fixed point.
"""

from collections.abc import Callable

import numpy as np

from evocity.citymap import CityMap, same_grid
from evocity.coding.collage_map import CollageMap
from evocity.coding.decode import decode
from evocity.coding.fixed_point import fixed_point
from evocity.coding.optimiser import minimise
from evocity.errors import GenomeError
from evocity.genome import Genome

#: An iteration ends when a step changes no pixel by more than this share of the peak.
_TOLERANCE = 1e-5
#: A step of so many peaks counts as divergence.
_SKY = 1e9
#: An iteration of more steps counts as divergence too.
_MOST_STEPS = 500


def psnr(original: CityMap, decoded: CityMap) -> float:
    """Compute the peak signal-to-noise ratio, dB: 10 log₁₀(peak² / mean squared difference).

    The peak of the formula is the height of the highest roof of the original. If both maps are
    equal, the result is inf. If the original contains only ground, a map with buildings gives -inf.
    Raises `MapError` if the maps differ in the number or the size of their pixels.
    """
    same_grid([original, decoded])
    difference = original.heights.astype(np.float64) - decoded.heights
    error = np.mean(difference**2)
    peak = float(original.heights.max())
    if error == 0:
        return float("inf")
    return float(10 * np.log10(peak**2 / error)) if peak > 0 else float("-inf")


def fit_attractor(
    genome: Genome,
    city: CityMap,
    *,
    evaluations: int = 60,
    progress: Callable[[int, int], None] | None = None,
) -> Genome:
    """Refine σ and β of all lifs to minimise the squared error ‖attractor − map‖².

    The optimiser is MMA of NLopt (Svanberg 2002), with \\|σ\\| ≤ sigma_max and unbounded β. Lifs
    without a domain block keep σ = 0, and the condensation does not change. Equal arguments give
    equal genomes, bit for bit.

    Parameters
    ----------
    genome : genome whose decoding does not diverge, for example from `encode`.
    city : map to approximate, with the genome's size and pixel size.
    evaluations : largest number of attractors to try. The computation of one attractor takes 5 to
        15 ms for 256 × 256 px.
    progress : function to call with two numbers: the number of attractors tried, and
        ``evaluations``. An exception in the function ``progress`` ends the fit.

    Returns
    -------
    Genome : genome with a higher PSNR, or the unchanged genome if the fit does not increase the
        PSNR. The entry ``made["fit"]`` holds the number of attractors tried, and the PSNR (dB)
        before and after the fit. The PSNR after a perfect fit is None.

    Raises
    ------
    GenomeError : the genome's decoding diverges, or ``evaluations`` is not a whole number above 0.
    MapError : the map and the genome differ in size or pixel size.
    """
    if not 1 <= evaluations < np.inf or int(evaluations) != evaluations:
        raise GenomeError(
            f"the parameter 'evaluations' has the value {evaluations}",
            "the number of attractors that the fit decodes, 1 or more",
            "leave the parameter 'evaluations' out to decode 60 attractors",
        )
    before = psnr(city, decode(genome).city)
    if not np.isfinite(before):  # no error to lower, or nothing built
        return genome
    sigma, beta, tried = _minimise_error(genome, city, int(evaluations), progress)
    fitted = genome.replace(sigma=sigma, beta=beta)
    after = psnr(city, decode(fitted).city)
    if not after > before:
        return genome
    finite = after if np.isfinite(after) else None  # JSON has no infinity
    fit = {"evaluations": tried, "psnr_before": before, "psnr_after": finite}
    return fitted.replace(made={**genome.made, "fit": fit})


class AttractorError:
    """E(σ, β) = ‖attractor − map‖², m², and its gradient by the adjoint of the fixed point.

    The attractor solves A = ΣSA + β: S lays every shrunk domain block on its range block, Σ and β
    are those of each pixel's lifs. E responds to a push on each pixel by λ = (ΣS)ᵀλ + 2(A − map).
    Summed over a range block, λ·SA is its lifs' ∂E/∂σ and λ its ∂E/∂β. Both iterate in float64,
    from their last results, until no pixel changes by more than the share ``tolerance`` of the
    map's peak.
    """

    def __init__(self, genome: Genome, city: CityMap, tolerance: float = _TOLERANCE):
        self._pavement = genome.pavement
        self._heights = city.heights.astype(np.float64)
        peak = float(city.heights.max())
        self._tolerance, self._sky = tolerance * peak, _SKY * peak
        self._collage = CollageMap(genome, dtype=np.float64)
        _ = self._collage.sources  # all recoded copies then share it
        self._shrink = self._collage.recoded(~genome.uniform, np.zeros(len(genome)))
        self._attractor = self._heights.copy()
        self._adjoint = np.zeros_like(self._heights)
        layer = genome.condensation
        self._free = None if layer is None else ~layer.mask  # pixels that depend on σ and β

    def __call__(
        self, sigma: np.ndarray, beta: np.ndarray
    ) -> tuple[float, np.ndarray, np.ndarray] | None:
        """Compute (E, ∂E/∂σ, ∂E/∂β) in m², m² and m; None where an iteration diverges."""
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

    def _fixed_point(self, lay: Callable, start: np.ndarray, repeat=None) -> np.ndarray | None:
        limits = {"tolerance": self._tolerance, "most": _MOST_STEPS, "sky": self._sky}
        end = fixed_point(lay, start, **limits, repeat=repeat)
        return end.values if end.converged else None

    def _block_sums(self, values: np.ndarray) -> np.ndarray:
        free = values if self._free is None else values * self._free
        sums = np.empty(len(self._pavement))
        for side, which in self._pavement.levels.items():  # numpy's order of sums, for equal bits
            sums[which] = self._pavement.blocks(free, side).sum(axis=(1, 2))
        return sums


def _minimise_error(
    genome: Genome, city: CityMap, evaluations: int, progress: Callable | None
) -> tuple[np.ndarray, np.ndarray, int]:
    """Return (σ, β, attractors tried) of the least error, the genome's own included. A point of the
    optimiser is β of all lifs, in units of the peak, then σ of those with domain blocks."""
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
        result = error(*code(point))
        tried += 1
        if progress is not None:
            progress(tried, evaluations)
        if result is None:
            return None
        squares, by_sigma, by_beta = result
        if gradient.size:  # filled in place: NLopt reads this array
            gradient[:count] = by_beta * (peak / unit)
            gradient[count:] = by_sigma[busy] / unit
        return squares / unit

    bound = np.full(start.size, np.inf)
    bound[count:] = np.float32(genome.sigma_max)  # rounded as in the genome's check
    least = minimise(value, start, algorithm="mma", most=evaluations, lower=-bound, upper=bound)
    return *code(least.point), tried
