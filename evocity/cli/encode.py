"""`evocity encode`: the genome of a map."""

from collections.abc import Sequence
from math import inf
from pathlib import Path

import click

import evocity
from evocity.cli.shared.checks import check_block, check_genome_output, report_write_errors
from evocity.cli.shared.options import (
    HEIGHTS,
    NUMBERS,
    REACH,
    SIDES,
    json_option,
    map_options,
    option,
    output_option,
)
from evocity.cli.shared.terminal import (
    describe,
    echo,
    note_compiling,
    note_reading,
    print_json,
    progress_bar,
    warn,
)
from evocity.errors import EvocityError


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
@output_option("GENOME", "Genome file to write, usually .parquet")
@option(
    "--block SIDE|FINEST-LARGEST",
    "Finest and largest side of range blocks, pixels, or one side. [2-16]",
    SIDES,
)
@option("--lifs N", "Largest number of leaves. [one for 8 px of map]", int)
@option("--max-error METRES", "Collage error above which leaves split; replaces --lifs.", float)
@option("--domains N[,N…]", "Sides of the domain blocks, in range blocks.", NUMBERS, "2")
@option(
    "--reach PIXELS|all", "Largest distance of a domain block from its range block.", REACH, "24"
)
@option("--sigma-max", "Bound on |σ|; below 1, decoding always converges.", default=0.9)
@option("--fit/--no-fit", "Refine σ and β until the decoded map is closest.", default=True)
@option("--settle/--no-settle", "Give each decoded building its median height.", default=True)
@option(
    "--topological SHARE",
    "Margin of error within which the surroundings choose the domain block. [the first of equals]",
    float,
)
@option(
    "--lock locks FILE...",
    "Footprints, or a mask of values above 0; their pixels keep their heights in all descendants.",
)
@option("--lock-heights FILE|METRES", "Heights of the locked pixels. [the map's own]", HEIGHTS)
@map_options
@json_option
def encode(map, output: Path, locks, lock_heights, reading, as_json: bool, **coding) -> None:
    """Code MAP as a fractal genome.

    MAP is the name of a bundled district, or a file: GeoJSON, GeoPackage, Shapefile, OSM XML and
    PBF, CityJSON, GeoTIFF, PNG or NPY. The genome file is Parquet, with a row per lifs: DuckDB,
    polars and pandas read it directly.

    With --block 2-16, range blocks are leaves whose sides follow the city; with --block 4, all
    range blocks have one side. With --max-error, a leaf splits while its root-mean-square error is
    larger; leaves of the finest side never split. With --no-settle roofs are fractal, as in the
    papers. With --topological 0, the surroundings decide only between equally good domain blocks.
    With --lock-heights, the locked pixels get another height, of a new building or 0 for a river.

    JSON keys: psnr (of the decoded genome, dB), collage_rmse (metres), lifs, uniform (number of
    flat range blocks, coded without search), pairs (compared pairs of range and domain blocks),
    seconds (of the search and the fit).
    """
    sources = [source for source in (*locks, lock_heights) if isinstance(source, str)]
    check_genome_output(output, map, *sources)
    note_compiling()
    city = evocity.read_map(map, **reading)
    note_reading(city, reading)
    check_block(city, coding["block"])
    city, layer = _lock(city, locks, lock_heights)
    steepest = coding["sigma_max"]
    if steepest >= 1:
        warn(f"--sigma-max {steepest:g}: decoding may diverge; below 1 it always converges")
    with progress_bar(f"coding {city.name}") as progress:
        encoding = evocity.encode(city, **coding, condensation=layer, progress=progress)
    psnr = encoding.psnr  # decodes: a code that diverges fails before anything is written
    with report_write_errors(output):
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
        rules = ", ".join(
            f"{count} missing" if rule == "default" else f"{count} from {rule}"
            for rule, count in city.height_rules.items()
        )
        echo(f"heights of buildings: {rules}")
    if layer is not None:
        echo(f"locked: {len(layer)} of {layer.mask.size} px")
    echo(
        f"{len(encoding.genome)} lifs{_leaves(encoding.genome.pavement)}, {encoding.uniform} of "
        "them uniform; "
        f"{encoding.pairs:,} pairs searched{', attractor fitted,' if coding['fit'] else ''} "
        f"in {encoding.seconds:.1f} s"
    )
    if encoding.above:
        echo(f"{encoding.above} leaves of the finest side stay above {coding['max_error']:g} m")
    flat = ""
    if encoding.genome.settle:
        raw = encoding.psnr_unsettled
        before = "exact" if raw == inf else f"{raw:.1f} dB"
        flat = f" ({before} with fractal roofs, before each building got one height)"
    fidelity = "exactly" if psnr == inf else f"PSNR {psnr:.1f} dB{flat}"
    echo(f"decoded {fidelity}, collage error {encoding.collage_rmse:.2f} m (RMS)")
    echo(f"wrote {output}")


def _lock(city, locks: Sequence[str], heights: float | str | None):
    """The map with the attribution of its locks, and the locked layer, or None."""
    if not locks:
        if heights is not None:
            raise EvocityError(
                f"--lock-heights {heights} without --lock",
                "--lock FILE, which marks the locked pixels",
                "name footprints or a mask with --lock, or leave --lock-heights out",
            )
        return city, None
    from evocity.condensation import merged
    from evocity.genome import joined
    from evocity.io import read_condensation

    pairs = (read_condensation(lock, city, heights) for lock in locks)
    layers, attributions = zip(*pairs, strict=True)
    credit = joined([city.attribution, *attributions])
    return city.replace(city.heights, attribution=credit), merged(layers)


def _leaves(pavement) -> str:
    """The number of range blocks of each side, if there are several sides."""
    if pavement.uniform:
        return ""
    each = ", ".join(f"{which.size} of {side}" for side, which in pavement.levels.items())
    return f" ({each} px)"
