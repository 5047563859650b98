"""Shapes of the modeller: from the page, for the page, from files, and between two shapes.

The page draws while a hand drags; `evocity.shapes` checks each shape here, and makes all files.
"""

import json
import warnings
from collections.abc import Callable
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from evocity.shapes import (
    KNOWN,
    Curve,
    Detailed,
    Metamorphosis,
    Primitive,
    Shape,
    ShapeError,
    StoredCurve,
    known,
    metamorphosis,
    wire,
)
from evocity.shapes.files import curve_document, parse_curve, parse_shape, shape_document
from evocity.shapes.filters import interpolates
from evocity.shapes.languages import Language
from evocity.shapes.linear import polar
from evocity.shapes.primitives import primitive_of
from evocity.studio.request_fields import Body

#: The most maps, and points of a wire form or a figure, on the page; levels of a saved curve.
MOST_MAPS, MOST_POINTS, CURVE_LEVELS = 64, 400, 6
_SLACK = 1e-9

Index = Annotated[int, Field(ge=0, lt=MOST_POINTS)]
Affine = tuple[float, float, float, float, float, float]
Points = Annotated[tuple[tuple[float, float], ...], Field(max_length=MOST_POINTS)]


class FigureFields(Body):
    """An initial figure K of the page."""

    points: Points
    lines: Annotated[tuple[tuple[Index, Index], ...], Field(max_length=MOST_POINTS)] = ()
    faces: Annotated[tuple[tuple[Index, Index, Index], ...], Field(max_length=MOST_POINTS)] = ()


class ShapeFields(Body):
    """A shape of the page: maps by their ``frames``; a ``wire`` form with its points and arcs; or
    a ``curve``, a projected IFS with control points and matrices."""

    kind: Literal["frames", "wire", "curve"]
    maps: Annotated[tuple[Affine, ...], Field(max_length=MOST_MAPS)] = ()
    points: Points = ()
    arcs: Annotated[tuple[tuple[Index, Index], ...], Field(max_length=MOST_MAPS)] = ()
    flipped: Annotated[tuple[bool, ...], Field(max_length=MOST_MAPS)] = ()
    matrices: Annotated[tuple[tuple[tuple[float, ...], ...], ...], Field(max_length=MOST_MAPS)] = ()
    primitive: FigureFields | None = None
    colours: tuple[tuple[float, float, float], ...] | None = None
    mix: float = 0.5

    @property
    def is_curve(self) -> bool:
        return self.kind == "curve"

    def shape(self) -> Shape:
        """Make the shape. Raises `ShapeError` for a curve, and for maps not proved to contract."""
        if self.is_curve:
            raise ShapeError(
                "a curve is not a set of affine maps of the plane",
                "a shape with frames, or a wire form",
                "choose another shape",
            )
        primitive = None
        if self.primitive is not None:
            fields = self.primitive
            primitive = Primitive.of(fields.points, fields.lines, fields.faces)
        more: dict[str, Any] = {"colours": self.colours, "mix": self.mix}
        if self.kind == "wire":
            drawn = primitive or primitive_of("segment")
            return proved(
                lambda: wire(self.points, self.arcs, self.flipped, primitive=drawn, **more)
            )
        maps = np.array(self.maps, float).reshape(-1, 2, 3)
        return proved(lambda: Shape(maps, primitive, **more))

    def curve(self) -> Curve:
        return Curve(np.array(self.points, float), np.array(self.matrices, float))

    def document(self) -> dict:
        """Return the document of `write_shape`, or of `write_curve`."""
        if not self.is_curve:
            return shape_document(self.shape())
        curve = self.curve()
        shared = interpolates(curve.maps)
        detailed = Detailed.drawn(curve.points, curve.maps, shared, 0, CURVE_LEVELS)
        return curve_document(StoredCurve(detailed))


class FileText(Body):
    """The text of a file that a user opens."""

    text: str


class MorphRequest(Body):
    """A request for the shapes between two shapes."""

    first: ShapeFields
    last: ShapeFields


def proved(make: Callable[[], Shape]) -> Shape:
    """Make a shape. Raises `ShapeError` if nothing proves that its maps contract."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        shape = make()
    if not shape.contraction.proved:
        bounds = shape.contraction
        raise ShapeError(
            "nothing proves that the maps contract: their joint spectral radius lies between "
            f"{bounds.lower:.4g} and {bounds.upper:.4g}",
            "maps whose products contract",
            "make the frames smaller",
        )
    return shape


def starts() -> list[dict]:
    """List the shapes to start from, each with a title and the fields of `ShapeFields`."""
    listed = [(name, page_shape(known(name))) for name in KNOWN if known(name).size == 2]
    arch = wire([(0, 0), (0.3, 0.4), (0.7, 0.4), (1, 0)])
    branch = wire([(0, 0), (0.45, 0), (0.72, 0.3), (1, 0), (0.7, -0.25)], [(0, 1), (1, 2), (1, 4)])
    halves = [[[0.5, 0, x], [0, 0.5, y]] for x, y in ((0, 0), (0.5, 0.5))]
    square = Shape(np.array(halves), "square")
    ends = [(0, 0), (0.2, 0.6), (0.8, -0.6), (1, 0)]
    listed += [
        ("wire form, arch", page_shape(arch)),
        ("wire form, branches", page_shape(branch)),
        ("two squares", page_shape(square)),
        ("curve of Bézier", page_curve(Curve.bezier(ends))),
        ("curve of B-spline", page_curve(Curve.b_spline(ends))),
    ]
    return [{"title": title, "shape": shape} for title, shape in listed]


def page_shape(shape: Shape) -> dict:
    """Return the fields of `ShapeFields`: a wire form where all maps are similarities of a
    segment. Raises `ShapeError` for a shape that the page cannot show."""
    if shape.size != 2 or shape.language != Language.every(len(shape)):
        what = "three-dimensional" if shape.size != 2 else "limited to some words of its maps"
        raise ShapeError(
            f"the shape is {what}", "a shape of the plane with all words", "choose another file"
        )
    if len(shape) > MOST_MAPS:
        found, expected = f"the shape has {len(shape)} maps", f"at most {MOST_MAPS} maps"
        raise ShapeError(found, expected, "remove some maps, or choose another file")
    primitive = (
        primitive_of(shape.primitive) if isinstance(shape.primitive, str) else shape.primitive
    )
    if primitive is not None and len(primitive.points) > MOST_POINTS:
        found = f"the primitive has {len(primitive.points)} points"
        raise ShapeError(found, f"at most {MOST_POINTS} points", "choose a simpler primitive")
    page: dict[str, Any] = {
        "kind": "frames",
        "maps": shape.maps.reshape(-1, 6).tolist(),
        "primitive": primitive and {
            name: getattr(primitive, name).tolist() for name in ("points", "lines", "faces")
        },
        "colours": None if shape.colours is None else shape.colours.tolist(),
        "mix": shape.mix,
    }  # fmt: skip
    segment = primitive_of("segment")
    is_segment = primitive is not None and np.array_equal(primitive.points, segment.points)
    return page | (_wire_of(shape.maps) if is_segment else {})


def _wire_of(maps: np.ndarray) -> dict:
    """Return points, arcs and flips of a wire form; nothing where a map is not a similarity."""
    (a, b, e), (c, d, f) = maps.transpose(1, 2, 0)
    flipped = a * d - b * c < 0
    sign = np.where(flipped, -1.0, 1.0)
    if max(np.abs(d - sign * a).max(), np.abs(b + sign * c).max()) > _SLACK:
        return {}
    points: list[tuple[float, float]] = []

    def number(x: float, y: float) -> int:
        near = [k for k, (u, v) in enumerate(points) if max(abs(u - x), abs(v - y)) < _SLACK]
        if not near:
            points.append((float(x), float(y)))
        return near[0] if near else len(points) - 1

    ends = np.stack([e, f, a + e, c + f], axis=1)
    arcs = [[number(x, y), number(u, v)] for x, y, u, v in ends]
    return {"kind": "wire", "maps": [], "points": points, "arcs": arcs, "flipped": flipped.tolist()}


def page_curve(curve: Curve) -> dict:
    """Return the fields of `ShapeFields`, and the weights of the control points at both ends."""
    return {
        "kind": "curve",
        "points": curve.points.tolist(),
        "matrices": curve.maps.tolist(),
        "ends": curve.ends.tolist(),
    }


def open_file(file: FileText) -> dict:
    """Read a shape, or a curve without details, from the text of a file."""
    name = "the file"
    try:
        document = json.loads(file.text)
    except (ValueError, RecursionError):
        document = None
    if not isinstance(document, dict) or document.get("evocity") not in ("shape", "curve"):
        raise ShapeError(
            "the file is not a shape",
            "a JSON file of write_shape or write_curve, or one that this page saved",
            "choose another file",
        )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        if document["evocity"] == "shape":
            return {"shape": page_shape(proved(lambda: parse_shape(document, name)))}
        detailed = parse_curve(document, name).detailed
    if detailed.kept or detailed.curve.points.shape[1] != 2 or len(detailed.curve) > MOST_MAPS:
        raise ShapeError(
            "the curve has details, or too many parts",
            f"a curve of the plane without details, of at most {MOST_MAPS} parts",
            "drop the details first: evocity curve detail --drop",
        )
    return {"shape": page_curve(detailed.curve)}


def morph_of(first: ShapeFields, last: ShapeFields) -> Callable[[float], Shape | Curve]:
    """Return the function from a time, 0…1, to a shape or a curve between two."""
    if not (first.is_curve or last.is_curve):
        return metamorphosis(first.shape(), last.shape())
    if not (first.is_curve and last.is_curve):
        raise ShapeError(
            "one of the two shapes is a curve", "two curves, or no curve", "choose another shape"
        )
    one, other = first.curve(), last.curve()
    if one.points.shape != other.points.shape or one.maps.shape != other.maps.shape:
        raise ShapeError(
            "the two curves differ in the number of control points or parts",
            "curves with equal numbers of control points and parts",
            "choose another curve",
        )
    return lambda t: Curve(
        (1 - t) * one.points + t * other.points, (1 - t) * one.maps + t * other.maps
    )


def prepare_morph(request: MorphRequest) -> dict:
    """Return the numbers by which the page computes the shapes between two shapes."""
    morph = morph_of(request.first, request.last)
    if not isinstance(morph, Metamorphosis):
        return {"curve": True}
    before, after = (list(numbers) for numbers in zip(*morph.pairs, strict=True))
    pairs = []
    for a, b in zip(morph.first.maps[before], morph.last.maps[after], strict=True):
        (turn, stretch), (other, other_stretch) = polar(a[:, :2]), polar(b[:, :2])
        back = np.einsum("ji,jk->ik", turn, other)
        is_mirror = back[0, 0] * back[1, 1] - back[0, 1] * back[1, 0] < 0
        pairs.append({
            "first": a.ravel().tolist(),
            "last": b.ravel().tolist(),
            "turn": [*turn.ravel().tolist(), *back.ravel().tolist()],
            "stretches": [stretch.ravel().tolist(), other_stretch.ravel().tolist()],
            "angle": None if is_mirror else float(np.arctan2(back[1, 0], back[0, 0])),
        })  # fmt: skip
    return {"curve": False, "linear": morph.linear, "pairs": pairs, "numbers": [before, after]}
