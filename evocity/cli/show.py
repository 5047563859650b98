"""`evocity show`: the picture of a map, a genome or a run."""

from pathlib import Path

import click

import evocity
from evocity.cli.shared.checks import check_output, replace_file
from evocity.cli.shared.inputs import city_of, decode_genome, fabric_in, genome_of, refuse_reading
from evocity.cli.shared.options import (
    count_option,
    flag,
    ids_option,
    map_options,
    one_id,
    option,
    output_option,
)
from evocity.cli.shared.terminal import echo
from evocity.errors import EvocityError

#: Titles of pictures of --usage, by --count.
_COUNTS = {
    "pixels": "calls of each pixel",
    "domains": "calls of the domain blocks",
    "ranges": "calls of each range block's domain block",
}


@click.command(
    epilog="""\b
Examples:
  evocity show lyon-1er -o lyon.png
  evocity show runs/lyon-x-montpellier -o bred.png
  evocity show runs/lyon-x-montpellier --id 97 -o one.png
  evocity show runs/lyon-x-montpellier --id 97 --id 12 --id 40 -o sheet.png
  evocity show runs/lyon-x-montpellier --id 97 --ancestry -o whose.png
  evocity show lyon.parquet --leaves -o leaves.png
  evocity show lyon.parquet --usage -o calls.png"""
)
@click.argument("what", metavar="MAP|GENOME|RUN")
@output_option("PNG", "Picture to write")
@ids_option("several give a contact sheet")
@flag("--leaves", "Draw the borders of a genome's range blocks, over its map.")
@flag("--usage", "Draw how often a genome's code calls each pixel.")
@count_option
@flag("--ancestry", "Draw the source city of each pixel of a genome.")
@option("--depth", "Number of domain blocks that --ancestry traces back. [the limit]", int)
@map_options
def show(
    what: str, output: Path, identifiers, leaves, usage, count, ancestry, depth, reading
) -> None:
    """Draw a map, the map of a genome, or the best of a run.

    Pictures have a colour scale of heights in metres, a scale bar and the attribution of the
    sources. For a run folder, the picture shows the parents and the best of the last generation
    side by side. With --id, the picture shows one individual, or several with their scores. For a
    run of map_elites, the picture shows the grid: in each filled cell, the map of the best birth.

    --leaves, --usage and --ancestry draw the code of a genome over its map. With --ancestry --depth
    0, each pixel shows the source city of its range block.
    """
    flags = {"--leaves": leaves, "--usage": usage, "--ancestry": ancestry}
    parts = [name for name, given in flags.items() if given]
    _check_options(parts, count, depth)
    check_output(output, what, {".png"})
    several = len(identifiers) > 1 and not parts
    identifier = None if several else one_id(identifiers)
    if parts:
        refuse_reading(parts[0], reading)
        genome = fabric_in(genome_of(what, identifier), what)
        if leaves:
            _show_leaves(genome, decode_genome(genome, what, identifier), output)
        elif usage:
            _show_usage(genome, decode_genome(genome, what, identifier), count or "pixels", output)
        else:
            _show_ancestry(genome, what, identifier, depth, output)
    elif several:
        refuse_reading(f"the run {what}", reading)
        evocity.open_run(what).save(identifiers, output)
    elif identifier is not None or not Path(what).is_dir():
        evocity.write_map(city_of(what, reading, identifier), output)
    else:
        _show_run(what, output, reading)
    echo(f"wrote {output}")


def _check_options(parts: list[str], count: str | None, depth: int | None) -> None:
    if len(parts) > 1:
        raise EvocityError(
            " and ".join(parts), "one of these options", "make one picture after the other"
        )
    if count is not None and "--usage" not in parts:
        raise EvocityError("--count without --usage", "--count with --usage", "add --usage")
    if depth is not None and "--ancestry" not in parts:
        raise EvocityError(
            "--depth without --ancestry", "--depth with --ancestry", "add --ancestry"
        )


def _show_leaves(genome, city, output: Path) -> None:
    from evocity.io import write_leaves
    from evocity.pictures import Leaves

    write_leaves(Leaves(city, genome.pavement), output)
    each = (f"{which.size} of {side}" for side, which in genome.pavement.levels.items())
    echo(f"{len(genome)} lifs, a range block each: {', '.join(each)} px")


def _show_usage(genome, city, count: str, output: Path) -> None:
    from evocity.coding import usage
    from evocity.io import write_field
    from evocity.pictures import Field

    calls = usage(genome)
    values = getattr(calls, count)
    write_field(Field(city, values.astype("float32"), _COUNTS[count], "calls"), output)
    calling, never = int((calls.calls > 0).sum()), float((calls.pixels == 0).mean())
    echo(
        f"{len(calls.domain_calls)} domain blocks serve {calling} of {len(genome)} lifs; "
        f"the most called serves {calls.domain_calls.max(initial=0)}; "
        f"a pixel has up to {calls.pixels.max()} calls, and {never:.0%} have none"
    )


def _show_ancestry(genome, source: str, identifier, depth: int | None, output: Path) -> None:
    from evocity.coding import ancestry
    from evocity.genome import VOID
    from evocity.io import write_shares
    from evocity.pictures import Shares
    from evocity.pictures.colours import VOID_LABEL

    weights = ancestry(genome, depth=depth)
    title = "ancestry" if depth is None else f"ancestry to depth {depth}"
    city = decode_genome(genome, source, identifier)
    parts = tuple(VOID_LABEL if name == VOID else name for name in genome.cities)
    write_shares(Shares(city, weights, parts, title), output)
    shares = zip(genome.cities, weights.mean(axis=(0, 1), dtype=float), strict=True)
    echo(", ".join(f"{name} {share:.1%}" for name, share in shares if share > 0))


def _show_run(folder: str, output: Path, reading) -> None:
    from evocity.report import run_picture

    refuse_reading(f"the run {folder}", reading)
    picture = run_picture(evocity.open_run(folder))
    with replace_file(output) as temporary:
        picture.save(temporary, format="PNG")
