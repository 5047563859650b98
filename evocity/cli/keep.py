"""`evocity keep`: the individuals of a run that are worth keeping, and why."""

from pathlib import Path

import click

import evocity
from evocity.cli.shared.checks import check_crs, check_output
from evocity.cli.shared.commands import command
from evocity.cli.shared.options import (
    POSITIVE,
    at_option,
    crs_option,
    json_option,
    option,
    output_option,
)
from evocity.cli.shared.terminal import echo, print_json
from evocity.errors import EvocityError, keyword, setting


@command("""
  evocity keep runs/lyon-x-montpellier
  evocity keep runs/lyon-x-montpellier --count 8 -o sheet.png
  evocity keep runs/lyon-x-montpellier -o chosen.zip --at lyon-1er""")
@click.argument("run", metavar="RUN")
@option("--count N", "Largest number of individuals to keep.", POSITIVE, 5)
@output_option(
    "PNG|ZIP",
    "File to write: .png (a contact sheet) or .zip (map, footprints, picture, genome and scene of "
    "each individual)",
    required=False,
)
@at_option
@crs_option
@json_option
def keep(
    run: str, count: int, output: Path | None, at: str | None, crs: str | None, as_json: bool
) -> None:
    """Print which individuals of RUN to keep, and why.

    The individuals to keep are the best compromise, the best individual for each goal, and a few
    individuals that look unlike the best individuals. No birth of the run dominates any of the
    individuals to keep. For each individual, the command prints the id, the role, the reason to
    keep the individual, the weaknesses, and the sources of the buildings. The command warns of
    source cities that have less than 10 % of the buildings. The report of RUN begins with the
    individuals to keep. The run may still be in progress, because the command changes and executes
    nothing in the run folder.

    With --at, the maps, footprints and genomes in a .zip file get the coordinates of a source city.
    With --crs, the maps, footprints and scenes get another reference system.

    The JSON document has the keys "kept" and "untraced". The key "kept" lists the individuals, each
    with the keys "id", "role", "why", "gave_up", "built" and "scores". The key "built" contains the
    share of the built area from each source city, or null if nothing comes from source cities. The
    key "untraced" lists the source cities that supply at most 1 % of the built area in every kept
    individual.
    """
    if output is not None:
        check_output(output, run, {".png", ".zip"})
    for name, value in (("at", at), ("crs", crs)):
        if value is not None and output is None:
            raise EvocityError(
                f"{setting(name, value)} is given without an output file",
                f"{keyword('output')} together with an output file whose name ends in .zip",
                f"leave {keyword(name)} out, or write a .zip file",
            )
    if output is not None:
        check_crs(crs, output, [".zip"])
    opened = evocity.open_run(run)
    kept = opened.keep(count)
    if output is not None:
        opened.save(kept, output, at=at, crs=crs)
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
    from evocity.analysis.individual import command_for_blender, command_for_gis

    first = kept[0].individual
    echo(f"\nOne of them as a file for QGIS:\n  {command_for_gis(run, first.id, first.ground)}")
    echo(f"For Blender:\n  {command_for_blender(run, first.id)}")
