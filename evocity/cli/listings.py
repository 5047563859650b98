"""`evocity cities`, `operators list`, `readers list`: what there is to choose from."""

import inspect
from collections.abc import Callable, Mapping

import click

from evocity.cli.shared.commands import command
from evocity.cli.shared.options import json_option
from evocity.cli.shared.terminal import echo, print_json, print_table, warn


@command("""
  evocity show lyon-1er -o lyon.png
  evocity cities --json""")
@json_option
def cities(as_json: bool) -> None:
    """List the bundled districts, with the number of buildings, the number of missing heights, and
    the attribution of each district.

    Wherever a command or a recipe needs a map file, you can write the name of a district. Pictures
    and files made from a district contain the attribution of the district. Keep the attribution of
    a district with everything that you publish.

    For each district, the JSON document has the keys "attribution", "buildings" and
    "without_height". The key "without_height" counts the buildings that get the default height.
    """
    from evocity.io.bundled_cities import DISTRICTS

    def row(name: str, about: Mapping) -> tuple[str, ...]:
        count, without = about["buildings"], about["without_height"]
        missing = "all" if without == count else str(without or "none")
        return name, str(count), missing, about["attribution"]

    listed = {name: district._asdict() for name, district in DISTRICTS.items()}
    _print_list(listed, ("name", "buildings", "without height", "attribution"), row, as_json)


@click.group()
def operators() -> None:
    """List the operators that breed genomes."""


@command("""
  evocity operators list
  evocity breed pavement_fusion lyon-1er montpellier-pas-du-loup --set fill=0.3 -o child.parquet""")
@json_option
def list_operators(as_json: bool) -> None:
    """List all operators with their number of parents, origin, effect, and parameters with
    defaults.

    The page docs/operators.md explains the parameters. Set parameters in a recipe, or with the
    option --set of `evocity breed`.

    For each operator, the JSON document has the keys "of", "parents", "parameters", "origin" and
    "doc". The key "of" says what the operator breeds: fabric, shape or curve. The key "parents"
    contains the smallest and the largest number of parents; null means any number.
    """
    from evocity.operators import operators as all_operators
    from evocity.operators import origins, plugin_warnings

    listed = {
        name: _about_operator(kind, origins()[name])
        for name, kind in sorted(all_operators().items())
    }

    def row(name: str, about: Mapping) -> tuple[str, ...]:
        fewest, most = about["parents"]
        count = f"{fewest}" if most == fewest else f"{fewest}…{most or ''}"
        return name, count, about["origin"], about["doc"]

    _print_list(listed, ("name", "parents", "from", "what it does"), row, as_json)
    if not as_json:
        for name, about in listed.items():
            parameters = "  ".join(f"{k}={_typed(v)}" for k, v in about["parameters"].items())
            echo()
            echo(click.wrap_text(f"{name}: {parameters}", 100, subsequent_indent="  "))
    for text in plugin_warnings():
        warn(text)


def _about_operator(kind: type, origin: str) -> dict[str, object]:
    from evocity.operators import bred_by

    parameters = inspect.signature(kind).parameters.values()
    return {
        "of": bred_by(kind),
        "parents": list(kind.parents),
        "parameters": {
            parameter.name: _plain(parameter.default)
            for parameter in parameters
            if parameter.kind is not inspect.Parameter.VAR_KEYWORD
        },
        "origin": origin,
        "doc": _summary(kind),
    }


def _summary(thing: object) -> str:
    """The first paragraph of a docstring, in one line."""
    return " ".join((inspect.getdoc(thing) or "").partition("\n\n")[0].split())


def _plain(default: object) -> object:
    """A default as a value of JSON; "required" if the parameter has no default."""
    if default is inspect.Parameter.empty:
        return "required"
    if isinstance(default, list | tuple):
        return [_plain(item) for item in default]
    return default if isinstance(default, bool | int | float | str | None) else str(default)


def _typed(default: object) -> str:
    """A default as a user types it after --set."""
    if isinstance(default, list):
        return ",".join(map(_typed, default)) or "[]"
    if default is None:
        return "none"
    return str(default).lower() if isinstance(default, bool) else str(default)


@click.group()
def readers() -> None:
    """List the readers of map files."""


@command("""
  evocity readers list
  evocity show buildings.gpkg --layer roofs -o roofs.png""")
@json_option
def list_readers(as_json: bool) -> None:
    """List all readers of map files with their suffix, expected content, options, origin and
    effect.

    The page docs/maps.md describes each reader. Other packages add readers through entry points of
    the group "evocity.readers".

    For each suffix, the JSON document has the keys "content", "options", "origin" and "doc" of the
    reader. If the key "content" is null, the reader accepts any content.
    """
    from evocity.io import plugin_warnings
    from evocity.io import readers as all_readers

    def about_reader(reader, origin: str) -> dict[str, object]:
        return {
            "content": reader.content,
            "options": sorted("--" + option.replace("_", "-") for option in reader.takes),
            "origin": origin,
            "doc": _summary(reader.read),
        }

    def row(suffix: str, about: Mapping) -> tuple[str, ...]:
        options = " ".join(about["options"]) or "-"
        return suffix, about["content"] or "any", options, about["origin"], about["doc"] or "-"

    listed = {suffix: about_reader(*entry) for suffix, entry in sorted(all_readers().items())}
    _print_list(listed, ("suffix", "content", "options", "from", "what it does"), row, as_json)
    for text in plugin_warnings():
        warn(text)


def _print_list(listed: Mapping, head: tuple[str, ...], row: Callable, as_json: bool) -> None:
    """Print what is ``listed`` as JSON, or as a table with a ``row`` for each."""
    if as_json:
        print_json(listed)
    else:
        print_table([head, *(row(*entry) for entry in listed.items())])


operators.add_command(list_operators, "list")


readers.add_command(list_readers, "list")
