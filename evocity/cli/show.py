"""`evocity show`: a map, a genome or a run becomes a picture."""

from pathlib import Path

import click

import evocity
from evocity.cli.common import check_output, count_option, echo, map_options, output_option, writing
from evocity.cli.given import (
    city_of,
    decoded,
    fabric_in,
    genome_of,
    ids_option,
    one_id,
    refuse_reading,
)
from evocity.errors import EvocityError

#: Title of the picture of each count.
_COUNTS = {
    "pixels": "calls of each pixel",
    "domains": "calls of the domain blocks",
    "ranges": "calls of what each range block is made of",
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
@output_option("PNG", "Picture to write; overwritten if it exists.")
@ids_option(
    "Which individual of a run folder, by the number its report and `status` give it. Give it "
    "several times for a contact sheet."
)
@click.option(
    "--leaves",
    is_flag=True,
    help="Of a genome: the borders of its range blocks, over its map.",
)
@click.option(
    "--usage",
    is_flag=True,
    help="Draw how often a genome's code calls each pixel, instead of heights.",
)
@count_option
@click.option(
    "--ancestry",
    is_flag=True,
    help="Draw which source city each pixel of a genome comes from, a colour each.",
)
@click.option(
    "--depth",
    type=int,
    show_default="the limit",
    help="With --ancestry: how many domain blocks to look back over; 0 for the city of each "
    "range block alone.",
)
@map_options
def show(
    what: str, output: Path, identifiers, leaves, usage, count, ancestry, depth, reading
) -> None:
    """Draw a map, the map of a genome, or the best of a run.

    Heights are drawn on a colour scale in metres, with a scale bar and the attribution of the
    sources. A run folder shows its parents and the best of its last generation side by side, or
    the individual named by --id, or several of them with their scores. A run of map_elites shows
    its grid: in each filled cell the map of its best birth.

    --leaves, --usage and --ancestry draw what a genome's code is made of, over its map.
    """
    flags = {"--leaves": leaves, "--usage": usage, "--ancestry": ancestry}
    asked = [flag for flag, given in flags.items() if given]
    _check_wanted(asked, count, depth)
    check_output(output, what, {".png"})
    several = len(identifiers) > 1 and not asked
    identifier = None if several else one_id(identifiers)
    if asked:
        refuse_reading(asked[0], reading)
        genome = fabric_in(genome_of(what, identifier), what)
        if leaves:
            _show_leaves(genome, decoded(genome, what, identifier), output)
        elif usage:
            _show_usage(genome, decoded(genome, what, identifier), count or "pixels", output)
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


def _check_wanted(asked: list[str], count: str | None, depth: int | None) -> None:
    if len(asked) > 1:
        raise EvocityError(" and ".join(asked), "one of them", "make one picture after the other")
    if count is not None and "--usage" not in asked:
        raise EvocityError("--count without --usage", "both", "add --usage")
    if depth is not None and "--ancestry" not in asked:
        raise EvocityError("--depth without --ancestry", "both", "add --ancestry")


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

    found = usage(genome)
    values = getattr(found, count)
    write_field(Field(city, values.astype("float32"), _COUNTS[count], "calls"), output)
    calling, never = int((found.calls > 0).sum()), float((found.pixels == 0).mean())
    echo(
        f"{len(found.domain_calls)} domain blocks serve {calling} of {len(genome)} lifs, "
        f"the most called {found.domain_calls.max(initial=0)} of them; "
        f"a pixel is called up to {found.pixels.max()} times, {never:.0%} of them never"
    )


def _show_ancestry(genome, source: str, identifier, depth: int | None, output: Path) -> None:
    from evocity.coding import ancestry
    from evocity.genome import VOID
    from evocity.io import write_shares
    from evocity.pictures import Shares
    from evocity.pictures.palette import VOID_TOLD

    weights = ancestry(genome, depth=depth)
    title = "ancestry" if depth is None else f"ancestry to depth {depth}"
    city = decoded(genome, source, identifier)
    parts = tuple(VOID_TOLD if name == VOID else name for name in genome.cities)
    write_shares(Shares(city, weights, parts, title), output)
    shares = zip(genome.cities, weights.mean(axis=(0, 1), dtype=float), strict=True)
    echo(", ".join(f"{name} {share:.1%}" for name, share in shares if share > 0))


def _show_run(folder: str, output: Path, reading) -> None:
    from evocity.files import whole_file
    from evocity.report import run_picture

    refuse_reading(f"the run {folder}", reading)
    picture = run_picture(evocity.open_run(folder))
    with writing(output), whole_file(output) as temporary:
        picture.save(temporary, format="PNG")
