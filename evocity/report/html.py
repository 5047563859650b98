"""The HTML report of a run: one page that opens anywhere, without network."""

import os
from base64 import b64encode
from collections.abc import Sequence
from hashlib import sha256
from pathlib import Path

from markupsafe import Markup

from evocity.analysis import Aim, Run, open_run
from evocity.analysis.export import report_write_errors, written_file
from evocity.fitness import measures
from evocity.fitness.part import own_name
from evocity.report import tables
from evocity.report.front import Front, curves
from evocity.report.gallery import Galleries, city_key, parents
from evocity.report.grid import grid_picture
from evocity.report.islands import Islands, island_curves
from evocity.report.pictures import pictures_of, scale_colours
from evocity.report.plots import ticks
from evocity.report.shortlist import best_of_last, search_for, shortlist_cards, title_of
from evocity.report.shown_births import ShownBirths
from evocity.report.summary import Summary
from evocity.store.run_directory import RunDirectory
from evocity.templates import data_uri, templates_of

#: Word -> explanation. Templates explain a word at its first place, and list all at the end.
WORDS = {
    "birth": "One child: bred, decoded, measured and logged, whether it survives or not.",
    "generation": (
        "As many births as the population has places, and then the selection of the survivors."
    ),
    "genome": "A city coded as an iterated function system: one lifs per range block.",
    "lifs": (
        "A gene: the function that rebuilds one square of the map, its range block, from a "
        "larger square."
    ),
    "range block": "A square of the map that one lifs rebuilds. Range blocks tile the whole map.",
    "operator": (
        "A function that makes a child of one parent or several: mutation, crossover or fusion."
    ),
    "constraint": (
        "A measure that must lie between bounds. Individuals that keep all constraints rank "
        "before those that break one."
    ),
    "dominate": "To be at least as good in every goal, and better in one.",
    "front": "The individuals that no other dominates: a set of compromises, not one best city.",
    "rank": "0 for the front, 1 for the front of the others, and so on.",
    "archive": (
        "The births of the whole run that no other dominates, or the best of each cell of a "
        "grid. Some are no longer alive."
    ),
    "hypervolume": (
        "The volume of all scores that the living reach or surpass: how good they are together."
    ),
    "crowding": "The distance of a birth from its neighbours on the front: the larger, the rarer.",
    "compromise": (
        "The individual whose largest distance from the best of any goal is the smallest."
    ),
    "island": "One of several populations in a run. Their best individuals migrate between them.",
    "qd score": (
        "Quality-diversity score: the sum, over the filled cells of the grid, of how far the best "
        "of each is better than a reference point."
    ),
    "coverage": "The share of the grid's cells that are filled.",
    "cells": "The number of the grid's cells that are filled.",
    "seed": "The number behind all random draws of a run: the same seed gives the same births.",
}

TEMPLATES = Path(__file__).parent / "templates"

# The page fetches nothing and runs only our own script: a stranger's text can do neither.
_POLICY = (
    "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'sha256-{}'; "
    "base-uri 'none'; form-action 'none'"
)


def write_report(run_folder: str | os.PathLike, output: str | os.PathLike | None = None) -> Path:
    """Write the report of a run as a web page. Return the path of the page: ``output``, or by
    default ``report.html`` in the run folder.

    The page contains everything in one file. The page shows which individuals to keep and why, the
    parents, the front, and curves over the generations. The page has galleries of the last
    generation and of the archive, and tables of births and failures. The page ends with the
    settings of the run and the attributions. The function executes no code from the run folder.
    Raises `RunError` if there is no run, if no generation is complete, or if the page cannot be
    written.
    """
    run = open_run(run_folder)
    if output is None:
        return _write_into(run)
    text = page_of(ShownBirths(run))
    with written_file(Path(output)) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return Path(output)


def _write_into(run: Run) -> Path:
    """Write the report into the run folder, never through a link."""
    directory, page = RunDirectory(run.path), run.path / "report.html"
    directory.check_replaceable(page)
    text = page_of(ShownBirths(run))
    with report_write_errors(page):
        directory.write_bytes(page, text.encode())
    return page


def page_of(shown: ShownBirths) -> str:
    """Return the report as HTML. Raises as `write_report` does."""
    return templates_of(TEMPLATES).get_template("page.html").render(page_values(shown))


def page_values(shown: ShownBirths) -> dict:
    """Return the values of the template, which escapes all but our drawings, style and script."""
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


def measure_texts(logged: Sequence[Aim]) -> tuple[dict[str, str], dict[str, str]]:
    """Explain the measures that a run ``logged``, and all other known measures of maps."""
    known = {
        one.name: f"{one.summary} {one.range_text} {one.unit}".rstrip() for one in measures(None)
    }
    texts = {}
    for aim in logged:
        own = f"{aim.meaning or 'A measure of its own.'} {aim.unit}".rstrip()
        texts[aim.name] = known.get(own_name(aim.name), own)
    names = {own_name(name) for name in texts}
    others = [one.name for one in measures() if one.name not in names]
    return texts, {name: known[name] for name in others}
