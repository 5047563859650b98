"""`evocity library`: objects of real maps, to stand where generated buildings are."""

import contextlib
import json
from collections import Counter
from pathlib import Path

import click

import evocity
from evocity.cli.common import (
    Commands,
    check_output,
    echo,
    json_option,
    map_options,
    note_compiling,
    note_reading,
    print_json,
)
from evocity.errors import EvocityError


@click.group(cls=Commands)
def library() -> None:
    """Objects of real maps, to stand where generated buildings are."""


@library.command(
    epilog="""\b
Examples:
  evocity library new new-york-west-village cape-town-salt-river -o objects
  evocity library new town.gpkg --licence CC0-1.0 --atmosphere "garden city" -o objects
  evocity library new lyon-1er --pixels 512 --metres-per-pixel 1 --isolated -o objects"""
)
@click.argument("maps", metavar="MAP...", nargs=-1, required=True)
@click.option(
    "-o",
    "--output",
    required=True,
    type=click.Path(path_type=Path),
    metavar="FOLDER",
    help="Folder of the library, made if need be; a table in it is overwritten.",
)
@click.option(
    "--licence",
    metavar="NAME",
    show_default="what the map's file tells, as bundled districts do",
    help="Under which licence the maps may be used, such as ODbL-1.0.",
)
@click.option(
    "--atmosphere",
    metavar="TEXT",
    default="",
    show_default="none",
    help="What kind of place the objects are of, in words.",
)
@click.option("--isolated", is_flag=True, help="Leave out what stands wall to wall with others.")
@click.option(
    "--classes",
    type=click.Path(path_type=Path),
    metavar="TOML",
    show_default="the seven of evocity",
    help="Table of classes, by which each object has its own.",
)
@map_options
@json_option
def new(maps, output: Path, licence, atmosphere, isolated, classes, reading, as_json) -> None:
    """Make a library of the buildings of MAPs.

    Each MAP is a map file or the name of a bundled district. Its buildings of 24 m² and more that
    its border does not cut become objects, with straight walls, heights and classes. FOLDER gets
    objects.gpkg, which QGIS opens; `evocity scene --library FOLDER` uses it.

    JSON keys: table (its path), objects, isolated, classes (how many of each), maps (how many
    of each).
    """
    from evocity.scene.library import Library
    from evocity.views.classes import ClassTable

    _check_folder(output)
    if output.is_dir():
        for source in maps:
            check_output(output / "objects.gpkg", source)
    note_compiling()
    table = None if classes is None else ClassTable.read(classes)
    for source, count in Counter(maps).items():
        if count > 1:
            raise EvocityError(f"the map {source} twice", "each map once", "leave one out")
    made, named = [], Counter()
    for source in maps:
        city = evocity.read_map(source, **reading)
        told = licence or _licence_of(source)
        if not told:
            raise EvocityError(
                f"{source} tells no licence",
                "the licence under which it may be used",
                "name it, for example with --licence ODbL-1.0",
            )
        note_reading(city, reading)
        named[city.name] += 1
        if named[city.name] > 1:  # ids begin with it
            city = city.replace(city.heights, name=f"{city.name} ({named[city.name]})")
        objects = Library.of(
            city,
            licence=told,
            atmosphere=atmosphere,
            attached=not isolated,
            table=table,
        )
        made.append((source, objects))
    whole = Library.joined(objects for _, objects in made)
    if not len(whole):
        raise EvocityError(
            f"no building of 24 m² and more in {', '.join(maps)} that the border does not cut",
            "a map with whole buildings",
            "choose another window with --center, --pixels and --metres-per-pixel",
        )
    path = whole.write(output)
    alone = int((~whole.attached).sum())
    kinds = {one: whole.classes.count(one) for one in dict.fromkeys(whole.classes)}
    if as_json:
        counts = {source: len(objects) for source, objects in made}
        about = {"table": str(path), "objects": len(whole), "isolated": alone}
        print_json({**about, "classes": kinds, "maps": counts})
        return
    for source, objects in made:
        echo(f"{source}: {len(objects)} objects")
    told = ", ".join(f"{count} {name}" for name, count in kinds.items())
    echo(f"{len(whole)} objects, {alone} of them isolated: {told}")
    echo(f"wrote {path}")


def _check_folder(folder: Path) -> None:
    """Raise unless ``folder`` is one, or may become one."""
    if folder.is_dir() or (not folder.exists() and folder.absolute().parent.is_dir()):
        return
    what = "is a file" if folder.exists() else "lies in no folder that is there"
    raise EvocityError(f"{str(folder)!r} {what}", "a folder", "choose another name after -o")


def _licence_of(source: str) -> str:
    """What a bundled district, or a GeoJSON file like it, tells as its ``licence``; "" if none."""
    from evocity.io.bundled import cities, path_of

    path = path_of(source) if source in cities() else Path(source)
    if path.suffix.lower() not in (".geojson", ".json"):
        return ""
    with contextlib.suppress(OSError, ValueError, RecursionError):
        document = json.loads(path.read_text(encoding="utf-8"))
        if isinstance(document, dict) and isinstance(document.get("licence"), str):
            return document["licence"].strip()
    return ""
