"""The details of one birth: scores, pictures, solids, origin, call counts, buildings; its
difference from another birth."""

import io
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from PIL import Image
from pydantic import Field

from evocity.analysis.arguments import check_count
from evocity.analysis.births import label
from evocity.analysis.clusters import farthest_first
from evocity.analysis.distributions import QUANTITIES, Distribution, distributions
from evocity.analysis.individual import Individual, describe_scarce
from evocity.analysis.page.shortlist import city_labels
from evocity.citymap import CityMap
from evocity.errors import RunError
from evocity.fitness.light import find_latitude
from evocity.genome import Genome
from evocity.pictures import Change, render_change
from evocity.pictures.colours import field_colours, scale_end
from evocity.studio.background_job import Cache
from evocity.studio.request_fields import Body, Id
from evocity.studio.run_watcher import Moment, RunWatcher

if TYPE_CHECKING:
    from evocity.scene import Library

#: The kinds of pictures of a birth.
PICTURES = ("map", "stones")
#: Children shown of a birth; letters shown of a text; at most.
MOST_CHILDREN, LETTERS = 12, 400
#: Points of a distribution that the page receives, at most.
MOST_POINTS = 256
#: Triangles of one birth, and births whose triangles are kept; at most.
MOST_TRIANGLES, MOST_KEPT = 400_000, 12
# Height of a bar of colours, px.
_BAR = 8


def describe_birth(moment: Moment, identifier: int) -> dict:
    """Return plain values: origin, measures with goals, record of the operator, cities of the
    parts."""
    births = moment.run.columns
    individual = Individual(births, identifier)
    birth = individual.birth
    (row,) = births.rows([individual.id])
    measures = [
        {
            "name": label(aim.name),
            "value": _number(births.value(aim.name)[row]),
            "unit": aim.unit,
            "sign": aim.sign,
            "wanted": aim.wanted,
            "summary": aim.meaning,
            "kept": bool(aim.within(births.value(aim.name)[row : row + 1])[0]),
        }
        for aim in [*births.aims, *births.recorded]
    ]
    shares = {}
    fabric = None if birth.genome is None else births.run.header.chromosome.fabric(birth.genome)
    if fabric is not None:
        pairs = zip(city_labels(fabric.cities), fabric.shares, strict=True)
        shares = {city: float(share) for city, share in pairs if share > 0}
    facts = ("id", "generation", "island", "operator", "status", "alive", "lived", "feasible")
    return {
        **{name: getattr(individual, name) for name in facts},
        "error": None if birth.error is None else birth.error[:LETTERS],
        "seconds": _number(individual.seconds),
        "parents": [int(parent) for parent in birth.parents],
        "children": _children(moment, row),
        "measures": measures,
        "made": [
            [str(key)[:LETTERS], _text(value)[:LETTERS]]
            for key, value in birth.made.items()
            if key != "operator"
        ],
        "stones": shares,
        "scarce": _scarce(individual, fabric),
        "pictured": birth.genome is not None or birth.left_out,
        "fabric": "fabric" in births.run.header.chromosome.factors,
    }


def _scarce(individual: Individual, fabric: Genome | None) -> str:
    """Name the source cities with few of the buildings of a child, in a sentence."""
    if fabric is None or individual.status != "ok" or individual.operator == "source":
        return ""
    cities = [one.name for one in individual.births.sources if one.city.built.any()]
    return describe_scarce(individual.ancestry(built=True), cities)


def _children(moment: Moment, row: int) -> list[int]:
    """Return the ids of the first children of the birth in a ``row``."""
    parents, children = moment.run.pedigree.parents(np.arange(len(moment.run.columns)))
    return moment.run.columns.ids[np.unique(children[parents == row])[:MOST_CHILDREN]].tolist()


def _text(value: object) -> str:
    if isinstance(value, Mapping):
        return ", ".join(f"{key} {_text(entry)}" for key, entry in value.items())
    if isinstance(value, list | tuple):
        return ", ".join(map(_text, value[:LETTERS])) or "none"
    return f"{value:.4g}" if isinstance(value, float) else "none" if value is None else str(value)


def _number(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


# -- pictures -------------------------------------------------------------------------------------


def picture_of(moment: Moment, identifier: int, kind: str, other: int | None = None) -> bytes:
    """Return a picture of `PICTURES` as PNG; a map shares its heights' scale with an ``other``
    birth."""
    individual = Individual(moment.run.columns, identifier)
    if kind != "map":
        return png_of(individual.ancestry_picture())
    if other is None:
        return png_of(individual.picture())
    highest = scale_end(individual.city, Individual(moment.run.columns, other).city)
    return png_of(individual.picture(highest=highest))


def png_of(picture: Image.Image) -> bytes:
    file = io.BytesIO()
    picture.save(file, "PNG", compress_level=1)
    return file.getvalue()


def call_counts_of(
    moment: Moment, identifier: int, count: str, other: int | None = None
) -> tuple[dict, bytes]:
    """Return how often a birth calls its own parts, by a count of `COUNTS`: the ``most`` calls and
    the ``end`` of the colours, above which few parts lie; `coloured_field`. With an ``other`` birth
    both have the same ``end``."""
    from evocity.coding.usage import usage

    ids = [identifier] if other is None else [identifier, other]
    counts = [getattr(usage(Individual(moment.run.columns, n).genome), count) for n in ids]
    end = max(float(np.quantile(one, 0.995)) or float(one.max()) for one in counts) or 1.0
    return {"most": int(counts[0].max()), "end": end}, coloured_field(counts[0], end)


def coloured_field(values: np.ndarray, end: float) -> bytes:
    """Return values with colours up to ``end``, above a bar of the colours, as PNG."""
    bar = np.linspace(0, end, values.shape[1])[None].repeat(_BAR, axis=0)
    gap = np.full((_BAR // 2, values.shape[1], 3), 255, np.uint8)
    parts = [field_colours(values.astype(np.float32), end), gap, field_colours(bar, end)]
    return png_of(Image.fromarray(np.concatenate(parts)))


def heights_of(moment: Moment, identifier: int) -> tuple[dict, bytes]:
    """Return `framed_heights`, and the latitude of the map."""
    city = Individual(moment.run.columns, identifier).city
    about, content = framed_heights(city)
    return about | {"latitude": find_latitude(city, moment.cities[0])}, content


def framed_heights(city: CityMap) -> tuple[dict, bytes]:
    """Return rows, columns and metres per pixel; heights in metres, float32, from the north."""
    height, width = city.shape
    about = {"height": height, "width": width, "metres": float(city.metres_per_pixel)}
    return about, np.ascontiguousarray(city.heights, "<f4").tobytes()


@dataclass(frozen=True)
class SceneOptions:
    """Options of a 3D view: ``streets`` as ground, colours by ``classes``, objects of the
    ``library`` of the command line."""

    streets: bool = False
    classes: bool = False
    library: bool = False


class Solids:
    """Triangles of births of one run, with straight walls; the last ones are kept. The ``library``
    is that of the command line, if there is one."""

    def __init__(self, watcher: RunWatcher, library: "Library | None" = None):
        self._watcher, self._library = watcher, library
        self._cache = Cache(MOST_KEPT)

    def of(self, identifier: int, options: SceneOptions = SceneOptions()) -> tuple[dict, bytes]:
        """Return the ``groups`` of a birth's scene that have a colour of their own, each with name,
        colour and number of objects, and the ``attribution``; and `evocity.scene.Scene.triangles`:
        nine float32 of corners for each, then three bytes of colour for each. One birth is
        computed at a time; the run stays readable."""
        with self._watcher.reading:
            moment = self._watcher.moment
            key = (moment.fingerprint, identifier, options)
            city = Individual(moment.run.columns, identifier).city
            highest = moment.thumbnails.highest
        return self._cache.get(key, lambda: self._triangles(city, highest, identifier, options))

    def _triangles(
        self, city: CityMap, highest: float, identifier: int, options: SceneOptions
    ) -> tuple[dict, bytes]:
        from evocity.scene import scene

        library = self._library if options.library else None
        made = scene(city, streets=options.streets, library=library)
        colours = "classes" if options.classes else "heights"
        corners, shades = made.triangles(colours, highest=highest)
        if len(corners) > MOST_TRIANGLES:
            raise RunError(
                f"birth {identifier} has too many triangles for a 3D view: {len(corners)}",
                f"at most {MOST_TRIANGLES} triangles",
                "save the birth as a scene, and open the scene in a 3D program",
            )
        groups = [
            [group.name, [round(255 * c) for c in group.colour], len(group)]
            for group in made.groups
            if len(group) and (options.classes or not group.heights.any())
        ]
        content = np.ascontiguousarray(corners, "<f4").tobytes() + shades.tobytes()
        return {"groups": groups, "attribution": made.about.attribution}, content


# -- comparison -----------------------------------------------------------------------------------


def difference_of(moment: Moment, identifier: int, other: int) -> tuple[dict, bytes]:
    """Return the difference from an ``other`` birth: the share of the map that differs by over a
    storey (``apart``), the mean in metres (``more``); a picture as PNG."""
    first, second = (Individual(moment.run.columns, n) for n in (other, identifier))
    change = Change(first.city, second.city)
    about = {"apart": change.apart, "more": float(change.metres.mean(dtype=float))}
    return about, png_of(render_change(change))


def buildings_of(moment: Moment, identifier: int, of: str, other: int | None) -> dict:
    """Return distributions of a quantity of `QUANTITIES` over the buildings of a birth, its
    parents, the cities of the run and a pinned ``other`` birth. The ``values`` of each rise, at
    most `MOST_POINTS`; ``shares`` are the buildings at or below each value."""
    births = moment.run.columns
    individual = Individual(births, identifier)
    sources, references = moment.cities
    listed = distributions(individual, of, sources=sources, references=references)
    if other is not None and other not in (identifier, *individual.birth.parents):
        pinned = distributions(Individual(births, other), of, False, (), ())[-1]
        listed.insert(-1, Distribution(f"birth {other}", "pinned", pinned.values))
    what, unit, powers = QUANTITIES[of]
    return {"what": what, "unit": unit, "powers": powers, "listed": [_points(d) for d in listed]}


def _points(distribution: Distribution) -> dict:
    values = distribution.values.astype(float)
    count = len(values)
    places = np.unique(np.ceil(np.linspace(1, count, min(count, MOST_POINTS))).astype(int))
    return {
        "name": distribution.name,
        "role": distribution.role,
        "colour": distribution.colour,
        "count": count,
        "quartiles": np.quantile(values, [0.25, 0.5, 0.75]).tolist() if count else [],
        "values": values[places - 1].tolist() if count else [],
        "shares": (places / count).tolist() if count else [],
    }


#: Births whose maps or genomes are compared, or that are compared with all others; at most.
MOST_COMPARED = 400
_BATCH = 64


class Comparison(Body):
    """A request for the distances of ``ids`` from ``to``; without ``to``: for the order in which
    each birth differs most from all before it. ``by``: see `evocity.analysis.likeness`."""

    by: Literal["looks", "scores", "kin"]
    ids: Annotated[list[Id], Field(min_length=1, max_length=200_000)]
    to: Id | None = None


def compare_births(moment: Moment, request: Comparison) -> bytes:
    """Return a float32 for each of the ``ids``: its distance from ``to``, or its place in the
    order, from 1. It is NaN for births that failed or whose genome is not in the log."""
    ids = np.array(list(dict.fromkeys(request.ids)), np.int64)
    if request.to is None or request.by != "scores":
        check_count("births to compare", len(ids), MOST_COMPARED)
    births = moment.run.columns
    every = ids if request.to is None else np.append(ids, request.to)
    known = births.ok[births.rows(every)]
    if request.by != "scores":
        known &= np.isin(every, _note_maps(moment, every[known].tolist()))
    if request.to is not None and not known[-1]:
        raise RunError(
            f"birth {request.to} failed, or its genome is not in the log",
            "a birth with a genome in the log",
            "choose another birth",
        )
    values = np.full(len(ids), np.nan, np.float32)
    kept = known[: len(ids)]
    if request.to is not None:
        values[kept] = moment.run.likeness.from_one(request.to, ids[kept], request.by)
    else:
        matrix = moment.run.likeness.matrix(ids[kept], request.by)
        ranks = np.empty(len(matrix), np.float32)
        ranks[farthest_first(matrix, len(matrix))] = np.arange(1, len(matrix) + 1)
        values[kept] = ranks
    return values.astype("<f4").tobytes()


def _note_maps(moment: Moment, ids: list[int]) -> list[int]:
    """Note the maps of births for the comparison; return the ``ids`` that have a map."""
    mapped = []
    for start in range(0, len(ids), _BATCH):
        for birth in moment.run.individuals(ids[start : start + _BATCH], rebred=False):
            city = None if birth.genome is None else moment.run.columns.expressed(birth).city
            if city is not None:
                moment.run.likeness.note(birth.id, city)
                mapped.append(birth.id)
    return mapped
