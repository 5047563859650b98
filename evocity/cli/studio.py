"""`evocity studio`: runs in the browser."""

from pathlib import Path

import click

import evocity
from evocity.cli.shared.commands import command
from evocity.cli.shared.inputs import measures_of
from evocity.cli.shared.options import FILE, flag, json_option, option
from evocity.cli.shared.terminal import echo, note, print_json, quiet_stdout
from evocity.errors import FitnessError


@command("""
  evocity studio
  evocity studio runs/lyon-x-montpellier
  evocity studio runs/tonight runs/last-night
  evocity studio --runs runs --port 8400 --no-browser""")
@click.argument("run", metavar="[RUN]...", nargs=-1)
@option(
    "--runs folder FOLDER",
    "Folder of the runs that studio shows, and of the new runs that studio saves. [runs, without "
    "a RUN]",
)
@option(
    "--fitness words FILE.py|FILE.toml...",
    "Measures that the page for new runs offers: a Python file that studio executes, or a table "
    "of building types.",
)
@option(
    "--recipe FILE.toml",
    "Recipe that the page for new runs offers; studio executes the measures of the recipe.",
    FILE,
)
@option(
    "--library FOLDER",
    "Library whose objects can replace buildings in the 3D views of births.",
    FILE,
)
@option("--port", "Network port of the page. [any free port]", click.IntRange(0, 65535), 0)
@flag("--no-browser", "Print the address without opening a browser.")
@json_option
def studio(
    run: tuple[str, ...],
    folder: str | None,
    words: tuple[str, ...],
    recipe: Path | None,
    library: Path | None,
    port: int,
    no_browser: bool,
    as_json: bool,
) -> None:
    """Show all births of one or more runs in a browser, with live updates and one filter for all
    runs.

    Without a RUN, studio opens the desk, a page to prepare a run. The desk is a page where you
    choose cities or footprint files, choose measures, and start a run. With a RUN, the page of
    studio has a button that opens the page for new runs.

    For one run, or two runs side by side, the page shows pictures, parallel coordinates and
    pedigrees of births. The page also shows the births that you picked, your notes, and the
    children of picked births. The page can save births as files. You can open a run that is still
    in progress: studio reads the births, and writes only your picks. A run that you start in studio
    continues when studio ends. New runs are saved in the folder --runs, or beside the first RUN if
    you do not give --runs.

    Only you can open the page, and only on this machine, because the address of the page contains a
    secret token. Ctrl-C ends studio. The command needs additional packages: pip install
    'evocity[studio]'.

    The JSON document is a single line. The key "url" of the document contains the address of the
    page, including the token.
    """
    from evocity import lazy_imports

    for name in ("starlette", "uvicorn"):
        lazy_imports.library(name, "studio", "studio")
    from evocity.recipe.values import describe_reach
    from evocity.studio.desk_routes import StudioOptions
    from evocity.studio.server import serve

    fresh = not run and folder is None
    if fresh:
        folder = "runs"
    with quiet_stdout():
        files = [(file, _measures(file)) for file in words]
        if recipe is not None:
            for text in describe_reach(evocity.read_recipe(recipe).evaluation.cluster):
                note(text)
    into = None if folder is None else Path(folder)
    options = StudioOptions(
        into, fresh, files, None if recipe is None else recipe.absolute(), library
    )

    def began(url: str) -> None:
        if as_json:
            print_json({"url": url}, indent=None)
        else:
            echo(f"studio: {url}\nCtrl-C ends it.")
        click.get_text_stream("stdout").flush()

    serve(run, port, began, options, browse=not no_browser)


def _measures(file: str) -> list:
    if file.endswith((".py", ".toml")):
        return measures_of(file)
    raise FitnessError(
        f"--fitness {file} is not a file of measures",
        "a Python file of measures, or a TOML file of building types",
        "leave out --fitness, because studio always offers evocity's own measures",
    )
