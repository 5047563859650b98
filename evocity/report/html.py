"""The report of a run: one page that opens anywhere, without network."""

import os
from base64 import b64encode
from hashlib import sha256
from pathlib import Path

from markupsafe import Markup

from evocity.analysis import open_run
from evocity.errors import RunError
from evocity.files import whole_file
from evocity.pages import data_uri, templates_of
from evocity.report import tables
from evocity.report.facts import Facts
from evocity.report.front import Front, curves, curves_of
from evocity.report.gallery import Galleries, city_key, parents
from evocity.report.grid import grid_picture
from evocity.report.islands import Islands
from evocity.report.kept import best_of_last, few_to_keep, search_for, title_of
from evocity.report.pictures import pictures_of, scale_colours
from evocity.report.plots import ticks
from evocity.report.summary import Summary
from evocity.report.words import WORDS, told_measures

TEMPLATES = Path(__file__).parent / "templates"

# A page that fetches nothing and runs our own script alone: even a stranger's text that slipped
# through could do neither.
_POLICY = (
    "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'sha256-{}'; "
    "base-uri 'none'; form-action 'none'"
)


def write_report(run_folder: str | os.PathLike, output: str | os.PathLike | None = None) -> Path:
    """Write a run's report into its folder as ``report.html``, or to ``output``; returns its path.

    The page stands alone: which few to keep and why, the parents, the front, the curves, the
    galleries of the last generation and of the archive, the numbers of births, failures,
    settings, attributions. Nothing in the folder is executed. Raises `RunError` if there is no
    run, if it has no whole generation yet, or if the page cannot be written.
    """
    run = open_run(run_folder)
    page = Path(run_folder) / "report.html" if output is None else Path(output)
    text = page_of(Facts(run))
    try:
        with whole_file(page) as temporary:
            temporary.write_text(text, encoding="utf-8")
    except OSError as error:
        raise RunError(
            f"{page} cannot be written: {error.strerror or error}",
            "a folder this user may write to, with room left",
            "free space, or write it to another place",
        ) from error
    return page


def page_of(facts: Facts) -> str:
    """The report as HTML. Raises as `write_report` does."""
    return templates_of(TEMPLATES).get_template("page.html").render(page_values(facts))


def page_values(facts: Facts) -> dict:
    """What the template of the page is given: plain values, all of them escaped there. Only our
    own drawings, style and script are no text."""
    pictures = pictures_of(facts)
    highest = pictures.highest
    kept = few_to_keep(facts, pictures)
    script = _asset("report.js")
    digest = b64encode(sha256(script.encode()).digest()).decode()
    return {
        "policy": Markup(_POLICY.format(digest)),
        "style": _asset("report.css"),
        "script": script,
        "words": WORDS,
        "measures": told_measures(facts.told.logged),
        "facts": facts,
        "header": facts.run.header,
        "summary": Summary(facts),
        "highest": highest,
        "top": max(float(source.city.heights.max()) for source in facts.sources),
        "colours": scale_colours(highest),
        "ticks": [(f"{metres / highest:.1%}", f"{metres:g}") for metres in ticks(0, highest)],
        "kept": kept,
        "kept_title": title_of(kept),
        "search_for": search_for(facts.kept_few.untraced),
        "best": [] if kept else best_of_last(facts, highest),
        "parents": parents(facts, pictures),
        "front": Front(facts),
        "grids": [_grid(facts, island) for island in facts.grids],
        "islands": _islands(facts),
        "curves": list(curves(facts)),
        "galleries": Galleries(facts, pictures),
        "cities": city_key(facts.run.header.cities),
        "tables": tables,
    }


def _asset(name: str) -> Markup:
    return Markup((TEMPLATES / name).read_text(encoding="utf-8"))


def _grid(facts: Facts, island: str | None) -> dict:
    """The picture of the grid that the run fills, or an ``island`` of it."""
    picture = grid_picture(facts, island)
    return {
        "title": "The grid" if island is None else f"The grid of {island}",
        "picture": data_uri(picture),
        "width": picture.width,
        "names": " × ".join(facts.grids[island].grid.descriptors),
    }


def _islands(facts: Facts) -> dict | None:
    """How good each island is, who lives where, and who moved."""
    if not facts.run.header.islands:
        return None
    told = Islands(facts)
    return tables.of_islands(told) | {"curves": curves_of(told)}


__all__ = ["page_of", "page_values", "write_report"]
