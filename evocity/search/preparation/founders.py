"""Founders: parents that are genomes of files, individuals of other runs, shapes or curves."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from evocity.citymap import CityMap
from evocity.errors import GenomeError
from evocity.kinds import Kind
from evocity.recipe.recipe import Recipe
from evocity.recipe.sections import Parent
from evocity.search.record.commands import refuse_failed
from evocity.search.record.complete_run import CompleteRun
from evocity.store import Birth, RunLog


def read_founder(recipe: Recipe, parent: Parent) -> tuple[CityMap, Any]:
    """Read the map and the genome of a ``parent`` that is not a map. It becomes a city of its own.

    Raises `GenomeError` if its window or σ does not fit the recipe, or if it does not converge.
    Raises `RunError` if the run has no such individual, or it failed. Both name the parent.
    """
    kind = recipe.kind
    if parent.bred:
        path = (recipe.folder / Path(parent.genome or parent.run).expanduser()).resolve()
        genome = _read_individual(path, parent, kind) if parent.genome is None else kind.read(path)
        _refuse_unsuited(genome, recipe, parent)
        founder = kind.founder(genome, parent.title, recipe.genome.settle)
    else:
        founder = kind.make_parent(parent, recipe.folder, recipe.window, parent.title)
    expressed = kind.express(founder)
    if expressed.city is None:
        raise GenomeError(
            f"{parent.place}: {expressed.problem}",
            "a genome that decodes to a map",
            f"choose another {'individual' if parent.bred else 'parent'}",
        )
    return expressed.city.replace(expressed.city.heights, name=parent.title), founder


def _read_individual(path: str | os.PathLike, parent: Parent, kind: Kind) -> Any:
    run = CompleteRun(path)
    if run.header.kind != kind.name:
        raise GenomeError(
            f"{parent.place} comes from a run that breeds {run.header.kind}s",
            f"an individual of a run that breeds {kind.name}s",
            "choose an individual of another run",
        )
    (birth,) = require_alive(run, [parent.id])
    return birth.genome


def require_alive(run: RunLog, ids: Sequence[int]) -> list[Birth]:
    """Return the births ``ids`` of a ``run``. Raises `RunError` if it has no such birth, or one
    failed."""
    births = run.individuals(ids)
    refuse_failed(run, births)
    return births


def _refuse_unsuited(genome: Any, recipe: Recipe, parent: Parent) -> None:
    unsuited = recipe.kind.window_mismatch(genome, recipe.window)
    if unsuited is not None:
        raise GenomeError(
            f"the genome of {parent.place} has {unsuited[0]}",
            f"{unsuited[1]}, as [map] of the recipe says",
            "set 'pixels' and 'metres_per_pixel' in [map] to the values of the genome, and choose "
            "parents with the same window",
        )
    fabric = recipe.kind.fabric(genome)
    if fabric is None:
        return
    steepest = float(np.abs(fabric.sigma).max(initial=0))
    if steepest > np.float32(recipe.genome.sigma_max):
        raise GenomeError(
            f"the genome of {parent.place} has contrasts σ with |σ| up to {steepest:.4g}",
            f"|σ| of at most {recipe.genome.sigma_max:g}, the value of 'sigma_max' in [genome]",
            f"set 'sigma_max' to {fabric.sigma_max:g} or more, or choose another genome",
        )
    if fabric.condensation is not None and not recipe.locked.given:
        raise GenomeError(
            f"the genome of {parent.place} has locked pixels, but the recipe locks no pixels",
            "a genome without locked pixels, or the section [locked] in the recipe",
            "lock the same pixels with footprints or a mask in [locked] of the recipe",
        )
