"""`evocity recipe new`: a first recipe for maps of your own."""

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import click

import evocity
from evocity.cli.shared.checks import check_output, replace_file
from evocity.cli.shared.commands import Commands, command
from evocity.cli.shared.inputs import measures_of
from evocity.cli.shared.options import (
    FILE,
    centers_option,
    file_options,
    flag,
    json_option,
    metres_option,
    option,
)
from evocity.cli.shared.search_progress import blame_options
from evocity.cli.shared.terminal import (
    echo,
    note,
    note_heights,
    note_window,
    print_json,
    print_table,
    quiet_stdout,
    relative_path,
    warn,
)
from evocity.errors import EvocityError

#: The longest run of a new recipe, hours: a week.
_MOST_HOURS = 168


@click.group(cls=Commands)
def recipe() -> None:
    """Recipes for runs."""


@command("""
  evocity recipe new lyon-1er new-york-west-village -o night.toml
  evocity recipe new here.osm.pbf there.geojson --center 37.62 55.82 --center 4.83 45.77 \\
      --fitness my_measure.py -o night.toml
  evocity recipe new lyon-1er new-york-west-village --fitness winter_sun \\
      --band fsi 2.1 2.3 --band gsi 0 0.42 -o night.toml
  evocity run night.toml""")
@click.argument("maps", metavar="MAP...", nargs=-1, required=True)
@option(
    "--fitness words NAME|FILE.py|FILE.toml...",
    "Measure that guides the search: the name of a measure, a Python file that the command "
    "executes, or a table of building types. [autosimilarity, alignment, salingaros_law, "
    "crumbs]",
)
@option(
    "--band bands NAME LOW HIGH...",
    "Band of a measure that every birth should keep, in place of the guard's bound on it. LOW or "
    "HIGH at the end of the measure's range does not become a bound.",
    (str, float, float),
)
@option(
    "-o --output FILE.toml",
    "Recipe file to write; it must not exist, unless --force is given.",
    FILE,
    required=True,
)
@flag("--force", "Overwrite an existing recipe.")
@option(
    "--hours",
    "Length of the run: as many births as all cores breed in so many hours, at most "
    f"{_MOST_HOURS}.",
    float,
    8.0,
)
@option("--pixels", "Number of pixels on each side of a map's window: a multiple of 16.", int, 256)
@metres_option
@centers_option
@file_options
@json_option
def new(
    maps,
    words,
    bands,
    output: Path,
    force,
    hours: float,
    pixels,
    metres_per_pixel,
    center,
    as_json,
    **of_files,
) -> None:
    """Write a recipe that breeds from MAPs, with bounds calibrated on these maps.

    Each MAP is a map file or the name of a bundled district. The command encodes each map as a
    genome, then measures both the map and the decoded genome. The recipe sets bounds that real
    districts keep, for example on integrity, fabric distance, street distance and repetition. At
    least one encoded parent keeps each bound; the bound on smallest_share is only for children.
    Comments in the recipe explain each line, list the values of the parents, and estimate the time
    of a run. The command breeds a few children, and fits the number of generations to the option
    --hours. Paths in the recipe are relative to the folder of the recipe. For a measure without a
    goal, the recipe sets a target: the value that the first MAP has after encoding and decoding.

    The JSON document has the keys "recipe", "values", "bounds", "births", "seconds" and "duration".
    For each measure and parent, the key "values" has two values: one for the original map, and one
    for the decoded genome. For each measure with a bound, the object "bounds" contains the key
    "min" or "max". The key "seconds" is the time that one birth takes, in seconds. The key
    "duration" is the estimated time of the run on all cores, in seconds.
    """
    from evocity.search.calibration.calibration import calibrate_recipe
    from evocity.search.calibration.recipe_text import RecipeSettings, describe_forecast

    for source in maps:
        check_output(output, source, {".toml"})
    _refuse_existing(output, force)
    _check_hours(hours)
    parents = _parents(maps, center, of_files, output.parent)
    texts = RecipeSettings(_name(output), parents, pixels, metres_per_pixel, minutes=60 * hours)
    with quiet_stdout():
        goals = _with_bands(_goals(words, output.parent), bands)
        with blame_options(pixels=pixels, metres_per_pixel=metres_per_pixel):
            result = calibrate_recipe(texts, goals, output, _print_step, _note_parent)
    noted = {_source_note(source.city) for source in result.sources}
    for text in result.notes:
        if text not in noted:
            note(text)
    if result.failing:
        warn(result.failing)
    _refuse_existing(output, force)  # another process may have written it
    with replace_file(output) as temporary:
        temporary.write_text(result.text, encoding="utf-8")
    bounds = {bound.measure.name: bound.keys for bound in result.bounds}
    bounds |= {goal.measure.name: goal.bounds for goal in goals if goal.bounds}
    if as_json:
        values = {
            name: {
                parent: dict(zip(("map", "code"), pair, strict=True))
                for parent, pair in of_parents.items()
            }
            for name, of_parents in result.values.items()
        }
        times = {key: getattr(result, key) for key in ("births", "seconds", "duration")}
        print_json({"recipe": str(output), "values": values, "bounds": bounds} | times)
        return
    _print_values(result.values, bounds)
    echo(
        f"{result.births} births of about {1000 * result.seconds:.0f} ms: "
        f"{describe_forecast(result.duration)} on {result.recipe.worker_count} cores"
    )
    echo(f"wrote {output}")
    echo()
    first = "Correct what makes births fail" if result.failing else "Read its comments"
    command = f"evocity run {relative_path(str(output))}"
    echo(f"{first}, then:\n  {command}")
    echo(f"A short trial:\n  {command} --generations 5 --out runs/trial")


def _check_hours(hours: float) -> None:
    if 0 < hours <= _MOST_HOURS:  # False for NaN
        return
    if hours > _MOST_HOURS:
        remedy = (
            f"write --hours {_MOST_HOURS} or less; a run goes on for longer with "
            "evocity resume RUN --generations N"
        )
    else:
        remedy = "write --hours 0.5 for half an hour; or leave --hours out, for a night of 8 hours"
    raise EvocityError(
        f"--hours {hours:g} is not a length of a run",
        f"a number of hours above 0, and at most {_MOST_HOURS} (a week)",
        remedy,
    )


def _print_step(text: str) -> None:
    echo(f"{text} …", err=True)


def _note_parent(city, parent) -> None:
    """Note the facts of a parent's file, as soon as it is read."""
    note(_source_note(city))
    chosen = "default_height" in parent.model_fields_set
    note_heights(city, parent.default_height, "" if chosen else "--default-height")
    note_window(city, "--center, --pixels and --metres-per-pixel, with --force, choose")


def _source_note(city) -> str:
    return f"{city.name}: {city.taken}"


def _print_values(values: Mapping, bounds: Mapping) -> None:
    """Print a row per measure: the values of the parents' maps and codes, and the bound."""
    parents = list(next(iter(values.values())))
    rows = [("measure", *(f"{name}: map, code" for name in parents), "bound")]
    for name, of_parents in values.items():
        signs = {"min": "≥", "max": "≤"}
        bound = " ".join(f"{signs[key]} {value:g}" for key, value in bounds.get(name, {}).items())
        pairs = (of_parents[parent] for parent in parents)
        rows.append((name, *(", ".join(f"{value:.3g}" for value in pair) for pair in pairs), bound))
    print_table(rows)


def _refuse_existing(output: Path, force: bool) -> None:
    if not force and os.path.lexists(output):
        raise EvocityError(
            f"{str(output)!r} exists already",
            "the name of a file that does not exist yet",
            "choose another name after -o, or overwrite the file with --force",
        )


def _name(output: Path) -> str:
    """The name of the run: the recipe's, without characters that no folder's name can have."""
    kept = "".join("-" if c in '/\\:*?"<>|' or ord(c) < 32 else c for c in output.stem)
    return kept.lstrip(".").strip()[:100] or "run"


def _parents(
    maps: Sequence[str],
    centers: Sequence[tuple[float | None, float | None]],
    of_files: Mapping[str, object],
    folder: Path,
) -> list[dict[str, object]]:
    """The entry of each map in [[parents]]; each reading option goes to the maps that take it."""
    from evocity.io import cities
    from evocity.io.map_reader import options_of

    given = {key: value for key, value in of_files.items() if value is not None}
    terrain = given.get("terrain")
    if isinstance(terrain, str):
        given["terrain"] = _path_from(folder, terrain)
    takes = [options_of(source) | {"default_height"} for source in maps]
    for key in given:
        if not any(key in options for options in takes):
            raise EvocityError(
                f"--{key.replace('_', '-')} {given[key]} does not apply to {', '.join(maps)}",
                "an option that applies to at least one of the maps",
                f"leave out --{key.replace('_', '-')}",
            )
    files = [source for source in maps if source not in cities()]
    if len(centers) == len(maps):
        center_of = dict(enumerate(centers))
    elif len(centers) == len(files):
        center_of = {k: centers[files.index(name)] for k, name in enumerate(maps) if name in files}
    elif not centers:
        center_of = {}
    else:
        raise EvocityError(
            f"--center is given {len(centers)} times for {len(maps)} maps; {len(files)} of these "
            "maps come from files",
            "one --center LON LAT for each map; or one for each map that comes from a file, in the "
            "order of the maps",
            "give one --center for each map; for a map that keeps its own window, write --center "
            "own own",
        )
    half = [center for center in center_of.values() if (center[0] is None) != (center[1] is None)]
    if half:
        raise EvocityError(
            f"--center {' '.join('own' if x is None else f'{x:g}' for x in half[0])}",
            "longitude and latitude in degrees, or the word own twice",
            "write --center LON LAT or --center own own",
        )
    entries = []
    for k, source in enumerate(maps):
        entry: dict[str, object] = {"map": _path_from(folder, source)}
        if center_of.get(k, (None, None))[0] is not None:
            entry["center"] = list(center_of[k])
        entries.append(entry | {key: value for key, value in given.items() if key in takes[k]})
    return entries


def _goals(words: Sequence[str], folder: Path) -> list:
    """The goals of the search, each measure once; of a file with goals only those that have one."""
    from evocity.search.calibration.recipe_text import Goal

    goals = {}
    for word in words:
        measures = measures_of(word)
        file = _path_from(folder, word) if word.endswith((".py", ".toml")) else None
        for measure in [m for m in measures if m.goal is not None] or measures:
            goals[measure.name] = Goal(measure, file, several=len(measures) > 1)
    return list(goals.values())


def _with_bands(goals: Sequence, bands: Sequence[tuple[str, float, float]]) -> list:
    """The ``goals`` with bounds, and a constraint for each other measure with a band."""
    from evocity.fitness.registry import file_of
    from evocity.search.calibration.recipe_text import Goal

    joined = {goal.measure.name: goal for goal in goals}
    chosen: set[str] = set()
    for name, low, high in bands:
        typed = f"--band {name} {low:g} {high:g}"
        measure = evocity.fitness.get(name)
        if name in chosen:
            raise EvocityError(
                f"{typed} is the second band of {name}",
                "one band for each measure",
                "leave one of the bands out",
            )
        if file_of(name) is not None and name not in joined:
            raise EvocityError(
                f"{typed} is a band of a measure from a file, which is not a goal",
                "a measure of the package, or a goal that --fitness chooses",
                f"choose {name} as a goal with --fitness, or write the bounds into the recipe",
            )
        if not (math.isfinite(low) and math.isfinite(high) and low < high):
            raise EvocityError(
                f"{typed} is not a band",
                "two finite numbers, the lower number first",
                f"write for example --band {name} 0.2 0.4",
            )
        least, most = measure.range
        bounds = ({"min": low} if low > least else {}) | ({"max": high} if high < most else {})
        if not bounds or low >= most or high <= least:
            raise EvocityError(
                f"{typed} bounds nothing: values of {name} are {measure.range_text}",
                "a band within the range of the measure",
                "narrow the band, or leave it out",
            )
        chosen.add(name)
        goal = joined.get(name, Goal(measure, is_constraint=True))
        joined[name] = replace(goal, bounds=bounds)
    return list(joined.values())


def _path_from(folder: Path, source: str) -> str:
    """A path relative to a ``folder``; a bundled city's name as it is."""
    if source in evocity.cities():
        return source
    whole = os.path.abspath(os.path.expanduser(source))
    try:
        path = Path(os.path.relpath(whole, folder.resolve())).as_posix()
    except ValueError:  # on another drive
        path = Path(whole).as_posix()
    try:
        path.encode()
    except UnicodeEncodeError:
        raise EvocityError(
            f"the path {path!r} is not text in UTF-8",
            "a path of characters that a TOML file can contain",
            "rename the file or its folder",
        ) from None
    return f"./{path}" if path in evocity.cities() else path


recipe.add_command(new)
