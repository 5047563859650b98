"""`evocity resume`: go on with a run."""

from pathlib import Path

import click

import evocity
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


@click.command(
    epilog="""\b
Examples:
  evocity resume runs/lyon-x-montpellier
  evocity resume runs/lyon-x-montpellier --generations 400
  evocity resume runs/lyon-x-montpellier --recipe runs/lyon-x-montpellier.toml
  evocity resume runs/lyon-x-montpellier --cluster tcp://10.0.0.1:8786"""
)
@click.argument("folder", metavar="RUN", type=click.Path(path_type=Path))
@option(
    "--generations", "Number of generations of the whole run, past and new. [as at the start]", int
)
@option("--workers", "Number of processes that evaluate births. [as at the start]", WHOLE)
@cluster_option("as at the start")
@until_option
@option(
    "--recipe revised RECIPE",
    "Recipe that replaces the run's recipe, with other values or more measures (executed). "
    "[the run's]",
)
@accept_changes_option
@trust_option
@flag(
    "--set-aside",
    "Move damaged files at the end of the run to damaged/, and breed their births again.",
)
def resume(
    folder: Path, generations, workers, cluster, until, revised, accept_changes, trust, set_aside
) -> None:
    """Go on with the run in the folder RUN.

    The run goes on after its last whole generation, as if it had never stopped: the births are the
    same, bit for bit. If the run is finished, the command only writes its report again, unless
    --generations is larger. If the target of the run is still reached, or stagnation still lasts,
    the run stops at once and says what to change. The option --generations overrides both. The
    command executes the commands of the recipe, and the Python files of measures that the recipe
    names.

    Another --recipe may change weights, targets, bounds, parameters, generations, [stop], [notify]
    and [evaluation]. Another --recipe must keep all measures of the run, as goals, as bounds or in
    run.record. New measures in the recipe first score all births so far. With --set-aside, the
    command breeds the same births again.
    """
    if set_aside:
        from evocity import store

        moved = store.set_aside(folder)
        for name in moved:
            echo(f"set aside: {name}", err=True)
        if not moved:
            note("no file of births or membership is damaged")
    trust = revised is None and confirm_trust(folder, trust)

    def start(progress):
        with blame_options(generations=generations, until=until):
            return evocity.Search.resume(
                folder,
                generations=generations,
                workers=workers,
                cluster=cluster,
                until=until,
                recipe=revised,
                accept_changes=accept_changes,
                trust=trust,
                progress=progress,
            )

    carry_out(start, folder)
