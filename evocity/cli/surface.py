"""`evocity surface`: height maps of ground as surfaces with details."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from evocity.cli.shared.checks import check_output
from evocity.cli.shared.commands import Commands, command
from evocity.cli.shared.detail_options import (
    donor_gain_option,
    finest_levels_option,
    gain_option,
    levels_of,
    levels_option,
)
from evocity.cli.shared.options import WHOLE, json_option, option, output_option
from evocity.cli.shared.terminal import echo, print_json

if TYPE_CHECKING:
    from evocity.shapes import StoredSurface

_WRITTEN = (".json", ".parquet", ".tif", ".tiff", ".npy")
_surface_output = output_option(
    "FILE", "File to write: .json or .parquet (the surface), .tif or .npy (its heights)"
)


@click.group(cls=Commands)
def surface() -> None:
    """Fit surfaces with details to height maps of ground, and change the surfaces.

    A surface consists of a grid of control heights, affine maps along both axes, and details.
    GROUND is a file that `evocity surface fit` or `evocity surface make` wrote.
    """


@command("""
  evocity surface fit dtm.tif -o ground.json
  evocity surface fit dtm.tif --depth 6 --drawn 2 -o ground.parquet""")
@click.argument("raster", metavar="DTM")
@_surface_output
@option("--points", "Number of control heights along each axis.", click.IntRange(2, 16), 7)
@option("--depth", "Number of levels of detail. [from the raster]", click.IntRange(1, 12))
@option(
    "--drawn",
    "Number of finest levels whose details the surface may lose and still stay near the ground.",
    click.IntRange(1, 12),
    3,
)
@option("--starts", "Number of random starts of the fit.", click.IntRange(1, 1000), 3)
@option("--seed", "Seed of the random starts of the fit.", WHOLE, 0)
@option("--nodata", "Value of missing pixels. [the value that the file declares]", float)
@json_option
def fit(
    raster: str, output: Path, points: int, depth: int | None, drawn: int, starts: int, seed: int,
    nodata: float | None, as_json: bool,
) -> None:  # fmt: skip
    """Fit a surface, with details, to a raster of ground elevations (DTM).

    The raster is resampled to the heights of the finest level. With all its details, the surface
    has these heights exactly. The raster may not have holes.

    The JSON document has the keys "heights", "depth", "numbers" and "rms". The key "numbers" counts
    the numbers of the surface without its finest levels. The numbers of the maps count, too. The
    key "rms" is the root-mean-square error of the surface with these numbers, in metres.
    """
    import numpy as np

    from evocity.io.ground_rasters import read_ground
    from evocity.shapes import StoredSurface, fit_surface, surface_rms

    check_output(output, raster, _WRITTEN)
    ground = read_ground(raster, nodata)
    fitted = fit_surface(
        ground.heights, points, 2, depth, drawn, starts, np.random.default_rng(seed),
        spacing=ground.spacing,
    )  # fmt: skip
    stored = StoredSurface(fitted, ground.crs, ground.corner, ground.attribution)
    _write(stored, output)
    levels = min(drawn, fitted.depth)
    rms, numbers = surface_rms(fitted, levels), fitted.number_count(levels)
    rows, columns = fitted.heights().shape
    if as_json:
        counts = {"heights": [rows, columns], "depth": fitted.depth}
        print_json(counts | {"numbers": numbers, "rms": rms})
        return
    echo(f"{rows} × {columns} heights, {fitted.depth} levels; exact with all details")
    echo(f"without the finest {levels} levels: {numbers} numbers, {rms:.4g} m off (RMS)")
    echo(f"wrote {output}")


@command("""
  evocity surface make vault -o vault.json
  evocity surface make shed --bays 6 -o sheds.json""")
@click.argument("form", metavar="FORM")
@_surface_output
@option(
    "--bays",
    "Number of vaults or sheds side by side, 1 to 8. [1 vault, 4 sheds]",
    click.IntRange(1, 8),
)
@json_option
def make(form: str, output: Path, bays: int | None, as_json: bool) -> None:
    """Make a surface of 1 m in the form of a roof. FORM is vault, dome, saddle or shed.

    `evocity scene --roof-surface` lays the surface on wide buildings. The glass of sheds faces the
    north. The JSON document has the keys "lowest" and "highest", metres.
    """
    from evocity.shapes import StoredSurface, surface_form

    check_output(output, "", _WRITTEN)
    _say(StoredSurface(surface_form(form, bays)), output, as_json)


@command("""
  evocity surface detail ground.json
  evocity surface detail ground.json --drop 3 -o smooth.tif""")
@click.argument("source", metavar="GROUND")
@option("--drop", "Number of finest levels of detail to leave out.", WHOLE, 0)
@output_option("FILE", "Surface to write: .json, .parquet, .tif or .npy", required=False)
@json_option
def detail(source: str, drop: int, output: Path | None, as_json: bool) -> None:
    """For each level of a surface, print the amount of detail, and the error without it.

    The JSON document has the key "levels". Each entry has the keys "level", "amount" (root mean
    square of the details, metres) and "rms" (error without this level and finer ones, metres).
    """
    from evocity.shapes import read_surface, surface_rms

    if output is not None:
        check_output(output, source, _WRITTEN)
    stored = read_surface(source)
    own = stored.surface.dropped(drop)
    rows = [
        {
            "level": level,
            "amount": float(own.amounts[level]),
            "rms": surface_rms(own, own.depth - level),
        }
        for level in range(own.depth)
    ]
    if output is not None:
        _write(_changed(stored, own), output)
    if as_json:
        print_json({"levels": rows})
        return
    echo("level  detail, m  without it and finer ones, m")
    for row in rows:
        echo(f"{row['level']:5}  {row['amount']:<9.4g}  {row['rms']:.4g}")
    if output is not None:
        echo(f"wrote {output}")


@command("""
  evocity surface transfer plain.json hills.json -o rough.tif
  evocity surface transfer plain.json hills.json --levels 4 --gain 0.5 -o rough.json""")
@click.argument("source", metavar="GROUND")
@click.argument("donor", metavar="DONOR")
@_surface_output
@finest_levels_option
@donor_gain_option
@json_option
def transfer(
    source: str, donor: str, output: Path, levels: int | None, gain: float, as_json: bool
) -> None:
    """Replace the finest details of GROUND with the details of another surface, DONOR.

    If DONOR and GROUND have different affine maps, the command first encodes DONOR again with the
    affine maps of GROUND. Details grow with the size of the ground. The JSON document has the keys
    "lowest" and "highest", metres.
    """
    from evocity.shapes import read_surface

    check_output(output, source, _WRITTEN)
    check_output(output, donor)
    stored, other = read_surface(source), read_surface(donor)
    changed = stored.surface.transferred(other.surface.recoded(stored.surface), levels, gain)
    credits = dict.fromkeys(filter(None, (stored.attribution, other.attribution)))
    _say(_changed(stored, changed, "; ".join(credits)), output, as_json)


@command("""
  evocity surface amplify ground.json --gain 2 -o rougher.json
  evocity surface amplify ground.json --gain 0 --levels 5,6 -o smoother.tif""")
@click.argument("source", metavar="GROUND")
@_surface_output
@gain_option
@levels_option
@json_option
def amplify(source: str, output: Path, gain: float, levels: str | None, as_json: bool) -> None:
    """Enlarge or reduce the details of a surface.

    The JSON document has the keys "lowest" and "highest", metres.
    """
    from evocity.shapes import read_surface

    check_output(output, source, _WRITTEN)
    chosen = levels_of(levels)
    stored = read_surface(source)
    _say(_changed(stored, stored.surface.amplified(gain, chosen)), output, as_json)


def _changed(stored: "StoredSurface", surface, attribution: str | None = None) -> "StoredSurface":
    from dataclasses import replace

    credit = stored.attribution if attribution is None else attribution
    return replace(stored, surface=surface, attribution=credit)


def _say(stored: "StoredSurface", output: Path, as_json: bool) -> None:
    _write(stored, output)
    heights = stored.surface.heights()
    lowest, highest = float(heights.min()), float(heights.max())
    if as_json:
        print_json({"lowest": lowest, "highest": highest})
        return
    echo(f"heights from {lowest:.4g} to {highest:.4g} m; wrote {output}")


def _write(stored: "StoredSurface", output: Path) -> None:
    """Write a surface as one of `_WRITTEN`, by the suffix."""
    from evocity.io.ground_rasters import GroundRaster, write_ground
    from evocity.shapes import write_surface

    if output.suffix.lower() in (".json", ".parquet"):
        write_surface(stored, output)
        return
    own = stored.surface
    place = own.spacing, stored.corner, stored.crs, stored.attribution
    write_ground(GroundRaster(own.heights(), *place), output)


for _command in (fit, make, detail, transfer, amplify):
    surface.add_command(_command)
