"""`evocity curve`: lines as curves with details: `trace`, `fit` and `lay`."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import click

from evocity.cli.curve_detail import (
    WRITTEN,
    amplify,
    curve_output,
    detail,
    length_of,
    plain_line,
    print_warnings,
    read_stored,
    transfer,
    write_output,
)
from evocity.cli.shared.checks import check_output, replace_file
from evocity.cli.shared.commands import Commands
from evocity.cli.shared.inputs import city_of
from evocity.cli.shared.options import (
    FILE,
    POSITIVE,
    WHOLE,
    id_option,
    json_option,
    map_options,
    option,
    output_option,
)
from evocity.cli.shared.terminal import echo, note, print_json
from evocity.errors import EvocityError

if TYPE_CHECKING:
    import numpy as np

_RASTERS = (".tif", ".tiff", ".npy", ".png")


@click.group(cls=Commands)
def curve() -> None:
    """Curves with details: trace lines, fit curves, describe and change them, lay them on a map.

    A curve has a few control points, maps that make its parts, and details. The details are what
    the line adds to these parts, level by level. CURVE is a file that `fit` wrote.
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
@output_option("GEOJSON", "File to write")
@option(
    "--what",
    "Edge of the fabric, roofs against the sky, walls, or middle lines of streets.",
    click.Choice(["edge", "skyline", "facades", "streets"]),
    "edge",
)
@option(
    "--bearing",
    "Direction of view of a skyline, degrees clockwise from north.",
    click.FloatRange(-360, 360),
    0.0,
)
@option(
    "--reach", "Half the width of gaps that an edge closes, metres.", click.FloatRange(0, 200), 12.0
)
@option("--count", "Largest number of lines, the longest first.", POSITIVE, 1)
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
    """Trace lines of a map: the edge of its fabric, its skyline, façades, streets.

    JSON keys: lines, a list of objects with points and length (metres).
    """
    from evocity import scene
    from evocity.io import PlacedLines, write_lines
    from evocity.io.lines import crs_code

    check_output(output, source, {".geojson", ".json"})
    city = city_of(source, reading, identifier)
    if what == "skyline":
        lines, crs = [scene.skyline(city, bearing)], None
    else:
        trace_lines = {
            "edge": lambda: scene.fabric_edges(city, reach),
            "facades": lambda: scene.facades(city),
            "streets": lambda: scene.street_axes(city),
        }[what]
        lines, crs = trace_lines()[:count], crs_code(city)
    if not lines:
        raise EvocityError(
            f"{city.name}: the map has no line of 50 m or more",
            "a map with a line of 50 m or more",
            "choose a larger map, or another --what",
        )
    write_lines(PlacedLines(tuple(lines), crs, city.attribution), output)
    listed = [{"points": len(line), "length": length_of(line)} for line in lines]
    if as_json:
        print_json({"lines": listed})
        return
    for line in listed:
        echo(f"{what}: {line['points']} points, {line['length']:.0f} m")
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
@option("--points", "Number of control points.", click.IntRange(2, 16), 4)
@option("--maps", "Number of maps, and so of parts of each polygon.", click.IntRange(2, 64), 2)
@option("--depth", "Number of levels. [by the points of the line]", click.IntRange(1, 19))
@option("--drawn K|all", "Number of finest levels that the maps draw without details.", default="3")
@option("--starts", "Number of starting points of the fit.", click.IntRange(1, 1000), 6)
@option("--seed", "Seed of the starting points.", WHOLE, 0)
@option("--number", "Index of the line in the file, from 0. [the longest]", WHOLE)
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
    """Fit a curve, with details, to a line in a GeoJSON file.

    The fit searches for contracting maps that keep the curve near the line, even without details in
    the finest K levels (--drawn). Coordinates in degrees become metres around the middle of the
    line.

    JSON keys: points, depth, numbers (how many numbers the curve has without the finest K levels),
    rms (metres from the line, without these levels), contraction (lower, upper, proved).
    """
    import numpy as np

    from evocity.io import read_lines
    from evocity.shapes import StoredCurve, fit_curve, rms_of
    from evocity.shapes.lines import warn_crossing

    check_output(output, line, WRITTEN)
    if drawn != "all" and not (drawn.isdecimal() and 1 <= int(drawn) <= 64):
        raise EvocityError(
            f"--drawn {drawn} is not a number of levels",
            "a whole number, 1 or more, or all",
            "correct the number",
        )
    placed = read_lines(line)
    chosen = _choose_line(placed.lines, number, line)
    with print_warnings():
        fitted = fit_curve(
            chosen, points, maps, depth, None if drawn == "all" else int(drawn), starts,
            np.random.default_rng(seed),
        )  # fmt: skip
        warn_crossing(plain_line(fitted), line)
    levels = fitted.depth if drawn == "all" else min(int(drawn), fitted.depth)
    rms, bounds = rms_of(fitted, levels), fitted.curve.contraction
    write_output(StoredCurve(fitted, placed.crs, placed.attribution), output)
    numbers = len(fitted.points(fitted.depth - levels))
    if as_json:
        contraction = {"lower": bounds.lower, "upper": bounds.upper, "proved": bounds.proved}
        print_json(
            {
                "points": len(fitted.line()),
                "depth": fitted.depth,
                "numbers": numbers,
                "rms": rms,
                "contraction": contraction,
            }
        )
        return
    echo(f"{len(fitted.line())} points, {fitted.depth} levels; exact with all details")
    echo(f"without the finest {levels} levels: {numbers} points, {rms:.4g} m off (RMS)")
    proof = "proved" if bounds.proved else "not proved, not refuted"
    radius = f"{bounds.lower:.4g} to {bounds.upper:.4g}"
    echo(f"the maps contract: {proof}; joint spectral radius {radius}")
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
@output_option("TIF|NPY|PNG", "Map to write, with the curve on it")
@option("--width", "Width of the strip along the curve, metres.", float, required=True)
@option("--height", "Height of the strip, metres; 0 for ground or water.", float, 0.0)
@option("--mask NPY", "Mask of the strip to write, for `evocity encode --lock`.", FILE)
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

    If the curve and the map have places on Earth, the curve keeps its place. Otherwise the
    coordinates of the curve are metres from the map's south-west corner. The command refuses a
    curve that crosses itself, misses the map or is narrower than a pixel.

    JSON keys: pixels (covered by the strip), built (square metres of buildings that the strip
    replaces).
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
        with (
            replace_file(mask) as temporary,
            open(temporary, "wb") as file,
        ):
            np.save(file, layer.mask.astype(np.uint8))
    if as_json:
        print_json({"pixels": len(layer), "built": taken})
        return
    echo(f"{len(layer)} pixels, of which {taken:.0f} m² were built; wrote {output}")


def _choose_line(lines: "tuple[np.ndarray, ...]", number: int | None, name: str) -> "np.ndarray":
    if number is not None:
        if number >= len(lines):
            raise EvocityError(
                f"--number {number} is too large for the {len(lines)} lines in {name}",
                f"a number from 0 to {len(lines) - 1}",
                "choose another line",
            )
        return lines[number]
    longest = max(range(len(lines)), key=lambda k: length_of(lines[k]))
    if len(lines) > 1:
        note(f"{name} has {len(lines)} lines; this command takes number {longest}, the longest")
    return lines[longest]


for _command in (detail, transfer, amplify):
    curve.add_command(_command)
