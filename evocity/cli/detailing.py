"""`evocity curve detail`, `transfer`, `amplify`: the details of a curve, told and changed."""

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import click

from evocity.cli.common import (
    check_output,
    echo,
    json_option,
    output_option,
    print_json,
    warn,
    writing,
)
from evocity.errors import EvocityError
from evocity.files import whole_file

if TYPE_CHECKING:
    import numpy as np

    from evocity.shapes import Detailed, StoredCurve

#: What a curve is written as.
WRITTEN = (".json", ".parquet", ".geojson", ".png", ".svg")
curve_output = output_option(
    "FILE",
    "File to write; overwritten if it exists. .json or .parquet: the curve; .geojson: its line; "
    ".png or .svg: a picture.",
)


@click.command(
    epilog="""\b
Examples:
  evocity curve detail edge.json
  evocity curve detail edge.json --drop 3 -o eighth.json"""
)
@click.argument("source", metavar="CURVE")
@click.option(
    "--drop",
    type=click.IntRange(min=0),
    default=0,
    show_default=True,
    help="Leave the details of so many of the finest levels out.",
)
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    metavar="FILE",
    show_default="none",
    help="Write the curve: .json, .parquet, .geojson, .png or .svg. Overwritten if it exists.",
)
@json_option
def detail(source: str, drop: int, output: Path | None, as_json: bool) -> None:
    """Tell of a curve how much detail each level has, and what the line is without it.

    JSON keys: levels, a list of level, points, amount (root of the mean square of its details, in
    chords of their polygons) and rms (metres, without this level and all finer ones); length
    (metres), dimension (by boxes).
    """
    from evocity.shapes import StoredCurve, line_dimension, rms_of

    if output is not None:
        check_output(output, source, WRITTEN)
    stored = read_stored(source)
    with warned():
        one = stored.detailed.dropped(drop)
    rows = [
        {
            "level": level,
            "points": len(one.points(level)),
            "amount": float(one.amounts[level]),
            "rms": rms_of(one, one.depth - level),
        }
        for level in range(one.depth)
    ]
    line = plain_line(one)
    told = {"levels": rows, "length": length_of(line), "dimension": line_dimension(line).dimension}
    if output is not None:
        written(StoredCurve(one, stored.crs, stored.attribution), output)
    if as_json:
        print_json(told)
        return
    echo("level  points  detail     without it and finer ones, m")
    for row in rows:
        echo(f"{row['level']:5}  {row['points']:6}  {row['amount']:<9.4g}  {row['rms']:.4g}")
    echo(f"length {told['length']:.6g} m, dimension by boxes {told['dimension']:.4f}")
    if output is not None:
        echo(f"wrote {output}")


@click.command(
    epilog="""\b
Examples:
  evocity curve transfer street.json edge.json -o street-as-rough.json
  evocity curve transfer street.json edge.json --levels 4 --gain 0.5 -o out.geojson"""
)
@click.argument("source", metavar="CURVE")
@click.argument("donor", metavar="DONOR")
@curve_output
@click.option(
    "--levels",
    type=click.IntRange(min=0),
    show_default="all but the coarsest",
    help="How many of the finest levels get the donor's details.",
)
@click.option("--gain", type=float, default=1.0, show_default=True, help="So much larger.")
@json_option
def transfer(
    source: str, donor: str, output: Path, levels: int | None, gain: float, as_json: bool
) -> None:
    """Give a curve the details of another, DONOR, in its finest levels.

    They stand in the frames of the donor's polygons, and then in those of the curve's: how the
    donor lies and how large it is does not matter. A donor of other maps is analysed by those of
    the curve. A line that then crosses itself is written, and told.

    JSON keys: length (metres), crosses (a place, or null).
    """
    check_output(output, source, WRITTEN)
    check_output(output, donor)
    stored, other = read_stored(source), read_stored(donor)
    with warned():
        found = stored.detailed.transferred(other.detailed.recoded(stored.detailed), levels, gain)
    names = dict.fromkeys(one for one in (stored.attribution, other.attribution) if one)
    _told(found, stored.crs, "; ".join(names), output, as_json)


@click.command(
    epilog="""\b
Examples:
  evocity curve amplify edge.json --gain 2 -o rougher.json
  evocity curve amplify edge.json --gain 0 --levels 6,7 -o smoother.png"""
)
@click.argument("source", metavar="CURVE")
@curve_output
@click.option("--gain", type=float, required=True, help="So many times larger; 0 takes them away.")
@click.option(
    "--levels",
    show_default="all",
    metavar="A,B",
    help="Which levels, 0 the coarsest, as `evocity curve detail` tells them.",
)
@json_option
def amplify(source: str, output: Path, gain: float, levels: str | None, as_json: bool) -> None:
    """Make the details of a curve larger or smaller.

    A line that then crosses itself is written, and told.

    JSON keys: length (metres), crosses (a place, or null).
    """
    check_output(output, source, WRITTEN)
    chosen = None
    if levels is not None:
        parts = [part.strip() for part in levels.split(",")]
        if not all(part.isdecimal() and len(part) < 4 for part in parts):
            raise EvocityError(f"--levels {levels}", "whole numbers, such as 5,6", "correct it")
        chosen = [int(part) for part in parts]
    stored = read_stored(source)
    with warned():
        found = stored.detailed.amplified(gain, chosen)
    _told(found, stored.crs, stored.attribution, output, as_json)


def read_stored(source: str) -> "StoredCurve":
    from evocity.shapes import read_curve

    with warned():
        return read_curve(source)


def plain_line(one: "Detailed") -> "np.ndarray":
    """The line of a curve without points that repeat the one before."""
    import numpy as np

    line = one.line()
    return line[np.append(True, (np.diff(line, axis=0) != 0).any(axis=1))]


def length_of(line: "np.ndarray") -> float:
    from evocity.shapes.lines import lengths_of

    return float(lengths_of(line)[-1])


def _told(one: "Detailed", crs: str | None, attribution: str, output: Path, as_json: bool) -> None:
    from evocity.shapes import StoredCurve, crossing_of

    line = plain_line(one)
    crossing = crossing_of(line)
    written(StoredCurve(one, crs, attribution), output)
    if as_json:
        crosses = None if crossing is None else crossing.tolist()
        print_json({"length": length_of(line), "crosses": crosses})
        return
    echo(f"length {length_of(line):.6g} m; wrote {output}")


def written(stored: "StoredCurve", output: Path) -> None:
    from evocity.io import PlacedLines, write_lines
    from evocity.shapes import line_picture, write_curve
    from evocity.shapes.drawing import line_svg

    suffix, line = output.suffix.lower(), plain_line(stored.detailed)
    if suffix == ".geojson":
        write_lines(PlacedLines((line,), stored.crs, stored.attribution), output)
    elif suffix in (".json", ".parquet"):
        write_curve(stored.detailed, output, stored.crs, stored.attribution)
    else:
        with writing(output), whole_file(output) as temporary:
            if suffix == ".png":
                line_picture([line], 1024).save(temporary, "PNG")
            else:
                temporary.write_text(line_svg(line), encoding="utf-8")


@contextmanager
def warned() -> Iterator[None]:
    """What the library warns of, told as the commands tell it."""
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        yield
    for text in dict.fromkeys(str(one.message) for one in found):
        warn(text)


__all__ = [
    "WRITTEN",
    "amplify",
    "curve_output",
    "detail",
    "length_of",
    "plain_line",
    "read_stored",
    "transfer",
    "warned",
    "written",
]
