"""What a search needs around it before its first birth: its folder and its workers."""

import os
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from evocity.fitness.shipping import Shipment
from evocity.search.compiling import needed
from evocity.search.evaluation import Engine, Here, Workers
from evocity.search.keeping import kept_by
from evocity.search.noting import provenance_of
from evocity.search.preparation import Prepared
from evocity.search.recipe import Recipe
from evocity.search.trust import marked
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


def pool_of(
    prepared: Prepared,
    count: int,
    shipped: tuple[Shipment, ...],
    tell: Callable[[str], None],
    retried: Callable[[str], None],
) -> Engine:
    """Where births are bred and evaluated: in ``count`` workers, or in this process if that is 0.
    ``shipped``: measures of the session; ``tell`` and ``retried`` are told in words what is done,
    and what went wrong with the pool itself."""
    recipe = prepared.recipe
    parts, sides = tuple(needed(recipe)), sides_of(recipe, prepared)
    setup = replace(prepared.setup, shipped=shipped, sides=sides, parts=parts)
    if count == 0:
        return Here(setup)
    tell(f"starting {count} worker{'' if count == 1 else 's'}")
    asked = recipe.evaluation
    return Workers(setup, count, asked.timeout, retried, asked.memory_bytes)


__all__ = ["pool_of", "sides_of", "writer_of"]
