"""Options of commands: a short way to declare one, and those that several commands share."""

import contextlib
import functools
import tomllib
from collections.abc import Callable, Collection, Mapping
from pathlib import Path

import click

from evocity.errors import EvocityError, GenomeError

WHOLE = click.IntRange(min=0)
POSITIVE = click.IntRange(min=1)
FILE = click.Path(path_type=Path)

# Largest side of a map, pixels.
_MAX_SIDE = 32767
_NOT_GIVEN = click.core.ParameterSource.DEFAULT


def option(usage: str, text: str, kind=None, default=None, **settings) -> Callable:
    """Declare an option.

    usage : how it is typed, as in ``"--center LON LAT"``: its names; its parameter, in small
        letters, if that has another name; its metavar, a word for each value. "..." at the end:
        it may come several times, which its help says.
    text : its help, a fragment. Text in [brackets] after it is shown as the default, else "none".
    kind, default : its type, and its value unless it is given.
    settings : what else `click.option` takes.
    """
    words = usage.removesuffix("...").split()
    names = [word for word in words if word[0] == "-" or (word.isidentifier() and word.islower())]
    values = words[len(names) :]
    shown = True if default is not None else not settings.get("required") and "none"
    if text.endswith("]"):
        text, shown = text[:-1].split(". [", 1)
        text += "."
    if usage.endswith("..."):
        settings["multiple"] = True
        text += " Repeatable."
    if default is not None:
        settings["default"] = default
    settings.setdefault("show_default", shown)
    if values:
        settings |= {"metavar": " ".join(values), "nargs": len(values)}
    return click.option(*names, type=kind, help=text, **settings)


def flag(names: str, text: str) -> Callable:
    """Declare an option without a value."""
    return click.option(*names.split(), is_flag=True, help=text)


class _WordOption(click.Option):
    """An option with a word that may be left out: its first one stands for it then."""

    def __init__(self, *names, **settings):
        super().__init__(*names, **settings)
        self.words = tuple(self.type.choices)


#: How decoding settles roofs, as users name it, and the value of `evocity.genome.Genome.settle`.
SETTLINGS = {"buildings": True, "roofs": "roofs"}


def settle_options(default: str) -> Callable:
    """Add ``--settle`` and ``--no-settle``, which arrive as ``settle``: True, False, "roofs", or
    None where neither is given. The help shows the ``default``."""

    def add(command: Callable) -> Callable:
        def gather(values: Mapping) -> dict:
            way, raw = values["settle"], values["no_settle"]
            if raw and way is not None:
                raise EvocityError(
                    f"--settle {way} together with --no-settle",
                    "one of the two options",
                    "leave --no-settle out, unless you want roofs with fractal heights",
                )
            return {"settle": False if raw else SETTLINGS.get(way)}

        options = {
            "settle": option(
                "--settle buildings|roofs",
                "Make decoded roofs flat. With the word roofs, each roof gets its own median "
                "height. With the word buildings, or without a word, each building gets its "
                f"median height. [{default}]",
                click.Choice(tuple(SETTLINGS)),
                cls=_WordOption,
            ),
            "no_settle": flag("--no-settle", "Leave fractal heights on decoded roofs."),
        }
        return add_options(command, options, gather)

    return add


# -- types -------------------------------------------------------------------------------------


class Parsed(click.ParamType):
    """A type that ``parse`` reads from text; ``right`` describes the text it reads."""

    def __init__(self, name: str, parse: Callable[[str], object], right: str):
        self.name, self._parse, self._right = name, parse, right

    def convert(self, value, param, ctx) -> object:
        if not isinstance(value, str):
            return value
        try:
            return self._parse(value)
        except GenomeError as error:
            self.fail(f"{value!r}; expected: {error.expected}, {error.remedy}", param, ctx)
        except ValueError:
            self.fail(f"{value!r} is not {self._right}", param, ctx)


def _read_degrees(text: str) -> float | None:
    """Degrees; None for the word "own"."""
    return None if text == "own" else float(text)


def _read_numbers(text: str) -> tuple[int, ...]:
    return tuple(int(part) for part in text.split(","))


def _read_sizes(text: str) -> tuple[int, ...]:
    """Sizes and ranges of sizes: 16,20 or 9-32."""
    sizes = []
    for part in text.split(","):
        first, dash, last = part.partition("-")
        first, last = int(first), int(last if dash else first)
        if not 0 < first <= last <= _MAX_SIDE:
            raise ValueError(text)
        sizes += range(first, last + 1)
    return tuple(sizes)


def _read_sides(text: str) -> int | tuple[int, int]:
    from evocity.pavement import read_sides

    return read_sides(text)


def _read_heights(text: str) -> float | str:
    """Metres, or the name of a file."""
    try:
        return float(text)
    except ValueError:
        return text


def _read_reach(text: str) -> int | None:
    """Pixels; None for the whole map."""
    return None if text == "all" else int(text)


NUMBERS = Parsed("list", _read_numbers, "a list of whole numbers such as 2 or 2,3")
SIZES = Parsed("sizes", _read_sizes, "a list of pixels such as 20 or 16,20 or 9-32")
SIDES = Parsed("sides", _read_sides, "a side such as 4, or a range such as 2-16")
HEIGHTS = Parsed("heights", _read_heights, "metres or a file")
TERRAIN = Parsed("terrain", _read_heights, "metres or a file")
REACH = Parsed("reach", _read_reach, "a whole number of pixels or all")


# -- maps --------------------------------------------------------------------------------------

_WINDOW = "[the file's own window, or the middle of the buildings]"

#: The options of `evocity.read_map`, by the name of its parameter.
MAP_OPTIONS = {
    "pixels": option(
        "--pixels",
        "Side of the square map window, in pixels. [256 for footprints, a raster's own size]",
        int,
    ),
    "metres_per_pixel": option(
        "--metres-per-pixel",
        "Side of a pixel, in metres. [2.0 for footprints, a raster's own; PNG and NPY need it]",
        float,
    ),
    "center": option(
        "--center LON LAT",
        f"Centre of the map window in degrees, longitude first. {_WINDOW}",
        float,
    ),
    "layer": option(
        "--layer",
        "Layer to read from a file with layers, or map in a zip. [the buildings, if one layer has "
        "them]",
    ),
    "default_height": option(
        "--default-height",
        "Height in metres for buildings that have no height in the file. [6.0]",
        float,
    ),
    "height_scale": option(
        "--height-scale",
        "Height in metres of one grey level in a picture, or of one unit in a raster. [1; PNG "
        "needs it]",
        float,
    ),
    "height_column": option(
        "--height-column NAME",
        "Name of the column that holds the heights of buildings, in metres. [by the names of "
        "columns]",
    ),
    "levels_column": option(
        "--levels-column NAME",
        "Name of the column that holds the storeys of buildings, each 3 m high. [by the names of "
        "columns]",
    ),
    "nodata": option(
        "--nodata",
        "Value of missing pixels in a raster that declares no such value; these pixels are ground. "
        "[the value that the file declares]",
        float,
    ),
    "terrain": option(
        "--terrain FILE|METRES",
        "Raster of the ground to subtract from a raster of elevations above sea level, or the "
        "elevation of flat ground. The value 0 means that the heights are above ground.",
        TERRAIN,
    ),
    "attribution": option(
        "--attribution TEXT",
        "Attribution that the licence of the map file requires; all outputs contain this "
        "attribution. Bundled districts already have an attribution. [from the file]",
    ),
}

pixels_option = option("--pixels", "Side of the square map, in pixels.", int, 256)
metres_option = option("--metres-per-pixel", "Side of a pixel, in metres.", float, 2.0)
centers_option = option(
    "--center LON LAT...",
    "Longitude and latitude of the centre of a map window, in degrees. Give one centre for each "
    'MAP, or leave out the centres of bundled districts. The centre "own own" is the file\'s own '
    f"window. {_WINDOW}",
    Parsed("float", _read_degrees, 'a number of degrees, or "own"'),
)


def add_options(command: Callable, options: Mapping[str, Callable], gather: Callable) -> Callable:
    """Add ``options`` by parameter; ``gather`` turns their values into keywords of ``command``."""

    @functools.wraps(command)
    def gathered(**given):
        return command(**gather({key: given.pop(key) for key in options}), **given)

    for declare in reversed(options.values()):
        gathered = declare(gathered)
    return gathered


def map_options(command: Callable) -> Callable:
    """Add the options of `evocity.read_map`; those given arrive as the mapping ``reading``."""

    def gather(values: Mapping) -> dict:
        return {"reading": {k: v for k, v in values.items() if v is not None}}

    return add_options(command, MAP_OPTIONS, gather)


def file_options(command: Callable) -> Callable:
    """Add the options that several map files may share; None where they are not given."""
    keys = ("layer", "default_height", "height_scale", "height_column", "levels_column")
    keys += ("nodata", "terrain")
    return add_options(command, {key: MAP_OPTIONS[key] for key in keys}, dict)


_CODING_OPTIONS = {
    "block": option(
        "--block SIDE|FINEST-LARGEST",
        "Sides of the range blocks, in pixels, for maps that the command encodes. "
        "[as a genome among them, else 2-16]",
        SIDES,
    ),
    "domains": option(
        "--domains N[,N…]",
        "Sides of the domain blocks, as multiples of the range block's side, for maps that the "
        "command encodes. [2]",
        NUMBERS,
    ),
    "reach": option(
        "--reach PIXELS|all",
        "Largest distance between a range block and its domain block, in pixels. [24]",
        REACH,
    ),
}


def parent_options(command: Callable) -> Callable:
    """Add the options of reading and coding maps; given ones are in ``reading`` and ``coding``."""

    def gather(values: Mapping) -> dict:
        source = click.get_current_context().get_parameter_source
        return {"coding": {k: v for k, v in values.items() if source(k) is not _NOT_GIVEN}}

    return map_options(add_options(command, _CODING_OPTIONS, gather))


# -- outputs -----------------------------------------------------------------------------------


def output_option(metavar: str, text: str, *, required: bool = True, default: str = "") -> Callable:
    """``-o``: the file to write; an existing one is overwritten. The help shows ``default``."""
    text = f"{text}. An existing file is overwritten." + f" [{default}]" * bool(default)
    return option(f"-o --output {metavar}", text, FILE, required=required)


json_option = flag(
    "--json as_json", "Print only a JSON document, with null for each number that is not finite."
)


# -- genomes and runs --------------------------------------------------------------------------

seed_option = option("--seed", "Seed of the random draws.", WHOLE, 0)
count_option = option(
    "--count",
    'Copies to count: "pixels" counts copies of the pixel, "domains" counts copies of the most '
    'copied domain block that contains the pixel, and "ranges" counts copies of the domain '
    "block that the pixel's range block copies. [pixels]",
    click.Choice(["pixels", "domains", "ranges"]),
)
part_option = option(
    "--part",
    "Parts to filter as wholes, by the mean number of copies of their pixels: pixels and "
    '"buildings" become ground, and "blocks" (range blocks) become flat. [pixels]',
    click.Choice(["pixels", "blocks", "buildings"]),
)
frames_option = option(
    "--frames N",
    "Number of frames, 2 to 500: write an animation (.webp), or all frames in one picture (.png). "
    "[no frames]",
    int,
)
_PLACE = "[the common place of all source cities, else no coordinates on Earth]"
at_option = option(
    "--at CITY",
    f"Source city of the run; the output gets the coordinates of this city on Earth. {_PLACE}",
)

crs_option = option(
    "--crs CODE",
    "Reference system of the coordinates in the output, such as EPSG:2154. [the map's own]",
)

_INDIVIDUAL = "Number of an individual in a run folder, as shown in the report"


def one_id(identifiers: tuple) -> int | None:
    """The only value of ``--id``, or None. Raises `EvocityError` for several."""
    if len(identifiers) > 1:
        raise EvocityError(
            " ".join(f"--id {number}" for number in identifiers),
            "--id once",
            "name one individual; call the command again for the next",
        )
    return identifiers[0] if identifiers else None


def _declare_id(kind, required: bool) -> Callable:
    """``--id``, once."""

    def only(context, parameter, identifiers: tuple) -> int | None:
        return one_id(identifiers)

    only_once = {"multiple": True, "callback": only, "required": required}
    return option("--id identifier N", f"{_INDIVIDUAL}.", kind, **only_once)


id_option = _declare_id(int, required=False)
required_id_option = _declare_id(WHOLE, required=True)


def ids_option(use: str) -> Callable:
    """``--id`` of a command that takes several; ``use`` ends its help."""
    return option("--id identifiers N...", f"{_INDIVIDUAL}. {use}.", int)


def settings_option(default: str) -> Callable:
    """``--set``; ``default`` says whose parameters stand unless they are set."""
    text = "Name of a parameter and its value, written in TOML. Write lists without outer brackets:"
    lists = "2,3 or [64,64],[256,256]."
    return option("--set settings KEY=VALUE...", f"{text} {lists} [{default}]")


_WORDS = {"none": None, "true": True, "false": False}


def settings_of(settings: tuple[str, ...], texts: Collection[str] = ()) -> dict[str, object]:
    """Read parameters from ``KEY=VALUE`` each; those of ``texts`` stay text. Raises
    `EvocityError`."""
    values: dict[str, object] = {}
    for setting in settings:
        key, equals, value = setting.partition("=")
        key = key.strip()
        if not (equals and key and value.strip()) or key in values:
            raise EvocityError(
                f"--set {setting}, the second of {key}" if key in values else f"--set {setting}",
                "KEY=VALUE, once for each parameter",
                f"write for example --set {key or 'key'}=8; lists 2,3; none for nothing",
            )
        values[key] = value.strip() if key in texts else value_of(value.strip())
    return values


def value_of(text: str) -> object:
    """Read a value as TOML; 2,3 is a list, none is None, other text is a word."""
    if text.lower() in _WORDS:
        return _WORDS[text.lower()]
    for value in (text, f"[{text}]") if "," in text else (text,):
        with contextlib.suppress(ValueError, RecursionError):  # TOML's own errors are the former
            document = tomllib.loads(f"value = {value}")
            if list(document) == ["value"]:  # else the text holds more than a value
                return document["value"]
    with contextlib.suppress(ValueError):
        return float(text)  # TOML has no .5
    if "," in text and not set(text) & set("[]{}\"'"):
        return [value_of(part.strip()) for part in text.split(",") if part.strip()]
    return text


accept_changes_option = flag(
    "--accept-changes", "Continue even if files of measures, maps or other inputs have changed."
)
trust_option = flag(
    "--trust",
    "Execute the measures and commands of the run without asking, even if the run comes from "
    "another machine.",
)
until_option = option(
    "--until HH:MM",
    "Time of day, or date with time (2026-11-25T07:00), at which the run ends; the word "
    '"none" means no end time. [the recipe\'s]',
)


def cluster_option(default: str) -> Callable:
    """``--cluster``; ``default`` says which one is used unless it is given."""
    return option(
        "--cluster ADDRESS",
        "Address of a Dask scheduler, such as tcp://host:8786; local:N starts N Dask workers; "
        'the word "none" means no cluster. On a cluster, the option --workers sets the number '
        "of processes of each Dask worker. "
        f"[{default}]",
    )
