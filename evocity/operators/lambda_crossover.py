"""λ crossover: every lifs between those of two parents, with a λ of its own."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from evocity.citymap import MAX_SIDE
from evocity.coding.decode import decode
from evocity.genome import FIELDS, Genome, merged_cities
from evocity.operators.crossing import Draft, Drafting
from evocity.operators.parameters import check_parameters, repair_checks
from evocity.pavement import Pavement


@dataclass(frozen=True)
class LambdaCrossover(Drafting):
    """ω_i = λ_i·ω1_i + (1 − λ_i)·ω2_i, pseudo-convex (Marsault 2002 §3.5).

    The λ_i are drawn as a field over the map, so that neighbouring lifs stay together:
    lifs-by-lifs draws (``grain`` = 1) crumble into noise, as the papers say.

    Parameters
    ----------
    share : mean of the λ_i, 0…1: share of the first parent. 0 and 1 give a parent back.
    blend : width of the seam in which λ_i runs from 0 to 1, as a share of all lifs. 0 is
        the exclusive choice λ_i ∈ {0, 1}; 1 interpolates everywhere.
    grain : size of the patches, in range blocks, 1 or more.
    repair, reach, domains : as in `PavementFusion`; what is meant to be laid is the mixture
        λ·A1 + (1 − λ)·A2 of the parents' decoded maps.
    """

    share: float = 0.5
    blend: float = 0.0
    grain: int = 8
    repair: float | None = 0.5
    reach: int | None = 24
    domains: Sequence[int] = (2,)

    name = "lambda_crossover"
    parents = (2, 2)

    def __post_init__(self):
        check_parameters(
            self,
            {
                "share": (lambda share: 0 <= share <= 1, "0…1"),
                "blend": (lambda width: 0 <= width <= 1, "0…1"),
                "grain": (lambda size: 1 <= size <= MAX_SIDE, f"1…{MAX_SIDE} blocks"),
                **repair_checks(),
            },
        )

    def _draft(self, parents: Sequence[Genome], rng: np.random.Generator) -> Draft:
        pavement = parents[0].pavement
        lambdas = lambda_field(pavement, self.share, self.blend, self.grain, rng)
        child = interpolated(*parents, lambdas, rng.random(lambdas.size))
        weight = pavement.raster(lambdas.astype(np.float32))
        first, second = (decode(parent).city.heights for parent in parents)
        made = {"share": self.share, "blend": self.blend, "grain": self.grain}
        return Draft(child, weight * first + (1 - weight) * second, made)


def lambda_field(
    pavement: Pavement, share: float, blend: float, grain: int, rng: np.random.Generator
) -> np.ndarray:
    """One λ a lifs, ``(n,)``, of mean ``share``: a smooth random field, evened out so that any
    share is met. ``blend`` and ``grain`` are those of `LambdaCrossover`."""
    field = rng.random((pavement.rows, pavement.columns))
    if grain > 1:
        field = ndimage.gaussian_filter(field, grain / 2, mode="reflect")
    rank = np.empty(field.size)
    rank[np.argsort(field, axis=None)] = (np.arange(field.size) + 0.5) / field.size
    if blend == 0:
        return (rank < share).astype(float)
    cut = share * (1 + blend) - blend / 2
    return np.clip((cut - rank) / blend + 0.5, 0, 1)


def interpolated(first: Genome, second: Genome, lambdas: np.ndarray, draws: np.ndarray) -> Genome:
    """Lifs between those of two genomes of one pavement: λ of the first, 1 − λ of the second.

    σ and β mix convexly; domain corners and extents too, rounded to legal values; the isometry,
    whose group is not convex, is the first's where ``draws`` (0…1, ``(n,)``) < λ. A lifs
    without a domain is taken as one of σ = 0 on the other's domain. Provenance follows the
    larger λ. Where λ is 0 or 1 the lifs is its parent's, bit for bit.
    """
    cities, pointers, attribution = merged_cities([first, second])
    ours, theirs = _columns(first, pointers[0]), _columns(second, pointers[1])
    between = (lambdas > 0) & (lambdas < 1)
    mixed = _mixed(first, second, ours, theirs, lambdas, draws) if between.any() else {}
    columns = {}
    for name, nucleotide in FIELDS.items():
        values = np.where(lambdas >= 0.5, ours[name], theirs[name])
        if name in mixed:
            values = np.where(between, mixed[name], values)
        columns[name] = values.astype(nucleotide.dtype)
    return first.replace(
        **columns,
        cities=cities,
        attribution=attribution,
        sigma_max=max(first.sigma_max, second.sigma_max),
    )


def _columns(genome: Genome, pointers: np.ndarray) -> dict[str, np.ndarray]:
    return {name: getattr(genome, name) for name in FIELDS} | {"parent": pointers}


def _mixed(first: Genome, second: Genome, ours, theirs, lambdas, draws) -> dict[str, np.ndarray]:
    """Nucleotides between those of two genomes, as `interpolated` tells, by name."""
    pavement, block = first.pavement, first.pavement.block
    lone = {"ours": first.uniform & ~second.uniform, "theirs": second.uniform & ~first.uniform}
    mixed = {}
    for name in ("sigma", "beta", "x", "y", "dx", "dy"):
        a, b = ours[name].astype(float), theirs[name].astype(float)
        if name not in ("sigma", "beta"):
            a, b = np.where(lone["ours"], b, a), np.where(lone["theirs"], a, b)
        mixed[name] = lambdas * a + (1 - lambdas) * b
    for extent, corner, side in (("dx", "x", pavement.width), ("dy", "y", pavement.height)):
        domain = mixed[extent] > 0
        whole = np.clip(np.rint(mixed[extent] / block), 2, side // block) * block
        mixed[extent] = np.where(domain, whole, 0)
        mixed[corner] = np.clip(np.rint(mixed[corner]), 0, side - mixed[extent])
    mixed["iso"] = np.where(
        lone["ours"] | (~lone["theirs"] & (draws >= lambdas)), theirs["iso"], ours["iso"]
    )
    return mixed
