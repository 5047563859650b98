"""λ crossover and interpolation: codes between the codes of two parents."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import scipy

from evocity.coding.collage_map import CollageMap
from evocity.coding.fixed_point import fixed_point
from evocity.condensation import merged
from evocity.errors import OperatorError, spell
from evocity.genome import DOMAIN, FIELDS, Genome, descended, refined
from evocity.operators.crossover import Draft, Drafting, assemble, raw_heights
from evocity.operators.grid import common_grid, in_cells, refinement, side_checks
from evocity.operators.parameters import SHARE, Check, are_shares, at_fault
from evocity.pavement import Pavement

#: The iteration ends as in `decode`: with a step below this, metres.
_TOLERANCE = 0.01
#: The default size of the patches, metres.
GRAIN = 64.0


@dataclass(frozen=True)
class LambdaCrossover(Drafting):
    """Cross two parents pseudo-convexly: ω_i = λ_i·ω1_i + (1 − λ_i)·ω2_i mixes the parents' lifs
    ω1_i and ω2_i (Marsault 2002 §3.5).

    The weights λ_i are drawn as a field over the map, so that neighbouring lifs stay together. If
    each λ_i is drawn separately (``grain`` = 1), the child crumbles into noise, as the papers say.

    Parameters
    ----------
    share : mean of all λ_i, 0…1; this mean is the share of the first parent in the child. If
        ``share`` is 0 or 1, the child equals one of the parents.
    blend : width of the seam in which λ_i changes from 0 to 1, as a share of all lifs, 0…1. A blend
        of 0 makes each λ_i either 0 or 1; a blend of 1 mixes both parents everywhere.
    grain_side : size of the patches of neighbouring lifs with similar weights, metres; by default
        64 m.
    grain : size of the patches of lifs with similar weights, counted in range blocks of equal size,
        1 or more. Deprecated.
    repair, reach, domains : parameters of collage repair, as in the operator `PavementFusion`. The
        intended map is the mixture λ·A1 + (1 − λ)·A2 of the parents' decoded maps A1 and A2.
    """

    share: float = 0.5
    blend: float = 0.0
    grain_side: float | None = None
    grain: int | None = None

    name = "lambda_crossover"
    takes_turns: ClassVar[bool] = True
    parents = (2, 2)

    def _checks(self) -> dict[str, Check]:
        return {"share": SHARE, "blend": SHARE, **side_checks(self, "grain")}

    def _draft(self, parents: Sequence[Genome], rng: np.random.Generator) -> Draft:
        grid = common_grid(self.name, parents)
        grain = in_cells(self, "grain", GRAIN, grid, parents)
        lambdas = lambda_field(grid, self.share, self.blend, grain, rng)
        child = interpolate(self.name, parents, grid, lambdas, rng)
        weight = grid.raster(lambdas.astype(np.float32))
        first, second = (raw_heights(parent) for parent in parents)
        metres = grain * grid.block * parents[0].metres_per_pixel
        made = {"share": self.share, "blend": self.blend, "grain_side": metres}
        return Draft(child, weight * first + (1 - weight) * second, made)


@dataclass(frozen=True)
class Interpolation(Drafting):
    """Interpolate two parents pseudo-convexly, either by mixing their lifs or in a stepwise form
    (Marsault 2002 §3.5, 2005 §2.2).

    In the default form, each lifs ω_i mixes the parents' lifs ω1_i and ω2_i by a share λ_i: ω_i =
    λ_i·ω1_i + (1 − λ_i)·ω2_i, as in `LambdaCrossover`. The range blocks of the parents are split
    until both parents have the same blocks. Without repair, only large shapes survive, because a
    mixed lifs reads a domain block that lies between the domain blocks of the two parents.

    The stepwise form approximates the attractor of λ·W1(I) + (1 − λ)·W2(I), where I is a map, and
    W1 and W2 are the decoding steps of the parents. The stepwise form mixes no lifs, so the range
    blocks of the parents may have different sides, for example 6 px and 4 px. In the stepwise form,
    the child has the range blocks of the first parent. The child keeps lifs of the first parent
    that reproduce the stepwise attractor. Lifs that do not reproduce the stepwise attractor keep
    their domain blocks and isometries, but get the best possible σ and β. Collage repair finds new
    domain blocks for range blocks that still differ too much from the intended map.

    The papers show a picture of the stepwise form, but give no code. In the stepwise form, all lifs
    of the child have the fields ``parent`` and ``source`` of the first parent.

    Parameters
    ----------
    share : share λ of the first parent, 0…1, or a share λ_i for each of its lifs. If ``share`` is
        None, the operator draws one share λ for all lifs. If all shares are 1, the child is the
        first parent; if all shares are 0, the child is the second parent.
    stepwise : whether the operator uses the stepwise form instead of mixing lifs.
    repair, reach, domains : parameters of collage repair, as in the operator `PavementFusion`. The
        intended map is the mixture λ·A1 + (1 − λ)·A2 of the parents' decoded maps A1 and A2, or the
        stepwise attractor.
    """

    share: float | Sequence[float] | None = 0.5
    stepwise: bool = False

    name = "interpolation"
    takes_turns: ClassVar[bool] = True
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
            grid = refinement(self.name, [first.pavement, second.pavement])
            shares = lambdas[first.pavement.index[grid.corners]]
            child = mix(refined(first, grid), refined(second, grid), shares, rng)
            return Draft(child, weight * ours + (1 - weight) * theirs, made)
        attractor = self._attractor(parents, weight)
        child = _refit(first.replace(**pointers[0], **common), attractor)
        return Draft(child, np.maximum(attractor, 0), made, first.pavement.coarsest)

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
                f"a height changed by {np.nanmax(end.moves):.3g} m",
                "parents in which nearly all lifs (codes of one range block) have a contrast |σ| "
                "< 1",
                "encode both parents with 'sigma_max' below 1",
            )
        return end.values


def lambda_field(
    grid: Pavement, share: float, blend: float, grain: int, rng: np.random.Generator
) -> np.ndarray:
    """Draw a λ for each cell of the ``grid``, ``(n,)``, of mean ``share``: a smooth random field,
    equalised to any share. ``blend`` as in `LambdaCrossover`, ``grain`` in cells."""
    field = rng.random((grid.rows, grid.columns))
    if grain > 1:
        field = scipy.ndimage.gaussian_filter(field, grain / 2, mode="reflect")
    rank = np.empty(field.size)
    rank[np.argsort(field, axis=None)] = (np.arange(field.size) + 0.5) / field.size
    if blend == 0:
        return (rank < share).astype(float)
    cut = share * (1 + blend) - blend / 2
    return np.clip((cut - rank) / blend + 0.5, 0, 1)


def interpolate(
    name: str,
    parents: Sequence[Genome],
    grid: Pavement,
    lambdas: np.ndarray,
    rng: np.random.Generator,
) -> Genome:
    """Interpolate the lifs of two ``parents``: λ of the first, 1 − λ of the second, a λ for each
    cell of the ``grid``, ``(n,)``.

    Where λ is 0 or 1 the lifs are a parent's, bit for bit. Elsewhere both parents' lifs split to
    the common refinement of range blocks and cells, and mix in pairs. σ and β mix convexly; so do
    domain corners and extents, rounded to legal values. The isometry is the first's with the chance
    λ. A lifs without a domain block counts as σ = 0 on the other's domain block. Provenance follows
    the larger λ.
    """
    if not ((lambdas > 0) & (lambdas < 1)).any():
        return assemble(parents, np.where(lambdas >= 0.5, 0, 1), grid)
    common = refinement(name, [grid, *(parent.pavement for parent in parents)])
    top, left = common.corners
    return mix(
        *(refined(parent, common) for parent in parents), lambdas[grid.index[top, left]], rng
    )


def mix(first: Genome, second: Genome, lambdas: np.ndarray, rng: np.random.Generator) -> Genome:
    """`interpolate` two genomes of one pavement, with a λ for each lifs, ``(n,)``."""
    pointers, common = descended([first, second])
    ours, theirs = (
        {name: getattr(genome, name) for name in FIELDS} | pointer
        for genome, pointer in zip((first, second), pointers, strict=True)
    )
    draws = rng.random(lambdas.size)
    between = (lambdas > 0) & (lambdas < 1)
    mixture = _mix_fields(first, second, ours, theirs, lambdas, draws) if between.any() else {}
    columns = {}
    for name, nucleotide in FIELDS.items():
        values = np.where(lambdas >= 0.5, ours[name], theirs[name])
        if name in mixture:
            values = np.where(between, mixture[name], values)
        columns[name] = values.astype(nucleotide.dtype)
    return first.replace(**columns, **common)


def _mix_fields(
    first: Genome, second: Genome, ours, theirs, lambdas, draws
) -> dict[str, np.ndarray]:
    """Mix the fields of two genomes as `interpolate` says, by name."""
    pavement, block = first.pavement, first.pavement.side
    lone = {"ours": first.uniform & ~second.uniform, "theirs": second.uniform & ~first.uniform}
    mixed = {}
    for name in ("sigma", "beta", *DOMAIN):
        a, b = ours[name].astype(float), theirs[name].astype(float)
        if name not in ("sigma", "beta"):
            a, b = np.where(lone["ours"], b, a), np.where(lone["theirs"], a, b)
        mixed[name] = lambdas * a + (1 - lambdas) * b
    for extent, corner, side in (("dx", "x", pavement.width), ("dy", "y", pavement.height)):
        domain = mixed[extent] > 0
        whole = np.clip(np.rint(mixed[extent] / block), 2, side // block) * block
        mixed[extent] = np.where(domain, whole, 0)
        mixed[corner] = np.clip(np.rint(mixed[corner]), 0, side - mixed[extent])
    larger = lambdas >= 0.5
    mixed["other"] = np.where(larger, theirs["parent"], ours["parent"])
    one_city = ours["parent"] == theirs["parent"]
    mixed["part"] = np.where(one_city, 1, np.where(larger, lambdas, 1 - lambdas))
    mixed["iso"] = np.where(
        lone["ours"] | (~lone["theirs"] & (draws >= lambdas)), theirs["iso"], ours["iso"]
    )
    return mixed


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
