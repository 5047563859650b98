"""`evocity studio`: runs in the browser."""

import threading
import webbrowser

import click

from evocity.cli.common import echo, json_option, print_json


@click.command(
    epilog="""\b
Examples:
  evocity studio runs/lyon-x-montpellier
  evocity studio runs/tonight runs/last-night
  evocity studio --runs runs --port 8400 --no-browser"""
)
@click.argument("run", metavar="[RUN]...", nargs=-1)
@click.option(
    "--runs",
    "folder",
    metavar="FOLDER",
    show_default="none",
    help="A folder with runs in it: all of them besides, and those that come to it.",
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
    run: tuple[str, ...], folder: str | None, port: int, no_browser: bool, as_json: bool
) -> None:
    """Look at the runs in the folders RUN in a browser: all births, live, and one filter for all.

    Pictures and parallel coordinates, one birth with its pedigree, picks with notes, children of
    picks, chosen births as files; one run at a time, or two beside each other. A run may go on
    meanwhile; it is only read, but for the picks, which are kept beside its births.

    The page is for you alone, on this machine: the address that is printed has a token, which no
    other page knows. Ctrl-C ends it. It comes with the extra studio: pip install 'evocity[studio]'.

    JSON keys: url (the address with its token); one line.
    """
    if not run and folder is None:
        raise click.UsageError("name a RUN, or several, or a folder of runs by --runs")
    from evocity.analysis.extras import library

    for name in ("starlette", "uvicorn"):
        library(name, "studio", "studio")
    from evocity.studio.serving import serve

    def began(url: str) -> None:
        if as_json:
            print_json({"url": url}, indent=None)
        else:
            echo(f"studio: {url}\nCtrl-C ends it.")
        click.get_text_stream("stdout").flush()
        if not no_browser:
            threading.Thread(target=webbrowser.open, args=(url,), daemon=True).start()

    serve(run, port, folder, began)
