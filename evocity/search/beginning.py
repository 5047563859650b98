"""What a search needs around it before its first birth: its folder and its workers."""

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from evocity.errors import RecipeError, keyword, setting
from evocity.fitness.shipping import Shipment
from evocity.fitness.shipping import shipped as send
from evocity.search.compiling import compile_once, needed
from evocity.search.evaluation import Engine, Here, Workers
from evocity.search.evaluation.parcels import parcel_of
from evocity.search.keeping import kept_by
from evocity.search.noting import provenance_of
from evocity.search.preparation import Prepared
from evocity.search.recipe import Recipe
from evocity.search.trust import marked
from evocity.search.values import CLUSTERS, cluster_of
from evocity.store import RunWriter


def sides_of(recipe: Recipe, prepared: Prepared | None) -> int | tuple[int, int]:
    """Of the range blocks, px: of a run of an older release its one."""
    before = None if prepared is None else prepared.header.block
    return before or recipe.genome.block


def writer_of(prepared: Prepared, out: str | os.PathLike, engine: Mapping[str, Any]) -> RunWriter:
    """The run folder ``out``, made with all that the run begins with; ``engine``: what carries out
    its births, described. Raises `RunError`."""
    kept, text = kept_by(prepared.recipe), prepared.recipe.text
    about = provenance_of(prepared, out, kept) | {"evaluation": dict(engine)}
    return RunWriter.create(
        out,
        text,
        marked(about, text, out),
        prepared.header,
        prepared.sources,
        prepared.condensation,
        kept.files,
        prepared.others,
        [part.mask for part in prepared.within.values()],
    )


@dataclass(frozen=True)
class Crew:
    """Who breeds and evaluates: so many ``workers`` processes, this process if that is 0; on a
    ``cluster`` so many in each Dask worker, None for one a thread of it."""

    workers: int | None
    cluster: str | None = None

    @classmethod
    def asked(
        cls, recipe: Recipe, workers: int | None = None, cluster: str | None = None
    ) -> "Crew":
        """As the ``recipe`` says, but for what is told. Raises `RecipeError`."""
        given = recipe.evaluation
        try:
            address = cluster_of(cluster or given.cluster or "none")
        except ValueError:
            raise RecipeError(
                f"a search on {setting('cluster', cluster)}", CLUSTERS, "correct the address"
            ) from None
        if address is None:
            return cls(recipe.worker_count if workers is None else workers)
        elsewhere = cluster is not None and given.cluster in (None, "none")
        if workers is None and not elsewhere:  # else the recipe means workers of one machine
            workers = given.workers
        crew = cls(workers, address)
        if crew.workers == 0:
            raise RecipeError(
                f"{setting('workers', 0)} beside {setting('cluster', address)}",
                "worker processes, which each worker of the cluster hosts",
                f"leave {keyword('workers')} out for one a thread, or the cluster",
            )
        return crew

    @property
    def here(self) -> bool:
        """Whether everything is done in this process."""
        return self.workers == 0


def pool_of(
    prepared: Prepared,
    crew: Crew,
    shipped: tuple[Shipment, ...],
    tell: Callable[[str], None],
    retried: Callable[[str], None],
) -> Engine:
    """Where births are bred and evaluated. ``shipped``: measures of the session; ``tell`` and
    ``retried`` are told in words what is done, and what went wrong with the pool itself. Raises
    `RunError` if a cluster cannot be had."""
    recipe = prepared.recipe
    parts, sides = tuple(needed(recipe)), sides_of(recipe, prepared)
    setup = replace(prepared.setup, shipped=shipped, sides=sides, parts=parts)
    if crew.here:
        return Here(setup)
    limits = recipe.evaluation.timeout, recipe.evaluation.memory_bytes
    if crew.cluster is None:
        tell(f"starting {crew.workers} worker{'' if crew.workers == 1 else 's'}")
        return Workers(setup, crew.workers, limits[0], retried, limits[1])
    from evocity.search.evaluation.cluster import Cluster  # it loads Dask

    tell(f"going to the Dask cluster at {crew.cluster}")
    parcel = parcel_of(setup, [*recipe.measures, *recipe.recorded])
    return Cluster(parcel, crew.cluster, crew.workers, *limits, tell, retried)


def engine_of(
    prepared: Prepared,
    workers: int | None,
    cluster: str | None,
    tell: Callable[[str], None],
    retried: Callable[[str], None],
) -> Engine:
    """Where births of a run are evaluated that goes on, compiled; ``workers`` and ``cluster`` as
    `Crew.asked` takes them, the rest as of `pool_of`."""
    recipe = prepared.recipe
    crew = Crew.asked(recipe, workers, cluster)
    sent = () if crew.here else send([*recipe.measures, *recipe.recorded])
    compile_once(sides_of(recipe, prepared), needed(recipe), tell)
    return pool_of(prepared, crew, sent, tell, retried)


__all__ = ["Crew", "engine_of", "pool_of", "sides_of", "writer_of"]
