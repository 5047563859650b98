"""`evocity encode`: a map becomes a genome."""

from collections.abc import Sequence
from math import gcd, inf
from pathlib import Path

import click

import evocity
from evocity.cli.common import (
    check_output,
    describe,
    echo,
    json_option,
    map_options,
    note_compiling,
    note_reading,
    output_option,
    print_json,
    progress_bar,
    warn,
    writing,
)
from evocity.errors import EvocityError, GenomeError


class Domains(click.ParamType):
    """Whole numbers with commas between."""

    name = "list"

    def convert(self, value, param, ctx) -> tuple[int, ...]:
        if isinstance(value, tuple):
            return value
        try:
            return tuple(int(part) for part in value.split(","))
        except ValueError:
            self.fail(f"{value!r} is no list of whole numbers such as 2 or 2,3", param, ctx)


class Sides(click.ParamType):
    """One side of range blocks, or a range of sides."""

    name = "sides"

    def convert(self, value, param, ctx) -> int | tuple[int, int]:
        if not isinstance(value, str):
            return value
        from evocity.pavement import read_sides

        try:
            return read_sides(value)
        except GenomeError as error:
            self.fail(f"{value!r}; expected: {error.expected}, {error.remedy}", param, ctx)


class _Heights(click.ParamType):
    name = "heights"

    def convert(self, value, param, ctx) -> float | str:
        try:
            return float(value)
        except ValueError:
            return value


class Reach(click.ParamType):
    """Pixels, or "all" for the whole map, which is None."""

    name = "reach"

    def convert(self, value, param, ctx) -> int | None:
        if value is None or value == "all":
            return None
        try:
            return int(value)
        except ValueError:
            self.fail(f"{value!r} is neither a whole number of pixels nor all", param, ctx)


@click.command(
    epilog="""\b
Examples:
  evocity encode lyon-1er -o lyon.parquet
  evocity encode buildings.gpkg --center 4.834 45.768 --reach all -o here.parquet
  evocity encode lyon-1er --block 2-16 --lifs 4096 -o fewer.parquet
  evocity encode lyon-1er --max-error 0.5 -o true.parquet
  evocity encode lyon-1er --block 4 --no-fit --no-settle -o as-in-the-papers.parquet
  evocity encode lyon-1er --lock listed.geojson -o lyon.parquet
  evocity encode dsm.png --metres-per-pixel 2 --height-scale 0.5 --json -o dsm.parquet"""
)
@click.argument("map", metavar="MAP")
@output_option("GENOME", "Genome file to write, usually .parquet; overwritten if it exists.")
@click.option(
    "--block",
    type=Sides(),
    metavar="SIDE|FINEST-LARGEST",
    show_default="2-16",
    help="Sides of the range blocks, pixels: leaves that follow the city, 2-16, or one side, 4.",
)
@click.option(
    "--lifs",
    type=int,
    metavar="N",
    show_default="one for 8 px of map",
    help="Of leaves: how many there may be at most. Simple maps take fewer.",
)
@click.option(
    "--max-error",
    type=float,
    metavar="METRES",
    show_default="none",
    help="Of leaves, instead of --lifs: the collage error (root mean square) above which they are "
    "split; the finest stay.",
)
@click.option(
    "--domains",
    type=Domains(),
    metavar="N[,N…]",
    default="2",
    show_default=True,
    help="Sides of the domain blocks in range blocks; 2,3 searches D = 2B and 3B.",
)
@click.option(
    "--reach",
    type=Reach(),
    metavar="PIXELS|all",
    default="24",
    show_default=True,
    help="How far a domain block may lie from its range block; all = the whole map.",
)
@click.option(
    "--sigma-max",
    default=0.9,
    show_default=True,
    help="Bound on |σ|; below 1 decoding always converges.",
)
@click.option(
    "--fit/--no-fit",
    default=True,
    show_default=True,
    help="Refine σ and β to bring the decoded map, before roofs are settled, closest: a second "
    "or two.",
)
@click.option(
    "--settle/--no-settle",
    default=True,
    show_default=True,
    help="Lay each building of the decoded map at its median height; without, roofs are fractal, "
    "as in the papers.",
)
@click.option(
    "--topological",
    type=float,
    metavar="SHARE",
    show_default="the first of equals",
    help="Let the surroundings decide between domain blocks whose error is within this share of "
    "the best; 0 decides ties alone.",
)
@click.option(
    "--lock",
    "locks",
    multiple=True,
    metavar="FILE",
    show_default="nothing",
    help="Footprints, or a mask above 0 where it counts, on the map: what they cover keeps its "
    "heights pixel for pixel, in this genome and in all that are bred of it. Give it once for each "
    "of several.",
)
@click.option(
    "--lock-heights",
    type=_Heights(),
    metavar="FILE|METRES",
    show_default="the map's own",
    help="What stands in the locked pixels instead: a new building, or 0 for a river.",
)
@map_options
@json_option
def encode(
    map,
    output: Path,
    block,
    lifs,
    max_error,
    domains,
    reach,
    sigma_max,
    fit,
    settle,
    topological,
    locks,
    lock_heights,
    reading,
    as_json,
) -> None:
    """Code MAP as a fractal genome.

    MAP is a file or the name of a bundled district. Reads GeoJSON, GeoPackage, Shapefile, OSM
    XML and PBF, CityJSON, GeoTIFF, PNG and NPY. The genome file is Parquet, one row a lifs:
    DuckDB, polars and pandas read it as it is.

    JSON keys: psnr (dB, of the decoded genome), collage_rmse (metres), lifs, uniform (flat
    range blocks, coded without search), pairs (range and domain blocks compared), seconds (of
    the search, and of the fit if asked for).
    """
    for source in (map, *locks, lock_heights):
        if isinstance(source, str):
            check_output(output, source)
    check_no_map_name(output)
    note_compiling()
    city = evocity.read_map(map, **reading)
    note_reading(city, reading)
    check_block(city, block)
    city, layer = _locked(city, locks, lock_heights)
    if sigma_max >= 1:
        warn(f"--sigma-max {sigma_max:g}: decoding may diverge; below 1 it always converges")
    with progress_bar(f"coding {city.name}") as progress:
        encoding = evocity.encode(
            city,
            block=block,
            lifs=lifs,
            max_error=max_error,
            domains=domains,
            reach=reach,
            sigma_max=sigma_max,
            fit=fit,
            settle=settle,
            topological=topological,
            condensation=layer,
            progress=progress,
        )
    psnr = encoding.psnr  # decodes: a code that diverges is told before anything is written
    with writing(output):
        encoding.genome.write(output)
    if as_json:
        print_json(
            {
                "psnr": psnr,
                "collage_rmse": encoding.collage_rmse,
                "lifs": len(encoding.genome),
                "uniform": encoding.uniform,
                "pairs": encoding.pairs,
                "seconds": encoding.seconds,
            }
        )
        return
    echo(describe(city))
    if city.height_rules:
        rules = ", ".join(f"{count} by {rule}" for rule, count in city.height_rules.items())
        echo(f"heights of buildings: {rules}")
    if layer is not None:
        echo(f"locked: {len(layer)} of {layer.mask.size} px")
    echo(
        f"{len(encoding.genome)} lifs{_leaves(encoding.genome.pavement)}, {encoding.uniform} of "
        "them uniform; "
        f"{encoding.pairs:,} pairs searched{', attractor fitted,' if fit else ''} "
        f"in {encoding.seconds:.1f} s"
    )
    if encoding.above:
        echo(f"{encoding.above} leaves of the finest side stay above {max_error:g} m")
    flat = ""
    if encoding.genome.settle:
        raw = encoding.psnr_unsettled
        before = "exact" if raw == inf else f"{raw:.1f} dB"
        flat = f" ({before} before its roofs were settled: each building flat, so that it is whole)"
    fidelity = "exactly" if psnr == inf else f"PSNR {psnr:.1f} dB{flat}"
    echo(f"decoded {fidelity}, collage error {encoding.collage_rmse:.2f} m (RMS)")
    echo(f"wrote {output}")


def _locked(city, locks: Sequence[str], heights: float | str | None):
    """The map with the attribution of what is locked in it, and that layer, or None."""
    if not locks:
        if heights is not None:
            raise EvocityError(
                f"--lock-heights {heights} without --lock",
                "--lock FILE, which tells what is locked",
                "name footprints or a mask with --lock, or leave --lock-heights out",
            )
        return city, None
    from evocity.condensation import merged
    from evocity.genome import joined
    from evocity.io import read_condensation

    layers, told = zip(*(read_condensation(one, city, heights) for one in locks), strict=True)
    credit = joined([city.attribution, *told])
    return city.replace(city.heights, attribution=credit), merged(layers)


def _leaves(pavement) -> str:
    """How many range blocks there are of each side, if there are several."""
    if pavement.uniform:
        return ""
    each = ", ".join(f"{which.size} of {side}" for side, which in pavement.levels.items())
    return f" ({each} px)"


def check_block(city, block) -> None:
    """Raise if the range blocks do not cover a map, naming options that would do."""
    height, width = city.shape
    if block is None:
        return
    finest, block = (None, block) if isinstance(block, int) else block
    if block < 2 or not (height % block or width % block):
        return
    side = min(height, width) // block * block
    if finest is None:
        largest = min(height, width) // 2  # a domain block is at least twice as large
        fitting = [size for size in range(2, largest + 1) if gcd(height, width) % size == 0]
        near = min(fitting, key=lambda size: abs(size - block), default=None)
    else:
        from evocity.pavement.levels import halved_sides

        roots = [side for side in halved_sides(finest, block) if side > finest]
        root = next((side for side in roots if gcd(height, width) % side == 0), None)
        near = None if root is None else f"{finest}-{root}"
    options = [f"--pixels {side}"] * (side > 0) + [f"--block {near}"] * (near is not None)
    raise EvocityError(
        f"{city.name}: {height} × {width} px for range blocks of {block} px",
        f"sides that are multiples of {block}",
        f"give {' or '.join(options) or 'another window'}",
    )


def check_no_map_name(output: Path) -> None:
    """Raise if ``output``, a genome file to be, is named like a map."""
    from evocity.io import suffixes

    if any(output.name.lower().endswith(suffix) for suffix in suffixes()):
        raise EvocityError(
            f"{output.name}: the name of a map for a genome",
            "a genome file's name, such as genome.parquet",
            "choose a name that ends in .parquet; to write a map, use evocity decode",
        )
