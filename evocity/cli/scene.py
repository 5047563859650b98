"""`evocity scene`: a map, a genome or one individual of a run in three dimensions."""

from pathlib import Path

import click

import evocity
from evocity.cli.shared.checks import check_crs, check_needs, check_output, check_zoom
from evocity.cli.shared.commands import command
from evocity.cli.shared.inputs import (
    city_of,
    decode_genome,
    genome_of,
    is_code,
    is_run,
    note_nowhere,
    place_at,
    refuse_reading,
)
from evocity.cli.shared.options import (
    FILE,
    WHOLE,
    at_option,
    crs_option,
    flag,
    id_option,
    json_option,
    map_options,
    option,
    output_option,
)
from evocity.cli.shared.scene_options import (
    check_glb_options,
    check_lod_node,
    check_outputs,
    check_tile,
    lod_option,
    printing_options,
    roof_rise_option,
    roof_surface_option,
    roofs_option,
    say_tiles,
    streets_option,
    tile_option,
    tiles_option,
    triangles_option,
    water_of,
    water_option,
    write_scene_tiles,
)
from evocity.cli.shared.terminal import describe, echo, note, note_compiling, print_json
from evocity.errors import EvocityError

#: As `evocity.views.walls.DETAIL`, which is slow to load.
DETAIL = 2.2
#: Heights of eaves on some buildings, and of ridges on others.
MIXED = "eaves and ridges"

# Formats whose programs expect a place on Earth.
_PLACED = (".city.json", ".gpkg", ".fgb", ".geoparquet")


@command("""
  evocity scene lyon-1er -o lyon.city.json
  evocity scene lyon.parquet -o lyon.glb
  evocity scene runs/lyon-x-montpellier --id 97 -o bred.glb --angles square --storeys 3
  evocity scene lyon.parquet -o level.glb --zoom 0.5 --zoom 1 --zoom 2
  evocity scene lyon.parquet -o walk.wrl --zoom 0.5 --zoom 1 --zoom 2 --lod-node
  evocity scene lyon-1er -o light.glb --lod 1.2
  evocity scene lyon-1er --streets --water rivers.gpkg -o wet.glb
  evocity scene lyon-1er -o lyon-hills.city.json --relief ground.json
  evocity scene lyon-1er -o lyon-vaults.glb --roof-surface vault.json
  evocity scene lyon-1er --tiles lyon-tiles --tile 128""")
@click.argument("what", metavar="MAP|GENOME|RUN")
@output_option(
    "FILE",
    "Scene to write: .city.json (CityJSON 2.0, for GIS), .glb (glTF 2.0, for Blender and "
    "browsers), .obj, .3dm (for Rhino), .dxf (for CAD), .wrl (VRML97), .x3d, .stl or .3mf (for "
    "printers), .gpkg, .fgb or .geoparquet (footprints) or .png (a picture)",
    required=False,
)
@tiles_option
@tile_option
@lod_option
@triangles_option
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
@flag(
    "--lod-node",
    "In a .wrl or .x3d file, write several --zoom as levels of a node LOD: the finest level is "
    "visible from nearby, and the coarsest from afar.",
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
@flag(
    "--merge",
    "In a .glb file, make the objects of a class one mesh with a table of their properties, also "
    "below 2000 objects.",
)
@flag(
    "--instances",
    "In a .glb file, store the places of objects that share a mesh, such as trees, as "
    "EXT_mesh_gpu_instancing.",
)
@roofs_option
@roof_surface_option
@roof_rise_option
@streets_option
@water_option
@option(
    "--relief GROUND",
    "Ground from `evocity surface fit`, on which buildings stand and streets lie; in .city.json, "
    ".glb, .obj, .wrl, .x3d, .dxf and .3dm files. [flat ground]",
    FILE,
)
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
@option(
    "--print-side MM",
    "Longest side of the print in a .stl or .3mf file, in millimetres. [200]",
    click.FloatRange(10, 10_000),
)
@at_option
@crs_option
@map_options
@json_option
def scene(
    what: str, output: Path | None, tiles, tile, lod, triangles, identifier, at, detail, angles,
    storeys, least_area, zoom, lod_node, classes, library, atmosphere, seed, streets, water, roofs,
    roof_surface, roof_rise, merge, instances, print_side, relief, crs, reading, as_json, **drawn,
) -> None:  # fmt: skip
    """Write a map in three dimensions: solids with floors, walls and roofs, on the ground.

    MAP is a map file or the name of a bundled district, GENOME is a genome file, and RUN is a run
    folder with --id. Walls are straight lines fitted to the pixels. With --angles square, the walls
    of a building follow one or two main directions. A building smaller than --least-area is merged
    with a neighbour, or removed if it has no neighbour. With several --zoom, the command writes one
    file for each zoom factor, such as level-z0.5.glb and level-z1.glb for level.glb. With
    --lod-node, the command writes one .wrl or .x3d file with all zoom factors.

    With --tiles, the command writes a folder of tiles that meet exactly. A building belongs to one
    tile as a whole. Ground and streets are cut at the borders of tiles. Each tile has files of the
    level --lod and of all coarser levels, such as 1.3/0-2.glb for the first row and third column.
    With --crs, only the .city.jsonl files have another reference system.

    The coordinates in the file are metres from the map's south-west corner. The file contains the
    coordinate reference system, the position of the map's south-west corner in this system, and the
    attribution. Other evocity commands can read a .city.json file that this command wrote. With
    --crs, the coordinates have another reference system, in metres. Only footprints may have
    degrees. Files for CAD (.dxf, .3dm) need the extra "cad".

    The surface of --roof-surface lies on buildings that have room for a circle of 12 m. Its columns
    lie along the longer side of the building, and its first row in the north. Walls reach up to the
    surface. With --roofs, buildings with pitched roofs keep these. Without --roofs, all other roofs
    are flat.

    A .stl or .3mf file has the buildings on a plate of 2 mm, in millimetres. Each solid reaches
    into the plate, so that a slicer joins all solids.
    """
    import numpy as np

    from evocity.analysis.individual import facts_of_buildings
    from evocity.scene import SUFFIXES, check_suffix
    from evocity.scene.detail import check_format
    from evocity.scene.export import UNPLACED, cuts_attribution
    from evocity.scene.roofs import check_curved, level_of

    check_outputs(output, tiles, tile, crs)
    check_needs("--water", "--streets", water is not None and not streets)
    check_needs("--triangles", "-o", triangles is not None and output is None)
    if output is not None:
        check_crs(crs, output, [one for one in SUFFIXES if one not in UNPLACED])
    suffix = "" if output is None else check_suffix(output)
    sources = what, classes, water, roof_surface, library and library / "objects.gpkg"
    for source in filter(None, sources):
        if output is not None:
            check_output(output, str(source))
    if lod_node:
        check_lod_node(output, suffix, zoom)
    level = level_of(lod, roofs, roof_surface is not None)
    if triangles is not None:  # which may choose a coarser level
        level = ""
    check_format(level, suffix, streets)
    check_glb_options(output, suffix, merge=merge, instances=instances)
    check_needs("--relief", "-o", relief is not None and output is None)
    if relief is not None:
        from evocity.scene.relief import check_relief, write_on_relief
        from evocity.shapes import read_surface

        check_relief(output, level)
        for name, is_given in (("--crs", crs), ("--tiles", tiles), ("--lod-node", lod_node)):
            if is_given:
                raise EvocityError(
                    f"--relief cannot be used with {name}",
                    "one file in the reference system of the map",
                    f"leave {name} or --relief out",
                )
        ground = read_surface(str(relief))
    check_needs("--roof-rise", "--roof-surface", roof_rise is not None and roof_surface is None)
    form = None
    if roof_surface is not None:
        from evocity.shapes import read_surface

        form = read_surface(str(roof_surface))
        check_curved(form, roof_rise)
    note_compiling()
    how = {"detail": detail, "squared": angles == "square", "storeys": storeys}
    how |= {"least_area": least_area, "streets": streets, "measures": _measures(what, identifier)}
    how |= {"lod": lod, "roofs": roofs, "triangles": triangles}
    how |= {"roof_surface": form, "roof_rise": roof_rise}
    if classes is not None:
        from evocity.views.classes import ClassTable

        how["classes"] = ClassTable.read(classes)
    if library is not None:
        from evocity.scene.library import Library

        objects = Library.read(library)
        how["library"] = objects if atmosphere is None else objects.of_atmosphere(atmosphere)
    check_needs("--atmosphere", "--library", atmosphere is not None and library is None)
    drawn = {name: value for name, value in drawn.items() if value is not None}
    if drawn and suffix != ".png":
        name = f"--{next(iter(drawn))}"
        raise EvocityError(
            f"{name} cannot be used with the output {output.name if output else 'of --tiles'}",
            "an output file whose name ends in .png",
            f"leave {name} out",
        )
    if classes is not None and suffix == ".png":
        drawn = {"colours": "classes"} | drawn
    if suffix == ".glb":
        drawn = {"merge": merge or None, "instances": instances}
    drawn |= printing_options(output, print_side)
    written, levels = [], []
    place = {} if at is None else place_at(what, at)
    for path, city, genome in _levels(what, reading, identifier, zoom, output, tiles is not None):
        of_buildings = facts_of_buildings(city, genome)
        check_tile(tiles, tile, *city.shape, settings={})
        city = city.replace(city.heights, **place)
        more = {"rng": np.random.default_rng(seed), **of_buildings}
        made = evocity.scene(city, **more, **water_of(water, city), **how)
        _note_fitting(made)
        if tiles is not None or suffix in _PLACED:
            note_nowhere(what, genome, city)
        if cuts_attribution(suffix, made.about):
            note(
                f"the header of the {suffix} file has no room for the whole attribution; publish "
                "the attribution with the file, or write .3mf"
            )
        facts = _facts(made, made.about_in(crs, suffix))
        if tiles is not None:  # first, because the folder may hold other tiles
            facts["tiles"] = write_scene_tiles(made, tiles, tile, crs=crs)
        levels.append(made)
        if output is not None and not lod_node:
            if relief is None:
                made.write(path, crs=crs, **drawn)
            else:
                facts["ground"] = write_on_relief(made, ground, path, **drawn)
            facts = {"file": str(path), "bytes": path.stat().st_size} | facts
        written.append(facts)
        if not as_json:
            echo(describe(city))
            echo(_summary(made))
            if "ground" in facts:
                low, high = facts["ground"]
                echo(f"ground from {low:.4g} to {high:.4g} m")
            if output is not None and not lod_node:
                echo(f"wrote {path}")
            if tiles is not None:
                echo(say_tiles(facts["tiles"], tiles))
    if lod_node:
        from evocity.scene import write_levels

        ranges = write_levels(levels[::-1], output, crs=crs)
        if not as_json:
            metres = ", ".join(f"{one:g}" for one in ranges)
            echo(f"wrote {output}, {len(levels)} levels, coarser from {metres} m on")
        written = [{"file": str(output), "ranges": list(ranges)} | one for one in written]
    if as_json:
        print_json({"scenes": written})


def _levels(
    what: str, reading, identifier, zooms: tuple[float, ...], output: Path | None, tiled: bool
):
    """A path, a map and its genome, or None, for each level of detail."""
    if not zooms and not (is_code(what) or identifier is not None):
        yield output, city_of(what, reading, identifier), None
        return
    if zooms and not is_code(what):
        raise EvocityError(
            f"--zoom cannot be used with the map {what}",
            "a genome, because only genomes can be decoded at another zoom",
            f"encode the map first: evocity encode {what} -o GENOME.parquet",
        )
    from evocity.scene import suffix_of

    refuse_reading(f"the {'run' if is_run(what) else 'genome'} {what}", reading)
    genome = genome_of(what, identifier)
    if not zooms:
        yield output, decode_genome(genome, what, identifier), genome
        return
    for zoom in zooms:
        check_zoom(genome.pavement, zoom)
    if len(zooms) == 1:
        yield output, decode_genome(genome, what, identifier, zooms[0]), genome
        return
    if output is None or tiled:
        raise EvocityError(
            f"{len(zooms)} × --zoom cannot be used with --tiles",
            "one zoom factor for tiles",
            "give --zoom once, or leave --tiles out",
        )
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
        yield path, decode_genome(genome, what, identifier, zoom), genome


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
    import numpy as np

    walls = made.walls
    triangles = made.triangle_count
    parts = [f"{len(walls)} buildings, {triangles} triangles"]
    if walls.simplified:
        parts.append(f"{walls.simplified} with walls only simplified")
    if walls.stairs:
        parts.append(f"{walls.stairs} with walls along the pixels")
    if walls.dropped:
        parts.append(f"{walls.dropped} buildings under the least area dropped")
    if made.lod == "2.2":
        roofs = _roofs(made)
        shapes = ", ".join(f"{count} {name}" for name, count in roofs["forms"].items() if count)
        meaning = f"heights are those of the {roofs['heights']}"
        if roofs["heights"] == MIXED:
            high = np.count_nonzero(made.ridges)
            meaning = f"heights: {high} to the ridge, {len(made.ridges) - high} to the eaves"
        parts.append(f"roofs: {shapes or 'none'} ({meaning})")
    if made.substitution is not None:
        fitted = made.substitution.counts["fitted"]
        parts.append(f"{fitted} replaced by objects of the library, {len(walls) - fitted} not")
    return ", ".join(parts)


def _roofs(made) -> dict:
    """The number of roofs of each shape, and what the heights of the map measure to."""
    from evocity.scene.roofs import count_shapes

    ridges = made.ridges
    heights = ("ridges" if ridges.all() else MIXED) if ridges.any() else "eaves"
    return {"forms": count_shapes(made.groups), "heights": heights}


def _facts(made, about) -> dict:
    walls = made.walls
    return {
        "name": about.name,
        "attribution": about.attribution,
        "crs": about.crs,
        "offset": list(about.offset),
        "lod": made.lod,
        "buildings": len(walls),
        "triangles": made.triangle_counts,
        "volume": float(sum(group.volume for group in made.groups)),
        "walls": {key: getattr(walls, key) for key in ("fitted", "simplified", "stairs")},
        "dropped": walls.dropped,
        "classes": made.classes.counts,
        "roofs": _roofs(made) if made.lod == "2.2" else None,
        "substitution": made.substitution.counts if made.substitution else None,
    }
