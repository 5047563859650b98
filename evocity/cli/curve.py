"""`evocity curve`: lines as curves with details: traced, fitted, laid on maps; `detailing`: told
and changed."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import click

from evocity.cli.common import (
    Commands,
    check_output,
    echo,
    json_option,
    map_options,
    note,
    output_option,
    print_json,
    writing,
)
from evocity.cli.detailing import (
    WRITTEN,
    amplify,
    curve_output,
    detail,
    length_of,
    plain_line,
    read_stored,
    transfer,
    warned,
    written,
)
from evocity.cli.given import city_of, id_option
from evocity.errors import EvocityError
from evocity.files import whole_file

if TYPE_CHECKING:
    import numpy as np

_RASTERS = (".tif", ".tiff", ".npy", ".png")


@click.group(cls=Commands)
def curve() -> None:
    """Lines as curves with details: trace, fit, tell, change, lay on a map.

    A curve has a few control points, maps that make the parts of it, and what the line has beside
    these, level by level. CURVE is a file that `fit` wrote.
    """


@curve.command(
    epilog="""\b
Examples:
  evocity curve trace lyon-1er -o edge.geojson
  evocity curve trace lyon-1er --what streets --count 5 -o streets.geojson
  evocity curve trace lyon-1er --what skyline --bearing 30 -o skyline.geojson"""
)
@click.argument("source", metavar="MAP|GENOME|RUN")
@id_option
@output_option("GEOJSON", "File to write; overwritten if it exists.")
@click.option(
    "--what",
    type=click.Choice(["edge", "skyline", "facades", "streets"]),
    default="edge",
    show_default=True,
    help="The edge of the fabric; the roofs against the sky; walls; middle lines of streets.",
)
@click.option(
    "--bearing",
    type=click.FloatRange(-360, 360),
    default=0.0,
    show_default=True,
    help="Of a skyline: whither one looks, degrees from north by east.",
)
@click.option(
    "--reach",
    type=click.FloatRange(0, 200),
    default=12.0,
    show_default=True,
    help="Of an edge: gaps narrower than twice this, metres, are within the fabric.",
)
@click.option(
    "--count",
    type=click.IntRange(min=1),
    default=1,
    show_default=True,
    help="How many lines at most, the longest first.",
)
@json_option
@map_options
def trace(
    source: str,
    identifier: int | None,
    output: Path,
    what: str,
    bearing: float,
    reach: float,
    count: int,
    as_json: bool,
    reading: Mapping[str, object],
) -> None:
    """Take lines of a map: edge, skyline, façades, streets.

    JSON keys: lines, a list of points and length (metres).
    """
    from evocity import scene
    from evocity.io import PlacedLines, write_lines
    from evocity.io.lines import crs_told

    check_output(output, source, {".geojson", ".json"})
    city = city_of(source, reading, identifier)
    if what == "skyline":
        lines, crs = [scene.skyline(city, bearing)], None
    else:
        found = {
            "edge": lambda: scene.fabric_edges(city, reach),
            "facades": lambda: scene.facades(city),
            "streets": lambda: scene.street_axes(city),
        }
        lines, crs = found[what]()[:count], crs_told(city)
    if not lines:
        raise EvocityError(
            f"{city.name}: no line of 50 m or more", "a larger map", "choose another --what"
        )
    write_lines(PlacedLines(tuple(lines), crs, city.attribution), output)
    told = [{"points": len(line), "length": length_of(line)} for line in lines]
    if as_json:
        print_json({"lines": told})
        return
    for one in told:
        echo(f"{what}: {one['points']} points, {one['length']:.0f} m")
    echo(f"wrote {output}")


@curve.command(
    epilog="""\b
Examples:
  evocity curve fit edge.geojson -o edge.json
  evocity curve fit edge.geojson --points 5 --depth 8 -o edge.json
  evocity curve fit coast.geojson --drawn all -o coast.parquet"""
)
@click.argument("line", metavar="LINE.geojson")
@curve_output
@click.option(
    "--points",
    type=click.IntRange(2, 16),
    default=4,
    show_default=True,
    help="Control points of a polygon.",
)
@click.option(
    "--maps", type=click.IntRange(2, 64), default=2, show_default=True, help="Parts of a polygon."
)
@click.option(
    "--depth",
    type=click.IntRange(1, 19),
    show_default="as many as the line has points for",
    help="Levels; the line is resampled at equal steps.",
)
@click.option(
    "--drawn",
    default="3",
    show_default=True,
    metavar="K|all",
    help="The maps are fitted to draw so many of the finest levels alone.",
)
@click.option(
    "--starts",
    type=click.IntRange(1, 1000),
    default=6,
    show_default=True,
    help="From how many maps the fit sets out.",
)
@click.option(
    "--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Of their draws."
)
@click.option(
    "--number",
    type=click.IntRange(min=0),
    show_default="the longest",
    help="Which line of the file, from 0.",
)
@json_option
def fit(
    line: str,
    output: Path,
    points: int,
    maps: int,
    depth: int | None,
    drawn: str,
    starts: int,
    seed: int,
    number: int | None,
    as_json: bool,
) -> None:
    """Make a curve of a line in a GeoJSON file, its details included.

    The maps are fitted so that without details in the finest K levels the curve lies as near to
    the line as it can; they contract. Degrees become metres about the line's middle.

    JSON keys: points, depth, numbers (kept without the finest K levels), rms (metres, then),
    contraction (lower, upper, proved).
    """
    import numpy as np

    from evocity.io import read_lines
    from evocity.shapes import StoredCurve, fit_curve, rms_of
    from evocity.shapes.lines import tell_crossing

    check_output(output, line, WRITTEN)
    if drawn != "all" and not (drawn.isdecimal() and 1 <= int(drawn) <= 64):
        raise EvocityError(f"--drawn {drawn}", "a whole number, 1 or more, or all", "correct it")
    placed = read_lines(line)
    taken = _taken(placed.lines, number, line)
    with warned():
        one = fit_curve(
            taken, points, maps, depth, None if drawn == "all" else int(drawn), starts,
            np.random.default_rng(seed),
        )  # fmt: skip
        tell_crossing(plain_line(one), line)
    levels = one.depth if drawn == "all" else min(int(drawn), one.depth)
    rms, told = rms_of(one, levels), one.curve.contraction
    written(StoredCurve(one, placed.crs, placed.attribution), output)
    numbers = len(one.points(one.depth - levels))
    if as_json:
        contraction = {"lower": told.lower, "upper": told.upper, "proved": told.proved}
        print_json(
            {
                "points": len(one.line()),
                "depth": one.depth,
                "numbers": numbers,
                "rms": rms,
                "contraction": contraction,
            }
        )
        return
    echo(f"{len(one.line())} points, {one.depth} levels; exact with all details")
    echo(f"without the finest {levels} levels: {numbers} points, {rms:.4g} m off (RMS)")
    known = "proved" if told.proved else "not proved, not refuted"
    echo(f"the maps contract: {known}; joint spectral radius {told.lower:.4g} to {told.upper:.4g}")
    echo(f"wrote {output}")


@curve.command(
    epilog="""\b
Examples:
  evocity curve lay river.json lyon-1er --width 14 -o with-river.tif
  evocity curve lay river.json lyon-1er --width 14 -o with-river.tif --mask river.npy
  evocity curve lay wall.json lyon-1er --width 4 --height 12 -o walled.tif"""
)
@click.argument("source", metavar="CURVE")
@click.argument("place", metavar="MAP|GENOME|RUN")
@id_option
@output_option("TIF|NPY|PNG", "The map with the curve on it; overwritten if it exists.")
@click.option("--width", type=float, required=True, help="Of the strip along the curve, metres.")
@click.option(
    "--height",
    type=float,
    default=0.0,
    show_default=True,
    help="Of what lies there, metres: 0 is ground or water, more a wall.",
)
@click.option(
    "--mask",
    type=click.Path(path_type=Path),
    metavar="NPY",
    show_default="none",
    help="Write also where it lies: what `evocity encode --lock` takes, for decoding to keep.",
)
@json_option
@map_options
def lay(
    source: str,
    place: str,
    identifier: int | None,
    output: Path,
    width: float,
    height: float,
    mask: Path | None,
    as_json: bool,
    reading: Mapping[str, object],
) -> None:
    """Lay a curve on a map: a river, a boulevard, a wall.

    Of both on Earth the curve is laid where it is; a curve that lies nowhere, in metres from the
    map's south-west corner. One that crosses itself, misses the map or is narrower than a pixel is
    refused.

    JSON keys: pixels (covered), built (square metres of buildings that it takes).
    """
    import numpy as np

    import evocity
    from evocity.io import condensation_along, line_on

    check_output(output, source, _RASTERS)
    if mask is not None:
        check_output(mask, source, {".npy"})
    stored = read_stored(source)
    city = city_of(place, reading, identifier)
    line = line_on(city, plain_line(stored.detailed), stored.crs)
    layer = condensation_along(city, line, width, height)
    taken = int(np.count_nonzero(layer.mask & city.built)) * city.metres_per_pixel**2
    evocity.write_map(city.replace(layer.laid(city.heights)), output)
    if mask is not None:
        with writing(mask), whole_file(mask) as temporary, open(temporary, "wb") as file:
            np.save(file, layer.mask.astype(np.uint8))
    if as_json:
        print_json({"pixels": len(layer), "built": taken})
        return
    echo(f"{len(layer)} pixels, of which {taken:.0f} m² were built; wrote {output}")


def _taken(lines: "tuple[np.ndarray, ...]", number: int | None, name: str) -> "np.ndarray":
    if number is not None:
        if number >= len(lines):
            raise EvocityError(
                f"--number {number}, of {len(lines)} lines in {name}",
                f"0…{len(lines) - 1}",
                "choose another",
            )
        return lines[number]
    longest = max(range(len(lines)), key=lambda k: length_of(lines[k]))
    if len(lines) > 1:
        note(f"{name} has {len(lines)} lines; number {longest}, the longest, is taken")
    return lines[longest]


for _command in (detail, transfer, amplify):
    curve.add_command(_command)

__all__ = ["curve"]
