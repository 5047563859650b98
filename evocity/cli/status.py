"""`evocity status`: where a run is."""

from datetime import timedelta
from math import isfinite

import click

import evocity
from evocity.cli.common import json_option, print_json, print_table
from evocity.errors import EvocityError

#: Ids of the front that are listed at most.
_MOST_IDS = 12

#: The time left is told by the pace of so many generations.
_PACE = 8

#: A time left above this, thirty years, tells of a damaged log.
_MOST_SECONDS = 1e9


@click.command(
    epilog="""\b
Example:
  evocity status runs/lyon-x-montpellier --json"""
)
@click.argument("run", metavar="RUN")
@json_option
def status(run: str, as_json: bool) -> None:
    """Say where the run in the folder RUN is.

    Safe while it goes on: nothing is changed, and only whole generations are seen. Individuals
    of the front stand by their numbers, for --id of decode, score and show; all of them with
    --json. The hypervolume is measured by the first population of RUN: its rise says how much
    better the run gets, its height nothing beside another run.

    JSON keys: generation (the last whole one, null before the first), births, failures,
    hypervolume, best (measure to the best value among the living; constraints are left out),
    algorithm (what the
    algorithm tells of all the living: of map_elites coverage, cells and qd_score), islands (of a
    run with islands, name to what is told of each: living, feasible, and by its own goals
    hypervolume, best and algorithm; hypervolume, best and front above are those of all together,
    by all goals), parents (each
    source city to what its code has of these measures, null where it has none),
    evaluations_per_second, finished, stopped (why it ended before, in words; null while it goes
    on), running (a process is at it now), seconds_left (an estimate while it is running, else
    null), front (numbers of all individuals of the last generation's front), picked (numbers of
    those that are bred from besides, see `evocity pick`), picks_share (the share of births
    that have one of them for their first parent), weights (those that `evocity reweight` has set,
    by name), waiting (commands that are not yet carried out, in words), refused
    (those that were refused: generation and reason), evaluation (what births were evaluated by
    last: engine, workers and the cluster; null in runs of older releases), differs
    (births that were not the same when the run replayed them by itself: generation, id, differs as
    `evocity replay` tells it).
    """
    opened = evocity.open_run(run)
    held = _is_held(opened)  # before the state: a run that ends between is not told to go on
    state = opened.status()
    running = held and not state["finished"]
    left = _seconds_left(opened) if running else None
    from evocity.analysis.wanted import aims_of
    from evocity.report import Facts, differing, differing_told, failures
    from evocity.report.facts import figures_told
    from evocity.store.events import UNTOLD, ended_untold

    if not held and ended_untold(opened.events()):
        state["stopped"] = UNTOLD

    facts = Facts(opened)
    members = [] if state["generation"] is None else _members(facts, state["generation"])
    front = sorted(row["id"] for row in members if row["rank"] == 0)
    # runs of old had constraints among the best
    sought = (one.name for one in aims_of(opened) if one.sought)
    best = {name: state["best"][name] for name in sought if name in state["best"]}
    whole = state["generation"] is not None
    parents = _parents(facts, best) if whole else {}
    steered = _steered(opened, state["generation"])
    if as_json:
        more = {"parents": parents, "running": running, "seconds_left": left, "front": front}
        more |= steered | {"evaluation": _engine(opened), "differs": differing(opened)}
        print_json(state | {"best": best} | more)
        return
    planned = "" if facts.planned is None else f"/{facts.planned}"
    failed = failures(opened) if whole else []
    rows = [
        ("finished", _finished(run, state, running, left, members)),
        ("generation", _shown(state["generation"]) + (planned if whole else "")),
        ("births", _shown(state["births"])),
        ("failures", _shown(state["failures"])),
        *(("", str(kind)) for kind in failed),
        *([("replayed", unsteady)] if (unsteady := differing_told(opened)) else []),
        ("hypervolume", _shown(state["hypervolume"])),
        *figures_told(state["algorithm"]),
        *((f"on {name}", _island(told)) for name, told in state["islands"].items()),
        *(row for a in facts.sought if a.name in best for row in _goal(a, best[a.name], parents)),
        *([("constraints", _kept(facts))] if whole and _bounded(facts) else []),
        *([("front", _ids(front, run))] if whole else []),
        *_steered_rows(steered, run),
        ("evaluations/s", _shown(state["evaluations_per_second"])),
        *([("evaluated by", _engine_told(_engine(opened)))] if _engine(opened) else []),
    ]
    print_table(rows)


def _island(told: dict) -> str:
    """What is told of one island."""
    from evocity.report.facts import figures_told

    best = ", ".join(f"{name} {value:.4g}" for name, value in told.get("best", {}).items())
    parts = [f"{told['living']} living", f"hypervolume {_shown(told.get('hypervolume'))}"]
    parts += [f"{name} {value}" for name, value in figures_told(told.get("algorithm", {}))]
    return ", ".join(parts) + (f"; best {best}" if best else "")


def _engine(opened) -> dict | None:
    """What births were evaluated by since the run was last started or resumed."""
    told = [event for event in opened.events() if "engine" in event]
    kept = ("engine", "cluster", "dask_workers", "workers")
    return {key: told[-1][key] for key in kept if key in told[-1]} if told else None


def _engine_told(engine: dict) -> str:
    place = f"Dask at {engine['cluster']}" if "cluster" in engine else "this machine"
    count = engine.get("workers")
    return (
        f"{place}, {count} worker process{'' if count == 1 else 'es'}" if count else "this process"
    )


def _is_held(opened) -> bool:
    from evocity.store.lock import is_held

    return is_held(opened.path / "lock")


def _members(facts, generation: int) -> list[dict]:
    if facts.run.header.islands:
        return facts.members
    return facts.run.members(generation).select(["id", "rank"]).to_pylist()


def _seconds_left(opened) -> float | None:
    """Of a run that goes on, by its last generations' pace; None if there is nothing to tell by."""
    from evocity.report import Facts

    planned, history = Facts(opened).planned, opened.history()
    # the first generation also waited for the workers
    paces = [one.get("evaluations_per_second") for one in history[1:][-_PACE:] or history]
    if planned is None or not paces or not all(paces):
        return None
    one = sum(opened.header.population / pace for pace in paces) / len(paces)
    left = max(0, planned - history[-1]["generation"]) * one
    return left if left < _MOST_SECONDS else None


def _finished(run: str, state: dict, running: bool, left: float | None, members: list) -> str:
    """Whether the run is done; if not, what it does or what is to be done."""
    if state["finished"]:
        return "yes"
    if running:
        time = "" if left is None else f", about {timedelta(seconds=round(left))} left"
        return f"no; running{time}"
    if state["generation"] is not None and not members:
        from evocity.search.resuming import nobody_lives

        error = nobody_lives(run, state["generation"])
        return f"no, and it cannot go on: {error.found}; {error.remedy}"
    why = f"stopped: {state['stopped']}; " if state["stopped"] else ""
    return f"no; {why}go on with: evocity resume {run}"


def _bounded(facts) -> list:
    return [aim for aim in facts.told.aims if aim.bounds]


def _kept(facts) -> str:
    living = len(facts.members)
    kept = living - len(facts.broken)
    bounds = "; ".join(f"{aim.name} {aim.bounds}" for aim in _bounded(facts))
    return f"kept by {'all' if kept == living else f'{kept} of'} {living} living: {bounds}"


def _parents(facts, measures) -> dict[str, dict[str, float | None]]:
    """What the code of each source city has of the ``measures``; nothing of a run that has lost
    its first births."""
    cities = facts.run.header.cities
    try:
        births = facts.source_births
    except EvocityError:
        return {}
    values = {cities[birth.id]: birth.values for birth in births}
    return {
        name: {measure: _number(of.get(measure)) for measure in measures}
        for name, of in values.items()
    }


def _number(value: float | None) -> float | None:
    return value if value is not None and isfinite(value) else None


def _goal(aim, value: float, parents: dict) -> list[tuple[str, str]]:
    """The best by a measure, and below it what the parents have."""
    had = ", ".join(
        f"{name} {'–' if of[aim.name] is None else _shown(of[aim.name])}"
        for name, of in parents.items()
    )
    return [(f"best {aim.name}", _best(aim, value))] + [("", f"parents: {had}")] * bool(had)


def _best(aim, value: float) -> str:
    return f"{_shown(value)} {aim.unit}".rstrip() + f" ({aim.wanted})"


def _steered(opened, generation: int | None) -> dict:
    """What commands have changed: who is picked, what is weighed otherwise; and what waits, and was
    refused."""
    from evocity.search.commands import Standing, asked_of

    share = opened.provenance.get("recipe", {}).get("search", {}).get("picks")
    none = {"picked": [], "picks_share": share, "weights": {}, "waiting": [], "refused": []}
    try:
        standing, asked = Standing.of(opened.events(), (generation or 0) + 1), asked_of(opened)
    except ValueError:  # told where the run is resumed
        return none
    return {
        "picked": list(standing.picks),
        "picks_share": standing.share or share,
        "weights": dict(standing.weights),
        "waiting": [one.words for one in asked.waits],
        "refused": [{"generation": at, "reason": reason} for at, reason in asked.refused],
    }


def _steered_rows(steered: dict, run: str) -> list[tuple[str, str]]:
    rows = []
    if steered["picked"]:
        share = steered["picks_share"]
        of = f", first parents of {share:.0%} of the births" if share else ""
        rows.append(("picked", _ids(steered["picked"], run) + of))
    if steered["weights"]:
        rows.append(("weights", _weights(steered["weights"])))
    rows += [("waiting", words) for words in steered["waiting"][:_MOST_IDS]]
    if steered["refused"]:
        last, count = steered["refused"][-1], len(steered["refused"])
        more = f" (and {count - 1} before; all: evocity status {run} --json)" * (count > 1)
        rows.append(("refused", f"before generation {last['generation']}: {last['reason']}{more}"))
    return rows


def _weights(weights: dict[str, float]) -> str:
    return ", ".join(f"{name} {weight:g}" for name, weight in weights.items())


def _ids(front: list[int], run: str) -> str:
    """Some individuals, to be named by --id."""
    more = len(front) - _MOST_IDS
    listed = " ".join(map(str, front[:_MOST_IDS]))
    if more > 0:
        return f"{listed} and {more} more; all: evocity status {run} --json"
    return listed or "nobody"


def _shown(value) -> str:
    if value is None:
        return "none yet"
    return f"{value:.4g}" if isinstance(value, float) else str(value)
