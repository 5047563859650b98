"""`evocity operators list`: the operators there are, and their parameters."""

import inspect

import click

from evocity.cli.common import echo, json_option, print_json, print_table, warn


@click.group()
def operators() -> None:
    """What genomes can be bred by."""


@operators.command(
    "list",
    epilog="""\b
Examples:
  evocity operators list
  evocity breed pavement_fusion lyon-1er montpellier-pas-du-loup --set fill=0.3 -o child.parquet""",
)
@json_option
def list_operators(as_json: bool) -> None:
    """List the operators: parents they take, where each comes from and what it does, its
    parameters and their defaults.

    docs/operators.md tells what the parameters mean. They are set in a recipe, or by --set of
    `evocity breed`.

    JSON: each name to what it breeds (fabric, shape, curve), parents (fewest, most; null for any
    number), parameters (each to its
    default; null for none), origin, doc.
    """
    from evocity.operators import operators as every
    from evocity.operators import origins, plugin_warnings

    told = {name: _about(kind, origins()[name]) for name, kind in sorted(every().items())}
    if as_json:
        print_json(told)
    else:
        rows = [("name", "parents", "from", "what it does")]
        for name, about in told.items():
            fewest, most = about["parents"]
            count = f"{fewest}" if most == fewest else f"{fewest}…{most or ''}"
            rows.append((name, count, about["origin"], about["doc"]))
        print_table(rows)
        for name, about in told.items():
            parameters = "  ".join(f"{k}={_typed(v)}" for k, v in about["parameters"].items())
            echo()
            echo(click.wrap_text(f"{name}: {parameters}", 100, subsequent_indent="  "))
    for text in plugin_warnings():
        warn(text)


def _about(kind: type, origin: str) -> dict[str, object]:
    parameters = inspect.signature(kind).parameters.values()
    from evocity.operators import bred_by

    return {
        "of": bred_by(kind),
        "parents": list(kind.parents),
        "parameters": {
            one.name: _plain(one.default)
            for one in parameters
            if one.kind is not inspect.Parameter.VAR_KEYWORD
        },
        "origin": origin,
        "doc": (inspect.getdoc(kind) or "").partition("\n\n")[0].replace("\n", " "),
    }


def _plain(default: object) -> object:
    """A default as JSON has it; "required" where there is none."""
    if default is inspect.Parameter.empty:
        return "required"
    if isinstance(default, list | tuple):
        return [_plain(one) for one in default]
    return default if isinstance(default, bool | int | float | str | None) else str(default)


def _typed(default: object) -> str:
    """A default as it would be typed after --set."""
    if isinstance(default, list):
        return ",".join(map(_typed, default)) or "[]"
    if default is None:
        return "none"
    return str(default).lower() if isinstance(default, bool) else str(default)
