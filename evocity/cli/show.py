"""`evocity show`: the picture of a map, a genome or a run."""

from pathlib import Path

import click

import evocity
from evocity.cli.shared.checks import check_needs, check_output, replace_file
from evocity.cli.shared.commands import command
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


@command("""
  evocity show lyon-1er -o lyon.png
  evocity show lyon-1er --plan -o plan.png
  evocity show lyon-1er --density fsi --radius 100 -o fsi.tif
  evocity show runs/lyon-x-montpellier -o bred.png
  evocity show runs/lyon-x-montpellier --id 97 -o one.png
  evocity show runs/lyon-x-montpellier --id 97 --id 12 --id 40 -o sheet.png
  evocity show runs/lyon-x-montpellier --id 97 --ancestry -o whose.png
  evocity show lyon.parquet --leaves -o leaves.png
  evocity show lyon.parquet --usage -o calls.png""")
@click.argument("what", metavar="MAP|GENOME|RUN")
@output_option("PNG", "Picture to write")
@ids_option("With several --id, the picture is a contact sheet")
@flag("--plan", "Draw the areas between the streets of a map.")
@flag("--leaves", "Draw the borders of a genome's range blocks over the map.")
@flag("--usage", "Draw how often a genome copies each pixel of the decoded map.")
@count_option
@flag("--ancestry", "Draw the source city of each pixel in the map of a genome.")
@option(
    "--density",
    "Draw the local density of a map, GSI or FSI around each pixel. [none]",
    click.Choice(["gsi", "fsi"]),
)
@option(
    "--radius M",
    "Radius in which --density counts, metres. [100]",
    click.FloatRange(0, min_open=True),
)
@option(
    "--depth",
    "Number of domain blocks that --ancestry follows back from each range block. [without limit]",
    int,
)
@map_options
def show(
    what: str,
    output: Path,
    identifiers,
    plan,
    leaves,
    usage,
    count,
    ancestry,
    density,
    radius,
    depth,
    reading,
) -> None:
    """Draw a picture of a map, of a decoded genome, or of the best individuals of a run.

    Pictures have a colour scale of heights in metres, a scale bar and the attribution of the
    sources. For a run folder, the picture shows the parents and the best individuals of the last
    generation side by side. With --id, the picture shows one individual, or several individuals
    with their scores. For a run with the algorithm map_elites, the picture shows the archive grid,
    with the best map in each filled cell; the grid needs the extra notebook.

    With --density, the picture shows GSI or FSI of the ground around each pixel. The output may
    also be a GeoTIFF (.tif) or an array (.npy).

    With --plan, the picture shows the areas between the streets, and the lots of buildings in these
    areas. A cross in each area between streets shows the directions of the walls in this area.

    The options --leaves, --usage and --ancestry draw properties of a genome over the decoded map.
    With --ancestry --depth 0, each pixel shows the source city of the range block that contains the
    pixel.
    """
    flags = {"--plan": plan, "--leaves": leaves, "--usage": usage, "--ancestry": ancestry}
    flags["--density"] = density
    parts = [name for name, given in flags.items() if given]
    _check_options(parts, count, depth, radius)
    check_output(output, what, {".png", ".tif", ".npy"} if density else {".png"})
    several = len(identifiers) > 1 and not parts
    identifier = None if several else one_id(identifiers)
    if plan:
        _show_plan(city_of(what, reading, identifier), output)
    elif density:
        _show_density(city_of(what, reading, identifier), density, radius or 100.0, output)
    elif parts:
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


def _check_options(
    parts: list[str], count: str | None, depth: int | None, radius: float | None
) -> None:
    if len(parts) > 1:
        raise EvocityError(
            " and ".join(parts), "one of these options", "make one picture after the other"
        )
    check_needs("--count", "--usage", count is not None and "--usage" not in parts)
    check_needs("--radius", "--density", radius is not None and "--density" not in parts)
    check_needs("--depth", "--ancestry", depth is not None and "--ancestry" not in parts)


def _show_plan(city, output: Path) -> None:
    import numpy as np

    from evocity.io import write_faces
    from evocity.operators.plans import plan_of
    from evocity.pictures import Faces

    plan = plan_of(city)
    angles = np.where(plan.open, np.nan, plan.angle)
    write_faces(Faces(city, plan.labels, plan.lots, plan.centre, angles), output)
    echo(f"{len(plan)} faces between streets, {np.count_nonzero(plan.open)} of them open")


def _show_density(city, density: str, radius: float, output: Path) -> None:
    import numpy as np

    from evocity.io import write_field
    from evocity.pictures import Field

    values = getattr(city.local_density(radius), density)
    title = f"{density.upper()} within {radius:g} m"
    write_field(Field(city, values.astype("float32"), title, density.upper()), output)
    low, high = np.nanmin(values), np.nanmax(values)
    echo(f"{title}: {low:.3g} to {high:.3g}, mean {np.nanmean(values):.3g}")


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
        f"a pixel has up to {calls.pixels.max()} calls, and {100 * never:.0f} % have none"
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
    echo(", ".join(f"{name} {100 * share:.1f} %" for name, share in shares if share > 0))


def _show_run(folder: str, output: Path, reading) -> None:
    from evocity.report import run_picture

    refuse_reading(f"the run {folder}", reading)
    picture = run_picture(evocity.open_run(folder))
    with replace_file(output) as temporary:
        picture.save(temporary, format="PNG")
