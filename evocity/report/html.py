"""The HTML report of a run: one file that opens anywhere, without network, and reads without
script."""

import json
import os
import re
from base64 import b64encode
from collections.abc import Sequence
from hashlib import sha256
from pathlib import Path

import numpy as np
from markupsafe import Markup
from PIL import Image

from evocity.analysis import Aim, Individual, Run, open_run
from evocity.analysis.export import report_write_errors, written_file
from evocity.analysis.page import Page
from evocity.analysis.thumbnails import cities_of, thumbnail
from evocity.citymap import CityMap
from evocity.errors import EvocityError, RunError
from evocity.fitness import Reference, measures
from evocity.fitness.part import own_name
from evocity.pictures.colours import ramp
from evocity.pictures.legend import round_steps
from evocity.scene import scene
from evocity.store.run_directory import RunDirectory
from evocity.templates import data_uri, number, templates_of
from evocity.viewer.module_bundle import module, text
from evocity.viewer.sheet import Sheet

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
#: Births with a picture on the page, at most; px along a picture; bytes of all pictures, at most.
MOST_PICTURES, SIDE, MOST_BYTES = 1200, 96, 1_720_000
# Ways to write the pictures, the finest first: px along a picture and the quality of WebP, None for
# no loss; more pictures than these are never written without loss, which is slow. Sides are
# multiples of a block of WebP, so that no picture colours its neighbour.
_WAYS = ((SIDE, None), (SIDE, 80), (SIDE, 60), (80, 50), (64, 60), (64, 50), (64, 40))
_MOST_EXACT = 500
# Px along a plan and across a scene.
_PLAN, _SCENE = 288, 560
# The page fetches nothing and runs only our own script: a stranger's text can do neither.
_POLICY = (
    "default-src 'none'; img-src data: blob:; style-src 'unsafe-inline'; "
    "script-src 'sha256-{}'; base-uri 'none'; form-action 'none'"
)
_NUMBERS = ("no", "one", "two", "three", "four", "five")


def write_report(run_folder: str | os.PathLike, output: str | os.PathLike | None = None) -> Path:
    """Write the report of a run as a web page. Return the path of the page: ``output``, or by
    default ``report.html`` in the run folder.

    The page contains everything in one file. The page shows which individuals to keep and why, the
    parents, the settings of the run and the attributions; a browser needs no script for them. With
    script, the page also shows all births: it filters them, and shows curves, pedigrees and tables.
    The function executes no code from the run folder. Raises `RunError` if there is no run, if no
    generation is complete, or if the page cannot be written.
    """
    run = open_run(run_folder)
    if output is None:
        return _write_into(run)
    content = html_of(Page(run))
    with written_file(Path(output)) as temporary:
        temporary.write_text(content, encoding="utf-8")
    return Path(output)


def _write_into(run: Run) -> Path:
    """Write the report into the run folder, never through a link."""
    directory, page = RunDirectory(run.path), run.path / "report.html"
    directory.check_replaceable(page)
    content = html_of(Page(run))
    with report_write_errors(page):
        directory.write_bytes(page, content.encode())
    return page


def html_of(page: Page) -> str:
    """Return a page as HTML. Raises as `write_report` does."""
    run, highest = page.run, page.thumbnails.highest
    if not run.columns.sources:
        raise RunError(
            f"the folder {run.path / 'sources'} contains no source city",
            "the source cities that `evocity run` wrote",
            "restore the folder from a backup, or start the run again",
        )
    sources = [source.city for source in run.columns.sources]
    cities = cities_of(run.columns, [card["id"] for card in page.keep])
    others = other_measures(page, cities)
    script = module() + (TEMPLATES / "host.js").read_text("utf-8")
    script = re.sub("</(?=script)", r"<\\/", script.replace("<!--", r"<\!--"), flags=re.I)
    steps = ramp(np.linspace(0, highest, 24, dtype=np.float32)[None], highest)[0]
    values = {
        "policy": Markup(_POLICY.format(b64encode(sha256(script.encode()).digest()).decode())),
        "style": Markup(text("viewer.css") + (TEMPLATES / "report.css").read_text("utf-8")),
        "script": Markup(script),
        "data": Markup(_data(page)),
        "page": page,
        "run": run,
        "title": _title(page),
        "search_for": search_for(page.shortlist.untraced),
        "plans": {one: _plan(city, highest) for one, city in cities.items()},
        "scenes": {one: _scene(city, highest) for one, city in cities.items()},
        "others": others,
        "parents": [_plan(city, highest) for city in sources],
        "highest": highest,
        "top": max(float(city.heights.max()) for city in sources),
        "colours": ["#" + bytes(colour).hex() for colour in steps],
        "ticks": [(f"{step / highest:.1%}", f"{step:g}") for step in round_steps(highest, 5)],
        "words": WORDS,
        "measures": measure_texts(run.columns.logged),
    }
    return templates_of(TEMPLATES).get_template("page.html").render(values)


def _data(page: Page) -> str:
    """Return the document of the page, its births and their pictures, as JSON."""
    sheet = picture_sheet(page)
    data = {
        "document": page.document,
        "births": b64encode(page.table.buffer).decode(),
        "pictures": sheet.about | {"image": b64encode(sheet.image).decode()},
    }
    return json.dumps(data, ensure_ascii=False, allow_nan=False).replace("<", "\\u003c")


def picture_sheet(page: Page) -> Sheet:
    """Return the pictures of the page on one sheet: of the births to keep, the living and the
    archive, and of the youngest other births whose small maps the log has. Many pictures are
    smaller and less exact, or the last pictures are left out, so that the page stays small."""
    births = page.run.columns
    first = [card["id"] for card in page.keep] + births.ranked()[0].tolist()
    first += page.run.archive.ids.tolist() if births.has_known_goals else []
    others = births.ids[births.ok][::-1].tolist() if page.thumbnails.logged else []
    ids = list(dict.fromkeys([*first, *others]))[:MOST_PICTURES]
    pictures, lacking = page.thumbnails.of(ids, SIDE)
    for one in [one for one, reason in lacking.items() if reason.startswith("ok: ")]:
        _ = Individual(births, one).city  # raises: its genome is damaged
    while True:
        for side, quality in _WAYS:
            if quality is None and len(pictures) > _MOST_EXACT:
                continue
            shown = pictures if side == SIDE else {n: _shrunk(pictures[n], side) for n in pictures}
            sheet = Sheet.of(shown, lacking, "webp", quality)
            if len(sheet.image) <= MOST_BYTES:
                return sheet
        pictures = dict(list(pictures.items())[: len(pictures) // 2])


def _shrunk(picture: np.ndarray, side: int) -> np.ndarray:
    """A ``picture`` of at most ``SIDE`` px, made smaller to at most ``side`` px."""
    size = [max(1, round(n * side / SIDE)) for n in picture.shape[1::-1]]
    return np.asarray(Image.fromarray(picture).resize(size, Image.Resampling.LANCZOS))


def _plan(city: CityMap, highest: float) -> str:
    return data_uri(thumbnail(city, highest, _PLAN))


def _scene(city: CityMap, highest: float) -> str:
    return data_uri(scene(city).picture(width=_SCENE, highest=highest, legend=False))


def _title(page: Page) -> str:
    many = len(page.keep)
    if not page.shortlist:
        return "Best of the last generation"
    return f"{_NUMBERS[many]} to keep".capitalize()


def search_for(untraced: Sequence[str]) -> str:
    """Return Python that finds births with stones of the ``untraced`` source cities."""
    return (
        'import evocity\nrun = evocity.open_run("RUN")\n'
        f"untraced = {list(untraced)!r}\n"
        'shares = run.ancestry("feasible")\n'
        "some = shares[(shares[untraced] > 0.05).all(axis=1)]\n"
        "print(run.keep(5, of=some))"
    )


def other_measures(page: Page, cities: dict[int, CityMap]) -> dict[int, list[tuple[str, str]]]:
    """Measure the ``cities`` of some births by measures that the run did not log: id -> pairs of
    name and value."""
    run, sources = page.run, [source.city for source in page.run.columns.sources]
    known = [one for one in measures() if one.name not in run.header.columns]
    bound = [one.bound(Reference.sources(sources)) for one in known]
    births = run.individuals(list(cities))
    values: dict[int, list[tuple[str, str]]] = {}
    for birth, parents in zip(births, run.parents(births), strict=True):
        given = {"parents": parents, "sources": sources, "genome": birth.genome}
        values[birth.id] = []
        for measure in bound:
            try:
                value = measure(cities[birth.id], **given)
            except EvocityError:  # not a measure of the run: the report goes on without it
                value = None
            values[birth.id].append((measure.name, number(value, measure.unit)))
    return values


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
