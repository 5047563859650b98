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
from evocity.pictures.picture import even
from evocity.studio.watched import Moment

#: What of a birth can be had as a picture.
PICTURES = ("map", "stones")
#: Steps back that a pedigree may have; births of each step that are shown; letters that are told of
#: one thing.
MOST_STEPS, IN_A_STEP, LETTERS = 6, 12, 400
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


def picture_of(moment: Moment, identifier: int, kind: str) -> bytes:
    """A picture of `PICTURES` as PNG. Raises `RunError` where the birth has none."""
    one = Individual(moment.run.told, identifier)
    return png_of(one.picture() if kind == "map" else one.ancestry_picture())


def png_of(picture: Image.Image) -> bytes:
    """A ``picture`` as PNG, soon made."""
    kept = io.BytesIO()
    picture.save(kept, "PNG", compress_level=1)
    return kept.getvalue()


def pedigree_of(moment: Moment, identifier: int, steps: int) -> dict:
    """From whom a birth descends: ``steps`` lists of ids, those that are one step back and so on,
    each where it comes first; ``links``, parent and child, among those that are shown; ``more``,
    how many of each step are not; ``cities``, which of them are source cities."""
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
    }


def calls_of(moment: Moment, identifier: int, count: str) -> tuple[dict, bytes]:
    """How often a birth calls its own parts, one of `COUNTS`: the ``most``, lifs; ``end``, at
    which colours end, for a few parts are called so often that all others would be pale; a PNG, a
    pixel a pixel, pale where nothing calls, and beneath it a bar of its colours. Raises
    `RunError` where it has no genome."""
    from evocity.coding.usage import usage

    values = getattr(usage(Individual(moment.run.told, identifier).genome), count)
    end = float(np.quantile(values, 0.995)) or float(values.max()) or 1.0
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
    "MOST_STEPS",
    "PICTURES",
    "calls_of",
    "fault_of",
    "heights_of",
    "pedigree_of",
    "picture_of",
    "png_of",
    "told_of",
]
