"""Parents that were bred before: a genome in a file, or an individual of another run."""

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from evocity.citymap import CityMap
from evocity.errors import GenomeError, RunError
from evocity.genome import Genome, read_genome
from evocity.search.opening import open_run
from evocity.search.recipe import Recipe
from evocity.search.sections import Parent
from evocity.store import Birth, Run


def founder_of(recipe: Recipe, parent: Parent) -> tuple[CityMap, Genome]:
    """The map and the genome of a ``parent`` that was bred before. It begins anew: all its stone
    is its own, of a city that is called as the parent is.

    Raises `GenomeError` if it has another window or pixel size than the recipe's ``[map]``, a
    steeper σ than ``[genome] sigma_max``, or does not converge; `RunError` if the run has no such
    individual, or it failed; both tell the parent.
    """
    path = (recipe.folder / Path(parent.genome or parent.run).expanduser()).resolve()
    genome = _of_run(path, parent.id) if parent.genome is None else read_genome(path)
    _refuse_others(genome, recipe, parent)
    founder = recipe.genome.kind.founder(genome, parent.title, recipe.genome.settle)
    expressed = recipe.genome.kind.express(founder)
    if expressed.city is None:
        raise GenomeError(
            f"{parent.place}: {expressed.problem}",
            "a genome that decodes to a map",
            "choose another individual",
        )
    return expressed.city.replace(expressed.city.heights, name=parent.title), founder


def _of_run(path: str | os.PathLike, identifier: int) -> Genome:
    (birth,) = alive(open_run(path), [identifier])
    return birth.genome


def alive(run: Run, ids: Sequence[int]) -> list[Birth]:
    """The individuals ``ids`` of a ``run``. Raises `RunError` if it has no such, or one failed."""
    births = run.individuals(ids)
    for birth in births:
        if not birth.ok:
            raise RunError(
                f"{run.path}: individual {birth.id} failed ({birth.error})",
                "an individual that was bred and measured",
                f"choose another, such as `evocity status {run.path}` lists",
            )
    return births


def _refuse_others(genome: Genome, recipe: Recipe, parent: Parent) -> None:
    pavement, wanted = genome.pavement, recipe.map
    size = pavement.height, pavement.width
    if size != (wanted.pixels,) * 2 or genome.metres_per_pixel != wanted.metres_per_pixel:
        raise GenomeError(
            f"{parent.place} has {size[0]} × {size[1]} px of {genome.metres_per_pixel:g} m",
            f"{wanted.pixels} × {wanted.pixels} px of {wanted.metres_per_pixel:g} m, as [map] says",
            "set pixels and metres_per_pixel in [map] as the genome has them, and choose others of "
            "the same window",
        )
    steepest = float(np.abs(genome.sigma).max(initial=0))
    if steepest > np.float32(recipe.genome.sigma_max):
        raise GenomeError(
            f"{parent.place} has |σ| up to {steepest:.4g}",
            f"|σ| ≤ {recipe.genome.sigma_max:g}, sigma_max in [genome]",
            f"set sigma_max to {genome.sigma_max:g} or more, or choose another",
        )
    if genome.condensation is not None and not recipe.locked.asked:
        raise GenomeError(
            f"{parent.place} has locked pixels, and the recipe locks none",
            "a genome without locked pixels, or [locked] in the recipe",
            "lock in the recipe what is locked in it, by footprints or mask in [locked]",
        )


__all__ = ["alive", "founder_of"]
