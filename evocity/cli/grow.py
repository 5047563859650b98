"""`evocity grow`: fabric of any size from genomes."""

import hashlib
import time
from pathlib import Path
from typing import Any

import click

from evocity.cli.shared.checks import check_crs, check_needs, check_output, report_write_errors
from evocity.cli.shared.commands import command
from evocity.cli.shared.inputs import parents_of
from evocity.cli.shared.options import (
    WHOLE,
    crs_option,
    flag,
    ids_option,
    json_option,
    option,
    output_option,
    parent_options,
)
from evocity.cli.shared.scene_options import (
    SIDE,
    check_outputs,
    check_tile,
    ground_option,
    lod_option,
    roofs_option,
    say_tiles,
    tile_option,
    tiles_option,
    write_scene_tiles,
)
from evocity.cli.shared.shares import share_of
from evocity.cli.shared.terminal import echo, print_json, progress_bar
from evocity.errors import EvocityError

#: Most pixels of what is built whole in memory (footprints, a picture, a genome): 4096².
MOST_WHOLE = 1 << 24
# Settings of a fabric, from `Growth.made`.
_MADE = ("cell", "side_min", "side_max", "tolerance", "candidates", "turned", "streets")


@command("""
  evocity grow lyon.parquet --width 4096 --height 4096 -o large.tif
  evocity grow lyon-1er --width 1024 --height 512 --seed 7 --straight -o long.png
  evocity grow lyon-1er --width 1024 --height 1024 --top -5000 --left 20000 -o far.tif
  evocity grow lyon-1er montpellier-pas-du-loup --width 1024 --height 512 -o between.tif
  evocity grow lyon-1er --width 2048 --height 2048 --streets -o along-streets.tif
  evocity grow runs/lyon-x-montpellier --id 97 --width 1024 --height 1024 -o large.parquet
  evocity grow lyon-1er --width 1024 --height 512 -o grown.glb --lod 1.2
  evocity grow lyon-1er --width 1024 --height 1024 --tiles grown-tiles --tile 256
  evocity grow lyon-1er --width 512 --height 512 --streets --ground -o streets.glb""")
@click.argument("genomes", metavar="GENOME|RUN|MAP...", nargs=-1, required=True)
@option("--width", "Width of the new map, in pixels.", int, required=True)
@option("--height", "Height of the new map, in pixels.", int, required=True)
@output_option(
    "FILE",
    "File to write: .tif (heights with coordinates) or .npy (only heights). Maps up to 4096 × "
    "4096 px may have the format .gpkg, .fgb, .geoparquet or .geojson (footprints with heights), "
    ".png (a picture), .parquet (a genome), or a format of evocity scene such as .glb",
    required=False,
)
@tiles_option
@tile_option
@lod_option
@roofs_option
@ground_option
@option("--seed", "Seed of the random draws; the same seed grows the same fabric.", WHOLE, 0)
@option(
    "--top PIXELS", "Row of the map's north-west pixel in the fabric. [original in the middle]", int
)
@option(
    "--left PIXELS",
    "Column of the map's north-west pixel in the fabric. [original in the middle]",
    int,
)
@option(
    "--corner ROW COLUMN",
    "Row and column of the cell where the original city's north-west corner lies. [middle]",
    int,
)
@option(
    "--share FILE|NUMBER...",
    "Share of groups that come from the second genome; with three or more genomes, one share for "
    "each genome. A share is a number from 0 to 1, or a picture in which white is 1. [a ramp from"
    " "
    "west to east]",
)
@option(
    "--share-over TOP LEFT HEIGHT WIDTH",
    "Area over which the shares of --share change, in pixels from the north-west corner of the "
    "first genome's city. [the map]",
    int,
)
@option("--cell PIXELS", "Side of the square cells that form groups, in pixels. [about 8 m]", int)
@option(
    "--side-min METRES",
    "Smallest side of a group of cells, in metres. [over half of --side-max]",
    float,
)
@option(
    "--side-max METRES",
    "Largest side of a group of cells, in metres. [56 px, or half the original]",
    float,
)
@option("--size-min", "Deprecated: the value of --side-min, counted in range blocks.", int)
@option("--size-max", "Deprecated: the value of --side-max, counted in range blocks.", int)
@option(
    "--tolerance", "Largest mean height difference along a group's outline, in metres.", float, 6.0
)
@option(
    "--candidates",
    "Number of candidates that the command compares for each group; more candidates improve the "
    "fit, but need more time.",
    int,
    600,
)
@flag("--straight", "Keep street directions: do not rotate or mirror groups.")
@flag(
    "--streets",
    "Grow streets that run through, with quarters of the original city between them, in place of "
    "small groups of cells.",
)
@crs_option
@ids_option("Give one --id for each run folder among the genomes, in the order of the folders")
@parent_options
@json_option
def grow(
    genomes, width, height, output: Path | None, tiles, tile, lod, roofs, ground, seed, top, left,
    corner, share, share_over, straight, streets, crs, identifiers, reading, coding, as_json,
    **sizes,
) -> None:  # fmt: skip
    """Grow an endless city fabric around a city, or between several cities.

    The original city stays unchanged. Around the original city, the command places copied groups of
    square map cells, and each group fits the adjacent groups without visible seams. No area of 64 ×
    64 px appears twice in the fabric, unless the original city repeats this area
    (docs/operators.md). The fabric depends only on the genomes, the options and the seed. With
    --top and --left, you can write any part of the fabric, and adjacent parts fit together. The
    command writes the map piece by piece, so a large map needs little memory.

    Each GENOME is a genome file, a run folder with --id, a map file, or the name of a bundled
    district. If you name a map, the command first encodes the map as a genome. With several
    genomes, only the city of the first genome stays unchanged in the fabric. The option --share
    sets the share of copied groups that come from each genome.

    With --tiles, the command writes a folder of tiles of a scene, as evocity scene does. It looks
    at a strip of the fabric around the map, so tiles of adjacent maps share their buildings. The
    ground of these tiles and of a scene after -o is one surface. With --ground, the ground consists
    of streets, pavements, squares and other surfaces. The folder keeps the seed and all other
    settings, and the command refuses other settings for this folder before it grows the fabric.
    With --crs, only the .city.jsonl files of tiles have another reference system.

    With --streets, the command first draws avenues and streets without end, and then fills the
    quarters between them. Each quarter shows one place of an original city, turned to the streets
    around it. A street cuts a building only along the building's front. The options --side-min and
    --side-max then set the sides of quarters. The options --tolerance, --size-min and --size-max do
    not apply.

    The options --top and --left count pixels from the north-west corner of the first genome's city,
    and may be negative. If only one of --top and --left is given, the other option is 0. With
    several genomes and without --top and --left, the first genome's city lies at the west edge of
    the map. You can give --corner instead of --top and --left. A picture for --share is black where
    all groups come from the first genome. Two adjacent maps of a fabric fit together only if you
    use the same --share-over for both maps. Cells consist of whole range blocks, and groups of
    cells have sides of at most 56 px.

    The JSON document has the keys "groups", "step", "forced", "repeated", "top", "left", "cell",
    "side_min", "side_max", "repaired" and "seconds". The key "step" is the mean height difference
    along the outlines of groups, in metres. The key "forced" counts groups whose mean height
    difference along the outline is above --tolerance. The key "repeated" counts groups that make an
    area appear twice. The key "cell" is the side of a cell, in pixels. The keys "side_min" and
    "side_max" are the smallest and the largest allowed side of a group, in metres. If the command
    writes a genome, the key "repaired" counts the repaired lifs of the genome. With --tiles, the
    key "tiles" holds the numbers of tiles, files and bytes, and of buildings and triangles by
    level. With --streets, groups are quarters. The key "front" then replaces "step" and "repeated":
    it is the mean built share of a strip along the streets. The key "forced" counts quarters that
    stay open, because no place fits.
    """
    import numpy as np

    from evocity.growth import grow as grow_fabric
    from evocity.io import WINDOW_WRITERS
    from evocity.io.export.reference_systems import check_placed, export_system
    from evocity.io.footprint_files import is_placed, no_geojson
    from evocity.scene.roofs import level_of

    suffix = _check_outputs(genomes, output, tiles, tile, lod, roofs, ground, crs)
    lod = level_of(lod, roofs)
    if (suffix not in WINDOW_WRITERS or tiles is not None) and width * height > MOST_WHOLE:
        what = "tiles" if tiles is not None else f"a {suffix} file"
        raise EvocityError(
            f"a map of {height} × {width} px is too large for {what}",
            f"a map of at most {MOST_WHOLE // 10**6} million pixels, for example 4096 × 4096",
            "write a .tif or .npy file, or choose a smaller --width or --height; parts of a fabric "
            "meet, see --top and --left",
        )
    if min(width, height) > 0:  # the fabric has its own errors for other sizes
        check_tile(tiles, tile, height, width)
    if corner and not (top is None and left is None):
        raise EvocityError(
            "--corner cannot be combined with --top or --left",
            "either the option --corner, or the options --top and --left",
            "leave out --corner, or leave out --top and --left",
        )
    placed = top is not None or left is not None
    check_needs("--share-over", "--top and --left", bool(share_over) and not placed)
    shares = share_of(share, len(genomes))
    codes = parents_of(genomes, identifiers, reading, coding)
    if suffix == ".geojson" and not is_placed(codes[0]):
        raise no_geojson(" × ".join(codes[0].cities))
    check_placed(codes[0], crs)
    start = time.perf_counter()
    place = (top or 0, left or 0, height, width)
    fabric = grow_fabric(
        codes,
        height,
        width,
        np.random.default_rng(seed),
        corner=(0, 0) if placed else corner or None,
        share=shares,
        share_over=share_over or (place if placed and len(codes) > 1 else None),
        turned=not straight,
        streets=streets,
        **sizes,
    )
    if placed:
        fabric = fabric.at(*place)
    top, left = (-at for at in fabric.place)
    settings = {"genomes": [code.digest for code in codes], "top": top, "left": left, "seed": seed}
    settings |= {"width": width, "height": height, "share_over": list(share_over or ()) or None}
    settings |= {"share": _spell_share(shares), "tile": tile or SIDE, "lod": lod, "ground": ground}
    settings |= {"crs": crs} | {key: fabric.made[key] for key in _MADE if key in fabric.made}
    check_tile(tiles, tile, height, width, settings)
    export_system(fabric, crs, metres=tiles is not None)
    with progress_bar(f"growing {fabric.name}") as progress:
        made = {**fabric.made, **fabric.account(progress=progress)}
    seconds = time.perf_counter() - start
    made |= {"top": top, "left": left}
    if tiles is not None:  # first, because the folder may hold tiles of another fabric
        made["tiles"] = _write_tiles(fabric, tiles, tile, lod, ground, crs=crs, settings=settings)
    if output is not None:
        made |= _write(fabric, output, lod, ground, crs)
    if as_json:
        keys = (
            "groups", "step", "front", "forced", "repeated", "top", "left", "cell", "side_min",
            "side_max", "repaired", "tiles",
        )  # fmt: skip
        print_json({key: made[key] for key in keys if key in made} | {"seconds": seconds})
        return
    pixel = fabric.metres_per_pixel
    echo(
        f"{fabric.name}: {height} × {width} px at {pixel:g} m, "
        f"{height * pixel / 1000:.3g} × {width * pixel / 1000:.3g} km, "
        f"from row {top}, column {left}"
    )
    for line in _quality_of(made, seconds):
        echo(line)
    if "repaired" in made:
        echo(f"{made['repaired']} lifs repaired")
    if output is not None:
        echo(f"wrote {output}")
    if tiles is not None:
        echo(say_tiles(made["tiles"], tiles))


def _check_outputs(genomes, output: Path | None, tiles, tile, lod, roofs, ground, crs) -> str:
    """Return the suffix of the output, or raise `EvocityError`."""
    from evocity.io import WINDOW_WRITERS, WRITERS
    from evocity.io.writers import PLACED
    from evocity.scene import SUFFIXES, suffix_of
    from evocity.scene.detail import check_format
    from evocity.scene.export import UNPLACED
    from evocity.scene.roofs import level_of

    check_outputs(output, tiles, tile, crs)
    if output is None:
        return ""
    check_crs(crs, output, (*PLACED, *(one for one in SUFFIXES if one not in UNPLACED)))
    scene = _is_scene(output)
    check_needs("--lod", "a scene or --tiles", lod is not None and not (scene or tiles))
    check_needs("--roofs", "a scene or --tiles", roofs and not (scene or tiles))
    covered = scene or tiles or output.suffix.lower() == ".gpkg"
    check_needs("--ground", "a scene, a .gpkg file or --tiles", ground and not covered)
    if scene:
        check_format(level_of(lod, roofs), suffix_of(output) or "")
    for genome in genomes:
        known = () if scene else {*WINDOW_WRITERS, *WRITERS, ".parquet"}
        check_output(output, genome, known)
    return output.suffix.lower()


def _is_scene(output: Path) -> bool:
    """Whether only `evocity.scene` writes files of this name."""
    from evocity.io import WRITERS
    from evocity.scene import suffix_of

    suffix = suffix_of(output)
    return suffix is not None and suffix not in WRITERS


def _spell_share(shares) -> Any:
    """Return shares as JSON holds them: numbers, or a digest of an array."""
    if shares is None or isinstance(shares, float | list):
        return shares
    return hashlib.sha256(repr(shares.shape).encode() + shares.tobytes()).hexdigest()


def _write_tiles(fabric, folder: Path, tile: int | None, lod: str, ground: bool, **how) -> dict:
    """Write the tiles of a fabric; returns facts about them."""
    import evocity
    from evocity.growth.surroundings import map_with_margin

    city, margin = map_with_margin(fabric)
    roofs = fabric.building_roofs(city, -margin, -margin)
    scene = evocity.scene(city, lod=lod, streets=ground, given_roofs=roofs)
    return write_scene_tiles(scene, folder, tile, margin=margin, **how)


def _quality_of(made: dict, seconds: float) -> list[str]:
    """Say in lines what was laid, and how well it fits."""
    sides = f"of {made['side_min']:g} to {made['side_max']:g} m laid in {seconds:.1f} s"
    if made.get("streets"):
        lines = [
            f"{made['groups']} quarters {sides}; "
            f"{100 * made['front']:.0f} % of their fronts are built"
        ]
        if made["forced"]:
            lines.append(f"{made['forced']} of them stay open, because no place fits")
        return lines
    lines = [
        f"{made['groups']} groups {sides}; mean step along their outlines {made['step']:.2f} m"
    ]
    if made["forced"]:
        lines.append(
            f"{made['forced']} of them had no admissible candidate; they have the smallest step"
        )
    if made.get("repeated"):
        lines.append(f"{made['repeated']} of them make a window of 64 × 64 px appear twice")
    return lines


def _write(fabric, output: Path, lod: str, ground: bool, crs: str | None) -> dict:
    """Write a fabric, as the suffix says; returns facts about a genome."""
    import evocity
    from evocity.io import WINDOW_WRITERS, WRITERS, write_windows

    if output.suffix.lower() in WINDOW_WRITERS:
        with progress_bar(f"writing {output.name}") as progress:
            write_windows(fabric, output, progress, crs)
    elif _is_scene(output):
        city = fabric.city()
        roofs = fabric.building_roofs(city)
        scene = evocity.scene(city, lod=lod, streets=ground, given_roofs=roofs)
        scene.write(output, crs=crs)
    elif output.suffix.lower() in WRITERS:
        streets = ground and output.suffix.lower() == ".gpkg"
        evocity.write_map(fabric.city(), output, crs=crs, streets=streets)
    else:
        genome = fabric.genome()
        with report_write_errors(output):
            genome.write(output)
        return dict(genome.made)
    return {}
