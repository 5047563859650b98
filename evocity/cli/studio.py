"""`evocity studio`: runs in the browser."""

import threading
import webbrowser
from pathlib import Path

import click

import evocity
from evocity.cli.common import echo, json_option, print_json, quiet_stdout
from evocity.cli.given import measures_of
from evocity.errors import FitnessError


@click.command(
    epilog="""\b
Examples:
  evocity studio
  evocity studio runs/lyon-x-montpellier
  evocity studio runs/tonight runs/last-night
  evocity studio --runs runs --port 8400 --no-browser"""
)
@click.argument("run", metavar="[RUN]...", nargs=-1)
@click.option(
    "--runs",
    "folder",
    metavar="FOLDER",
    show_default="runs, where no RUN is named",
    help="A folder with runs in it: all of them besides, and those that come to it. Runs that are "
    "begun in studio go there; else beside the first RUN.",
)
@click.option(
    "--fitness",
    "wanted",
    multiple=True,
    metavar="FILE.py|FILE.toml",
    show_default="none",
    help="A file of measures, which is executed, or a table of building types: the desk offers "
    "them too. Give it once for each.",
)
@click.option(
    "--recipe",
    type=click.Path(path_type=Path),
    metavar="FILE.toml",
    show_default="none",
    help="A recipe that the desk offers, to be begun as it is. Its measures are executed.",
)
@click.option(
    "--port",
    type=click.IntRange(0, 65535),
    default=0,
    show_default="any that is free",
    help="Port of this machine at which the page is answered.",
)
@click.option("--no-browser", is_flag=True, help="Print the address, and open no browser.")
@json_option
def studio(
    run: tuple[str, ...],
    folder: str | None,
    wanted: tuple[str, ...],
    recipe: Path | None,
    port: int,
    no_browser: bool,
    as_json: bool,
) -> None:
    """Look at the runs in the folders RUN in a browser: all births, live, and one filter for all.

    Without a RUN it begins at the desk: choose cities, or bring files of footprints, choose what is
    searched by, and begin a run. The desk is there with runs too.

    Pictures and parallel coordinates, one birth with its pedigree, picks with notes, children of
    picks, chosen births as files; one run at a time, or two beside each other. A run may go on
    meanwhile; it is only read, but for the picks, which are kept beside its births. A run that is
    begun here goes on when studio ends.

    The page is for you alone, on this machine: the address that is printed has a token, which no
    other page knows. Ctrl-C ends it. It comes with the extra studio: pip install 'evocity[studio]'.

    JSON keys: url (the address with its token); one line.
    """
    from evocity.analysis.extras import library

    for name in ("starlette", "uvicorn"):
        library(name, "studio", "studio")
    from evocity.studio.begins import Begins
    from evocity.studio.serving import serve

    fresh = not run and folder is None
    if fresh:
        folder = "runs"
    with quiet_stdout():
        files = [(file, _measures(file)) for file in wanted]
        if recipe is not None:
            evocity.read_recipe(recipe)
    into = None if folder is None else Path(folder)
    begins = Begins(into, fresh, files, None if recipe is None else recipe.absolute())

    def began(url: str) -> None:
        if as_json:
            print_json({"url": url}, indent=None)
        else:
            echo(f"studio: {url}\nCtrl-C ends it.")
        click.get_text_stream("stdout").flush()
        if not no_browser:
            threading.Thread(target=webbrowser.open, args=(url,), daemon=True).start()

    serve(run, port, folder, began, begins)


def _measures(file: str) -> list:
    if file.endswith((".py", ".toml")):
        return measures_of(file)
    raise FitnessError(
        f"--fitness {file}",
        "a Python file of measures, or a table of building types in TOML",
        "leave it out: the desk offers evocity's own measures without any file",
    )
