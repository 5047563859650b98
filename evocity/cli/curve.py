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
from evocity.cli.shared.commands import Commands, command
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
    """Trace lines in maps, fit curves with details to lines, change the curves, and draw them on
    maps.

    A curve consists of control points, affine maps and details. The affine maps generate the parts
    of the curve from the control points. On each level, the details are the differences between the
    generated curve and the original line. CURVE is a file that `evocity curve fit` wrote.
    """


@command("""
  evocity curve trace lyon-1er -o edge.geojson
  evocity curve trace lyon-1er --what streets --count 5 -o streets.geojson
  evocity curve trace lyon-1er --what skyline --bearing 30 -o skyline.geojson
  evocity curve trace leaf.png --what outline -o leaf.geojson""")
@click.argument("source", metavar="MAP|GENOME|RUN|PICTURE")
@id_option
@output_option("GEOJSON", "File to write")
@option(
    "--what",
    "Lines to trace: the edge of the built fabric, the skyline, the façades, the middle lines of "
    "streets, or the outline of the largest dark area of a PNG picture.",
    click.Choice(["edge", "skyline", "facades", "streets", "outline"]),
    "edge",
)
@option(
    "--bearing",
    "Viewing direction of a skyline, in degrees clockwise from north.",
    click.FloatRange(-360, 360),
    0.0,
)
@option(
    "--reach",
    "Half the width of the widest gap that the traced edge closes, in metres; in pixels for an "
    "outline. [12; 0 for an outline]",
    click.FloatRange(0, 200),
)
@option("--count", "Largest number of lines to write; the longest lines come first.", POSITIVE, 1)
@json_option
@map_options
def trace(
    source: str,
    identifier: int | None,
    output: Path,
    what: str,
    bearing: float,
    reach: float | None,
    count: int,
    as_json: bool,
    reading: Mapping[str, object],
) -> None:
    """Trace lines in a map: the edge of the built fabric, the skyline, façades or streets.

    With --what outline, the source is a PNG picture of a dark shape on a light ground, such as a
    leaf. The outline begins and ends at its lowest point. A pixel of the picture counts as a metre.

    In the JSON document, the key "lines" lists the number of points and the length (metres) of each
    line.
    """
    from evocity import scene
    from evocity.io import PlacedLines, write_lines
    from evocity.io.lines import crs_code
    from evocity.scene.lines import REACH

    check_output(output, source, {".geojson", ".json"})
    if what == "outline":
        if identifier is not None or reading:
            raise EvocityError(
                "--what outline cannot be used with --id or with options of maps",
                "a PNG picture, without these options",
                "leave these options out, or choose other lines with --what",
            )
        line = scene.picture_outline(_read_picture(source), reach or 0.0)
        write_lines(PlacedLines((line,), None, ""), output)
        _say_traced([line], what, output, as_json)
        return
    reach = REACH if reach is None else reach
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
            "a map with a line that is at least 50 m long",
            "use a larger map, or choose other lines with the option --what",
        )
    write_lines(PlacedLines(tuple(lines), crs, city.attribution), output)
    _say_traced(lines, what, output, as_json)


def _say_traced(lines: "list[np.ndarray]", what: str, output: Path, as_json: bool) -> None:
    listed = [{"points": len(line), "length": length_of(line)} for line in lines]
    if as_json:
        print_json({"lines": listed})
        return
    for line in listed:
        echo(f"{what}: {line['points']} points, {line['length']:.0f} m")
    echo(f"wrote {output}")


def _read_picture(source: str) -> "np.ndarray":
    """Read the dark pixels of the picture ``source``."""
    from evocity.errors import reason_of
    from evocity.fitness.curves import read_dark

    try:
        content = Path(source).read_bytes()
    except OSError as error:
        raise EvocityError(
            f"{source} cannot be read: {reason_of(error)}", "a PNG picture", "check the path"
        ) from None
    return read_dark(content, source)


@command("""
  evocity curve fit edge.geojson -o edge.json
  evocity curve fit edge.geojson --points 5 --depth 8 -o edge.json
  evocity curve fit coast.geojson --drawn all -o coast.parquet""")
@click.argument("line", metavar="LINE.geojson")
@curve_output
@option("--points", "Number of control points.", click.IntRange(2, 16), 4)
@option(
    "--maps",
    "Number of affine maps; each affine map generates a part of the curve.",
    click.IntRange(2, 64),
    2,
)
@option("--depth", "Number of levels of detail. [from the line]", click.IntRange(1, 19))
@option(
    "--drawn K|all",
    "Number of finest levels whose details the curve may lose and still stay near the line.",
    default="3",
)
@option("--starts", "Number of random starts of the fit.", click.IntRange(1, 1000), 6)
@option("--seed", "Seed of the random starts of the fit.", WHOLE, 0)
@option("--number", "Index of the line in the file, counted from 0. [the longest]", WHOLE)
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

    The fit searches for contracting affine maps. With --drawn K, the fitted curve stays near the
    line even without the details of the finest K levels. Coordinates in degrees are projected to
    metres around the middle of the line.

    The JSON document has the keys "points", "depth", "numbers", "rms" and "contraction". The object
    "contraction" contains the keys "lower", "upper" and "proved". With --drawn K, the key "numbers"
    counts the points of the curve without the finest K levels. With --drawn K, the key "rms" is the
    root-mean-square distance in metres between the line and the curve without the finest K levels.
    """
    import numpy as np

    from evocity.io import read_lines
    from evocity.shapes import StoredCurve, fit_curve, rms_of
    from evocity.shapes.lines import warn_crossing

    check_output(output, line, WRITTEN)
    if drawn != "all" and not (drawn.isdecimal() and 1 <= int(drawn) <= 64):
        raise EvocityError(
            f"--drawn {drawn} is not a number of levels",
            "the word 'all', or a whole number of levels from 1",
            "correct the value of --drawn",
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
        counts = {"points": len(fitted.line()), "depth": fitted.depth, "numbers": numbers}
        print_json(counts | {"rms": rms, "contraction": contraction})
        return
    echo(f"{len(fitted.line())} points, {fitted.depth} levels; exact with all details")
    echo(f"without the finest {levels} levels: {numbers} points, {rms:.4g} m off (RMS)")
    proof = "proved" if bounds.proved else "not proved, not refuted"
    radius = f"{bounds.lower:.4g} to {bounds.upper:.4g}"
    echo(f"the maps contract: {proof}; joint spectral radius {radius}")
    echo(f"wrote {output}")


@command("""
  evocity curve lay river.json lyon-1er --width 14 -o with-river.tif
  evocity curve lay river.json lyon-1er --width 14 -o with-river.tif --mask river.npy
  evocity curve lay wall.json lyon-1er --width 4 --height 12 -o walled.tif""")
@click.argument("source", metavar="CURVE")
@click.argument("place", metavar="MAP|GENOME|RUN")
@id_option
@output_option("TIF|NPY|PNG", "Map to write, with the curve drawn on the map")
@option("--width", "Width of the drawn curve, in metres.", float, required=True)
@option(
    "--height",
    "Height of the drawn curve above ground, in metres; use 0 for ground or water.",
    float,
    0.0,
)
@option(
    "--mask NPY",
    "Mask file to write; the mask marks the pixels under the curve for the option --lock of "
    "`evocity encode`.",
    FILE,
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
    """Draw a curve on a map, for example as a river, a boulevard or a wall.

    If the curve and the map both have coordinates on Earth, the curve keeps its coordinates. If the
    curve has no coordinates on Earth, its points are distances in metres from the south-west corner
    of the map. The command stops with an error if the curve crosses itself, misses the map, or is
    narrower than a pixel.

    The JSON document has the keys "pixels" and "built". The key "pixels" counts the pixels under
    the drawn curve. The key "built" is the area of the replaced buildings, in m².
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
                "choose another line with --number",
            )
        return lines[number]
    longest = max(range(len(lines)), key=lambda k: length_of(lines[k]))
    if len(lines) > 1:
        note(f"{name} has {len(lines)} lines; this command takes number {longest}, the longest")
    return lines[longest]


for _command in (trace, fit, lay, detail, transfer, amplify):
    curve.add_command(_command)
