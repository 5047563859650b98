"""Interpolation: codes between two codes, lifs by lifs or step by step."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from evocity.coding.decode import CollageMap
from evocity.coding.fixed_point import fixed_point
from evocity.condensation import merged
from evocity.errors import GenomeError, OperatorError, spell
from evocity.genome import Genome, descended, refined
from evocity.operators.crossover import Draft, Drafting, raw_heights
from evocity.operators.lambda_crossover import mix
from evocity.operators.parameters import Check, are_shares, at_fault
from evocity.pavement import common_refinement

#: The iteration ends as in `decode`: with a step below this, metres.
_TOLERANCE = 0.01


@dataclass(frozen=True)
class Interpolation(Drafting):
    """Interpolate two codes pseudo-convexly, in one of two forms (Marsault 2002 §3.5, 2005 §2.2).

    In the first form, each lifs is ω_i = λ_i·ω1_i + (1 − λ_i)·ω2_i, see
    `evocity.operators.lambda_crossover`. Intermediate lifs read domain blocks between those of
    their parents, so without repair only large shapes stay. Range blocks of both parents are split
    first, until both have the same.

    The stepwise form approximates the attractor of λ·W1(I) + (1 − λ)·W2(I), which mixes the two
    decodings at every step. No lifs is mixed with another. So the parents may have different range
    blocks on one map, such as 6 px and 4 px. The child has the first parent's pavement, and its
    lifs where they make that attractor. Elsewhere, lifs keep their domain blocks and isometries,
    and get the best σ and β. Or they become a mean height without a domain block. Repair matches
    blocks again that still differ too much.

    The papers give an image for this form, but no code. All lifs have the ``parent`` and ``source``
    of the first parent. The child has heights of the second parent, but no lifs of it.

    Parameters
    ----------
    share : λ, the share of the first parent, 0…1, or a λ_i for each of its lifs. None draws one λ
        evenly. If all values are 1, or all are 0, the child is that parent, on its own pavement.
    stepwise : whether to use the stepwise form.
    repair, reach, domains : as in `PavementFusion`. The intended map is the mixture λ·A1 + (1 −
        λ)·A2 of the parents' decoded maps. In the stepwise form it is the attractor above.
    """

    share: float | Sequence[float] | None = 0.5
    stepwise: bool = False

    name = "interpolation"
    parents = (2, 2)

    def _checks(self) -> dict[str, Check]:
        return {"share": (are_shares, "0…1, a list of such, or none")}

    def _draft(self, parents: Sequence[Genome], rng: np.random.Generator) -> Draft:
        first, second = parents
        share = float(rng.random()) if self.share is None else self.share
        lambdas = self._lambdas(share, len(first))
        made = {"share": round(float(lambdas.mean()), 4), "stepwise": self.stepwise}
        weight = first.pavement.raster(lambdas.astype(np.float32))
        pointers, common = descended(parents)
        for parent, pointer, whole in zip(parents, pointers, (1, 0), strict=True):
            if (lambdas == whole).all():
                child = parent.replace(**pointer, **common)
                return Draft(child, raw_heights(parent), made, parent.pavement.coarsest)
        if not self.stepwise:
            ours, theirs = (raw_heights(parent) for parent in parents)
            child = self._interpolate(first, second, lambdas, rng)
            return Draft(child, weight * ours + (1 - weight) * theirs, made)
        attractor = self._attractor(parents, weight)
        child = _refit(first.replace(**pointers[0], **common), attractor)
        return Draft(child, np.maximum(attractor, 0), made, first.pavement.coarsest)

    def _interpolate(self, first: Genome, second: Genome, lambdas, rng) -> Genome:
        """Interpolate lifs by lifs, on the common refinement of both pavements."""
        try:
            common = common_refinement([first.pavement, second.pavement])
        except GenomeError as error:
            raise OperatorError(
                f"{self.name}: {error.found}", error.expected, error.remedy
            ) from None
        share = lambdas[first.pavement.index[common.corners]]
        return mix(refined(first, common), refined(second, common), share, rng)

    def _lambdas(self, share: float | Sequence[float], count: int) -> np.ndarray:
        """Give each of ``count`` lifs its λ."""
        lambdas = np.asarray(share, float)
        if lambdas.ndim and lambdas.size != count:
            allowed = f"one number, or one for each of {count} lifs of the first parent"
            raise at_fault(self.name, {"share": (spell(self.share), allowed)})
        return np.broadcast_to(lambdas, count)

    def _attractor(self, parents: Sequence[Genome], weight: np.ndarray) -> np.ndarray:
        """Compute the fixed point of weight·W1 + (1 − weight)·W2, with both condensations."""
        layer = merged(parent.condensation for parent in parents)
        ours, theirs = (CollageMap(parent.replace(condensation=layer)) for parent in parents)
        start = weight * ours.flat_start + (1 - weight) * theirs.flat_start

        def lay(before: np.ndarray, after: np.ndarray) -> None:
            after[:] = weight * ours(before) + (1 - weight) * theirs(before)

        end = fixed_point(lay, start, tolerance=_TOLERANCE)
        if end.diverged:
            raise OperatorError(
                f"{self.name}: the mixture of both decodings diverges; after {end.steps} steps "
                f"a pixel moved by {np.nanmax(end.moves):.3g} m",
                "contractive codes, with |σ| < 1 in nearly all lifs",
                "encode the parents with sigma_max below 1",
            )
        return end.values


def _refit(genome: Genome, attractor: np.ndarray) -> Genome:
    """Fit σ and β of those lifs that do not lay the ``attractor`` (H, W) within the tolerance of
    decoding: least squares, \\|σ\\| capped inside the criterion."""
    pavement, target = genome.pavement, attractor.astype(np.float64)
    area = pavement.area
    laid = CollageMap(genome)(attractor)
    stray = pavement.sums((laid - target) ** 2) / area > _TOLERANCE**2
    bare = CollageMap(genome.replace(condensation=None))  # domain blocks under the condensation too
    read = bare.recoded(~genome.uniform, np.zeros(len(genome)))(attractor).astype(np.float64)
    level, mean = pavement.sums(target) / area, pavement.sums(read) / area
    relief = read - pavement.raster(mean)
    energy, product = pavement.sums(relief**2), pavement.sums(relief * target)
    cap = genome.sigma_max
    slope = np.clip(product / np.where(energy > 0, energy, 1), -cap, cap)
    sigma = np.where(stray, slope, genome.sigma)
    beta = np.where(stray, level - slope * mean, genome.beta)
    return genome.replace(sigma=sigma, beta=beta)
