"""`evocity readers list`: the files that can be read as maps."""

import inspect

import click

from evocity.cli.common import json_option, print_json, print_table, warn


@click.group()
def readers() -> None:
    """What files maps can be read from."""


@readers.command(
    "list",
    epilog="""\b
Examples:
  evocity readers list
  evocity show buildings.gpkg --layer roofs -o roofs.png""",
)
@json_option
def list_readers(as_json: bool) -> None:
    """List the readers: the suffix each knows, the content it expects, its options, where it
    comes from, and what it does.

    docs/maps.md tells more of each. Packages add readers by entry points of the group
    evocity.readers.

    JSON: each suffix to content (null for any), options, origin, doc.
    """
    from evocity.io import plugin_warnings
    from evocity.io import readers as every

    told = {suffix: _about(*row) for suffix, row in sorted(every().items())}
    if as_json:
        print_json(told)
    else:
        rows = [("suffix", "content", "options", "from", "what it does")]
        for suffix, about in told.items():
            options = " ".join(about["options"]) or "-"
            content = about["content"] or "any"
            rows.append((suffix, content, options, about["origin"], about["doc"] or "-"))
        print_table(rows)
    for text in plugin_warnings():
        warn(text)


def _about(reader, origin: str) -> dict[str, object]:
    return {
        "content": reader.content,
        "options": sorted("--" + option.replace("_", "-") for option in reader.takes),
        "origin": origin,
        "doc": " ".join((inspect.getdoc(reader.read) or "").partition("\n\n")[0].split()),
    }
