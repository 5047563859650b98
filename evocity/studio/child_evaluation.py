"""The workers that breed and measure children of picks, with the deadline of the search. They
execute measures of a user only for runs that began on this machine."""

import contextlib
import sys
from collections.abc import Mapping
from dataclasses import replace

from evocity import fitness
from evocity.coding.matching import available_cores
from evocity.errors import EvocityError
from evocity.evaluation import Workers, kernel_warmup
from evocity.evaluation.compilation import compile_once, kernel_parts
from evocity.evaluation.evaluator import Setup
from evocity.fitness.part import own_name
from evocity.fitness.source_transfer import shipped
from evocity.genome import VOID
from evocity.pavement.levels import USUAL
from evocity.recipe.values import PARENTS
from evocity.search.preparation.startup import Crew, block_sides, start_engine
from evocity.search.preparation.trust import Permission, is_trusted
from evocity.search.resume.prepared_run import read_preparation
from evocity.store import Header, RunLog

#: Workers; seconds and bytes that a child may take in a run that began elsewhere.
MOST_WORKERS, DEADLINE, MEMORY = 2, 60.0, 4 << 30


def workers_of(run: RunLog) -> tuple[Workers, dict[str, str]]:
    """Return workers for children of a ``run``, and the reasons for omitted measures. For a run
    that began elsewhere, they take only evocity's own measures, of the whole map."""
    count = min(MOST_WORKERS, available_cores())
    reason = "the run was not started on this machine"
    if is_trusted(run):
        try:
            with contextlib.redirect_stdout(sys.stderr):  # measures of a user may print
                prepared, _ = read_preparation(run, permission=Permission(accept_changes=True))
                prepared = replace(prepared, header=_with_void(prepared.header))
                recipe = prepared.recipe
                sent = shipped([*recipe.measures, *recipe.recorded])
            compile_once(block_sides(recipe, prepared), kernel_parts(recipe), _silent)
            return _prompt(start_engine(prepared, Crew(count), sent, _silent, _silent)), {}
        except EvocityError as error:
            reason = f"the run cannot be prepared again: {error.found}"
    return _workers_of_other_run(run, count, reason)


def _workers_of_other_run(run: RunLog, count: int, reason: str) -> tuple[Workers, dict[str, str]]:
    header, entries = run.header, _measure_entries(run.provenance)
    lacks = {name: _lack(name, entries.get(name, {})) for name in header.columns}
    left = {name: f"{lack}, and {reason}" for name, lack in lacks.items() if lack is not None}
    taken = [name for name in header.columns if name not in left]
    sources = [source.city for source in run.sources()]
    measures = [fitness.get(name) for name in taken]
    reference = fitness.Reference.sources(sources)
    fabric = header.chromosome.fabric(run.sources()[0].genome)
    setup = Setup(
        replace(_with_void(header), measures=(), recorded=tuple(taken)),
        tuple((name, None) for name in taken),
        run.condensation,
        sides=USUAL if fabric is None else fabric.pavement.ends,
        parts=(kernel_warmup.DECODE, kernel_warmup.SEARCH, *(f"measure:{n}" for n in taken)),
        references={one.name: reference for one in measures if "reference" in one.takes},
        sources=tuple(sources) if any("sources" in one.takes for one in measures) else (),
    )
    compile_once(setup.sides, setup.parts, _silent)
    return _prompt(Workers(setup, count, DEADLINE, None, MEMORY, main=False)), left


def _prompt(engine: Workers) -> Workers:
    """Let an ``engine`` return each child as soon as it can, because a person waits for it."""
    engine.is_prompt = True
    return engine


def _with_void(header: Header) -> Header:
    """Return the ``header`` of a run with the void among its cities: operators that the recipe of
    the run lacks may leave open ground."""
    if VOID in header.cities or "fabric" not in header.chromosome.factors:
        return header
    return replace(header, cities=(*header.cities, VOID))


def _lack(name: str, entry: Mapping) -> str | None:
    """Return why a measure is left out, None if it is taken."""
    ours = {measure.name for measure in fitness.measures() if measure.origin == "evocity"}
    brings = entry.get("kept") or not str(entry.get("file", "evocity/")).startswith("evocity/")
    if brings or own_name(name) not in ours:
        return "the measure is not one of evocity's own"
    if own_name(name) != name or entry.get("within"):
        return "the measure is taken of a part of the map"
    if entry.get("like") or entry.get("reference") not in (None, PARENTS):
        return "the measure compares with other cities"
    return None


def _measure_entries(provenance: Mapping) -> dict[str, Mapping]:
    tables = (provenance.get(kind) for kind in ("fitness", "recorded"))
    entries = [entry for table in tables if isinstance(table, list) for entry in table]
    return {str(entry.get("name")): entry for entry in entries if isinstance(entry, Mapping)}


def _silent(text: str) -> None:
    """Ignore the progress of the preparation: the page says that it waits."""
