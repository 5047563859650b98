"""`evocity autosimilarity`: where a map is similar to itself."""

import csv
import math
from pathlib import Path

import click

import evocity
from evocity.cli.shared.checks import check_output, replace_file
from evocity.cli.shared.commands import command
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


@command("""
  evocity autosimilarity lyon-1er --domains 20 -o lyon-mu.png
  evocity autosimilarity lyon-1er --block 4 --domains 5-16 --measure least -o lyon-mu.tif
  evocity autosimilarity lyon-1er --block 4,6,8 --measure likeness -o lyon-likeness.png
  evocity autosimilarity lyon-1er --domains 9-20 --measure domain --normalise variance -o d.png""")
@click.argument("map", metavar="MAP")
@output_option(
    "FILE", "File to write: .tif (values with coordinates), .png (a picture) or .npy (only values)"
)
@option(
    "--block N[,N…]",
    "Sides B of the range blocks, in pixels; with several sides, the side B varies over the map.",
    SIZES,
    "8",
)
@option(
    "--domains N[,N…]|N-N",
    "Sides D of the domain blocks, in pixels; a range block is compared only with larger domain "
    "blocks. [2B]",
    SIZES,
)
@option(
    "--measure",
    "Value to write for each pixel: the mean error µ, the least error µ, the largest side B, the "
    "product (1 − µ)·B, or the best side D. [mean; likeness if B is free]",
    click.Choice([*_MEASURES]),
)
@option(
    "--normalise",
    "Number that divides the error µ: the square of the map's height range, or the variance of "
    "the range block.",
    click.Choice(["heights", "variance"]),
    "heights",
)
@option(
    "--curve CSV",
    "CSV file to write: each row has a pair of block sides B and D, and the mean error µ.",
    FILE,
)
@option("--threads", "Number of threads. [all cores]", int)
@map_options
@json_option
def autosimilarity(
    map, output: Path, block, domains, measure, normalise, curve, threads, reading, as_json
) -> None:
    """Write a map of the places where MAP is similar to itself (Marsault 2005, section 1.3).

    The error µ, from 0 to 1, is the share of a range block that even the best domain block cannot
    explain. The error µ is 0 where the map repeats itself exactly at another scale. The search is
    exact, because the command compares all range blocks with all domain blocks, in 8 isometries.
    MAP is a file or the name of a bundled district.

    The computing time grows with the fourth power of the map's side, and with the number of block
    sides B and D. With one side B and one side D, a map of 256 × 256 px takes about ten seconds.

    Some pixels have no value, for example pixels of flat ground with --normalise variance. Pixels
    without a value are NaN in .tif and .npy files, and grey in pictures. The printed figures leave
    out pixels without a value.

    The JSON document has the keys "measure", "normalise", "lowest", "mean", "highest", "known",
    "curve" and "seconds". The keys "lowest", "mean" and "highest" are null if no pixel has a value.
    The key "known" is the share of pixels that have a value. The key "curve" contains the mean
    error µ for each pair of block sides B and D.
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
        facts = {"measure": measure, "normalise": normalise}
        facts |= {"lowest": lowest, "mean": mean, "highest": highest}
        facts |= {"known": known.size / values.size, "curve": {str(m.block): m.curve for m in maps}}
        print_json(facts | {"seconds": seconds})
        return
    echo(describe(city))
    echo(
        f"{title}: {lowest:.4g} to {highest:.4g}{unit and ' ' + unit}, mean {mean:.4g}"
        f"; {seconds:.1f} s"
        if known.size
        else f"{title}: no pixel has a value, all blocks are flat; {seconds:.1f} s"
    )
    if 0 < known.size < values.size:
        echo(f"{100 * known.size / values.size:.0f} % of the pixels have a value")
    for path in (output, curve):
        if path:
            echo(f"wrote {path}")


def _check_measure(measure: str, free: bool | None, blocks: list[int]) -> None:
    if free is None or free == (len(blocks) > 1):
        return
    sizes = ",".join(str(size) for size in blocks)
    raise EvocityError(
        f"--measure {measure} cannot be used with --block {sizes}",
        "several block sides for the measures 'largest' and 'likeness'; one block side for 'mean'",
        "write for example --measure largest --block 4,6,8; or --measure mean --block 8",
    )


def _write_curve(path: Path, maps) -> None:
    with (
        replace_file(path) as temporary,
        open(temporary, "w", newline="", encoding="utf-8") as file,
    ):
        rows = csv.writer(file)
        rows.writerow(["block", "domain", "mean_error"])
        rows.writerows((m.block, extent, mean) for m in maps for extent, mean in m.curve.items())
