"""`evocity report`: the page of a run, written anew."""

from pathlib import Path

import click

import evocity
from evocity.cli.common import check_output, echo


@click.command(
    epilog="""\b
Examples:
  evocity report runs/lyon-x-montpellier
  evocity report runs/lyon-x-montpellier -o so-far.html"""
)
@click.argument("run", metavar="RUN")
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    metavar="HTML",
    show_default="report.html in RUN",
    help="Page to write; overwritten if it exists.",
)
def report(run: str, output: Path | None) -> None:
    """Write the report of the run in the folder RUN, and say where it is.

    The run may be finished, stopped or still going on: the report tells of its whole
    generations. Nothing else in RUN is changed, and nothing in it is executed.
    """
    from evocity.report import write_report

    evocity.open_run(run)  # what is no run is told before the output is looked at
    if output is not None:
        check_output(output, run, {".html", ".htm"})
    echo(f"report: {write_report(run, output)}")
