"""Options of scenes: level of detail, budget of triangles, ground, tiles, kinds of files."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click

from evocity.cli.shared.checks import check_folder, check_needs
from evocity.cli.shared.options import FILE, flag, option
from evocity.cli.shared.terminal import progress_bar
from evocity.errors import EvocityError

#: As `evocity.scene.LEVELS`, which is slow to load.
LEVELS = ("2.2", "1.3", "1.2", "1.0", "afar", "0")

lod_option = option(
    "--lod",
    "Level of detail: 0 has footprints; 1.0 has blocks of buildings that touch; 1.2 has one height "
    "for parts that touch; 1.3 has a height for each part; 2.2 has roofs; afar has blocks that "
    "reach across streets. "
    "[1.3]",
    click.Choice(LEVELS),
)
triangles_option = option(
    "--triangles",
    "Most triangles of the scene: the command chooses a coarser --lod if needed.",
    int,
)
_GROUND = (
    "as layers in a .gpkg file, and as surfaces in files of solids and pictures. A .fgb or "
    ".geoparquet file cannot have streets."
)
streets_option = flag("--streets", f"Add streets, squares and other ground: {_GROUND}")
ground_option = flag(
    "--ground",
    f"Add streets, squares and other ground, as evocity scene does with --streets: {_GROUND}",
)
water_option = option(
    "--water FILE",
    "File that marks open ground that is water, with footprints or with raster values above 0; "
    "only with --streets. [no water]",
    FILE,
)
roofs_option = flag("--roofs", "Put pitched roofs on buildings, as with --lod 2.2.")
roof_surface_option = option(
    "--roof-surface SURFACE",
    "Surface from `evocity surface`, such as a vault, for the roofs of wide buildings; with "
    "--roofs, only of those without pitched roofs. The scene has LoD 2.2. [no surface]",
    FILE,
)
roof_rise_option = option(
    "--roof-rise METRES",
    "Rise of the surface of --roof-surface, in metres, above 0 and at most 100. [a fifth of the "
    "width of the building]",
    float,
)
tiles_option = option(
    "--tiles FOLDER",
    "Folder for tiles of the scene: a .glb file per tile and level of detail, a .city.jsonl file "
    "per tile, and a tileset.json (3D Tiles 1.1, for Cesium).",
    FILE,
)
tile_option = option("--tile PIXELS", "Side of a tile of --tiles, in pixels. [256]", int)

#: Side of a tile, pixels.
SIDE = 256


def check_outputs(
    output: Path | None, tiles: Path | None, tile: int | None, crs: str | None
) -> None:
    """Raise `EvocityError` without an output, for tiles that cannot be written, and for an unknown
    reference system ``crs`` of tiles."""
    check_needs("--tile", "--tiles", tile is not None and tiles is None)
    if output is None and tiles is None:
        raise EvocityError(
            "neither -o nor --tiles is given",
            "the name of a file after -o, or of a folder after --tiles",
            "add for example -o scene.glb",
        )
    if tiles is not None:
        if crs is not None:
            from evocity.io.export.reference_systems import parse_requested

            parse_requested(crs)
        if tiles.is_file():
            raise EvocityError(
                f"{str(tiles)!r} is a file",
                "the name of a folder after --tiles",
                "choose another name",
            )
        check_folder(tiles if tiles.is_dir() else tiles.absolute().parent)


def check_tile(
    tiles: Path | None,
    tile: int | None,
    high: int,
    wide: int,
    settings: Mapping[str, Any] | None = None,
) -> None:
    """Raise `EvocityError` for tiles that do not divide a map of ``high`` × ``wide`` px, and for a
    folder of ``tiles`` that holds other files, or tiles with other ``settings``."""
    if tiles is not None:
        from evocity.scene.tiles import check_side, check_tiles_folder

        check_side(SIDE if tile is None else tile, high, wide)
        check_tiles_folder(tiles, settings)


def write_scene_tiles(scene, folder: Path, tile: int | None, **how: Any) -> dict:
    """Write the tiles of a scene, with the options ``how`` of `evocity.scene.write_tiles`, and
    return its facts."""
    from evocity.scene import write_tiles

    with progress_bar(f"writing {folder.name}") as progress:
        return write_tiles(scene, folder, SIDE if tile is None else tile, progress=progress, **how)


def water_of(water: Path | None, city) -> dict[str, Any]:
    """Return the options of `evocity.scene` for the water in the file ``water``."""
    if water is None:
        return {}
    from evocity.io.condensation_masks import read_water

    mask, attribution = read_water(water, city)
    return {"water": mask, "credit": attribution}


def say_tiles(facts: dict, folder: Path) -> str:
    """Say in a line which tiles were written."""
    names = ", ".join(facts["levels"])
    return f"wrote {facts['tiles']} tiles of LoD {names}, {facts['files']} files, to {folder}"


def check_lod_node(output: Path | None, suffix: str, zooms: tuple[float, ...]) -> None:
    """Raise `EvocityError` unless several ``zooms`` can be levels of one file."""
    if suffix not in (".wrl", ".x3d"):
        raise EvocityError(
            f"--lod-node cannot be used with the output {output.name if output else 'of --tiles'}",
            "an output file whose name ends in .wrl or .x3d",
            "choose another suffix, or leave --lod-node out",
        )
    if len(set(zooms)) < 2:
        raise EvocityError(
            f"--lod-node with {len(set(zooms))} zoom factor{'s' * (len(set(zooms)) != 1)}",
            "two or more zoom factors",
            "give --zoom several times, for example --zoom 0.5 --zoom 1 --zoom 2",
        )


def check_glb_options(output: Path | None, suffix: str, **given: bool) -> None:
    """Raise `EvocityError` for options of .glb files with an ``output`` of another ``suffix``."""
    name_of = output.name if output else "of --tiles"
    if suffix != ".glb":
        for name in (name for name, on in given.items() if on):
            raise EvocityError(
                f"--{name} cannot be used with the output {name_of}",
                "an output file whose name ends in .glb",
                f"leave --{name} out",
            )


def printing_options(output: Path | None, side: float | None) -> dict[str, float]:
    """The options of a file for a printer. Raises `EvocityError` for a ``side`` of another file."""
    if side is None:
        return {}
    name = output.name if output else "of --tiles"
    if output is None or output.suffix.lower() not in (".stl", ".3mf"):
        raise EvocityError(
            f"--print-side cannot be used with the output {name}",
            "an output file whose name ends in .stl or .3mf",
            "leave --print-side out",
        )
    return {"side": side}
