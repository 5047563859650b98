"""`evocity studio`: runs in the browser."""

import threading
import webbrowser
from pathlib import Path

import click

import evocity
from evocity.cli.shared.inputs import measures_of
from evocity.cli.shared.options import FILE, flag, json_option, option
from evocity.cli.shared.terminal import echo, print_json, quiet_stdout
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
@option(
    "--runs folder FOLDER", "Folder of the runs to show, and of new runs. [runs, without a RUN]"
)
@option(
    "--fitness words FILE.py|FILE.toml...",
    "Python file of measures (executed), or table of building types, that the desk offers.",
)
@option("--recipe FILE.toml", "Recipe that the desk offers; its measures are executed.", FILE)
@option("--port", "Port of the page. [any free port]", click.IntRange(0, 65535), 0)
@flag("--no-browser", "Print the address, but open no browser.")
@json_option
def studio(
    run: tuple[str, ...],
    folder: str | None,
    words: tuple[str, ...],
    recipe: Path | None,
    port: int,
    no_browser: bool,
    as_json: bool,
) -> None:
    """Show the runs in the folders RUN in a browser: all births, live, with a common filter.

    Without a RUN, studio opens its desk. At the desk you choose cities or files of footprints,
    choose measures, and start a run. With a RUN, a button opens the desk.

    The page shows one run, or two side by side: pictures, parallel coordinates, pedigrees, picks
    with notes, and children of picks. The page also saves births as files. A shown run may still be
    running: studio only reads the run, and saves only your picks beside its births. A run that you
    start in studio goes on when studio ends. New runs go into the folder --runs, or else beside the
    first RUN.

    Only you can open the page, and only on this machine: its address contains a secret token.
    Ctrl-C ends studio. The command needs the extra studio: pip install 'evocity[studio]'.

    JSON keys: url (the address with its token); the document is a single line.
    """
    from evocity.analysis.optional_libraries import library

    for name in ("starlette", "uvicorn"):
        library(name, "studio", "studio")
    from evocity.studio.desk_routes import StudioOptions
    from evocity.studio.server import serve

    fresh = not run and folder is None
    if fresh:
        folder = "runs"
    with quiet_stdout():
        files = [(file, _measures(file)) for file in words]
        if recipe is not None:
            evocity.read_recipe(recipe)
    into = None if folder is None else Path(folder)
    options = StudioOptions(into, fresh, files, None if recipe is None else recipe.absolute())

    def began(url: str) -> None:
        if as_json:
            print_json({"url": url}, indent=None)
        else:
            echo(f"studio: {url}\nCtrl-C ends it.")
        click.get_text_stream("stdout").flush()
        if not no_browser:
            threading.Thread(target=webbrowser.open, args=(url,), daemon=True).start()

    serve(run, port, began, options)


def _measures(file: str) -> list:
    if file.endswith((".py", ".toml")):
        return measures_of(file)
    raise FitnessError(
        f"--fitness {file} is not a file of measures",
        "a Python file of measures, or a table of building types in TOML",
        "leave --fitness out: the desk offers evocity's own measures without a file",
    )
