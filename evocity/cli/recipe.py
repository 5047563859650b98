"""`evocity recipe`: what a run is carried out by; and `new`, one to begin from."""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path

import click

import evocity
from evocity.cli.common import (
    FILE_OPTIONS,
    Commands,
    check_output,
    echo,
    json_option,
    near,
    note,
    note_heights,
    note_window,
    output_option,
    print_json,
    print_table,
    quiet_stdout,
    warn,
    writing,
)
from evocity.cli.given import measures_of
from evocity.cli.searching import blaming_options
from evocity.errors import EvocityError


@click.group(cls=Commands)
def recipe() -> None:
    """Write recipes, by which runs are carried out."""


def _options(command):
    for option in reversed(FILE_OPTIONS):
        command = option(command)
    return command


@recipe.command(
    epilog="""\b
Examples:
  evocity recipe new lyon-1er new-york-west-village -o night.toml
  evocity recipe new here.osm.pbf there.geojson --center 37.62 55.82 --center 4.83 45.77 \\
      --fitness my_measure.py -o night.toml
  evocity run night.toml"""
)
@click.argument("maps", metavar="MAP...", nargs=-1, required=True)
@click.option(
    "--fitness",
    "wanted",
    multiple=True,
    metavar="NAME|FILE.py|FILE.toml",
    show_default="autosimilarity, alignment, salingaros_buildings, crumbs",
    help="What to search by: a measure by name, the measures in a Python file, which is executed, "
    "or those by a table of building types in TOML. Give it once for each.",
)
@output_option("FILE.toml", "Recipe to write; refused if it exists.")
@click.option("--force", is_flag=True, help="Write over a recipe that exists.")
@click.option(
    "--pixels",
    type=int,
    default=256,
    show_default=True,
    help="Side of the square window that every map is read at, pixels; a multiple of 16.",
)
@click.option(
    "--metres-per-pixel",
    type=float,
    default=2.0,
    show_default=True,
    help="Side of a pixel, metres.",
)
@click.option(
    "--center",
    type=float,
    nargs=2,
    multiple=True,
    metavar="LON LAT",
    show_default="the file's own window, or the middle of the buildings",
    help="Centre of a window, degrees, longitude first. Give one for each MAP that is a file, in "
    "their order, or one for every MAP.",
)
@_options
@json_option
def new(
    maps, wanted, output: Path, force, pixels, metres_per_pixel, center, as_json, **of_files
) -> None:
    """Write a recipe that breeds MAPs, with bounds calibrated on them.

    Each MAP is a map file or the name of a bundled district. They are coded, and what their maps
    and codes have is measured: the recipe bounds integrity, fabric distance and small buildings so
    that the parents' codes keep the bounds and a heap of rubble does not. Comments in it tell what
    each line means, what the parents have, and how long a run takes. Its paths are as seen from
    where it lies. A measure without a goal gets for a target what the code of the
    first of the MAPs has.

    JSON keys: recipe, values (measure to parent to what its map and its code have), bounds (measure
    to min or max), births, seconds (of one), duration (of all, seconds, on all cores).
    """
    _check(output, maps, force)
    parents = _parents(maps, center, of_files, output.parent)
    from evocity.search.calibration import begun
    from evocity.search.recipe_text import Words, duration

    words = Words(_name(output), parents, pixels, metres_per_pixel)
    with quiet_stdout():
        goals = _goals(wanted, output.parent)
        with blaming_options(pixels=pixels, metres_per_pixel=metres_per_pixel):
            found = begun(words, goals, output, _tell, _note_parent)
    said = {_taken(source.city) for source in found.sources}
    for text in found.notes:
        if text not in said:
            note(text)
    if found.failing:
        warn(found.failing)
    _write(output, found.text, force)
    bounds = {one.measure.name: one.keys for one in found.bounds}
    if as_json:
        values = {
            name: {
                parent: dict(zip(("map", "code"), had, strict=True)) for parent, had in of.items()
            }
            for name, of in found.values.items()
        }
        print_json(
            {
                "recipe": str(output),
                "values": values,
                "bounds": bounds,
                "births": found.births,
                "seconds": found.seconds,
                "duration": found.duration,
            }
        )
        return
    _print_values(found.values, bounds)
    echo(
        f"{found.births} births of about {1000 * found.seconds:.0f} ms: "
        f"{duration(found.duration)} on {found.recipe.worker_count} cores"
    )
    echo(f"wrote {output}")
    echo()
    before = "Correct what makes births fail" if found.failing else "Look at its comments"
    run = f"evocity run {near(str(output))}"
    echo(
        f"{before}, then:\n  {run}\nIn short, to try it:\n  {run} --generations 5 --out runs/trial"
    )


def _tell(text: str) -> None:
    echo(f"{text} …", err=True)


def _note_parent(city, parent) -> None:
    """Say what was taken of a parent's file, as soon as it is read."""
    note(_taken(city))
    chosen = "default_height" in parent.model_fields_set
    otherwise = "" if chosen else "; --default-height says otherwise"
    note_heights(city, parent.default_height, otherwise)
    note_window(city, "--center, --pixels and --metres-per-pixel, with --force, choose")


def _taken(city) -> str:
    return f"{city.name}: {city.taken}"


def _print_values(values: Mapping, bounds: Mapping) -> None:
    """A row a measure: what the parents' maps and codes have, and the bound."""
    parents = list(next(iter(values.values())))
    rows = [("measure", *(f"{name}: map, code" for name in parents), "bound")]
    for name, of in values.items():
        signs = {"min": "≥", "max": "≤"}
        bound = " ".join(f"{signs[key]} {value:g}" for key, value in bounds.get(name, {}).items())
        cells = (", ".join(f"{one:.3g}" for one in of[parent]) for parent in parents)
        rows.append((name, *cells, bound))
    print_table(rows)


def _check(output: Path, maps: Sequence[str], force: bool) -> None:
    """Raise, before any work, unless the recipe can be written."""
    for source in maps:
        check_output(output, source, {".toml"})
    _refuse_existing(output, force)


def _refuse_existing(output: Path, force: bool) -> None:
    if not force and os.path.lexists(output):
        raise EvocityError(
            f"{str(output)!r} exists already",
            "a file to be made anew",
            "choose another name after -o, or write over it with --force",
        )


def _write(output: Path, text: str, force: bool) -> None:
    from evocity.files import whole_file

    _refuse_existing(output, force)  # it may have come meanwhile
    with writing(output), whole_file(output) as temporary:
        temporary.write_text(text, encoding="utf-8")


def _name(output: Path) -> str:
    """What the run is called: as the recipe, without what no folder's name can have."""
    kept = "".join("-" if c in '/\\:*?"<>|' or ord(c) < 32 else c for c in output.stem)
    return kept.lstrip(".").strip()[:100] or "run"


def _parents(
    maps: Sequence[str],
    centers: Sequence[tuple[float, float]],
    of_files: Mapping[str, object],
    folder: Path,
) -> list[dict[str, object]]:
    """What [[parents]] has of each map: options of reading go to those that take them."""
    from evocity.io import cities
    from evocity.io.reading import options_of

    given = {key: value for key, value in of_files.items() if value is not None}
    takes = [options_of(one) | {"default_height"} for one in maps]
    for key in given:
        if not any(key in one for one in takes):
            raise EvocityError(
                f"--{key.replace('_', '-')} {given[key]} with {', '.join(maps)}",
                "an option that one of these files takes",
                "leave it out",
            )
    files = [one for one in maps if one not in cities()]
    if len(centers) == len(maps):
        about = dict(enumerate(centers))
    elif len(centers) == len(files):
        about = {k: centers[files.index(one)] for k, one in enumerate(maps) if one in files}
    elif not centers:
        about = {}
    else:
        raise EvocityError(
            f"{len(centers)} × --center for {len(maps)} maps, {len(files)} of them files",
            "--center LON LAT once for each map file, in their order, or once for each map",
            "give as many; or leave --center out, and write center = [LON, LAT] into the "
            "[[parents]] that need one",
        )
    found = []
    for k, source in enumerate(maps):
        entry: dict[str, object] = {"map": _seen_from(folder, source)}
        if k in about:
            entry["center"] = list(about[k])
        entry |= {key: value for key, value in given.items() if key in takes[k]}
        found.append(entry)
    return found


def _goals(wanted: Sequence[str], folder: Path) -> list:
    """What to search by, each measure once; of a file with goals those that have one."""
    from evocity.search.recipe_text import Goal

    found = {}
    for word in wanted:
        of_file = word.endswith((".py", ".toml"))
        measures = measures_of(word)
        chosen = [one for one in measures if one.goal is not None] or measures
        for one in chosen:
            file = _seen_from(folder, word) if of_file else None
            found[one.name] = Goal(one, file, several=len(measures) > 1)
    return list(found.values())


def _seen_from(folder: Path, source: str) -> str:
    """A path as it is seen from a ``folder``; a bundled city's name as it is."""
    if source in evocity.cities():
        return source
    whole = os.path.abspath(os.path.expanduser(source))
    try:
        told = Path(os.path.relpath(whole, folder.resolve())).as_posix()
    except ValueError:  # on another drive
        told = Path(whole).as_posix()
    try:
        told.encode()
    except UnicodeEncodeError:
        raise EvocityError(
            f"{told!r}, which is no text in UTF-8", "a path that TOML can tell", "rename it"
        ) from None
    return f"./{told}" if told in evocity.cities() else told
