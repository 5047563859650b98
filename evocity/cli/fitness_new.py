"""`evocity fitness new`: a Python file with a first measure."""

import builtins
import contextlib
import dataclasses
import keyword
import re
import textwrap
from collections.abc import Iterator
from functools import cached_property
from pathlib import Path

import click

import evocity
from evocity.cli.shared.checks import check_folder, report_write_errors
from evocity.cli.shared.commands import command
from evocity.cli.shared.inputs import city_of
from evocity.cli.shared.options import FILE, map_options, option
from evocity.cli.shared.terminal import echo
from evocity.errors import EvocityError, plain_text

_TEMPLATE = '''\
"""A measure of my own. Try it: evocity fitness check {file}"""

import math

import evocity
import numpy as np

# A city has the following. Its views are computed at first use, once for each map, shared by all
# measures, and read-only: change a copy. Times are those of a map of 256 × 256 px.
#
{offers}
#
# Lengths are in metres: a pixel's side is city.metres_per_pixel. A measure may have more
# arguments: genome, the code of the map; parents, the genomes it was bred from; and sources, the
# maps of the cities that it is made of.


@evocity.fitness({options})
def {name}(city):
    """What it says about a city, in one line.

    Formula: standard deviation of the heights of all built pixels, as a beginning.
    Unit: {unit}. Range: 0 upwards. Empty map: undefined, nothing is built.
    Source: its author, and where it is published.
    """
    if not city.built.any():
        return evocity.fitness.Undefined("nothing is built")
    return float(np.std(city.heights[city.built]))
'''


_FIELD_TEMPLATE = '''\
"""How far a map is from wanted densities. Try it: evocity fitness check {file}"""

import math
from pathlib import Path

import evocity
from evocity.fitness import WantedDensity

# {count} places on {city}, from {field}. They are metres from the south-west corner of the map.
WANTED = WantedDensity.load(Path(__file__).with_name("{data}"), radius={radius})
'''

_FIELD_MEASURE = '''

@evocity.fitness(goal="min", data="{data}", range=(0, math.inf))
def {name}(city):
    """Difference between local {index} and the {index} that a field wants.

    Formula: root of the mean squared difference over all places with a wish; local {index} counts
    the ground within {radius:g} m.
    Unit: none. Range: 0 upwards. Empty map: the differences to {index} 0. Undefined on a map that
    lacks places of the field.
    Source: local density, Marsault 2002 (section 6.2).
    """
    if not WANTED.fits(city):
        return evocity.fitness.Undefined("places of the field lie outside the map")
    return WANTED.gap(city, "{density}")
'''


@command("""
  evocity fitness new skyline
  evocity fitness new crowding --goal min --unit /ha -o measures
  evocity fitness new plan --field wanted.geojson --map lyon-1er --radius 100""")
@click.argument("name", metavar="NAME")
@option(
    "--goal",
    "Values that a search prefers: high values, low values, or neither. For a measure "
    "without a goal, the recipe sets a target value or a reference city.",
    click.Choice(["max", "min", "none"]),
    "max",
)
@option(
    "--unit",
    "Unit of the measure, such as m (metres) or /ha (per hectare). [a pure number]",
    default="",
)
@option(
    "-o --output FILE|FOLDER",
    "File to write, or the folder for the new file; existing files are never overwritten. "
    "[NAME.py here]",
    FILE,
)
@option(
    "--field FILE",
    "Wanted densities: a raster, GeoJSON points with properties gsi or fsi, or a CSV file with "
    "columns x, y and gsi or fsi.",
    FILE,
)
@option("--map MAP chart", "Map on which the field lies.")
@option("--radius M", "Radius in which densities count, metres.", float, 100.0)
@option("--density", "Density that a raster holds.", click.Choice(["fsi", "gsi"]), "fsi")
@map_options
def new(
    name: str, goal: str, unit: str, output: Path | None, field, chart, radius, density, reading
) -> None:
    """Write a Python file with an example measure called NAME.

    The example measure works without changes. The file sets each property of a measure, such as
    goal, unit and range. Change the formula in the file, then try the measure on cities with
    `evocity fitness check NAME.py`.

    With --field, the measure is the difference between the local density of a map and wanted
    densities. The option --map names the map on which the field lies. The command also writes
    NAME.csv, with the places of the field on the map.
    """
    _check_name(name)
    _check_unit(unit)
    path = _new_path(output or Path(), name)
    if field is not None or chart is not None:
        _write_field_measure(name, path, field, chart, radius, density, reading)
        return
    text = measure_text(name, goal, unit, path.name)
    with report_write_errors(path), open(path, "x", encoding="utf-8") as file:
        file.write(text)
    echo(f"wrote {path}")
    echo()
    echo(f"Change its formula, then:\n  evocity fitness check {path}")
    echo(f"  evocity score lyon-1er --fitness {path}")
    echo("To breed with it, in a recipe beside it (docs/recipe.md):")
    target = "\n  target = 1.0" if goal == "none" else ""
    echo(f'  [[fitness]]\n  file = "{path.name}"{target}')


def _write_field_measure(name, path: Path, field, chart, radius, density, reading) -> None:
    """Write a measure of the distance to a field, with the places of the field beside it."""
    if field is None or chart is None:
        raise EvocityError(
            f"only {'--field' if chart is None else '--map'}",
            "--field with the wanted densities, and --map with the map on which they lie",
            "give both options",
        )
    data = path.with_suffix(".csv")
    _refuse_existing(data)
    city = city_of(chart, reading)
    wanted = evocity.io.read_wanted_density(field, city, radius, density)
    wishes = wanted.wishes
    names = {name if len(wishes) == 1 else f"{name}_{wish}": wish for wish in wishes}
    known = {
        "data": data.name,
        "radius": float(radius),
        "city": plain_text(city.name),
        "field": plain_text(field.name),
    }
    text = _FIELD_TEMPLATE.format(file=path.name, count=len(wanted), **known)
    for own, wish in names.items():
        text += _FIELD_MEASURE.format(name=own, density=wish, index=wish.upper(), **known)
    with _new_file(data):
        wanted.save(data)
    try:
        with _new_file(path), open(path, "x", encoding="utf-8") as file:
            file.write(text)
    except EvocityError:
        data.unlink(missing_ok=True)
        raise
    echo(f"wrote {path} and {data}: {len(wanted)} places with {' and '.join(wishes)}")
    for own, wish in names.items():
        echo(f"{own} of {city.name}: {wanted.gap(city, wish):.4g}")
    echo("To breed with it, in a recipe beside it (docs/recipe.md):")
    echo(f'  [[fitness]]\n  file = "{path.name}"')


def measure_text(name: str, goal: str, unit: str, file: str) -> str:
    """The text of a file with a measure of this ``name``."""
    options = [] if goal == "none" else [f'goal="{goal}"']
    options += [f'unit="{unit}"'] if unit else []
    return _TEMPLATE.format(
        file=file,
        name=name,
        options=", ".join([*options, "range=(0, math.inf)"]),
        unit=unit or "none",
        offers="\n".join(_offers()),
    )


def _offers() -> list[str]:
    """Comments on everything that a `CityMap` has, from its documentation."""
    texts = {
        "heights": "float32 (H, W), metres above ground, 0 = ground; row 0 in the north.",
        "metres_per_pixel": "side of a pixel, metres.",
        "area": "ground covered by the whole map, m².",
    }
    texts |= {name: _summary(view) for name, view in views().items()}
    return [
        line
        for name, text in texts.items()
        for line in textwrap.wrap(
            f"city.{name}: {text}", 96, initial_indent="# ", subsequent_indent="#     "
        )
    ]


def views() -> dict[str, cached_property]:
    """The views of a `CityMap` by name."""
    members = vars(evocity.CityMap).items()
    return {name: view for name, view in members if isinstance(view, cached_property)}


def _summary(view: cached_property) -> str:
    """The first sentence of a ``view``'s documentation, its cost, and its fields."""
    from evocity.citymap import BUILT_ABOVE

    doc = re.sub(r"[`\\]", "", " ".join(view.__doc__.split()))
    first = doc.partition(". ")[0].rstrip(".").replace("BUILT_ABOVE", f"{BUILT_ABOVE} m")
    text = f"{first[0].lower()}{first[1:]}."
    if cost := re.search(r"(?:About )?[\d.]+(?: to [\d.]+)? [mµ]s at 256²", doc):
        text += f" {cost[0].removesuffix(' at 256²')}."
    kind = view.func.__annotations__.get("return")
    if dataclasses.is_dataclass(kind):
        computed = (name for name, member in vars(kind).items() if isinstance(member, _COMPUTED))
        names = [field.name for field in dataclasses.fields(kind)] + [*computed]
        text += f" It has {', '.join(name for name in names if not name.startswith('_'))}."
    return text


_COMPUTED = property | cached_property


def _check_name(name: str) -> None:
    if not name.isidentifier() or keyword.iskeyword(name):
        raise EvocityError(
            f"{name!r} cannot be the name of a measure",
            "a name of letters, digits and _ for a Python function; the name may not begin "
            "with a digit",
            f"choose another name, for example: evocity fitness new {_clean_name(name)}",
        )
    if name in ("evocity", "np", "math", "city") or hasattr(builtins, name):
        raise EvocityError(
            f"{name!r} cannot be the name of a measure",
            "a name that neither Python nor the new file uses for anything else",
            f"choose another name, for example: evocity fitness new my_{name}",
        )
    for measure in evocity.fitness.measures():
        if name in (measure.name, measure.name.partition(".")[0]):
            raise EvocityError(
                f"a measure called {name} exists already, from {measure.origin}",
                "a name that no measure has",
                f"choose another name, for example: evocity fitness new my_{name}",
            )


def _clean_name(name: str) -> str:
    letters = "".join(c if c.isalnum() else "_" for c in name).strip("_").lower()
    return letters if letters.isidentifier() and not keyword.iskeyword(letters) else "my_measure"


def _check_unit(unit: str) -> None:
    if not unit.isprintable() or set(unit) & set('"\\{}'):
        raise EvocityError(
            f"--unit {unit!r} contains characters that are not allowed in a unit",
            "a unit such as m, m² or /ha",
            "remove quotes, braces and backslashes from the unit",
        )


def _new_path(output: Path, name: str) -> Path:
    """The file to write. Raises `EvocityError` if it exists, or cannot be created."""
    path = output / f"{name}.py" if output.is_dir() else output
    if path.suffix != ".py":
        raise EvocityError(
            f"{str(path)!r} is not the name of a Python file",
            "a file name that ends in .py, or the name of an existing folder",
            f"choose another name, for example -o {path.with_suffix('.py')}",
        )
    check_folder(path.parent)
    _refuse_existing(path)
    return path


@contextlib.contextmanager
def _new_file(path: Path) -> Iterator[None]:
    """Report errors while a new file is written, and remove its part; keep a file of others."""
    try:
        with report_write_errors(path):
            yield
    except EvocityError as error:
        if not isinstance(error.__cause__, FileExistsError):
            with contextlib.suppress(OSError):
                path.unlink()
        raise


def _refuse_existing(path: Path) -> None:
    if path.exists() or path.is_symlink():
        raise EvocityError(
            f"{str(path)!r} exists already",
            "the name of a file that does not exist yet",
            "choose another file name or another folder with -o",
        )
