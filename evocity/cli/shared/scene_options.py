"""Options of scenes: level of detail, budget of triangles, tiles."""

from pathlib import Path

import click

from evocity.cli.shared.checks import check_folder, check_needs
from evocity.cli.shared.options import FILE, flag, option
from evocity.cli.shared.terminal import progress_bar
from evocity.errors import EvocityError

#: As `evocity.scene.LEVELS`, which is slow to load.
LEVELS = ("2.2", "1.3", "1.2", "1.0", "afar", "0")

lod_option = option(
    "--lod",
    "Level of detail: 0 for footprints, 1.0 for blocks of buildings that touch, 1.2 for one height "
    'for touching parts, 1.3 for each building, 2.2 for roofs, "afar" for blocks across streets. '
    "[1.3]",
    click.Choice(LEVELS),
)
triangles_option = option(
    "--triangles",
    "Most triangles of the scene: the command chooses a coarser --lod if needed.",
    int,
)
roofs_option = flag("--roofs", "Put pitched roofs on buildings, as with --lod 2.2.")
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
    """Raise `EvocityError` without an output, and for tiles that cannot be written."""
    check_needs("--tile", "--tiles", tile is not None and tiles is None)
    if output is None and tiles is None:
        raise EvocityError(
            "neither -o nor --tiles is given",
            "the name of a file after -o, or of a folder after --tiles",
            "add for example -o scene.glb",
        )
    if tiles is not None:
        if crs is not None:
            raise EvocityError(
                "--crs cannot be used with --tiles",
                "tiles without --crs: their tileset.json already has their place on the globe",
                "leave --crs out, or write a file with -o",
            )
        if tiles.is_file():
            raise EvocityError(
                f"{str(tiles)!r} is a file",
                "the name of a folder after --tiles",
                "choose another name",
            )
        check_folder(tiles if tiles.is_dir() else tiles.absolute().parent)


def check_tile(tiles: Path | None, tile: int | None, high: int, wide: int) -> None:
    """Raise `EvocityError` for a folder of ``tiles`` that holds other files, and for tiles that do
    not divide a map of ``high`` × ``wide`` px."""
    if tiles is not None:
        from evocity.scene.tiles import check_side, check_tiles_folder

        check_side(SIDE if tile is None else tile, high, wide)
        check_tiles_folder(tiles)


def write_scene_tiles(scene, folder: Path, tile: int | None, margin: int = 0) -> dict:
    """Write the tiles of a scene, and return the facts of `evocity.scene.write_tiles`."""
    from evocity.scene import write_tiles

    with progress_bar(f"writing {folder.name}") as progress:
        return write_tiles(
            scene, folder, SIDE if tile is None else tile, margin=margin, progress=progress
        )


def say_tiles(facts: dict, folder: Path) -> str:
    """Say in a line which tiles were written."""
    names = ", ".join(facts["levels"])
    return f"wrote {facts['tiles']} tiles of LoD {names}, {facts['files']} files, to {folder}"
