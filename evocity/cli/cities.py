"""`evocity cities`: the districts that come with evocity."""

import click

import evocity
from evocity.cli.common import print_table


@click.command(
    epilog="""\b
Example:
  evocity show lyon-1er -o lyon.png"""
)
def cities() -> None:
    """List the bundled districts, and whom to thank for each.

    Their names stand for a file wherever a MAP is asked for, recipes included. Pictures and
    files made from them carry the attribution; keep it with what you publish.
    """
    from evocity.io import attribution_of

    rows = [("name", "attribution")]
    print_table(rows + [(name, attribution_of(name)) for name in evocity.cities()])
