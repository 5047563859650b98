"""`evocity scene`: a map, a genome or one individual of a run in three dimensions."""

from pathlib import Path

import click

import evocity
from evocity.cli.common import (
    check_output,
    describe,
    echo,
    json_option,
    map_options,
    note,
    note_compiling,
    output_option,
    print_json,
)
from evocity.cli.given import (
    at_option,
    city_of,
    decoded,
    genome_of,
    id_option,
    is_genome,
    is_run,
    place_at,
)
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
    "browsers), .obj (for Rhino), .wrl (VRML97), .x3d, .gpkg (footprints) or .png (a picture); "
    "overwritten if it exists.",
)
@id_option
@click.option(
    "--tolerance",
    "detail",
    type=float,
    metavar="METRES",
    default=DETAIL,
    show_default=True,
    help="Pieces of wall shorter than this are left out.",
)
@click.option(
    "--angles",
    type=click.Choice(["none", "square"]),
    default="none",
    show_default=True,
    help="Turn walls to the one or two directions of their building, where they are near.",
)
@click.option(
    "--storeys",
    type=float,
    metavar="METRES",
    show_default="heights as they are",
    help="Round heights to whole storeys of this height, one at least.",
)
@click.option(
    "--least-area",
    type=float,
    metavar="M2",
    default=0.0,
    show_default=True,
    help="A smaller building joins its neighbour, or is dropped if it has none.",
)
@click.option(
    "--zoom",
    type=float,
    multiple=True,
    metavar="Z",
    show_default="1",
    help="Of a genome: level of detail by fractal zoom, above 1 finer, below 1 simpler. Given "
    "several times, a file each: level.glb becomes level-z0.5.glb, level-z1.glb and so on.",
)
@click.option(
    "--classes",
    type=click.Path(path_type=Path),
    metavar="TOML",
    show_default="the seven of the papers",
    help="Table of classes: limits of area, height and shape, and colours.",
)
@click.option(
    "--library",
    type=click.Path(path_type=Path),
    metavar="FOLDER",
    show_default="none",
    help="Library whose objects take the place of buildings, where they fit.",
)
@click.option(
    "--atmosphere",
    metavar="WORDS",
    show_default="any",
    help="With --library: objects of this atmosphere alone, as the library's table has it.",
)
@click.option(
    "--seed",
    type=click.IntRange(min=0),
    default=0,
    show_default=True,
    help="With --library: draws among objects that fit alike.",
)
@click.option("--streets", is_flag=True, help="Streets as surfaces; in .gpkg as layers.")
@click.option(
    "--colours",
    type=click.Choice(["heights", "classes"]),
    show_default="classes with --classes, else heights",
    help="Of .png: what roofs are coloured by.",
)
@click.option(
    "--azimuth",
    type=float,
    show_default="25",
    help="Of .png: where one looks to, degrees clockwise from north.",
)
@click.option(
    "--tilt",
    type=click.FloatRange(1, 90),
    show_default="40",
    help="Of .png: from how many degrees above the horizon; 90 is a plan.",
)
@click.option(
    "--width",
    type=click.IntRange(16, 8192),
    show_default="900",
    help="Of .png: width of what is drawn, px.",
)
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
    """Write a map in three dimensions: solids with floors, walls and flat roofs, on their ground.

    MAP is a file or a bundled name, GENOME a genome file, and RUN a run folder, of which --id names
    one individual. Walls are straight lines fitted to the pixels.

    Coordinates are metres from the map's south-west corner; the file keeps where that corner lies,
    the reference system and the attribution. `evocity` reads its own .city.json again.
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
            "--atmosphere without --library", "a library", "name one, or leave it out"
        )
    drawn = {"colours": colours, "azimuth": azimuth, "tilt": tilt, "width": width}
    drawn = {name: value for name, value in drawn.items() if value is not None}
    if drawn and check_suffix(output) != ".png":
        option = f"--{next(iter(drawn))}"
        raise EvocityError(f"{option} with {output.name}", "a .png", f"leave {option} out")
    if classes is not None and check_suffix(output) == ".png":
        drawn = {"colours": "classes"} | drawn
    found = []
    place = {} if at is None else place_at(what, at)
    for path, city in _levels(what, reading, identifier, zoom, output):
        city = city.replace(city.heights, **place)
        made = evocity.scene(city, rng=np.random.default_rng(seed), **how)
        made.write(path, **drawn)
        found.append((path, made))
        _note_fitted(made)
        if not as_json:
            echo(describe(city))
            echo(_told(made))
            echo(f"wrote {path}")
    if as_json:
        print_json({"scenes": [_facts(path, made) for path, made in found]})


def _levels(what: str, reading, identifier, zooms: tuple[float, ...], output: Path):
    """A path and a map for each level of detail."""
    if not zooms:
        yield output, city_of(what, reading, identifier)
        return
    if not (is_genome(what) or is_run(what)):
        raise EvocityError(
            f"--zoom with the map {what}",
            "a genome: the code makes the detail",
            f"encode it first: evocity encode {what} -o GENOME.parquet",
        )
    from evocity.cli.decode import check_zoom
    from evocity.cli.given import refuse_reading
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
            f"--zoom {' --zoom '.join(map(str, zooms))}, of which some have the same file name",
            "levels that differ in six digits",
            "leave one of them out",
        )
    for told, zoom in sorted(named.items(), key=lambda one: one[1]):
        path = output.with_name(f"{stem}-z{told}{suffix}") if len(named) > 1 else output
        yield path, decoded(genome, what, identifier, zoom)


def _measures(what: str, identifier: int | None) -> dict[str, float]:
    """What a run measured of its individual."""
    if identifier is None or not is_run(what):
        return {}
    return dict(evocity.open_run(what).individuals([identifier], rebred=False)[0].values)


def _note_fitted(made) -> None:
    """Say why no object of the library fits anywhere, where that is by the classes."""
    if made.substitution is None or made.substitution.counts["fitted"]:
        return
    own = {made.classes.names[number] for number in set(made.classes.of_buildings.tolist())}
    theirs = set(made.substitution.library.classes)
    if own and not own & theirs:
        note(
            f"no building found an object: the library has {', '.join(sorted(theirs))}, the map "
            f"{', '.join(sorted(own))}; make the library with the same --classes"
        )


def _told(made) -> str:
    walls = made.walls
    triangles = sum(len(group.mesh.triangles) for group in made.groups)
    left = []
    if walls.simplified:
        left.append(f"{walls.simplified} walls only simplified")
    if walls.stairs:
        left.append(f"{walls.stairs} left as the pixels are")
    if walls.dropped:
        left.append(f"{walls.dropped} buildings under the least area dropped")
    if made.substitution is not None:
        fitted = made.substitution.counts["fitted"]
        left.append(f"{fitted} of them objects of the library, {len(walls) - fitted} as they were")
    return ", ".join([f"{len(walls)} buildings, {triangles} triangles", *left])


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
