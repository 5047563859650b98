"""`evocity autosimilarity`: where a map is similar to itself."""

import csv
import math
from pathlib import Path

import click

import evocity
from evocity.cli.shared.checks import check_output, replace_file
from evocity.cli.shared.options import FILE, SIZES, json_option, map_options, option, output_option
from evocity.cli.shared.terminal import (
    describe,
    echo,
    note_compiling,
    note_reading,
    print_json,
    progress_bar,
)
from evocity.errors import EvocityError

#: Measure: title, symbol, unit, and whether B is free.
_MEASURES = {
    "mean": ("mean autosimilarity error", "mean µ", "", False),
    "least": ("least autosimilarity error", "least µ", "", None),
    "largest": ("largest block of least error", "B max", "px", True),
    "likeness": ("size of blocks times likeness", "(1 − µ)·B", "px", True),
    "domain": ("domain block of least error", "D best", "px", None),
}


@click.command(
    epilog="""\b
Examples:
  evocity autosimilarity lyon-1er --domains 20 -o lyon-mu.png
  evocity autosimilarity lyon-1er --block 4 --domains 5-16 --measure least -o lyon-mu.tif
  evocity autosimilarity lyon-1er --block 4,6,8 --measure likeness -o lyon-likeness.png
  evocity autosimilarity lyon-1er --domains 9-20 --measure domain --normalise variance -o d.png"""
)
@click.argument("map", metavar="MAP")
@output_option("FILE", "File to write: .tif (values with a place), .png (a picture), .npy (values)")
@option(
    "--block N[,N…]", "Sides B of the range blocks, pixels; several sides let B vary.", SIZES, "8"
)
@option(
    "--domains N[,N…]|N-N",
    "Sides D of the domain blocks, pixels; each B is compared only with larger D. [2B]",
    SIZES,
)
@option(
    "--measure",
    "Value to write for a pixel: mean µ, least µ, largest B, (1 − µ)·B, or best D. "
    "[mean; likeness if B is free]",
    click.Choice([*_MEASURES]),
)
@option(
    "--normalise",
    "Divisor of µ: the square of the map's range of heights, or the variance of the block.",
    click.Choice(["heights", "variance"]),
    "heights",
)
@option("--curve CSV", "CSV file for the mean of µ by D, a row for each B and D.", FILE)
@option("--threads", "Number of threads. [all cores]", int)
@map_options
@json_option
def autosimilarity(
    map, output: Path, block, domains, measure, normalise, curve, threads, reading, as_json
) -> None:
    """Write a map of the places where MAP is similar to itself (Marsault 2005, section 1.3).

    µ is the part of a range block that its best domain block does not explain, from 0 to 1. µ is 0
    where the map repeats itself exactly at another scale. The search is exact: it compares all
    positions of both blocks, in 8 isometries. MAP is a file or the name of a bundled district.

    The time grows with the fourth power of the map's side, and with the number of sides B and D. A
    map of 256 px takes about ten seconds with one B and one D.

    Some pixels have no value, for example flat ground with --normalise variance. Pixels without a
    value are NaN in .tif and .npy and grey in pictures, and the printed figures leave them out.

    JSON keys: measure, normalise, lowest, mean, highest (of the written values; null if there are
    none), known (share of the pixels that have a value), curve (by B and D, the mean of µ),
    seconds.
    """
    import numpy as np

    from evocity.coding import autosimilarity_maps, free_block_maps
    from evocity.io import FIELD_WRITERS, write_field
    from evocity.pictures import Field

    blocks = sorted(set(block))
    measure = measure or ("mean" if len(blocks) == 1 else "likeness")
    title, symbol, unit, free = _MEASURES[measure]
    _check_measure(measure, free, blocks)
    check_output(output, map, FIELD_WRITERS)
    if curve:
        check_output(curve, map, {".csv"})
    note_compiling()
    city = evocity.read_map(map, **reading)
    note_reading(city, reading)
    with progress_bar(f"comparing {city.name} with itself") as progress:
        options = {
            "domains": domains, "normalise": normalise, "threads": threads, "progress": progress,
        }  # fmt: skip
        if len(blocks) == 1:
            result = autosimilarity_maps(city, block=blocks[0], **options)
            maps = [result]
        else:
            result = free_block_maps(city, blocks=blocks, **options)
            maps = list(result.maps.values())
    values = getattr(result, measure)
    write_field(Field(city, values, title, symbol, unit), output)
    if curve:
        _write_curve(curve, maps)
    seconds = sum(m.seconds for m in maps)
    known = values[~np.isnan(values)]
    lowest, mean, highest = (
        (float(known.min()), float(known.mean(dtype=float)), float(known.max()))
        if known.size
        else [math.nan] * 3
    )
    if as_json:
        print_json(
            {
                "measure": measure,
                "normalise": normalise,
                "lowest": lowest,
                "mean": mean,
                "highest": highest,
                "known": known.size / values.size,
                "curve": {str(m.block): m.curve for m in maps},
                "seconds": seconds,
            }
        )
        return
    echo(describe(city))
    echo(
        f"{title}: {lowest:.4g} to {highest:.4g}{unit and ' ' + unit}, mean {mean:.4g}"
        f"; {seconds:.1f} s"
        if known.size
        else f"{title}: no pixel has a value, all blocks are flat; {seconds:.1f} s"
    )
    if 0 < known.size < values.size:
        echo(f"{known.size / values.size:.0%} of the pixels have a value")
    for path in (output, curve):
        if path:
            echo(f"wrote {path}")


def _check_measure(measure: str, free: bool | None, blocks: list[int]) -> None:
    if free is None or free == (len(blocks) > 1):
        return
    sizes = ",".join(str(size) for size in blocks)
    raise EvocityError(
        f"--measure {measure} does not fit --block {sizes}",
        "several block sizes for largest and likeness, one for mean, one or several for least",
        "give --block 4,6,8 for largest and likeness, --block 8 for mean",
    )


def _write_curve(path: Path, maps) -> None:
    with (
        replace_file(path) as temporary,
        open(temporary, "w", newline="", encoding="utf-8") as file,
    ):
        rows = csv.writer(file)
        rows.writerow(["block", "domain", "mean_error"])
        rows.writerows((m.block, extent, mean) for m in maps for extent, mean in m.curve.items())
