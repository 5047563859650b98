"""`evocity studio`: a run in the browser."""

import threading
import webbrowser

import click

from evocity.cli.common import echo, json_option, print_json


@click.command(
    epilog="""\b
Examples:
  evocity studio runs/lyon-x-montpellier
  evocity studio runs/tonight --port 8400 --no-browser"""
)
@click.argument("run", metavar="RUN")
@click.option(
    "--port",
    type=click.IntRange(0, 65535),
    default=0,
    show_default="any that is free",
    help="Port of this machine at which the page is answered.",
)
@click.option("--no-browser", is_flag=True, help="Print the address, and open no browser.")
@json_option
def studio(run: str, port: int, no_browser: bool, as_json: bool) -> None:
    """Look at the run in the folder RUN in a browser: all births, live, and one filter for all.

    Pictures and parallel coordinates, one birth with its pedigree, picks with notes, children of
    picks, chosen births as files. The run may go on meanwhile; it is only read, but for the picks,
    which are kept beside its births.

    The page is for you alone, on this machine: the address that is printed has a token, which no
    other page knows. Ctrl-C ends it. It comes with the extra studio: pip install 'evocity[studio]'.

    JSON keys: url (the address with its token); one line.
    """
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

    serve(run, port, began)
