"""`evocity status`: the state of a run; `evocity report`: its page."""

from datetime import timedelta
from math import isfinite
from pathlib import Path

import click

import evocity
from evocity.cli.shared.checks import check_output
from evocity.cli.shared.commands import command
from evocity.cli.shared.options import json_option, output_option
from evocity.cli.shared.terminal import echo, print_json, print_table
from evocity.errors import EvocityError

#: Most ids of the front in the table.
_MOST_IDS = 12

#: Most individuals to keep in the table.
_MOST_KEPT = 5


@command("""
  evocity status runs/lyon-x-montpellier --json""")
@click.argument("run", metavar="RUN")
@json_option
def status(run: str, as_json: bool) -> None:
    """Print the state of the run in the folder RUN.

    You can use this command while the run is in progress, because the command changes nothing and
    reads only complete generations. The command lists the ids of individuals on the Pareto front;
    use an id with the option --id of `evocity show`. With --json, the command lists all individuals
    on the Pareto front. The hypervolume is relative to the first population of the run. The
    hypervolume shows how much a run improves, but cannot compare two runs.

    If the run measures `smallest_share`, the command lists the individuals that `evocity keep`
    names. For each individual, the command prints the shares of the source cities in its buildings,
    and warns of shares below 10 %.

    The most important keys of the JSON document are "generation" (the last complete generation),
    "births", "failures", "hypervolume", "finished", "running", "seconds_left" and
    "evaluations_per_second". The key "stopped" says why the run ended early. The key "best"
    contains the best value of each goal among the living individuals. The key "algorithm" contains
    figures about the search algorithm, for example "coverage" for the algorithm map_elites. The key
    "islands" contains an object for each island, with the keys "living", "feasible", "hypervolume",
    "best" and "algorithm". The key "parents" contains the values of the source cities for all
    measures in the key "best". The key "front" contains the ids of all individuals on the Pareto
    front of the last generation. The keys "picked", "picks_share" and "weights" show the changes
    that you made with `evocity pick` and `evocity reweight`. The key "waiting" lists commands, such
    as `evocity pick`, that the run has not executed yet. The key "refused" lists commands, such as
    `evocity pick`, that the run refused to execute. The key "evaluation" says how the run evaluated
    its last births, in the keys "engine", "workers" and "cluster". The key "differs" lists births
    whose results changed when the run replayed these births. The key "kept" lists the individuals
    that `evocity keep` names, each with the keys "id" and "built" (the shares of its buildings).
    The key "damaged" lists files of the log that are damaged or missing. The key "unreachable"
    lists sentences about targets and bounds that no birth has reached. The key "more_births"
    forecasts the gain of as many births again, by the slope of the hypervolume. Unknown values are
    null.
    """
    from evocity.store.lock import is_held

    opened = evocity.open_run(run)
    # before the state: a run that ends in between does not go on
    held = is_held(opened.path / "lock")
    state = opened.status()
    running = held and not state["finished"]
    from evocity.analysis.failed_births import differing, differing_told, failures
    from evocity.analysis.goals import aims_of, figure_texts, planned_generations
    from evocity.analysis.outlook import seconds_left, unreachable
    from evocity.analysis.slope import more_births
    from evocity.store.events import KILLED, was_killed

    left = seconds_left(opened) if running else None
    if not held and was_killed(opened.events()):
        state["stopped"] = KILLED

    ranks = {} if state["generation"] is None else _ranks(opened, state["generation"])
    front = sorted(identifier for identifier, rank in ranks.items() if rank == 0)
    aims = aims_of(opened)
    # older runs list constraints among the best
    sought = [aim for aim in aims if aim.sought and aim.name in state["best"]]
    best = {aim.name: state["best"][aim.name] for aim in sought}
    whole = state["generation"] is not None
    parents = _parents(opened, best) if whole else {}
    steering = _steering(opened, state["generation"])
    missed, slope = (unreachable(opened), more_births(opened)) if whole else ([], "")
    if as_json:
        more = {"parents": parents, "running": running, "seconds_left": left, "front": front}
        more |= steering | {"evaluation": _engine(opened), "differs": differing(opened)}
        more |= {"damaged": _damaged(opened, held), "unreachable": missed}
        more |= {"more_births": slope}
        more |= {"kept": [{"id": c.individual.id, "built": c.built} for c in _kept(opened, state)]}
        print_json(state | {"best": best} | more)
        return
    planned = planned_generations(opened)
    of_planned = "" if planned is None else f"/{planned}"
    failed = failures(opened) if whole else []
    rows = [
        ("finished", _describe_state(run, state, running, left, ranks)),
        *_damage_rows(_damaged(opened, held), run),
        ("generation", _format(state["generation"]) + (of_planned if whole else "")),
        ("births", _format(state["births"])),
        ("failures", _format(state["failures"])),
        *(("", str(kind)) for kind in failed),
        *([("replayed", unsteady)] if (unsteady := differing_told(opened)) else []),
        ("hypervolume", _format(state["hypervolume"])),
        *figure_texts(state["algorithm"]),
        *((f"on {name}", _island(island)) for name, island in state["islands"].items()),
        *(row for aim in sought for row in _goal(aim, best[aim.name], parents)),
        *([("constraints", _bounds(opened))] if whole and any(a.bounds for a in aims) else []),
        *(("out of reach", text) for text in missed),
        *([("more births", slope)] if slope else []),
        *([("front", _ids(front, run))] if whole else []),
        *_kept_rows(_kept(opened, state)),
        *_steering_rows(steering, run),
        ("evaluations/s", _format(state["evaluations_per_second"])),
        *([("evaluated by", _describe_engine(_engine(opened)))] if _engine(opened) else []),
    ]
    print_table(rows)


def _damaged(opened, held: bool) -> list[str]:
    """The files of the log that are damaged, follow damaged ones, or are missing."""
    # a run that is being written may lack a file for a moment
    paths = [*opened.damaged, *(() if held else opened.missing)]
    return [path.relative_to(opened.path).as_posix() for path in paths]


def _damage_rows(names: list[str], run: str) -> list[tuple[str, str]]:
    if not names:
        return []
    more = f" and {len(names) - 1} more" if len(names) > 1 else ""
    return [("damaged", f"{names[0]}{more}; to repair: evocity resume {run} --set-aside")]


def _island(state: dict) -> str:
    """Describe the state of one island."""
    from evocity.analysis.goals import figure_texts

    best = ", ".join(f"{name} {value:.4g}" for name, value in state.get("best", {}).items())
    parts = [f"{state['living']} living", f"hypervolume {_format(state.get('hypervolume'))}"]
    parts += [f"{name} {value}" for name, value in figure_texts(state.get("algorithm", {}))]
    return ", ".join(parts) + (f"; best {best}" if best else "")


def _engine(opened) -> dict | None:
    """The engine that evaluates births since the run last started or resumed."""
    events = [event for event in opened.events() if "engine" in event]
    keys = ("engine", "cluster", "dask_workers", "workers")
    return {key: events[-1][key] for key in keys if key in events[-1]} if events else None


def _describe_engine(engine: dict) -> str:
    place = f"Dask at {engine['cluster']}" if "cluster" in engine else "this machine"
    count = engine.get("workers")
    return (
        f"{place}, {count} worker process{'' if count == 1 else 'es'}" if count else "this process"
    )


def _ranks(opened, generation: int) -> dict[int, int]:
    """Id -> rank of the living."""
    if opened.header.islands:
        return dict(zip(*(array.tolist() for array in opened.columns.ranked()), strict=True))
    members = opened.members(generation)
    return dict(zip(members["id"].to_pylist(), members["rank"].to_pylist(), strict=True))


def _describe_state(run: str, state: dict, running: bool, left: float | None, living: dict) -> str:
    """Whether the run is finished; if not, what it does, or what to do."""
    if state["finished"]:
        return "yes"
    if running:
        time = "" if left is None else f", about {timedelta(seconds=round(left))} left"
        return f"no; running{time}"
    if state["generation"] is not None and not living:
        from evocity.search.resume.resume import no_parents_error

        error = no_parents_error(run, state["generation"])
        return f"no, and it cannot go on: {error.found}; {error.remedy}"
    why = f"stopped: {state['stopped']}; " if state["stopped"] else ""
    return f"no; {why}go on with: evocity resume {run}"


def _bounds(opened) -> str:
    births = opened.columns
    living = int(births.alive.sum())
    kept = int((births.alive & births.feasible).sum())
    bounds = "; ".join(f"{aim.name} {aim.bounds}" for aim in births.aims if aim.bounds)
    return f"kept by {'all' if kept == living else f'{kept} of'} {living} living: {bounds}"


def _parents(opened, measures) -> dict[str, dict[str, float | None]]:
    """The values of each source city's code, by the ``measures``; empty without first births."""
    from evocity.analysis.births import source_births

    cities = opened.header.cities
    try:
        births = source_births(opened)
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
    """The best by a measure, and below it the values of the parents."""
    values = ", ".join(
        f"{name} {'–' if of[aim.name] is None else _format(of[aim.name])}"
        for name, of in parents.items()
    )
    rows = [(f"best {aim.name}", f"{_format(value)} {aim.unit}".rstrip() + f" ({aim.wanted})")]
    return rows + [("", f"parents: {values}")] * bool(values)


def _steering(opened, generation: int | None) -> dict:
    """The effect of commands: picks and weights; and the commands that wait, or were refused."""
    from evocity.search.record.commands import StandingOrders, command_state

    share = opened.provenance.get("recipe", {}).get("search", {}).get("picks")
    none = {"picked": [], "picks_share": share, "weights": {}, "waiting": [], "refused": []}
    try:
        standing = StandingOrders.of(opened.events(), (generation or 0) + 1)
        commands = command_state(opened)
    except ValueError:  # `evocity resume` raises it
        return none
    return {
        "picked": list(standing.picks),
        "picks_share": standing.share or share,
        "weights": dict(standing.weights),
        "waiting": [command.words for command in commands.pending],
        "refused": [{"generation": at, "reason": reason} for at, reason in commands.refused],
    }


def _steering_rows(steering: dict, run: str) -> list[tuple[str, str]]:
    rows = []
    if steering["picked"]:
        share = steering["picks_share"]
        of = f", first parents of {100 * share:.0f} % of the births" if share else ""
        rows.append(("picked", _ids(steering["picked"], run) + of))
    if steering["weights"]:
        rows.append(("weights", ", ".join(f"{k} {w:g}" for k, w in steering["weights"].items())))
    rows += [("waiting", words) for words in steering["waiting"][:_MOST_IDS]]
    if steering["refused"]:
        last, count = steering["refused"][-1], len(steering["refused"])
        more = f" (and {count - 1} before; all: evocity status {run} --json)" * (count > 1)
        rows.append(("refused", f"before generation {last['generation']}: {last['reason']}{more}"))
    return rows


def _kept(opened, state: dict) -> list:
    """The individuals to keep, if the run measures the shares of its source cities."""
    measured = "smallest_share" in opened.header.columns
    if not measured or state["generation"] is None:
        return []
    try:
        return list(opened.keep(_MOST_KEPT))
    except EvocityError:  # no archive, or a damaged log
        return []


def _kept_rows(kept: list) -> list[tuple[str, str]]:
    """A row for each individual to keep: the shares of its buildings, and a warning."""
    rows = []
    for choice in kept:
        texts = [f"{choice.individual.id}:", choice.stones, choice.scarce]
        rows.append(("" if rows else "to keep", " ".join(text for text in texts if text)))
    return rows


def _ids(front: list[int], run: str) -> str:
    """The ids of some individuals, for --id."""
    more = len(front) - _MOST_IDS
    listed = " ".join(map(str, front[:_MOST_IDS]))
    if more > 0:
        return f"{listed} and {more} more; all: evocity status {run} --json"
    return listed or "none"


def _format(value) -> str:
    if value is None:
        return "none yet"
    return f"{value:.4g}" if isinstance(value, float) else str(value)


@command("""
  evocity report runs/lyon-x-montpellier
  evocity report runs/lyon-x-montpellier -o so-far.html""")
@click.argument("run", metavar="RUN")
@output_option("HTML", "Page to write", required=False, default="report.html in RUN")
def report(run: str, output: Path | None) -> None:
    """Write the report of the run in the folder RUN, and print the path of the report.

    The run may be finished, stopped or in progress; the report covers all complete generations of
    the run. The command changes no other file of the run folder, and executes no measure.
    """
    from evocity.report import write_report

    evocity.open_run(run)  # what is not a run fails before the output is checked
    if output is not None:
        check_output(output, run, {".html", ".htm"})
    echo(f"report: {write_report(run, output)}")
