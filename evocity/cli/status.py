"""`evocity status`: where a run is."""

import click

import evocity
from evocity.cli.common import json_option, print_json, print_table

#: Ids of the front that are listed at most.
_MOST_IDS = 12


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
    of the front stand by their numbers, for --id of decode, score and show.

    JSON keys: generation (the last whole one, null before the first), births, failures,
    hypervolume, best (measure to its best value), evaluations_per_second, finished.
    """
    opened = evocity.open_run(run)
    state = opened.status()
    if as_json:
        print_json(state)
        return
    from evocity.report import Facts, failures

    facts = Facts(opened)
    whole, best = state["generation"] is not None, state["best"]
    planned = "" if facts.planned is None else f"/{facts.planned}"
    failed = failures(opened) if whole else []
    rows = [
        ("finished", "yes" if state["finished"] else f"no; go on with: evocity resume {run}"),
        ("generation", _shown(state["generation"]) + (planned if whole else "")),
        ("births", _shown(state["births"])),
        ("failures", _shown(state["failures"])),
        *(("", str(kind)) for kind in failed),
        ("hypervolume", _shown(state["hypervolume"])),
        *((f"best {a.name}", _best(a, best[a.name])) for a in facts.aims if a.name in best),
        *([("front", _ids(facts.front))] if whole else []),
        *([("constraints", _broken(facts))] if whole and facts.broken else []),
        ("evaluations/s", _shown(state["evaluations_per_second"])),
    ]
    print_table(rows)


def _broken(facts) -> str:
    return f"{len(facts.broken)} of the {len(facts.members)} living break one"


def _best(aim, value: float) -> str:
    return f"{_shown(value)} {aim.unit}".rstrip() + f" ({aim.wanted})"


def _ids(front: list[int]) -> str:
    """Who is on the front, to be named by --id."""
    more = len(front) - _MOST_IDS
    listed = " ".join(map(str, sorted(front)[:_MOST_IDS]))
    return f"{listed} and {more} more" if more > 0 else listed or "nobody"


def _shown(value) -> str:
    if value is None:
        return "none yet"
    return f"{value:.4g}" if isinstance(value, float) else str(value)
