"""`evocity scene`: a map, a genome or one individual of a run in three dimensions."""

from pathlib import Path

import click

import evocity
from evocity.cli.shared.checks import check_output, check_zoom
from evocity.cli.shared.inputs import (
    city_of,
    decode_genome,
    genome_of,
    is_code,
    is_run,
    place_at,
    refuse_reading,
)
from evocity.cli.shared.options import (
    FILE,
    WHOLE,
    at_option,
    flag,
    id_option,
    json_option,
    map_options,
    option,
    output_option,
)
from evocity.cli.shared.terminal import describe, echo, note, note_compiling, print_json
from evocity.errors import EvocityError

#: As `evocity.views.walls.DETAIL`, which is slow to load.
DETAIL = 2.2


@click.command(
    epilog="""\b
Examples:
  evocity scene lyon-1er -o lyon.city.json
  evocity scene lyon.parquet -o lyon.glb
  evocity scene runs/lyon-x-montpellier --id 97 -o bred.glb --angles square --storeys 3
  evocity scene lyon.parquet -o level.glb --zoom 0.5 --zoom 1 --zoom 2"""
)
@click.argument("what", metavar="MAP|GENOME|RUN")
@output_option(
    "FILE",
    "Scene to write: .city.json (CityJSON 2.0, for GIS), .glb (glTF 2.0, for Blender and "
    "browsers), .obj (for Rhino), .wrl (VRML97), .x3d, .gpkg (footprints) or .png (a picture)",
)
@id_option
@option("--tolerance detail METRES", "Length of the shortest piece of wall.", float, DETAIL)
@option("--angles", "Directions of walls in a building.", click.Choice(["none", "square"]), "none")
@option(
    "--storeys METRES",
    "Height of a storey, to which heights are rounded. [heights as they are]",
    float,
)
@option("--least-area M2", "Smallest area of a separate building.", float, 0.0)
@option("--zoom Z...", "Fractal zoom of a genome: above 1 finer, below 1 simpler. [1]", float)
@option("--classes TOML", "Table of classes and their colours. [the seven of the papers]", FILE)
@option("--library FOLDER", "Library of objects that replace buildings where they fit.", FILE)
@option("--atmosphere WORDS", "Atmosphere of the objects of --library. [any]")
@option(
    "--seed", "Seed of the random choice among objects of --library that fit equally.", WHOLE, 0
)
@flag("--streets", "Add streets: as surfaces, or as layers in a .gpkg.")
@option(
    "--colours",
    "Meaning of roof colours in a .png. [classes with --classes, else heights]",
    click.Choice(["heights", "classes"]),
)
@option("--azimuth", "Direction of view of a .png, degrees clockwise from north. [25]", float)
@option("--tilt", "Angle of view of a .png, degrees; 90 is a plan. [40]", click.FloatRange(1, 90))
@option("--width", "Width of a .png, pixels. [900]", click.IntRange(16, 8192))
@at_option
@map_options
@json_option
def scene(
    what: str,
    output: Path,
    identifier,
    at,
    detail,
    angles,
    storeys,
    least_area,
    zoom,
    classes,
    library,
    atmosphere,
    seed,
    streets,
    colours,
    azimuth,
    tilt,
    width,
    reading,
    as_json,
) -> None:
    """Write a map in three dimensions: solids with floors, walls and flat roofs, on the ground.

    MAP is a file or a bundled name, GENOME a genome file, and RUN a run folder with --id. Walls are
    straight lines fitted to the pixels. With --angles square, the walls of a building follow its
    one or two main directions. A building smaller than --least-area joins a neighbour; without a
    neighbour it disappears. With several --zoom, the command writes a file for each zoom: level.glb
    becomes level-z0.5.glb, level-z1.glb and so on.

    Coordinates are metres from the map's south-west corner. The file keeps the place of that
    corner, the reference system and the attribution. The commands of evocity can read a .city.json
    that this command wrote.
    """
    import numpy as np

    from evocity.scene import check_suffix

    check_suffix(output)
    for source in filter(None, (what, classes, library and library / "objects.gpkg")):
        check_output(output, str(source))
    note_compiling()
    how = {
        "detail": detail,
        "squared": angles == "square",
        "storeys": storeys,
        "least_area": least_area,
    }
    how |= {"measures": _measures(what, identifier), "streets": streets}
    if classes is not None:
        from evocity.views.classes import ClassTable

        how["classes"] = ClassTable.read(classes)
    if library is not None:
        from evocity.scene.library import Library

        objects = Library.read(library)
        how["library"] = objects if atmosphere is None else objects.of_atmosphere(atmosphere)
    elif atmosphere is not None:
        raise EvocityError(
            "--atmosphere without --library",
            "--atmosphere with --library",
            "add --library FOLDER, or leave --atmosphere out",
        )
    drawn = {"colours": colours, "azimuth": azimuth, "tilt": tilt, "width": width}
    drawn = {name: value for name, value in drawn.items() if value is not None}
    if drawn and check_suffix(output) != ".png":
        name = f"--{next(iter(drawn))}"
        raise EvocityError(
            f"{name} does not fit the output {output.name}", "an output .png", f"leave {name} out"
        )
    if classes is not None and check_suffix(output) == ".png":
        drawn = {"colours": "classes"} | drawn
    written = []
    place = {} if at is None else place_at(what, at)
    for path, city in _levels(what, reading, identifier, zoom, output):
        city = city.replace(city.heights, **place)
        made = evocity.scene(city, rng=np.random.default_rng(seed), **how)
        made.write(path, **drawn)
        written.append((path, made))
        _note_fitting(made)
        if not as_json:
            echo(describe(city))
            echo(_summary(made))
            echo(f"wrote {path}")
    if as_json:
        print_json({"scenes": [_facts(path, made) for path, made in written]})


def _levels(what: str, reading, identifier, zooms: tuple[float, ...], output: Path):
    """A path and a map for each level of detail."""
    if not zooms:
        yield output, city_of(what, reading, identifier)
        return
    if not is_code(what):
        raise EvocityError(
            f"--zoom does not fit the map {what}",
            "a genome, whose code makes the detail",
            f"encode the map first: evocity encode {what} -o GENOME.parquet",
        )
    from evocity.scene import suffix_of

    refuse_reading(f"the genome {what}", reading)
    genome = genome_of(what, identifier)
    for zoom in zooms:
        check_zoom(genome.pavement, zoom)
    ending = len(suffix_of(output))
    stem, suffix = output.name[:-ending], output.name[-ending:]
    named = {f"{zoom:g}": zoom for zoom in zooms}
    if len(named) < len(set(zooms)):
        raise EvocityError(
            f"--zoom {' --zoom '.join(map(str, zooms))}: two levels would have the same file name",
            "levels that differ in their first six digits",
            "leave one of them out",
        )
    for name, zoom in sorted(named.items(), key=lambda level: level[1]):
        path = output.with_name(f"{stem}-z{name}{suffix}") if len(named) > 1 else output
        yield path, decode_genome(genome, what, identifier, zoom)


def _measures(what: str, identifier: int | None) -> dict[str, float]:
    """The values of a run's individual."""
    if identifier is None or not is_run(what):
        return {}
    return dict(evocity.open_run(what).individuals([identifier], rebred=False)[0].values)


def _note_fitting(made) -> None:
    """Note if no object of the library fits anywhere because of the classes."""
    if made.substitution is None or made.substitution.counts["fitted"]:
        return
    own = {made.classes.names[number] for number in set(made.classes.of_buildings.tolist())}
    theirs = set(made.substitution.library.classes)
    if own and not own & theirs:
        note(
            f"no object fits a building: the library has {', '.join(sorted(theirs))}, the map "
            f"{', '.join(sorted(own))}; make the library with the same --classes"
        )


def _summary(made) -> str:
    walls = made.walls
    triangles = sum(len(group.mesh.triangles) for group in made.groups)
    parts = [f"{len(walls)} buildings, {triangles} triangles"]
    if walls.simplified:
        parts.append(f"{walls.simplified} with walls only simplified")
    if walls.stairs:
        parts.append(f"{walls.stairs} with walls along the pixels")
    if walls.dropped:
        parts.append(f"{walls.dropped} buildings under the least area dropped")
    if made.substitution is not None:
        fitted = made.substitution.counts["fitted"]
        parts.append(f"{fitted} replaced by objects of the library, {len(walls) - fitted} not")
    return ", ".join(parts)


def _facts(path: Path, made) -> dict:
    walls, about = made.walls, made.about
    return {
        "file": str(path),
        "bytes": path.stat().st_size,
        "name": about.name,
        "attribution": about.attribution,
        "crs": about.crs,
        "offset": list(about.offset),
        "buildings": len(walls),
        "triangles": {group.name: len(group.mesh.triangles) for group in made.groups},
        "volume": float(sum(group.volume for group in made.groups)),
        "walls": {
            "fitted": walls.fitted,
            "simplified": walls.simplified,
            "stairs": walls.stairs,
        },
        "dropped": walls.dropped,
        "classes": made.classes.counts,
        "substitution": made.substitution.counts if made.substitution else None,
    }
