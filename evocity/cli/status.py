"""`evocity status`: where a run is."""

import click

import evocity
from evocity.cli.common import json_option, print_json, print_table


@click.command(
    epilog="""\b
Example:
  evocity status runs/lyon-x-montpellier --json"""
)
@click.argument("run", metavar="RUN")
@json_option
def status(run: str, as_json: bool) -> None:
    """Say where the run in the folder RUN is.

    Safe while it goes on: nothing is changed, and only whole generations are seen.

    JSON keys: generation (the last whole one, null before the first), births, failures,
    hypervolume, best (measure to its best value), evaluations_per_second, finished.
    """
    state = evocity.open_run(run).status()
    if as_json:
        print_json(state)
        return
    best = state["best"]
    rows = [
        ("finished", "yes" if state["finished"] else f"no; go on with: evocity resume {run}"),
        ("generation", _shown(state["generation"])),
        ("births", _shown(state["births"])),
        ("failures", _shown(state["failures"])),
        ("hypervolume", _shown(state["hypervolume"])),
        *((f"best {name}", _shown(value)) for name, value in best.items()),
        ("evaluations/s", _shown(state["evaluations_per_second"])),
    ]
    print_table(rows)


def _shown(value) -> str:
    if value is None:
        return "none yet"
    return f"{value:.4g}" if isinstance(value, float) else str(value)
