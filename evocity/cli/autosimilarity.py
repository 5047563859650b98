"""`evocity autosimilarity`: where a map is like itself."""

import csv
import math
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
    writing,
)
from evocity.errors import EvocityError

#: Largest side of a map, pixels.
MAX_SIDE = 32767

#: Measure: title, symbol, unit, and whether B is free.
_MEASURES = {
    "mean": ("mean autosimilarity error", "mean µ", "", False),
    "least": ("least autosimilarity error", "least µ", "", None),
    "largest": ("largest block of least error", "B max", "px", True),
    "likeness": ("size of blocks times likeness", "(1 − µ)·B", "px", True),
    "domain": ("domain block of least error", "D best", "px", None),
}


class _Sizes(click.ParamType):
    name = "sizes"

    def convert(self, value, param, ctx) -> tuple[int, ...]:
        if isinstance(value, tuple):
            return value
        try:
            return tuple(size for part in value.split(",") for size in _span(part))
        except ValueError:
            self.fail(f"{value!r} is no list of pixels such as 20 or 16,20 or 9-32", param, ctx)


def _span(text: str) -> range:
    first, dash, last = text.partition("-")
    first, last = int(first), int(last if dash else first)
    if not 0 < first <= last <= MAX_SIDE:
        raise ValueError(text)
    return range(first, last + 1)


@click.command(
    epilog="""\b
Examples:
  evocity autosimilarity lyon-1er --domains 20 -o lyon-mu.png
  evocity autosimilarity lyon-1er --block 4 --domains 5-16 --measure least -o lyon-mu.tif
  evocity autosimilarity lyon-1er --block 4,6,8 --measure likeness -o lyon-likeness.png
  evocity autosimilarity lyon-1er --domains 9-20 --measure domain --normalise variance -o d.png"""
)
@click.argument("map", metavar="MAP")
@output_option(
    "FILE",
    "File to write: .tif (values, where on Earth), .png (a picture), .npy (bare values); "
    "overwritten if it exists.",
)
@click.option(
    "--block",
    type=_Sizes(),
    metavar="N[,N…]",
    default="8",
    show_default=True,
    help="B, side of the range blocks, pixels; several leave B free.",
)
@click.option(
    "--domains",
    type=_Sizes(),
    metavar="N[,N…]|N-N",
    show_default="2B",
    help="D, sides of the domain blocks, pixels: any above B; 9-32 leaves D free up to 32. With "
    "several B, each takes those of them that are larger than it.",
)
@click.option(
    "--measure",
    type=click.Choice([*_MEASURES]),
    show_default="mean; likeness if B is free",
    help="mean: µ̃ of each pixel; least: µ_min; with B free, largest: B_max; likeness: "
    "(1 − µ_min)·B_max; domain: the D that explains most.",
)
@click.option(
    "--normalise",
    type=click.Choice(["heights", "variance"]),
    default="heights",
    show_default=True,
    help="What µ is divided by: heights, the map's range of heights, squared; variance, the "
    "block's own, flat blocks left out.",
)
@click.option(
    "--curve",
    type=click.Path(path_type=Path),
    metavar="CSV",
    show_default="not written",
    help="Also write the curve D → mean of µ, a row for each B and D.",
)
@click.option("--threads", type=int, show_default="all cores", help="Threads to use.")
@map_options
@json_option
def autosimilarity(
    map, output: Path, block, domains, measure, normalise, curve, threads, reading, as_json
) -> None:
    """Map where MAP is like itself (Marsault 2005, section 1.3).

    µ is what the best domain block leaves unexplained of a range block, 0…1: 0 where the map
    repeats itself at another scale. Every position of either, 8 isometries, exact. MAP is a
    file or the name of a bundled district.

    Time grows with the fourth power of the map's side and with the number of B and D; 256 px
    with one of each take some ten seconds.

    Pixels without a value, as on flat ground if µ is divided by the variance, are NaN in .tif and
    .npy, grey in pictures, and left out of what is printed.

    JSON keys: measure, normalise, lowest, mean, highest (of the values written; null if there are
    none), known (share of the pixels that have a value), curve (B to D to the mean of µ), seconds.
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
            found = autosimilarity_maps(city, block=blocks[0], **options)
            every = [found]
        else:
            found = free_block_maps(city, blocks=blocks, **options)
            every = list(found.maps.values())
    values = getattr(found, measure)
    write_field(Field(city, values, title, symbol, unit), output)
    if curve:
        _write_curve(curve, every)
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
                "curve": {str(one.block): one.curve for one in every},
                "seconds": sum(one.seconds for one in every),
            }
        )
        return
    echo(describe(city))
    seconds = sum(one.seconds for one in every)
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
        f"--measure {measure} with --block {sizes}",
        "largest or likeness with several sizes of blocks, mean with one, least with either",
        "give --block 4,6,8 for the first two, --block 8 for mean",
    )


def _write_curve(path: Path, every) -> None:
    from evocity.files import whole_file

    with (
        writing(path),
        whole_file(path) as temporary,
        open(temporary, "w", newline="", encoding="utf-8") as file,
    ):
        rows = csv.writer(file)
        rows.writerow(["block", "domain", "mean_error"])
        rows.writerows((m.block, extent, mean) for m in every for extent, mean in m.curve.items())
