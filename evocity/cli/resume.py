"""`evocity resume`: go on with a run."""

from pathlib import Path

import click

import evocity
from evocity.cli.common import echo, note
from evocity.cli.searching import blaming_options, carry_out, cluster_option, until_option
from evocity.cli.trusting import confirmed, trust_option


@click.command(
    epilog="""\b
Examples:
  evocity resume runs/lyon-x-montpellier
  evocity resume runs/lyon-x-montpellier --generations 400
  evocity resume runs/lyon-x-montpellier --recipe runs/lyon-x-montpellier.toml
  evocity resume runs/lyon-x-montpellier --cluster tcp://10.0.0.1:8786"""
)
@click.argument("folder", metavar="RUN", type=click.Path(path_type=Path))
@click.option(
    "--generations",
    type=int,
    show_default="as it was started",
    help="Generations of the whole run, those it has included.",
)
@click.option(
    "--workers",
    type=click.IntRange(min=0),
    show_default="as it was started",
    help="Processes that evaluate; the result does not depend on them.",
)
@cluster_option("as it was started")
@until_option
@click.option(
    "--recipe",
    "revised",
    metavar="RECIPE",
    show_default="the run's own",
    help="Go on by another recipe: other weights, targets, bounds, parameters, more generations, "
    "[stop], [notify] or [evaluation]. It may have more measures too, by which all births so far "
    "are scored first; those of the run it keeps, as goals, bounds or in run.record. Its measures "
    "are executed.",
)
@click.option(
    "--accept-changes",
    is_flag=True,
    help="Go on although a measure's source, or what else the run started from, has changed.",
)
@trust_option
@click.option(
    "--set-aside",
    is_flag=True,
    help="Move damaged files at the end of the run to its folder damaged/, and breed their "
    "generations again: the same births.",
)
def resume(
    folder: Path, generations, workers, cluster, until, revised, accept_changes, trust, set_aside
) -> None:
    """Go on with the run in the folder RUN.

    It goes on after its last whole generation, however it ended, as if it had not been
    stopped: the same births, bit for bit. A run that is finished only gets its report written
    again, unless --generations asks for more. What stopped it may hold still, a target or
    stagnation: then it stops at once and says what to change; --generations goes on in spite of
    these. Measures and
    commands of your own that the recipe names are executed.
    """

    if set_aside:
        from evocity import store

        moved = store.set_aside(folder)
        for name in moved:
            echo(f"set aside: {name}", err=True)
        if not moved:
            note("no file of births or membership is damaged")

    trust = revised is None and confirmed(folder, trust)

    def start(tell):
        with blaming_options(generations=generations, until=until):
            return evocity.Search.resume(
                folder,
                generations=generations,
                workers=workers,
                cluster=cluster,
                until=until,
                recipe=revised,
                accept_changes=accept_changes,
                trust=trust,
                progress=tell,
            )

    carry_out(start, folder)
