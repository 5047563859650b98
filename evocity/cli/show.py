"""`evocity show`: a map, a genome or a run becomes a picture."""

from pathlib import Path

import click

import evocity
from evocity.cli.common import check_output, city_of, map_options, output_option, writing
from evocity.errors import EvocityError


@click.command(
    epilog="""\b
Examples:
  evocity show lyon-1er -o lyon.png
  evocity show runs/lyon-x-montpellier -o bred.png"""
)
@click.argument("what", metavar="MAP|GENOME|RUN")
@output_option("PNG", "Picture to write; overwritten if it exists.")
@map_options
def show(what: str, output: Path, reading) -> None:
    """Draw a map, the map of a genome, or the best of a run.

    Heights are drawn on a colour scale in metres, with a scale bar and the attribution of the
    sources. Of a run folder: its parents and its last front side by side.
    """
    check_output(output, what, {".png"})
    if not Path(what).is_dir():
        evocity.write_map(city_of(what, reading), output)
    else:
        _show_run(what, output, reading)
    click.echo(f"wrote {output}")


def _show_run(folder: str, output: Path, reading) -> None:
    from evocity.files import whole_file
    from evocity.report import contact_sheet

    if reading:
        raise EvocityError(
            f"options of reading a map with the run {folder}",
            "none: a run knows its maps",
            "leave them out",
        )
    picture = contact_sheet(evocity.open_run(folder))
    with writing(output), whole_file(output) as temporary:
        picture.save(temporary, format="PNG")
