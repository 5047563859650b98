"""`evocity fitness new`: a file with a measure to begin from."""

import builtins
import dataclasses
import keyword
import re
import textwrap
from functools import cached_property
from pathlib import Path

import click

import evocity
from evocity.cli.common import check_folder, echo, writing
from evocity.errors import EvocityError

_TEMPLATE = '''\
"""A measure of my own. Try it: evocity fitness check {file}"""

import math

import evocity
import numpy as np

# What a city offers. Its views are computed when first asked for, once a map, shared by all
# measures, and read-only: change a copy. Times are those of a map of 256 × 256 px.
#
{offers}
#
# Lengths are in metres: a pixel's side is city.metres_per_pixel. Take more arguments, called
# genome, parents and sources, to be given the code that the map was decoded from, those that this
# was bred from, and the maps of the cities that it is made of.


@evocity.fitness({options})
def {name}(city):
    """What it says of a city, in one line.

    Formula: standard deviation of the heights of all built pixels, to begin with.
    Unit: {unit}. Range: 0 upwards. Empty map: undefined, nothing is built.
    Source: who thought of it, and where it is written.
    """
    if not city.built.any():
        return evocity.fitness.Undefined("nothing is built")
    return float(np.std(city.heights[city.built]))
'''


@click.command(
    epilog="""\b
Examples:
  evocity fitness new skyline
  evocity fitness new crowding --goal min --unit /ha -o measures"""
)
@click.argument("name", metavar="NAME")
@click.option(
    "--goal",
    type=click.Choice(["max", "min", "none"]),
    default="max",
    show_default=True,
    help="What a search wants of it, if the recipe does not say otherwise; none: it must say a "
    "target, or a city to be like.",
)
@click.option("--unit", default="", show_default="a pure number", help="Unit, such as m or /ha.")
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    metavar="FILE|FOLDER",
    show_default="NAME.py here",
    help="File to write, or the folder for it; never overwritten.",
)
def new(name: str, goal: str, unit: str, output: Path | None) -> None:
    """Write a Python file with a measure called NAME, to begin from.

    It works as it is, and has a place for each thing a measure should say of itself. Change its
    formula, and see what it says of cities: `evocity fitness check NAME.py`.
    """
    _check_name(name)
    _check_unit(unit)
    path = _free(output or Path(), name)
    text = written(name, goal, unit, path.name)
    with writing(path), open(path, "x", encoding="utf-8") as file:
        file.write(text)
    echo(f"wrote {path}")
    echo()
    echo(f"Change its formula, then:\n  evocity fitness check {path}")
    echo(f"  evocity score lyon-1er --fitness {path}")
    echo("To breed with it, in a recipe beside it (docs/recipe.md):")
    wanted = "\n  target = 1.0" if goal == "none" else ""
    echo(f'  [[fitness]]\n  file = "{path.name}"{wanted}')


def written(name: str, goal: str, unit: str, file: str) -> str:
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
    """A comment on all that a `CityMap` has, a line or more each, as its own documentation says."""
    told = {
        "heights": "float32 (H, W), metres above ground, 0 = ground; row 0 in the north.",
        "metres_per_pixel": "side of a pixel, metres.",
        "area": "ground covered by the whole map, m².",
    }
    told |= {name: _in_short(view) for name, view in views().items()}
    lines = []
    for name, text in told.items():
        lines += textwrap.wrap(
            f"city.{name}: {text}", 96, initial_indent="# ", subsequent_indent="#     "
        )
    return lines


def views() -> dict[str, cached_property]:
    """The views of a `CityMap` by name."""
    found = vars(evocity.CityMap).items()
    return {name: one for name, one in found if isinstance(one, cached_property)}


def _in_short(view: cached_property) -> str:
    """What the documentation of a ``view`` begins with, its cost, and what the view itself has."""
    from evocity.citymap import BUILT_ABOVE

    doc = re.sub(r"[`\\]", "", " ".join(view.__doc__.split()))
    first = doc.partition(". ")[0].rstrip(".").replace("BUILT_ABOVE", f"{BUILT_ABOVE} m")
    text = f"{first[0].lower()}{first[1:]}."
    if cost := re.search(r"(?:About )?[\d.]+(?: to [\d.]+)? [mµ]s at 256²", doc):
        text += f" {cost[0].removesuffix(' at 256²')}."
    kind = view.func.__annotations__.get("return")
    if dataclasses.is_dataclass(kind):
        computed = (name for name, one in vars(kind).items() if isinstance(one, _COMPUTED))
        names = [field.name for field in dataclasses.fields(kind)] + [*computed]
        text += f" It has {', '.join(name for name in names if not name.startswith('_'))}."
    return text


_COMPUTED = property | cached_property


def _check_name(name: str) -> None:
    if not name.isidentifier() or keyword.iskeyword(name):
        raise EvocityError(
            f"{name!r} as the name of a measure",
            "a name that a function of Python can have: letters, digits and _, no digit first, "
            "no word of the language",
            f"for example evocity fitness new {_cleaned(name)}",
        )
    if name in ("evocity", "np", "math", "city") or hasattr(builtins, name):
        raise EvocityError(
            f"{name!r} as the name of a measure",
            "a name that means nothing else in the file",
            f"for example evocity fitness new my_{name}",
        )
    for measure in evocity.fitness.measures():
        if name in (measure.name, measure.name.partition(".")[0]):
            raise EvocityError(
                f"there is a measure called {name} already, of {measure.origin}",
                "a name of its own",
                f"for example evocity fitness new my_{name}",
            )


def _cleaned(name: str) -> str:
    letters = "".join(c if c.isalnum() else "_" for c in name).strip("_").lower()
    return letters if letters.isidentifier() and not keyword.iskeyword(letters) else "my_measure"


def _check_unit(unit: str) -> None:
    if not unit.isprintable() or set(unit) & set('"\\{}'):
        raise EvocityError(
            f"--unit {unit!r}", "a unit, such as m, m² or /ha", "leave quotes and such out"
        )


def _free(output: Path, name: str) -> Path:
    """The file to write; raises unless it can be made anew."""
    path = output / f"{name}.py" if output.is_dir() else output
    if path.suffix != ".py":
        raise EvocityError(
            f"{str(path)!r} is no name of a Python file",
            "a name that ends in .py, or an existing folder",
            f"for example -o {path.with_suffix('.py')}",
        )
    check_folder(path.parent)
    if path.exists() or path.is_symlink():
        raise EvocityError(
            f"{str(path)!r} exists already",
            "a file to be made anew",
            "choose another name, or another place with -o",
        )
    return path
