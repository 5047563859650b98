"""Interpolation: the codes between two, lifs by lifs or step by step."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from evocity.coding.decode import CollageMap, decode
from evocity.condensation import merged
from evocity.errors import OperatorError, shown
from evocity.genome import Genome, merged_cities
from evocity.operators.crossing import Draft, Drafting
from evocity.operators.lambda_crossover import interpolated
from evocity.operators.parameters import at_fault, check_parameters, repair_checks

#: As in `decode`: steps smaller than this end the iteration, metres; so many are made at most;
#: and changes beyond this are taken as proof of divergence, metres.
_TOLERANCE, _MOST, _SKY = 0.01, 500, 1e7


@dataclass(frozen=True)
class Interpolation(Drafting):
    """Pseudo-convex interpolation of two codes (Marsault 2002 §3.5, 2005 §2.2), in two forms.

    *Lifs by lifs*: ω_i = λ_i·ω1_i + (1 − λ_i)·ω2_i, see `interpolated`. Half-way lifs read
    domain blocks that lie between their parents': without repair only what is large stays.

    *Stepwise*: the attractor of λ·W1(I) + (1 − λ)·W2(I), the two decodings mixed at every step.
    No lifs need meet, so the parents may have different range blocks B on one map. The child is
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
    repair: float | None = 0.5
    reach: int | None = 24
    domains: Sequence[int] = (2,)

    name = "interpolation"
    parents = (2, 2)

    def __post_init__(self):
        check_parameters(
            self,
            {"share": (_are_lambdas, "0…1, a list of such, or none"), **repair_checks()},
        )

    @property
    def any_partition(self) -> bool:
        """Whether the parents' range blocks may differ in size, see `check_call`."""
        return self.stepwise

    def _draft(self, parents: Sequence[Genome], rng: np.random.Generator) -> Draft:
        first, second = parents
        share = float(rng.random()) if self.share is None else self.share
        lambdas = self._lambdas(share, len(first))
        draws = rng.random(lambdas.size)
        made = {"share": round(float(lambdas.mean()), 4), "stepwise": self.stepwise}
        weight = first.pavement.raster(lambdas.astype(np.float32))
        if not self.stepwise:
            ours, theirs = (decode(parent).city.heights for parent in parents)
            child = interpolated(first, second, lambdas, draws)
            return Draft(child, weight * ours + (1 - weight) * theirs, made)
        cities, pointers, attribution = merged_cities(parents)
        named = {
            "cities": cities,
            "attribution": attribution,
            "sigma_max": max(parent.sigma_max for parent in parents),
        }
        for parent, pointer, alone in zip(parents, pointers, (1, 0), strict=True):
            if (lambdas == alone).all():
                child = parent.replace(parent=pointer, **named)
                return Draft(child, decode(parent).city.heights, made)
        attractor = self._attractor(parents, weight)
        child = _refitted(first.replace(parent=pointers[0], **named), attractor)
        return Draft(child, np.maximum(attractor, 0), made)

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
        heights = weight * ours.flat_start + (1 - weight) * theirs.flat_start
        change, steps = np.inf, 0
        while change > _TOLERANCE and steps < _MOST:
            before = heights
            heights = weight * ours(before) + (1 - weight) * theirs(before)
            change, steps = float(np.abs(heights - before).max()), steps + 1
            if not change < _SKY:
                raise OperatorError(
                    f"{self.name}: the mixture of both decodings diverges; after {steps} steps "
                    f"a pixel moved by {change:.3g} m",
                    "contractive codes, |σ| < 1 but for few lifs",
                    "encode the parents with sigma_max below 1",
                )
        return heights


def _refitted(genome: Genome, attractor: np.ndarray) -> Genome:
    """``genome`` with σ and β of those lifs fitted to ``attractor`` (H, W) that do not lay it
    within the tolerance of decoding: least squares, \\|σ\\| capped inside the criterion."""
    pavement, collage = genome.pavement, CollageMap(genome)
    wanted = _flat(pavement.blocks(attractor))
    laid = _flat(pavement.blocks(collage(attractor)))
    stray = ((laid - wanted) ** 2).mean(axis=1) > _TOLERANCE**2
    bare = CollageMap(genome.replace(condensation=None))  # what is kept is no domain block's
    domains = bare.recoded(~genome.uniform, np.zeros(len(genome)))(attractor)
    read = _flat(pavement.blocks(domains))
    level, mean = wanted.mean(axis=1), read.mean(axis=1)
    relief = read - mean[:, None]
    energy = np.einsum("nk,nk->n", relief, relief)
    product = np.einsum("nk,nk->n", relief, wanted)
    cap = genome.sigma_max
    slope = np.clip(product / np.where(energy > 0, energy, 1), -cap, cap)
    sigma = np.where(stray, slope, genome.sigma)
    beta = np.where(stray, level - slope * mean, genome.beta)
    return genome.replace(sigma=sigma, beta=beta)


def _flat(blocks: np.ndarray) -> np.ndarray:
    return blocks.reshape(len(blocks), -1).astype(np.float64)


def _are_lambdas(share: float | Sequence[float] | None) -> bool:
    if share is None:
        return True
    lambdas = share if isinstance(share, Sequence) else [share]
    return len(lambdas) > 0 and all(0 <= one <= 1 for one in lambdas)
