"""`evocity show`: a map, a genome or a run becomes a picture."""

from pathlib import Path

import click

import evocity
from evocity.cli.common import check_output, map_options, output_option, writing
from evocity.cli.given import city_of, id_option, refuse_reading


@click.command(
    epilog="""\b
Examples:
  evocity show lyon-1er -o lyon.png
  evocity show runs/lyon-x-montpellier -o bred.png
  evocity show runs/lyon-x-montpellier --id 97 -o one.png"""
)
@click.argument("what", metavar="MAP|GENOME|RUN")
@output_option("PNG", "Picture to write; overwritten if it exists.")
@id_option
@map_options
def show(what: str, output: Path, identifier, reading) -> None:
    """Draw a map, the map of a genome, or the best of a run.

    Heights are drawn on a colour scale in metres, with a scale bar and the attribution of the
    sources. Of a run folder: its parents and the best of its last generation side by side, or
    the individual named by --id.
    """
    check_output(output, what, {".png"})
    if identifier is not None or not Path(what).is_dir():
        evocity.write_map(city_of(what, reading, identifier), output)
    else:
        _show_run(what, output, reading)
    click.echo(f"wrote {output}")


def _show_run(folder: str, output: Path, reading) -> None:
    from evocity.files import whole_file
    from evocity.report import contact_sheet

    refuse_reading(f"the run {folder}", reading)
    picture = contact_sheet(evocity.open_run(folder))
    with writing(output), whole_file(output) as temporary:
        picture.save(temporary, format="PNG")
