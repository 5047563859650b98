"""The HTML report of a run: one page that opens anywhere, without network."""

import os
from base64 import b64encode
from hashlib import sha256
from pathlib import Path

from markupsafe import Markup

from evocity.analysis import open_run
from evocity.errors import RunError, reason_of
from evocity.files import whole_file
from evocity.report import tables
from evocity.report.front import Front, curves
from evocity.report.gallery import Galleries, city_key, parents
from evocity.report.glossary import WORDS, measure_texts
from evocity.report.grid import grid_picture
from evocity.report.islands import Islands, island_curves
from evocity.report.pictures import pictures_of, scale_colours
from evocity.report.plots import ticks
from evocity.report.shortlist import best_of_last, search_for, shortlist_cards, title_of
from evocity.report.shown_births import ShownBirths
from evocity.report.summary import Summary
from evocity.templates import data_uri, templates_of

TEMPLATES = Path(__file__).parent / "templates"

# The page fetches nothing and runs only our own script: a stranger's text can do neither.
_POLICY = (
    "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'sha256-{}'; "
    "base-uri 'none'; form-action 'none'"
)


def write_report(run_folder: str | os.PathLike, output: str | os.PathLike | None = None) -> Path:
    """Write a run's report into its folder as ``report.html``, or to ``output``. Return its path.

    The page needs no other file. It shows which individuals to keep and why, the parents, the
    front, and curves. It also has galleries of the last generation and of the archive, tables of
    births and failures, settings, and attributions. The report executes nothing in the folder.
    Raises `RunError` if there is no run, if no generation is complete, or if the page cannot be
    written.
    """
    run = open_run(run_folder)
    page = Path(run_folder) / "report.html" if output is None else Path(output)
    text = page_of(ShownBirths(run))
    try:
        with whole_file(page) as temporary:
            temporary.write_text(text, encoding="utf-8")
    except OSError as error:
        raise RunError(
            f"{page} cannot be written: {reason_of(error)}",
            "a folder that you may write to, with space left",
            "free space, or choose another place",
        ) from error
    return page


def page_of(shown: ShownBirths) -> str:
    """Return the report as HTML. Raises as `write_report` does."""
    return templates_of(TEMPLATES).get_template("page.html").render(page_values(shown))


def page_values(shown: ShownBirths) -> dict:
    """Return the values of the page's template, which escapes all but our drawings, style and
    script."""
    run, pictures = shown.run, pictures_of(shown)
    highest = pictures.highest
    cards = shortlist_cards(shown, pictures)
    script = _asset("report.js")
    digest = b64encode(sha256(script.encode()).digest()).decode()
    return {
        "policy": Markup(_POLICY.format(digest)),
        "style": _asset("report.css"),
        "script": script,
        "words": WORDS,
        "measures": measure_texts(run.columns.logged),
        "shown": shown,
        "run": run,
        "header": run.header,
        "summary": Summary(shown),
        "highest": highest,
        "top": max(float(source.city.heights.max()) for source in shown.sources),
        "colours": scale_colours(highest),
        "ticks": [(f"{metres / highest:.1%}", f"{metres:g}") for metres in ticks(0, highest)],
        "cards": cards,
        "shortlist_title": title_of(cards),
        "search_for": search_for(shown.shortlist.untraced),
        "best": [] if cards else best_of_last(shown, highest),
        "parents": parents(shown, pictures),
        "front": Front(shown),
        "grids": [_grid(shown, island) for island in run.columns.grids],
        "islands": _islands(shown),
        "curves": list(curves(run)),
        "galleries": Galleries(shown, pictures),
        "cities": city_key(run.header.cities),
        "tables": tables,
    }


def _asset(name: str) -> Markup:
    return Markup((TEMPLATES / name).read_text(encoding="utf-8"))


def _grid(shown: ShownBirths, island: str | None) -> dict:
    """The picture of the run's grid, or of an ``island``'s."""
    picture = grid_picture(shown.run, island)
    return {
        "title": "The grid" if island is None else f"The grid of {island}",
        "picture": data_uri(picture),
        "width": picture.width,
        "names": " × ".join(shown.births.grids[island].grid.descriptors),
    }


def _islands(shown: ShownBirths) -> dict | None:
    """How good each island is, who lives where, and who moved."""
    if not shown.run.header.islands:
        return None
    islands = Islands(shown.run)
    return tables.of_islands(islands) | {"curves": island_curves(islands)}
