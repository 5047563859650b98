"""`evocity resume`: go on with a run."""

from pathlib import Path

import click

import evocity
from evocity.cli.shared.commands import command
from evocity.cli.shared.inputs import confirm_trust
from evocity.cli.shared.options import (
    WHOLE,
    accept_changes_option,
    cluster_option,
    flag,
    option,
    trust_option,
    until_option,
)
from evocity.cli.shared.search_progress import blame_options, carry_out
from evocity.cli.shared.terminal import echo, note


@command("""
  evocity resume runs/lyon-x-montpellier
  evocity resume runs/lyon-x-montpellier --generations 400
  evocity resume runs/lyon-x-montpellier --recipe runs/lyon-x-montpellier.toml
  evocity resume runs/lyon-x-montpellier --cluster tcp://10.0.0.1:8786""")
@click.argument("folder", metavar="RUN", type=click.Path(path_type=Path))
@option(
    "--generations",
    "Total number of generations, including the finished generations. [as at the start]",
    int,
)
@option("--workers", "Number of worker processes that evaluate births. [as at the start]", WHOLE)
@cluster_option("as at the start")
@until_option
@option(
    "--recipe revised RECIPE",
    "Recipe that replaces the recipe of the run; the command executes the Python files of "
    "measures that the new recipe names. [the run's]",
)
@accept_changes_option
@trust_option
@flag(
    "--set-aside",
    "Move damaged log files, and all log files after the first damaged file, to the folder "
    "damaged/; breed the lost births again.",
)
def resume(folder: Path, revised, trust, set_aside, accept_changes, **changes) -> None:
    """Continue the run in the folder RUN.

    The run continues after its last complete generation. The births of a resumed run are the same,
    bit for bit, as those of a run that never stopped. If the run is finished, the command only
    writes the report again, unless --generations asks for more generations. If the run has reached
    its target or stagnates, the run stops immediately and prints advice on what to change. With
    --generations, the run does not stop when it reaches the target or stagnates. The command
    executes the Python files of measures and the external commands that the recipe names.

    The recipe given by --recipe may change weights, targets, bounds, parameters, generations, and
    the tables [stop], [notify] and [evaluation]. The recipe given by --recipe must contain each
    measure of the run: as a goal, as a bound, or in the list "run.record". If the recipe given by
    --recipe adds measures, the command first computes the new measures for all earlier births. With
    --set-aside, the command breeds the births from damaged log files again.
    """
    if set_aside:
        from evocity import store

        moved = store.set_aside(folder)
        for name in moved:
            echo(f"set aside: {name}", err=True)
        if not moved:
            note("no file of births or membership is damaged or missing")
    trust = revised is None and confirm_trust(folder, trust)

    def start(progress):
        with blame_options(generations=changes["generations"], until=changes["until"]):
            return evocity.Search.resume(
                folder,
                recipe=revised,
                accept_changes=accept_changes,
                trust=trust,
                progress=progress,
                **changes,
            )

    carry_out(start, folder)
