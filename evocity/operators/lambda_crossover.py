"""λ crossover: every lifs between two parents' lifs, with its own λ."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from evocity.errors import GenomeError, OperatorError
from evocity.genome import DOMAIN, FIELDS, Genome, descended, refined
from evocity.operators.crossover import Draft, Drafting, assemble, raw_heights
from evocity.operators.grid import common_grid, in_cells, side_checks
from evocity.operators.parameters import SHARE, Check
from evocity.pavement import Pavement, common_refinement

#: The default size of the patches, metres.
GRAIN = 64.0


@dataclass(frozen=True)
class LambdaCrossover(Drafting):
    """Cross two parents by ω_i = λ_i·ω1_i + (1 − λ_i)·ω2_i, pseudo-convexly (Marsault 2002 §3.5).

    The λ_i are drawn as a field over the map, so that neighbouring lifs stay together. Single draws
    (``grain`` = 1) crumble into noise, as the papers say.

    Parameters
    ----------
    share : mean of the λ_i, 0…1, which is the share of the first parent. 0 and 1 return a parent.
    blend : width of the seam in which λ_i changes from 0 to 1, as a share of all lifs. 0 makes λ_i
        either 0 or 1; 1 interpolates everywhere.
    grain_side : size of the patches, metres; None for 64.
    grain : the same size in range blocks, 1 or more, for uniform pavements. Deprecated.
    repair, reach, domains : as in `PavementFusion`. The intended map is the mixture λ·A1 + (1 −
        λ)·A2 of the parents' decoded maps.
    """

    share: float = 0.5
    blend: float = 0.0
    grain_side: float | None = None
    grain: int | None = None

    name = "lambda_crossover"
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
    domain corners and extents, rounded to legal values. The isometry, whose group is not convex,
    is the first's with the chance λ. A lifs without a domain block counts as σ = 0 on the other's
    domain block. Provenance follows the larger λ, which stands in ``part``.
    """
    if not ((lambdas > 0) & (lambdas < 1)).any():
        return assemble(parents, np.where(lambdas >= 0.5, 0, 1), grid)
    try:
        common = common_refinement([grid, *(parent.pavement for parent in parents)])
    except GenomeError as error:
        raise OperatorError(f"{name}: {error.found}", error.expected, error.remedy) from None
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
