"""`evocity keep`: the individuals of a run that are worth keeping, and why."""

from pathlib import Path

import click

import evocity
from evocity.cli.shared.checks import check_output
from evocity.cli.shared.options import POSITIVE, at_option, json_option, option, output_option
from evocity.cli.shared.terminal import echo, print_json
from evocity.errors import EvocityError, keyword, setting


@click.command(
    epilog="""\b
Examples:
  evocity keep runs/lyon-x-montpellier
  evocity keep runs/lyon-x-montpellier --count 8 -o sheet.png
  evocity keep runs/lyon-x-montpellier -o chosen.zip --at lyon-1er"""
)
@click.argument("run", metavar="RUN")
@option("--count N", "Largest number of individuals.", POSITIVE, 5)
@output_option(
    "PNG|ZIP",
    "File to write: .png (contact sheet), .zip (map, footprints, picture, genome, scene of each)",
    required=False,
)
@at_option
@json_option
def keep(run: str, count: int, output: Path | None, at: str | None, as_json: bool) -> None:
    """Print which individuals of RUN to keep, and why.

    These individuals are the best compromise, the best by each goal, and a few that look unlike all
    of these. No other birth ever dominated these individuals. For each individual, the command
    prints the number, the role, the reason, what the individual gave up, and the sources of its
    buildings. The report of RUN begins with the same individuals. RUN may still be running; the
    command changes and executes nothing in RUN.

    With --at, the maps, footprints and genomes in a .zip get a place on Earth.

    JSON keys: kept, a list of id, role, why, gave_up, built (by source city, its share of the built
    area; null where nothing comes from source cities) and scores (by measure, its value); untraced
    (the source cities that have at most 0.01 of the built area in each kept individual).
    """
    if output is not None:
        check_output(output, run, {".png", ".zip"})
    if at is not None and output is None:
        raise EvocityError(
            f"{setting('at', at)} needs an output file",
            f"{keyword('output')} with a name that ends in .zip",
            f"leave {keyword('at')} out, or write a .zip",
        )
    opened = evocity.open_run(run)
    kept = opened.keep(count)
    if output is not None:
        opened.save(kept, output, at=at)
    if as_json:
        listed = [
            {
                "id": choice.individual.id,
                "role": choice.role,
                "why": choice.why,
                "gave_up": choice.gave_up,
                "built": choice.built if opened.header.chromosome.ancestry_columns else None,
                "scores": choice.individual.scores,
            }
            for choice in kept
        ]
        print_json({"kept": listed, "untraced": kept.untraced})
        return
    for choice in kept:
        echo(f"{choice.individual.id}  {choice.role}")
        for sentence in choice.reasons:
            echo(f"    {sentence}")
    if kept.untraced:
        echo(f"\n{kept.lacking} docs/analysis.md#children-of-all-parents shows how to find others.")
    if output is not None:
        echo(f"wrote {output}")
    from evocity.analysis.georeference import command_for_blender, command_for_gis

    first = kept[0].individual
    echo(f"\nOne of them as a file for QGIS:\n  {command_for_gis(run, first.id, first.ground)}")
    echo(f"For Blender:\n  {command_for_blender(run, first.id)}")
