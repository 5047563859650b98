"""`evocity keep`: which individuals of a run are worth keeping, and why."""

from pathlib import Path

import click

import evocity
from evocity.cli.common import check_output, echo, json_option, print_json
from evocity.errors import EvocityError, keyword, setting


@click.command(
    epilog="""\b
Examples:
  evocity keep runs/lyon-x-montpellier
  evocity keep runs/lyon-x-montpellier --count 8 -o sheet.png
  evocity keep runs/lyon-x-montpellier -o chosen.zip --at lyon-1er"""
)
@click.argument("run", metavar="RUN")
@click.option(
    "--count",
    type=click.IntRange(min=1),
    default=5,
    show_default=True,
    metavar="N",
    help="So many, or as many as differ.",
)
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    metavar="PNG|ZIP",
    show_default="none",
    help="Write them too: .png, a contact sheet with their scores; .zip, of each its map, "
    "footprints, picture, genome and scene. Overwritten if it exists.",
)
@click.option(
    "--at",
    metavar="CITY",
    show_default="where all source cities lie, else nowhere on Earth",
    help="Source city of RUN on whose ground maps, footprints and genomes in a .zip are laid.",
)
@json_option
def keep(run: str, count: int, output: Path | None, at: str | None, as_json: bool) -> None:
    """Say which individuals of RUN to keep, and why.

    They are the best compromise, the best by each goal, and such as look like none of these, out
    of all births that no other ever dominated. Each has its number, its role, the reason, and
    what it gave up, and whose stones its buildings are. The report of RUN begins with them. RUN
    may still go on, and nothing in it is changed or executed.

    JSON keys: kept, a list of id, role, why, gave_up, built (source city to share of what is built;
    null where nothing is made of stones) and scores (measure to value); untraced, the source cities
    of which in none of them more than 0.01 of what is built is made.
    """
    if output is not None:
        check_output(output, run, {".png", ".zip"})
    if at is not None and output is None:
        raise EvocityError(
            f"{setting('at', at)} without a file",
            f"files that are laid there: {keyword('output')} with a name that ends in .zip",
            f"leave {keyword('at')} out, or write a .zip",
        )
    opened = evocity.open_run(run)
    kept = opened.keep(count)
    if output is not None:
        opened.save(kept, output, at=at)
    if as_json:
        told = [
            {
                "id": one.individual.id,
                "role": one.role,
                "why": one.why,
                "gave_up": one.gave_up,
                "built": one.built if opened.header.chromosome.stones else None,
                "scores": one.individual.scores,
            }
            for one in kept
        ]
        print_json({"kept": told, "untraced": kept.untraced})
        return
    for one in kept:
        echo(f"{one.individual.id}  {one.role}")
        for sentence in one.reasons:
            echo(f"    {sentence}")
    if kept.untraced:
        echo(f"\n{kept.lacking} docs/analysis.md#children-of-all-parents tells how to find others.")
    if output is not None:
        echo(f"wrote {output}")
    from evocity.analysis.placing import command_for_blender, command_for_gis

    first = kept[0].individual
    echo(f"\nOne of them as a file for QGIS:\n  {command_for_gis(run, first.id, first.ground)}")
    echo(f"For Blender:\n  {command_for_blender(run, first.id)}")


__all__ = ["keep"]
