"""`evocity library`: objects from real maps, to replace generated buildings."""

import contextlib
import json
from collections import Counter
from pathlib import Path

import click

import evocity
from evocity.cli.shared.checks import check_output
from evocity.cli.shared.commands import Commands, command
from evocity.cli.shared.options import FILE, flag, json_option, map_options, option
from evocity.cli.shared.terminal import echo, note_compiling, note_reading, print_json
from evocity.errors import EvocityError


@click.group(cls=Commands)
def library() -> None:
    """Make libraries of real buildings, which can replace generated buildings in scenes."""


@command("""
  evocity library new new-york-west-village cape-town-salt-river -o objects
  evocity library new town.gpkg --licence CC0-1.0 --atmosphere "garden city" -o objects
  evocity library new lyon-1er --pixels 512 --metres-per-pixel 1 --isolated -o objects""")
@click.argument("maps", metavar="MAP...", nargs=-1, required=True)
@option(
    "-o --output FOLDER",
    "Folder of the library; the command creates the folder if necessary, and overwrites an "
    "existing objects.gpkg.",
    FILE,
    required=True,
)
@option("--licence NAME", "Licence of the maps, such as ODbL-1.0. [from the map's file]")
@option(
    "--atmosphere TEXT",
    'Words that describe the atmosphere of the objects, such as "garden city". [none]',
    default="",
)
@flag("--isolated", "Leave out buildings that touch other buildings.")
@option(
    "--classes TOML", "TOML file with a table of building classes. [the seven of evocity]", FILE
)
@map_options
@json_option
def new(maps, output: Path, licence, atmosphere, isolated, classes, reading, as_json) -> None:
    """Make a library from the buildings of MAPs.

    Each MAP is a map file or the name of a bundled district. Objects are buildings of 24 m² or more
    that lie wholly within the map. Each object has straight walls, a height and a class. The
    command writes the file objects.gpkg into FOLDER, for QGIS and for `evocity scene --library
    FOLDER`.

    The JSON document has the keys "table" (path of objects.gpkg), "objects" and "isolated" (numbers
    of objects), "classes" (numbers by class) and "maps" (numbers by map).
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
            raise EvocityError(
                f"the map {source} appears twice",
                "maps that are all different",
                "remove one of the two names of this map",
            )
    made, named = [], Counter()
    for source in maps:
        city = evocity.read_map(source, **reading)
        terms = licence or _licence_of(source)
        if not terms:
            raise EvocityError(
                f"{source} has no licence",
                "a map whose licence is known",
                "name the licence of the map, for example with --licence ODbL-1.0",
            )
        note_reading(city, reading)
        named[city.name] += 1
        if named[city.name] > 1:  # ids begin with it
            city = city.replace(city.heights, name=f"{city.name} ({named[city.name]})")
        objects = Library.of(
            city, licence=terms, atmosphere=atmosphere, attached=not isolated, table=table
        )
        made.append((source, objects))
    whole = Library.joined(objects for _, objects in made)
    if not len(whole):
        raise EvocityError(
            f"there is no whole building of 24 m² or more in {', '.join(maps)}",
            "at least one building of 24 m² or more that the border of the map does not cut",
            "choose another window with --center, --pixels and --metres-per-pixel",
        )
    path = whole.write(output)
    isolated = int((~whole.attached).sum())
    kinds = {name: whole.classes.count(name) for name in dict.fromkeys(whole.classes)}
    if as_json:
        counts = {source: len(objects) for source, objects in made}
        about = {"table": str(path), "objects": len(whole), "isolated": isolated}
        print_json({**about, "classes": kinds, "maps": counts})
        return
    for source, objects in made:
        echo(f"{source}: {len(objects)} objects")
    counted = ", ".join(f"{count} {name}" for name, count in kinds.items())
    echo(f"{len(whole)} objects, {isolated} of them isolated: {counted}")
    echo(f"wrote {path}")


def _check_folder(folder: Path) -> None:
    """Raise `EvocityError` unless ``folder`` is a folder, or can be created."""
    if folder.is_dir() or (not folder.exists() and folder.absolute().parent.is_dir()):
        return
    what = "a file has this name" if folder.exists() else "its parent folder does not exist"
    raise EvocityError(
        f"the folder {str(folder)!r} cannot be created: {what}",
        "an existing folder, or a new name inside an existing folder",
        "choose another folder after -o",
    )


def _licence_of(source: str) -> str:
    """The ``licence`` of a bundled district, or of a GeoJSON file like it; "" without a licence."""
    from evocity.io.bundled_cities import cities, path_of

    path = path_of(source) if source in cities() else Path(source)
    if path.suffix.lower() not in (".geojson", ".json"):
        return ""
    with contextlib.suppress(OSError, ValueError, RecursionError):
        document = json.loads(path.read_text(encoding="utf-8"))
        if isinstance(document, dict) and isinstance(document.get("licence"), str):
            return document["licence"].strip()
    return ""


library.add_command(new)
