"""Who breeds and measures children of a run's births: workers, with the search's deadline. No
measure of a run that was not begun here is executed."""

import contextlib
import sys
from collections.abc import Iterable, Mapping
from dataclasses import replace

from evocity import fitness
from evocity.coding.matching import available_cores
from evocity.errors import EvocityError
from evocity.fitness.part import own_name
from evocity.fitness.shipping import shipped
from evocity.pavement.levels import USUAL
from evocity.search import warm
from evocity.search.beginning import Crew, pool_of, sides_of
from evocity.search.compiling import compile_once, needed
from evocity.search.evaluation import Workers
from evocity.search.evaluator import Setup
from evocity.search.rereading import read_again
from evocity.search.trust import is_ours
from evocity.search.values import PARENTS
from evocity.store import Run

#: Workers; seconds and bytes that one child may take where no recipe of ours says.
MOST_WORKERS, DEADLINE, MEMORY = 2, 60.0, 4 << 30


def workers_of(run: Run) -> tuple[Workers, dict[str, str]]:
    """Workers for children of a ``run``'s births, and of its measures that they do not take why.

    Those of a run that was begun here measure as the run would now. Those of another take evocity's
    own measures alone, of the whole map, by the run's source cities. Raises `RunError` if its
    sources are damaged.
    """
    count = min(MOST_WORKERS, available_cores())
    reason = "the run was not begun on this machine"
    if is_ours(run):
        try:
            with contextlib.redirect_stdout(sys.stderr):  # measures of one's own may print
                prepared, _ = read_again(run, accept_changes=True)
                recipe = prepared.recipe
                sent = shipped([*recipe.measures, *recipe.recorded])
            compile_once(sides_of(recipe, prepared), needed(recipe), _silent)
            return pool_of(prepared, Crew(count), sent, _silent, _silent), {}
        except EvocityError as error:
            reason = f"the run cannot be prepared again: {error.found}"
    return _by_own_measures(run, count, reason)


def _by_own_measures(run: Run, count: int, reason: str) -> tuple[Workers, dict[str, str]]:
    header, noted = run.header, _noted(run.provenance)
    taken, left = [], {}
    for name in header.columns:
        lack = _lack(name, noted.get(name, {}))
        if lack is None:
            taken.append(name)
        else:
            left[name] = f"{lack}, and {reason}"
    sources = [source.city for source in run.sources()]
    measures = [fitness.get(name) for name in taken]
    reference = fitness.Reference.sources(sources)
    fabric = header.chromosome.fabric(run.sources()[0].genome)
    sides = USUAL if fabric is None else fabric.pavement.ends
    parts = (warm.DECODE, warm.SEARCH, *(f"measure:{name}" for name in taken))
    setup = Setup(
        replace(header, measures=(), recorded=tuple(taken)),
        tuple((name, None) for name in taken),
        run.condensation,
        sides=sides,
        parts=parts,
        references={one.name: reference for one in measures if "reference" in one.takes},
        sources=tuple(sources) if any("sources" in one.takes for one in measures) else (),
    )
    compile_once(setup.sides, setup.parts, _silent)
    return Workers(setup, count, DEADLINE, None, MEMORY, main=False), left


def _lack(name: str, noted: Mapping) -> str | None:
    """Why a measure is not taken, None if it is."""
    own = {one.name: one for one in fitness.measures() if one.origin == "evocity"}
    brings = noted.get("kept") or not str(noted.get("file", "evocity/")).startswith("evocity/")
    if brings or own_name(name) not in own:
        return "it is a measure of its own"
    if own_name(name) != name or noted.get("within"):
        return "it is taken of a part of the map"
    if noted.get("like") or noted.get("reference") not in (None, PARENTS):
        return "it compares with other cities"
    return None


def _noted(provenance: Mapping) -> dict[str, Mapping]:
    tables: Iterable = (provenance.get(kind) for kind in ("fitness", "recorded"))
    listed = [one for table in tables if isinstance(table, list) for one in table]
    return {str(one.get("name")): one for one in listed if isinstance(one, Mapping)}


def _silent(text: str) -> None:
    """Nobody is told what is prepared: the page says that it waits."""


__all__ = ["workers_of"]
