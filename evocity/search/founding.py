"""Parents that are no maps: a genome in a file, an individual of another run, a shape, a curve."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from evocity.citymap import CityMap
from evocity.errors import GenomeError, RunError
from evocity.kinds import Kind
from evocity.search.opening import open_run
from evocity.search.recipe import Recipe
from evocity.search.sections import Parent
from evocity.store import Birth, Run


def founder_of(recipe: Recipe, parent: Parent) -> tuple[CityMap, Any]:
    """The map and the genome of a ``parent`` that is no map: it was bred before, or is a shape or a
    curve. It begins anew: all its stone is its own, of a city that is called as the parent is.

    Raises `GenomeError` if it has another window or pixel size than the recipe's ``[map]``, a
    steeper σ than ``[genome] sigma_max``, or does not converge; `RunError` if the run has no such
    individual, or it failed; both tell the parent.
    """
    kind = recipe.kind
    if parent.bred:
        path = (recipe.folder / Path(parent.genome or parent.run).expanduser()).resolve()
        genome = _of_run(path, parent, kind) if parent.genome is None else kind.read(path)
        _refuse_others(genome, recipe, parent)
        founder = kind.founder(genome, parent.title, recipe.genome.settle)
    else:
        founder = kind.begun(parent, recipe.folder, recipe.window, parent.title)
    expressed = kind.express(founder)
    if expressed.city is None:
        raise GenomeError(
            f"{parent.place}: {expressed.problem}",
            "a genome that decodes to a map",
            "choose another individual" if parent.bred else "choose another",
        )
    return expressed.city.replace(expressed.city.heights, name=parent.title), founder


def _of_run(path: str | os.PathLike, parent: Parent, kind: Kind) -> Any:
    run = open_run(path)
    if run.header.kind != kind.name:
        raise GenomeError(
            f"{parent.place} is of a run that breeds {run.header.kind}s",
            f"an individual of a run of {kind.name}s",
            "choose another run",
        )
    (birth,) = alive(run, [parent.id])
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


def _refuse_others(genome: Any, recipe: Recipe, parent: Parent) -> None:
    unsuited = recipe.kind.unsuited(genome, recipe.window)
    if unsuited is not None:
        raise GenomeError(
            f"{parent.place} has {unsuited[0]}",
            f"{unsuited[1]}, as [map] says",
            "set pixels and metres_per_pixel in [map] as the genome has them, and choose others of "
            "the same window",
        )
    fabric = recipe.kind.fabric(genome)
    if fabric is None:
        return
    steepest = float(np.abs(fabric.sigma).max(initial=0))
    if steepest > np.float32(recipe.genome.sigma_max):
        raise GenomeError(
            f"{parent.place} has |σ| up to {steepest:.4g}",
            f"|σ| ≤ {recipe.genome.sigma_max:g}, sigma_max in [genome]",
            f"set sigma_max to {fabric.sigma_max:g} or more, or choose another",
        )
    if fabric.condensation is not None and not recipe.locked.asked:
        raise GenomeError(
            f"{parent.place} has locked pixels, and the recipe locks none",
            "a genome without locked pixels, or [locked] in the recipe",
            "lock in the recipe what is locked in it, by footprints or mask in [locked]",
        )


__all__ = ["alive", "founder_of"]
