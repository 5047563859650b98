"""`evocity scene`: a map, a genome or one individual of a run in three dimensions."""

from pathlib import Path

import click

import evocity
from evocity.cli.shared.checks import check_needs, check_output, check_zoom
from evocity.cli.shared.commands import command
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


@command("""
  evocity scene lyon-1er -o lyon.city.json
  evocity scene lyon.parquet -o lyon.glb
  evocity scene runs/lyon-x-montpellier --id 97 -o bred.glb --angles square --storeys 3
  evocity scene lyon.parquet -o level.glb --zoom 0.5 --zoom 1 --zoom 2""")
@click.argument("what", metavar="MAP|GENOME|RUN")
@output_option(
    "FILE",
    "Scene to write: .city.json (CityJSON 2.0, for GIS), .glb (glTF 2.0, for Blender and "
    "browsers), .obj (for Rhino), .wrl (VRML97), .x3d, .gpkg (footprints) or .png (a picture)",
)
@id_option
@option(
    "--tolerance detail METRES", "Length of the shortest wall segment, in metres.", float, DETAIL
)
@option(
    "--angles",
    'Angles of corners: the value "none" allows any angle, and the value "square" makes right '
    "angles where possible.",
    click.Choice(["none", "square"]),
    "none",
)
@option(
    "--storeys METRES",
    "Height of a storey, in metres; building heights are rounded to whole storeys. [heights as "
    "they are]",
    float,
)
@option("--least-area M2", "Smallest area of a separate building, in square metres.", float, 0.0)
@option(
    "--zoom Z...",
    "Fractal zoom factor: values above 1 add detail, and values below 1 simplify the map. [1]",
    float,
)
@option(
    "--classes TOML",
    "TOML file with a table of building classes and their colours. [the seven of the papers]",
    FILE,
)
@option("--library FOLDER", "Library whose objects replace buildings where the objects fit.", FILE)
@option(
    "--atmosphere WORDS",
    "Use only the objects of --library whose atmosphere is the given text. [any]",
)
@option(
    "--seed", "Seed of the random choice between equally suitable objects of --library.", WHOLE, 0
)
@flag("--streets", "Add streets: as layers in a .gpkg file, as surfaces in all other files.")
@option(
    "--colours",
    "Meaning of the roof colours in a .png picture. [classes with --classes, else heights]",
    click.Choice(["heights", "classes"]),
)
@option(
    "--azimuth", "Viewing direction of a .png picture, in degrees clockwise from north. [25]", float
)
@option(
    "--tilt",
    "Viewing angle of a .png picture, in degrees; an angle of 90 shows a plan. [40]",
    click.FloatRange(1, 90),
)
@option("--width", "Width of a .png picture, in pixels. [900]", click.IntRange(16, 8192))
@at_option
@map_options
@json_option
def scene(
    what: str, output: Path, identifier, at, detail, angles, storeys, least_area, zoom, classes,
    library, atmosphere, seed, streets, reading, as_json, **drawn,
) -> None:  # fmt: skip
    """Write a map in three dimensions: solids with floors, walls and flat roofs, on the ground.

    MAP is a map file or the name of a bundled district, GENOME is a genome file, and RUN is a run
    folder with --id. Walls are straight lines fitted to the pixels. With --angles square, the walls
    of a building follow one or two main directions. A building smaller than --least-area is merged
    with a neighbour, or removed if it has no neighbour. With several --zoom, the command writes one
    file for each zoom factor, such as level-z0.5.glb and level-z1.glb for level.glb.

    The coordinates in the file are metres from the map's south-west corner. The file contains the
    coordinate reference system, the position of the map's south-west corner in this system, and the
    attribution. Other evocity commands can read a .city.json file that this command wrote.
    """
    import numpy as np

    from evocity.scene import check_suffix

    check_suffix(output)
    for source in filter(None, (what, classes, library and library / "objects.gpkg")):
        check_output(output, str(source))
    note_compiling()
    how = {"detail": detail, "squared": angles == "square", "storeys": storeys}
    how |= {"least_area": least_area, "streets": streets, "measures": _measures(what, identifier)}
    if classes is not None:
        from evocity.views.classes import ClassTable

        how["classes"] = ClassTable.read(classes)
    if library is not None:
        from evocity.scene.library import Library

        objects = Library.read(library)
        how["library"] = objects if atmosphere is None else objects.of_atmosphere(atmosphere)
    check_needs("--atmosphere", "--library", atmosphere is not None and library is None)
    drawn = {name: value for name, value in drawn.items() if value is not None}
    if drawn and check_suffix(output) != ".png":
        name = f"--{next(iter(drawn))}"
        raise EvocityError(
            f"{name} cannot be used with the output {output.name}",
            "an output file whose name ends in .png",
            f"leave {name} out",
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
            f"--zoom cannot be used with the map {what}",
            "a genome, because only genomes can be decoded at another zoom",
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
            f"--zoom {' --zoom '.join(map(str, zooms))}: two zoom factors would have the same file"
            " name",
            "zoom factors that differ in their first six digits",
            "leave out one of these zoom factors",
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
        "walls": {key: getattr(walls, key) for key in ("fitted", "simplified", "stairs")},
        "dropped": walls.dropped,
        "classes": made.classes.counts,
        "substitution": made.substitution.counts if made.substitution else None,
    }
