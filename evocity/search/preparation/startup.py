"""The start of a search: its run folder, its workers or cluster, and their compiled kernels."""

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from evocity.errors import RecipeError, keyword, setting
from evocity.evaluation import Engine, Here, Workers
from evocity.evaluation.cluster.parcel import parcel_of
from evocity.evaluation.compilation import compile_once, kernel_parts
from evocity.fitness.source_transfer import Shipment, shipped
from evocity.recipe.recipe import Recipe
from evocity.recipe.values import CLUSTERS, cluster_of
from evocity.search.preparation.preparation import Prepared
from evocity.search.preparation.provenance import collect_own_files, provenance_of
from evocity.search.preparation.trust import add_mark
from evocity.store import RunWriter


def block_sides(recipe: Recipe, prepared: Prepared | None) -> int | tuple[int, int]:
    """Return the sides of range blocks, px; the only one of a run of an older release."""
    before = None if prepared is None else prepared.header.block
    return before or recipe.genome.block


def create_run_folder(
    prepared: Prepared, out: str | os.PathLike, engine: Mapping[str, Any]
) -> RunWriter:
    """Create the run folder ``out`` with all that a run begins with; ``engine`` describes what
    carries out its births. Raises `RunError`."""
    own, text = collect_own_files(prepared.recipe), prepared.recipe.text
    about = provenance_of(prepared, out, own) | {"evaluation": dict(engine)}
    return RunWriter.create(
        out,
        text,
        add_mark(about, text, out),
        prepared.header,
        prepared.sources,
        prepared.condensation,
        own.files,
        prepared.others,
        [part.mask for part in prepared.within.values()],
    )


@dataclass(frozen=True)
class Crew:
    """The processes that breed and evaluate: ``workers`` of them, or this one if 0. On a
    ``cluster`` each Dask worker hosts so many; None means one per thread."""

    workers: int | None
    cluster: str | None = None

    @classmethod
    def choose(
        cls, recipe: Recipe, workers: int | None = None, cluster: str | None = None
    ) -> "Crew":
        """Take the crew of the ``recipe``, with the arguments that are given in its place. Raises
        `RecipeError`."""
        given = recipe.evaluation
        try:
            address = cluster_of(cluster or given.cluster or "none")
        except ValueError:
            raise RecipeError(
                f"{setting('cluster', cluster)} is not the address of a cluster",
                CLUSTERS,
                "correct the address",
            ) from None
        if address is None:
            return cls(recipe.worker_count if workers is None else workers)
        elsewhere = cluster is not None and given.cluster in (None, "none")
        if workers is None and not elsewhere:  # else the recipe means workers of one machine
            workers = given.workers
        if workers == 0:
            raise RecipeError(
                f"{setting('workers', 0)} is given together with {setting('cluster', address)}",
                "1 or more processes in each worker of the cluster",
                f"leave {keyword('workers')} out to use one process per thread, or search without "
                "a cluster",
            )
        return cls(workers, address)

    @property
    def in_process(self) -> bool:
        """Whether this process does everything."""
        return self.workers == 0

    def ship(self, recipe: Recipe) -> tuple[Shipment, ...]:
        """Return the measures declared in this session, as other processes need them. Raises
        `FitnessError` for one that cannot be sent."""
        return () if self.in_process else shipped([*recipe.measures, *recipe.recorded])


def start_engine(
    prepared: Prepared,
    crew: Crew,
    shipment: tuple[Shipment, ...],
    tell: Callable[[str], None],
    retried: Callable[[str], None],
) -> Engine:
    """Start what breeds and evaluates births. ``shipment``: see `Crew.ship`; ``tell`` is called
    with each step, ``retried`` with failures of the pool itself. Raises `RunError` if the cluster
    cannot be reached."""
    recipe = prepared.recipe
    parts, sides = tuple(kernel_parts(recipe)), block_sides(recipe, prepared)
    setup = replace(prepared.setup, shipped=shipment, sides=sides, parts=parts)
    if crew.in_process:
        return Here(setup)
    limits = recipe.evaluation.timeout, recipe.evaluation.memory_bytes
    if crew.cluster is None:
        tell(f"starting {crew.workers} worker{'' if crew.workers == 1 else 's'}")
        return Workers(setup, crew.workers, limits[0], retried, limits[1])
    from evocity.evaluation.cluster.engine import Cluster  # it loads Dask

    tell(f"going to the Dask cluster at {crew.cluster}")
    parcel = parcel_of(setup, [*recipe.measures, *recipe.recorded])
    return Cluster(parcel, crew.cluster, crew.workers, *limits, tell, retried)


def compile_and_start(
    prepared: Prepared,
    crew: Crew,
    tell: Callable[[str], None],
    retried: Callable[[str], None] | None = None,
) -> Engine:
    """Compile the kernels of a run's births, then `start_engine`; ``retried`` is ``tell`` by
    default."""
    recipe, shipment = prepared.recipe, crew.ship(prepared.recipe)
    compile_once(block_sides(recipe, prepared), kernel_parts(recipe), tell)
    return start_engine(prepared, crew, shipment, tell, retried or tell)
