"""`evocity cities`: the districts that come with evocity."""

import click

from evocity.cli.common import json_option, print_json, print_table


@click.command(
    epilog="""\b
Examples:
  evocity show lyon-1er -o lyon.png
  evocity cities --json"""
)
@json_option
def cities(as_json: bool) -> None:
    """List the bundled districts, how many heights they know, and whom to thank for each.

    Their names stand for a file wherever a MAP is asked for, recipes included. Pictures and
    files made from them carry the attribution; keep it with what you publish.

    JSON: each name to attribution, buildings (in the window), without_height (those that get
    the default height).
    """
    from evocity.io.bundled import DISTRICTS

    told = {name: district._asdict() for name, district in DISTRICTS.items()}
    if as_json:
        print_json(told)
        return
    rows = [("name", "buildings", "without height", "attribution")]
    for name, about in told.items():
        count, without = about["buildings"], about["without_height"]
        missing = "all" if without == count else str(without or "none")
        rows.append((name, str(count), missing, about["attribution"]))
    print_table(rows)
