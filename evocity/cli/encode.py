"""`evocity encode`: the genome of a map."""

from collections.abc import Sequence
from math import inf
from pathlib import Path

import click

import evocity
from evocity.cli.shared.checks import (
    check_block,
    check_genome_output,
    check_needs,
    report_write_errors,
)
from evocity.cli.shared.commands import command
from evocity.cli.shared.options import (
    HEIGHTS,
    NUMBERS,
    REACH,
    SIDES,
    json_option,
    map_options,
    option,
    output_option,
    settle_options,
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


@command("""
  evocity encode lyon-1er -o lyon.parquet
  evocity encode buildings.gpkg --center 4.834 45.768 --reach all -o here.parquet
  evocity encode lyon-1er --block 2-16 --lifs 4096 -o fewer.parquet
  evocity encode lyon-1er --max-error 0.5 -o true.parquet
  evocity encode lyon-1er --settle roofs -o closest.parquet
  evocity encode lyon-1er --block 4 --no-fit --no-settle -o as-in-the-papers.parquet
  evocity encode lyon-1er --lock listed.geojson -o lyon.parquet
  evocity encode dsm.png --metres-per-pixel 2 --height-scale 0.5 --json -o dsm.parquet""")
@click.argument("map", metavar="MAP")
@output_option("GENOME", "Genome file to write, usually .parquet")
@option(
    "--block SIDE|FINEST-LARGEST",
    "Smallest and largest side of range blocks in pixels, or a single side. [2-16]",
    SIDES,
)
@option(
    "--lifs N",
    "Largest number of lifs (affine maps) in the genome; each range block has one lifs. "
    "[one for each 8 px of the map]",
    int,
)
@option(
    "--max-error METRES",
    "Collage error above which the quadtree splits a range block; this option replaces --lifs.",
    float,
)
@option(
    "--domains N[,N…]",
    "Side of a domain block, divided by the side of the range block that copies the domain block.",
    NUMBERS,
    "2",
)
@option(
    "--reach PIXELS|all",
    "Largest distance between a range block and its domain block, in pixels.",
    REACH,
    "24",
)
@option(
    "--sigma-max",
    "Upper limit of the coefficient |σ|; with a limit below 1, decoding always converges.",
    default=0.9,
)
@option(
    "--fit/--no-fit",
    "Refine the coefficients σ and β of each lifs, to bring the decoded map as close as possible "
    "to MAP.",
    default=True,
)
@settle_options("buildings")
@option(
    "--topological SHARE",
    "Largest difference in error at which the surroundings of a range block decide between two "
    "domain blocks. [the first of equals]",
    float,
)
@option(
    "--lock locks FILE...",
    "File that marks the pixels to lock, with footprints or with raster values above 0. The "
    "locked pixels keep their heights in all descendants.",
)
@option(
    "--lock-heights FILE|METRES",
    "File or number with the new heights of the locked pixels. [the map's own]",
    HEIGHTS,
)
@map_options
@json_option
def encode(
    map, output: Path, locks, lock_heights, reading, settle, as_json: bool, **coding
) -> None:
    """Encode MAP as a fractal genome.

    MAP is the name of a bundled district, or a file. Files of footprints are GeoJSON, GeoPackage,
    Shapefile, GeoParquet, FlatGeobuf, File GDB, OSM XML, OSM PBF, Overpass JSON, KML and DXF. Files
    of solids are CityJSON, CityGML and GML. Rasters are GeoTIFF, ESRI ASCII grid, PNG and NPY. A
    zip may hold one of these. The genome file is a Parquet table with a row for each lifs. DuckDB,
    polars and pandas can read the genome file.

    With --block 2-16, a quadtree divides the map into range blocks with sides from 2 to 16 px. With
    --block 4, all range blocks have sides of 4 px. With --max-error, the quadtree splits a range
    block if the root-mean-square error of the block is above the given limit. The quadtree never
    makes range blocks smaller than the smallest side in --block. With --settle roofs, decoded maps
    keep steps of more than .5 m between roofs, and gaps of one pixel, and are closer to MAP. With
    --no-settle, decoded roofs keep their fractal heights and do not become flat. With --topological
    0, the surroundings of a range block decide only between equally good domain blocks. With
    --lock-heights, the locked pixels get new heights, for example the height of a new building, or
    0 for a river.

    The JSON document has the keys "psnr", "collage_rmse", "lifs", "uniform", "pairs" and "seconds".
    The key "psnr" is the fidelity of the decoded genome, in dB. The key "collage_rmse" is the
    collage error, in metres. The key "uniform" counts flat range blocks, which need no search. The
    key "pairs" counts the pairs of range and domain blocks that the search compared. The key
    "seconds" is the time of the search and the fit.
    """
    sources = [source for source in (*locks, lock_heights) if isinstance(source, str)]
    check_genome_output(output, map, *sources)
    note_compiling()
    city = evocity.read_map(map, **reading)
    note_reading(city, reading)
    check_block(city, coding["block"])
    city, layer = _lock(city, locks, lock_heights)
    coding["settle"] = True if settle is None else settle
    steepest = coding["sigma_max"]
    if steepest >= 1:
        warn(f"--sigma-max {steepest:g}: decoding may diverge; below 1 it always converges")
    with progress_bar(f"coding {city.name}") as progress:
        encoding = evocity.encode(city, **coding, condensation=layer, progress=progress)
    psnr = encoding.psnr  # decodes: a code that diverges fails before anything is written
    with report_write_errors(output):
        encoding.genome.write(output)
    if as_json:
        facts = {"psnr": psnr, "collage_rmse": encoding.collage_rmse, "lifs": len(encoding.genome)}
        print_json(facts | {key: getattr(encoding, key) for key in ("uniform", "pairs", "seconds")})
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
        each = "roof" if encoding.genome.settle == "roofs" else "building"
        flat = f" ({before} with fractal roofs, before each {each} got one height)"
    fidelity = "exactly" if psnr == inf else f"PSNR {psnr:.1f} dB{flat}"
    echo(f"decoded {fidelity}, collage error {encoding.collage_rmse:.2f} m (RMS)")
    echo(f"wrote {output}")


def _lock(city, locks: Sequence[str], heights: float | str | None):
    """The map with the attribution of its locks, and the locked layer, or None."""
    if not locks:
        check_needs(f"--lock-heights {heights}", "--lock FILE", heights is not None)
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
