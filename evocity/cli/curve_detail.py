"""`evocity curve detail`, `transfer`, `amplify`: print and change the details of a curve."""

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import click

from evocity.cli.shared.checks import check_output, replace_file
from evocity.cli.shared.commands import command
from evocity.cli.shared.detail_options import (
    donor_gain_option,
    finest_levels_option,
    gain_option,
    levels_of,
    levels_option,
)
from evocity.cli.shared.options import WHOLE, json_option, option, output_option
from evocity.cli.shared.terminal import echo, print_json, warn

if TYPE_CHECKING:
    import numpy as np

    from evocity.shapes import Detailed, StoredCurve

#: Suffixes of the files of curves.
WRITTEN = (".json", ".parquet", ".geojson", ".png", ".svg")
curve_output = output_option(
    "FILE",
    "File to write: .json or .parquet (the curve), .geojson (a line), .png or .svg (a picture)",
)


@command("""
  evocity curve detail edge.json
  evocity curve detail edge.json --drop 3 -o eighth.json""")
@click.argument("source", metavar="CURVE")
@option("--drop", "Number of finest levels of detail to leave out.", WHOLE, 0)
@output_option("FILE", "Curve to write: .json, .parquet, .geojson, .png or .svg", required=False)
@json_option
def detail(source: str, drop: int, output: Path | None, as_json: bool) -> None:
    """For each level of a curve, print the amount of detail, and the error of the curve without the
    detail.

    The JSON document has the keys "levels", "length" (metres) and "dimension" (from box counting).
    Each entry of the key "levels" has the keys "level", "points", "amount" and "rms". The key
    "amount" is the root mean square of the details, relative to the distance between the ends of
    each curve part. The key "rms" is the error of the curve, in metres, without the details of the
    level and of all finer levels.
    """
    from evocity.shapes import StoredCurve, line_dimension, rms_of

    if output is not None:
        check_output(output, source, WRITTEN)
    stored = read_stored(source)
    with print_warnings():
        curve = stored.detailed.dropped(drop)
    rows = [
        {
            "level": level,
            "points": len(curve.points(level)),
            "amount": float(curve.amounts[level]),
            "rms": rms_of(curve, curve.depth - level),
        }
        for level in range(curve.depth)
    ]
    line = plain_line(curve)
    length, dimension = length_of(line), line_dimension(line).dimension
    if output is not None:
        write_output(StoredCurve(curve, stored.crs, stored.attribution), output)
    if as_json:
        print_json({"levels": rows, "length": length, "dimension": dimension})
        return
    echo("level  points  detail     without it and finer ones, m")
    for row in rows:
        echo(f"{row['level']:5}  {row['points']:6}  {row['amount']:<9.4g}  {row['rms']:.4g}")
    echo(f"length {length:.6g} m, dimension by boxes {dimension:.4f}")
    if output is not None:
        echo(f"wrote {output}")


@command("""
  evocity curve transfer street.json edge.json -o street-as-rough.json
  evocity curve transfer street.json edge.json --levels 4 --gain 0.5 -o out.geojson""")
@click.argument("source", metavar="CURVE")
@click.argument("donor", metavar="DONOR")
@curve_output
@finest_levels_option
@donor_gain_option
@json_option
def transfer(
    source: str, donor: str, output: Path, levels: int | None, gain: float, as_json: bool
) -> None:
    """Replace the finest details of CURVE with the details of another curve, DONOR.

    The position and the size of DONOR have no effect, because details are relative to the size of
    the curve. If DONOR and CURVE have different affine maps, the command first encodes DONOR again
    with the affine maps of CURVE. If the new line crosses itself, the command still writes the
    line, and prints a warning.

    The JSON document has the keys "length" (metres) and "crosses" (the place where the line crosses
    itself, or null).
    """
    check_output(output, source, WRITTEN)
    check_output(output, donor)
    stored, other = read_stored(source), read_stored(donor)
    with print_warnings():
        changed = stored.detailed.transferred(other.detailed.recoded(stored.detailed), levels, gain)
    credits = dict.fromkeys(filter(None, (stored.attribution, other.attribution)))
    _write_changed(changed, stored.crs, "; ".join(credits), output, as_json)


@command("""
  evocity curve amplify edge.json --gain 2 -o rougher.json
  evocity curve amplify edge.json --gain 0 --levels 6,7 -o smoother.png""")
@click.argument("source", metavar="CURVE")
@curve_output
@gain_option
@levels_option
@json_option
def amplify(source: str, output: Path, gain: float, levels: str | None, as_json: bool) -> None:
    """Enlarge or reduce the details of a curve.

    If the new line crosses itself, the command still writes the line, and prints a warning.

    The JSON document has the keys "length" (metres) and "crosses" (the place where the line crosses
    itself, or null).
    """
    check_output(output, source, WRITTEN)
    chosen = levels_of(levels)
    stored = read_stored(source)
    with print_warnings():
        changed = stored.detailed.amplified(gain, chosen)
    _write_changed(changed, stored.crs, stored.attribution, output, as_json)


def read_stored(source: str) -> "StoredCurve":
    """Read a curve from a file, and print the library's warnings."""
    from evocity.shapes import read_curve

    with print_warnings():
        return read_curve(source)


def plain_line(curve: "Detailed") -> "np.ndarray":
    """The line of a ``curve`` without points that repeat the previous point."""
    import numpy as np

    line = curve.line()
    return line[np.append(True, (np.diff(line, axis=0) != 0).any(axis=1))]


def length_of(line: "np.ndarray") -> float:
    """The length of a ``line``, metres."""
    from evocity.shapes.lines import lengths_of

    return float(lengths_of(line)[-1])


def _write_changed(
    curve: "Detailed", crs: str | None, attribution: str, output: Path, as_json: bool
) -> None:
    from evocity.shapes import StoredCurve, crossing_of

    line = plain_line(curve)
    crossing = crossing_of(line)
    write_output(StoredCurve(curve, crs, attribution), output)
    if as_json:
        crosses = None if crossing is None else crossing.tolist()
        print_json({"length": length_of(line), "crosses": crosses})
        return
    echo(f"length {length_of(line):.6g} m; wrote {output}")


def write_output(stored: "StoredCurve", output: Path) -> None:
    """Write a curve as one of `WRITTEN`, by the suffix."""
    from evocity.io import PlacedLines, write_lines
    from evocity.shapes import line_picture, write_curve
    from evocity.shapes.rendering import line_svg

    suffix, line = output.suffix.lower(), plain_line(stored.detailed)
    if suffix == ".geojson":
        write_lines(PlacedLines((line,), stored.crs, stored.attribution), output)
    elif suffix in (".json", ".parquet"):
        write_curve(stored.detailed, output, stored.crs, stored.attribution)
    else:
        with replace_file(output) as temporary:
            if suffix == ".png":
                line_picture([line], 1024).save(temporary, "PNG")
            else:
                temporary.write_text(line_svg(line), encoding="utf-8")


@contextmanager
def print_warnings() -> Iterator[None]:
    """Print the library's warnings as commands print theirs."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        yield
    for text in dict.fromkeys(str(warning.message) for warning in caught):
        warn(text)
