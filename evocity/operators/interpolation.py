"""Interpolation: the codes between two, lifs by lifs or step by step."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from evocity.coding.decode import CollageMap
from evocity.coding.fixed_point import fixed_point
from evocity.condensation import merged
from evocity.errors import GenomeError, OperatorError, shown
from evocity.genome import Genome, descended, refined
from evocity.operators.crossing import Draft, Drafting, raw_heights
from evocity.operators.lambda_crossover import mixed
from evocity.operators.parameters import Check, at_fault
from evocity.pavement import common_refinement

#: As in `decode`: steps smaller than this end the iteration, metres.
_TOLERANCE = 0.01


@dataclass(frozen=True)
class Interpolation(Drafting):
    """Pseudo-convex interpolation of two codes (Marsault 2002 §3.5, 2005 §2.2), in two forms.

    *Lifs by lifs*: ω_i = λ_i·ω1_i + (1 − λ_i)·ω2_i, see `evocity.operators.lambda_crossover`.
    Half-way lifs read domain blocks that lie between their parents': without repair only what is
    large stays. Leaves of both are split to what they have in common first.

    *Stepwise*: the attractor of λ·W1(I) + (1 − λ)·W2(I), the two decodings mixed at every step.
    No lifs need meet, so the parents may have any range blocks on one map, 6 px and 4. The child is
    on the first parent's pavement. Its lifs are the first's, where these lay that attractor;
    where not they keep their domain blocks and isometries with the σ and β that do it best, or
    a mean height where there is no domain; what then still strays is for repair to match again.
    The papers give an image and no code for this form. ``parent`` and ``source`` are the
    first's throughout, whatever λ is: of the second the child has heights, not lifs.

    Parameters
    ----------
    share : λ, share of the first parent, 0…1, or one λ_i a lifs of it; None draws one λ evenly.
        Where all are 1 or 0 the child is that parent, on its own pavement.
    stepwise : the second form.
    repair, reach, domains : as in `PavementFusion`; what is meant to be laid is the mixture
        λ·A1 + (1 − λ)·A2 of the parents' decoded maps or, stepwise, the attractor above.
    """

    share: float | Sequence[float] | None = 0.5
    stepwise: bool = False

    name = "interpolation"
    parents = (2, 2)

    def _checks(self) -> dict[str, Check]:
        return {"share": (_are_lambdas, "0…1, a list of such, or none")}

    def _draft(self, parents: Sequence[Genome], rng: np.random.Generator) -> Draft:
        first, second = parents
        share = float(rng.random()) if self.share is None else self.share
        lambdas = self._lambdas(share, len(first))
        made = {"share": round(float(lambdas.mean()), 4), "stepwise": self.stepwise}
        weight = first.pavement.raster(lambdas.astype(np.float32))
        pointers, common = descended(parents)
        for parent, pointer, alone in zip(parents, pointers, (1, 0), strict=True):
            if (lambdas == alone).all():
                child = parent.replace(**pointer, **common)
                return Draft(child, raw_heights(parent), made, parent.pavement.coarsest)
        if not self.stepwise:
            ours, theirs = (raw_heights(parent) for parent in parents)
            child = self._between(first, second, lambdas, rng)
            return Draft(child, weight * ours + (1 - weight) * theirs, made)
        attractor = self._attractor(parents, weight)
        child = _refitted(first.replace(**pointers[0], **common), attractor)
        return Draft(child, np.maximum(attractor, 0), made, first.pavement.coarsest)

    def _between(self, first: Genome, second: Genome, lambdas, rng) -> Genome:
        """Lifs by lifs, on what both parents' range blocks have in common."""
        try:
            common = common_refinement([first.pavement, second.pavement])
        except GenomeError as error:
            found = f"{self.name}: {error.found}"
            raise OperatorError(found, error.expected, error.remedy) from None
        share = lambdas[first.pavement.index[common.corners]]
        return mixed(refined(first, common), refined(second, common), share, rng)

    def _lambdas(self, share: float | Sequence[float], count: int) -> np.ndarray:
        """λ of each of ``count`` lifs."""
        lambdas = np.asarray(share, float)
        if lambdas.ndim and lambdas.size != count:
            allowed = f"one number, or one for each of {count} lifs of the first parent"
            raise at_fault(self.name, {"share": (shown(self.share), allowed)})
        return np.broadcast_to(lambdas, count)

    def _attractor(self, parents: Sequence[Genome], weight: np.ndarray) -> np.ndarray:
        """Fixed point of weight·W1 + (1 − weight)·W2, float32 ``(H, W)``, metres; what either
        parent condenses stands in both."""
        kept = merged(parent.condensation for parent in parents)
        ours, theirs = (CollageMap(parent.replace(condensation=kept)) for parent in parents)
        start = weight * ours.flat_start + (1 - weight) * theirs.flat_start

        def lay(before: np.ndarray, after: np.ndarray) -> None:
            after[:] = weight * ours(before) + (1 - weight) * theirs(before)

        found = fixed_point(lay, start, tolerance=_TOLERANCE)
        if found.lost:
            raise OperatorError(
                f"{self.name}: the mixture of both decodings diverges; after {found.steps} steps "
                f"a pixel moved by {np.nanmax(found.moves):.3g} m",
                "contractive codes, |σ| < 1 but for few lifs",
                "encode the parents with sigma_max below 1",
            )
        return found.values


def _refitted(genome: Genome, attractor: np.ndarray) -> Genome:
    """``genome`` with σ and β of those lifs fitted to ``attractor`` (H, W) that do not lay it
    within the tolerance of decoding: least squares, \\|σ\\| capped inside the criterion."""
    pavement, wanted = genome.pavement, attractor.astype(np.float64)
    area = pavement.area
    laid = CollageMap(genome)(attractor)
    stray = pavement.sums((laid - wanted) ** 2) / area > _TOLERANCE**2
    bare = CollageMap(genome.replace(condensation=None))  # what is kept is no domain block's
    read = bare.recoded(~genome.uniform, np.zeros(len(genome)))(attractor).astype(np.float64)
    level, mean = pavement.sums(wanted) / area, pavement.sums(read) / area
    relief = read - pavement.raster(mean)
    energy, product = pavement.sums(relief**2), pavement.sums(relief * wanted)
    cap = genome.sigma_max
    slope = np.clip(product / np.where(energy > 0, energy, 1), -cap, cap)
    sigma = np.where(stray, slope, genome.sigma)
    beta = np.where(stray, level - slope * mean, genome.beta)
    return genome.replace(sigma=sigma, beta=beta)


def _are_lambdas(share: float | Sequence[float] | None) -> bool:
    if share is None:
        return True
    lambdas = share if isinstance(share, Sequence) else [share]
    return len(lambdas) > 0 and all(0 <= one <= 1 for one in lambdas)
