"""Genomes of every kind as a document with arrays, for messages of workers."""

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np

from evocity.citymap import MAX_SIDE
from evocity.condensation import Condensation
from evocity.errors import EvocityError
from evocity.genome import FIELDS, Genome
from evocity.genome.checks import is_settling
from evocity.kinds import CurveForm, ShapeForm, Site
from evocity.pavement import Pavement

#: Fields of a document that are JSON values.
_OF_GENOME = ("metres_per_pixel", "sigma_max", "attribution", "crs", "settle", "made")
_OF_FORM = ("pixels", "metres_per_pixel", "name", "attribution", "crs", "made")
_TEXTS = ("attribution", "name")
#: Errors of documents that are not those of genomes.
_FAULTS = EvocityError, TypeError, LookupError, AttributeError, ArithmeticError, MemoryError


def describe_genome(genome: Any, arrays: list[np.ndarray]) -> dict:
    """Return the document of a ``genome``, and append its arrays to ``arrays``. Raises TypeError
    for an object that is not a genome."""

    def place(array: np.ndarray) -> int:
        arrays.append(array)
        return len(arrays) - 1

    if isinstance(genome, Genome):
        p, layer = genome.pavement, genome.condensation
        sides = p.block if p.uniform else [place(p.side.astype(np.int16))]
        about = {name: getattr(genome, name) for name in _OF_GENOME}
        about |= {"origin": genome.origin, "cities": genome.cities}
        about["pavement"] = [p.height, p.width, sides]
        about["fields"] = [place(getattr(genome, name)) for name in FIELDS]
        if layer is not None:
            kept = place(np.packbits(layer.mask)), place(layer.heights[layer.mask])
            about["condensation"] = kept
        return about | {"kind": "fabric"}
    about = {name: getattr(genome, name) for name in _OF_FORM} | {"origin": genome.origin}
    if isinstance(genome, Site):
        about["fabric"] = describe_genome(genome.fabric, arrays)
        about["courses"] = [describe_genome(one, arrays) for one in genome.courses]
    elif isinstance(genome, CurveForm):
        about |= {"breadth": float(genome.breadth), "lay": float(genome.lay)}
        about |= {"points": place(genome.points), "maps": place(genome.maps)}
        about["details"] = [place(level) for level in genome.details]
    elif isinstance(genome, ShapeForm):
        about["maps"] = place(genome.maps)
    else:
        raise TypeError(f"a {type(genome).__name__} is not a genome")
    return about | {"kind": genome.kind}


def genome_of(about: Any, arrays: Sequence[np.ndarray]) -> Any:
    """Return the genome of a document ``about`` it, checked as at construction. Raises ValueError
    for any other document."""
    try:
        return _genome_of(about, arrays)
    except _FAULTS as error:
        raise ValueError(f"{type(error).__name__}: {error}") from None


def _genome_of(about: dict, arrays: Sequence[np.ndarray]) -> Any:
    kind = about["kind"]
    names = _OF_GENOME if kind == "fabric" else _OF_FORM
    common = {name: about[name] for name in names}
    if not isinstance(common["made"], dict) or not is_settling(common.get("settle", True)):
        raise ValueError("made or settle of another type")
    if not all(isinstance(common.get(name, ""), str) for name in _TEXTS):
        raise ValueError("a text of another type")
    origin = about["origin"]
    if origin is not None:
        east, north = origin
        if not {type(east), type(north)} <= {int, float}:
            raise ValueError("an origin of other types")
        origin = east, north
    common["origin"] = origin
    if kind == "fabric":
        return _fabric(about, arrays, common)
    if type(common["pixels"]) is not int:
        raise ValueError("pixels of another type")
    if kind == "site":
        fabric = _genome_of(about["fabric"] | {"kind": "fabric"}, arrays)
        courses = [_genome_of(one | {"kind": "curve"}, arrays) for one in about["courses"]]
        return Site(fabric=fabric, courses=tuple(courses), **common)
    if kind == "curve":
        taken = (array_at(arrays, at, "c").copy() for at in about["details"])
        return CurveForm(
            points=array_at(arrays, about["points"], "f"),
            maps=array_at(arrays, about["maps"], "f"),
            breadth=float(about["breadth"]),
            lay=float(about["lay"]),
            details=tuple(taken),
            **common,
        )
    if kind == "shape":
        return ShapeForm(maps=array_at(arrays, about["maps"], "f"), **common)
    raise ValueError(f"a genome of kind {kind!r}")


def _fabric(about: dict, arrays: Sequence[np.ndarray], common: dict) -> Genome:
    height, width, sides = about["pavement"]
    if not all(type(one) is int and 0 < one <= MAX_SIDE for one in (height, width)):
        raise ValueError(f"a map of {height!r} × {width!r} px")
    if isinstance(sides, list):
        pavement = Pavement(height, width, array_at(arrays, sides[0], "i"))
    else:
        pavement = _uniform(height, width, int(sides))
    layer = None
    if "condensation" in about:
        bits, kept = (array_at(arrays, at, "uf").tobytes() for at in about["condensation"])
        layer = _layer((height, width), bits, kept)
    fields = (array_at(arrays, at, "iuf") for at in about["fields"])
    nucleotides: dict[str, Any] = dict(zip(FIELDS, fields, strict=True))
    if not isinstance(about["cities"], list):
        raise ValueError("cities of another type")
    return Genome(
        pavement,
        **nucleotides,
        **common,
        cities=tuple(about["cities"]),
        condensation=layer,
    )


def array_at(arrays: Sequence[np.ndarray], at: Any, kinds: str) -> np.ndarray:
    """Return the array with the number ``at``, of one of these ``kinds`` of numbers. Raises
    ValueError for another."""
    if type(at) is not int or not 0 <= at < len(arrays) or arrays[at].dtype.kind not in kinds:
        raise ValueError(f"array {at!r}")
    return arrays[at]


@lru_cache(maxsize=2)
def _uniform(height: int, width: int, block: int) -> Pavement:
    """Share one object, and its cached arrays, among the genomes of a run."""
    return Pavement(height, width, block)


@lru_cache(maxsize=4)
def _layer(shape: tuple[int, int], bits: bytes, kept: bytes) -> Condensation:
    """Share one locked layer among the genomes of a run."""
    count = shape[0] * shape[1]
    if len(bits) != (count + 7) // 8:
        raise ValueError("a locked layer of another size")
    mask = np.unpackbits(np.frombuffer(bits, np.uint8), count=count).astype(bool).reshape(shape)
    heights = np.zeros(shape, np.float32)
    heights[mask] = np.frombuffer(kept, np.float32)
    return Condensation(heights, mask)
