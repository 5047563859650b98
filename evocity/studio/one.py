"""All that is told of one birth: what it is worth, how it was made, from whom it descends."""

import io
import math
from collections.abc import Iterator, Mapping

import numpy as np
from PIL import Image

from evocity.analysis.births import label
from evocity.analysis.individual import Individual
from evocity.coding.usage import COUNTS
from evocity.errors import EvocityError
from evocity.pictures.colours import even, scale_end
from evocity.studio.watched import Moment

#: What of a birth can be had as a picture.
PICTURES = ("map", "stones")
#: Steps back that a pedigree may have; births of each step that are shown; letters that are told of
#: one thing.
MOST_STEPS, IN_A_STEP, LETTERS = 6, 12, 400
#: Spans of generations in which ancestors are counted, at most.
MOST_SPANS = 240
# Pixels that a bar of colours is high.
_BAR = 8


def told_of(moment: Moment, identifier: int) -> dict:
    """Plain values: where it is from, what it has of each measure and what was wanted of that, what
    its operator recorded, whose stones it is made of. Raises `RunError` for an id that is none."""
    told = moment.run.told
    one = Individual(told, identifier)
    birth, (row,) = one.run.individuals([one.id], rebred=False)[0], told.rows([one.id])
    measures = [
        {
            "name": label(aim.name),
            "value": _number(told.value(aim.name)[row]),
            "unit": aim.unit,
            "sign": aim.sign,
            "wanted": aim.wanted,
            "summary": aim.meaning,
            "kept": bool(aim.within(told.value(aim.name)[row : row + 1])[0]),
        }
        for aim in [*told.aims, *told.recorded]
    ]
    stones = {}
    fabric = None
    if birth.genome is not None:
        fabric = told.run.header.chromosome.fabric(birth.genome)
    if fabric is not None:
        shares = zip(fabric.cities, fabric.shares, strict=True)
        stones = {str(city): float(share) for city, share in shares if share > 0}
    return {
        "id": one.id,
        "generation": one.generation,
        "island": one.island,
        "operator": one.operator,
        "status": one.status,
        "error": None if birth.error is None else birth.error[:LETTERS],
        "seconds": _number(one.seconds),
        "alive": one.alive,
        "lived": one.lived,
        "feasible": one.feasible,
        "parents": [int(parent) for parent in birth.parents],
        "children": _children(moment, row),
        "measures": measures,
        "made": [[key, text] for key, text in _lines(birth.made)],
        "stones": stones,
        "pictured": birth.genome is not None or birth.left_out,
    }


def _children(moment: Moment, row: int) -> list[int]:
    """Ids of the first of those that were bred from the birth in a ``row``."""
    every = np.arange(len(moment.run.told))
    parents, children = moment.pedigree.parents(every)
    return moment.run.told.ids[np.unique(children[parents == row])[:IN_A_STEP]].tolist()


def _lines(made: Mapping) -> Iterator[tuple[str, str]]:
    for key, value in made.items():
        if key != "operator":
            yield str(key)[:LETTERS], _text(value)[:LETTERS]


def _text(value: object) -> str:
    if isinstance(value, Mapping):
        return ", ".join(f"{key} {_text(one)}" for key, one in value.items())
    if isinstance(value, list | tuple):
        return ", ".join(map(_text, value[:LETTERS])) or "none"
    return f"{value:.4g}" if isinstance(value, float) else "none" if value is None else str(value)


def _number(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def picture_of(moment: Moment, identifier: int, kind: str, other: int | None = None) -> bytes:
    """A picture of `PICTURES` as PNG; a map's heights on one scale with those of an ``other``.
    Raises `RunError` where the birth, or the other, has none."""
    one = Individual(moment.run.told, identifier)
    if kind != "map":
        return png_of(one.ancestry_picture())
    if other is None:
        return png_of(one.picture())
    highest = scale_end(one.city, Individual(moment.run.told, other).city)
    return png_of(one.picture(highest=highest))


def png_of(picture: Image.Image) -> bytes:
    """A ``picture`` as PNG, soon made."""
    kept = io.BytesIO()
    picture.save(kept, "PNG", compress_level=1)
    return kept.getvalue()


def pedigree_of(moment: Moment, identifier: int, steps: int) -> dict:
    """From whom a birth descends: ``steps`` lists of ids, those that are one step back and so on,
    each where it comes first; ``links``, parent and child, among those that are shown; ``more``,
    how many of each step are not; ``cities``, which of them are source cities; `born_of` all
    ancestors. No genome is read."""
    told, pedigree = moment.run.told, moment.pedigree
    known = rows = told.rows([identifier])
    listed, more = [rows], [0]
    for _ in range(steps):
        parents = np.unique(pedigree.parents(rows)[0])
        rows = parents[~np.isin(parents, known)]
        known = np.union1d(known, rows)
        if not rows.size:
            break
        listed.append(rows[:IN_A_STEP])
        more.append(max(0, rows.size - IN_A_STEP))
    shown = np.concatenate(listed)
    every = pedigree.ancestors(listed[0])
    links = np.column_stack(pedigree.edges(shown)).tolist()
    return {
        "steps": [told.ids[one].tolist() for one in listed],
        "links": [list(pair) for pair in dict.fromkeys(map(tuple, links))],
        "more": more,
        "cities": {
            int(one): str(moment.run.header.cities[one])
            for one in told.ids[shown].tolist()
            if told.operator[told.rows([one])[0]] == "source"
            and one < len(moment.run.header.cities)
        },
        "born": born_of(told.generation[every[every != listed[0]]], told.generation[shown[1:]]),
    }


def born_of(every: np.ndarray, shown: np.ndarray) -> dict:
    """When ancestors were born: of each ``span`` of generations from the first run's on, how many
    of ``every`` one, and of those that are ``shown``; `MOST_SPANS` at most."""
    last = int(every.max(initial=0))
    span = -(-(last + 1) // MOST_SPANS)
    counts = [np.bincount(one // span, minlength=last // span + 1) for one in (every, shown)]
    return {"span": span, "every": counts[0].tolist(), "shown": counts[1].tolist()}


def calls_of(
    moment: Moment, identifier: int, count: str, other: int | None = None
) -> tuple[dict, bytes]:
    """How often a birth calls its own parts, one of `COUNTS`: the ``most``, lifs; ``end``, at
    which colours end, for a few parts are called so often that all others would be pale; a PNG, a
    pixel a pixel, pale where nothing calls, and beneath it a bar of its colours. ``end`` is the
    same for both with an ``other`` birth. Raises `RunError` where one has no genome."""
    from evocity.coding.usage import usage

    ids = [identifier] if other is None else [identifier, other]
    found = [getattr(usage(Individual(moment.run.told, one).genome), count) for one in ids]
    end = max(float(np.quantile(one, 0.995)) or float(one.max()) for one in found) or 1.0
    values = found[0]
    about = {"most": int(values.max()), "end": end}
    bar = np.linspace(0, end, values.shape[1])[None].repeat(_BAR, axis=0)
    gap = np.full((_BAR // 2, values.shape[1], 3), 255, np.uint8)
    parts = [even(values.astype(np.float32), end), gap, even(bar, end)]
    return about, png_of(Image.fromarray(np.concatenate(parts)))


def heights_of(moment: Moment, identifier: int) -> tuple[dict, bytes]:
    """The map of a birth: rows, columns, metres a pixel; heights in metres as float32, row by row
    from the north. Raises `RunError` where it has none."""
    city = Individual(moment.run.told, identifier).city
    height, width = city.shape
    about = {"height": height, "width": width, "metres": float(city.metres_per_pixel)}
    return about, np.ascontiguousarray(city.heights, "<f4").tobytes()


def fault_of(error: EvocityError) -> dict:
    """An ``error`` in the three parts that it has."""
    return {"found": error.found, "expected": error.expected, "remedy": error.remedy}


__all__ = [
    "COUNTS",
    "MOST_SPANS",
    "MOST_STEPS",
    "PICTURES",
    "born_of",
    "calls_of",
    "fault_of",
    "heights_of",
    "pedigree_of",
    "picture_of",
    "png_of",
    "told_of",
]
