"""What a shape of the modeller becomes in a run: a parent, a course, or a motif of buildings."""

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Literal

import numpy as np

from evocity.citymap import CityMap
from evocity.io import write_map
from evocity.io.bundled_cities import DISTRICTS
from evocity.kinds.form import WALL
from evocity.kinds.window_lines import crosses_itself
from evocity.shapes import Curve, Shape, ShapeError, mask_of
from evocity.shapes.files import shape_document, write_document
from evocity.shapes.rendering import Frame
from evocity.shapes.wires import joint_gap
from evocity.studio.modeller import ShapeFields
from evocity.studio.modeller_pictures import MOST_FINE, MOST_LEVEL, curve_depth, segment_line
from evocity.studio.request_fields import Body, typed_field, whole_field

#: The window of a run, pixels and metres; the free share on each side of a shape in it.
_PIXELS, _METRES, _MARGIN = 128, 2.0, 0.05
_SHAPE_PIXELS, _LINE_POINTS = 64, 1025
_HEAD = """# Made by the modeller of evocity studio.
[run]
name = "{name}"
kind = "{kind}"
seed = {seed}
population = {population}
generations = {generations}

[map]
pixels = {pixels}
metres_per_pixel = {metres:.1f}
"""
_GOALS = {
    "parent": ('name = "shape_dimension"\ngoal = "max"', 'name = "shape_cover"\ngoal = "min"'),
    "curve": ('name = "curve_length"\ngoal = "min"', 'name = "sinuosity"\ngoal = "max"'),
    "course": ('name = "built_area_lost"', 'name = "buildings_near_course"'),
    "motif": ('name = "autosimilarity"', 'name = "alignment"'),
}
_KIND = {"parent": "shape", "curve": "curve", "course": "site", "motif": "fabric"}


class UseRequest(Body):
    """A request to use a shape in a run, and perhaps to ``begin`` it. ``last`` is a second parent;
    ``city`` is the number of a bundled city; ``width``: of a course, in metres."""

    role: Literal["parent", "course", "motif"]
    shape: ShapeFields
    last: ShapeFields | None = None
    begin: bool = False
    city: Annotated[int, whole_field("city", 0, len(DISTRICTS) - 1)] = 0
    width: Annotated[float, typed_field("width of the course in metres", "2 to 60", ge=2, le=60)]
    level: Annotated[int | None, whole_field("level", 0, 12)] = None
    population: Annotated[int, whole_field("individuals alive", 2, 10_000)] = 30
    generations: Annotated[int, whole_field("generations", 1, 100_000)] = 20
    seed: Annotated[int, whole_field("seed", 0, 2**53 - 1)] = 1


#: Files of a use: the lines of the recipe for each, and the function that writes it.
Parts = dict[str, Callable[[Path], object]]


def parts_of(request: UseRequest) -> Parts:
    """Return the entries of a recipe for a shape, each with the function that writes its file."""
    return {"parent": _parent, "course": _course, "motif": _motif}[request.role](request)


def _parent(request: UseRequest) -> Parts:
    parents = [fields for fields in (request.shape, request.last) if fields is not None]
    if request.shape.is_curve:
        return {f"[[parents]]\ncurve = {_placed(each)}": lambda folder: None for each in parents}
    return {
        f'[[parents]]\nshape = "shape-{number}.json"': _writer(
            f"shape-{number}.json", shape_document(each.shape())
        )
        for number, each in enumerate(parents, 1)
    }


def _placed(fields: ShapeFields) -> list:
    """Lay the control points of a Bézier curve into the window of a run of curves, in metres."""
    if not (fields.is_curve and _is_bezier(fields.curve())):
        raise ShapeError(
            "a parent of a run of curves is not a curve of Bézier",
            "a curve of Bézier", "choose another shape, or use the curve as a course",
        )  # fmt: skip
    curve = fields.curve()
    return laid_in(curve.points, _SHAPE_PIXELS).round(3).tolist()


def _is_bezier(curve: Curve) -> bool:
    return np.array_equal(curve.maps, Curve.bezier(curve.points).maps)


def laid_in(points: np.ndarray, side: float) -> np.ndarray:
    """Scale ``points`` into the middle of a window of ``side`` metres, with a margin."""
    low, high = points.min(axis=0), points.max(axis=0)
    scale = (1 - 2 * _MARGIN) * side / max(float((high - low).max()), 1e-300)
    return (points - (low + high) / 2) * scale + side / 2


def _writer(name: str, document: dict) -> Callable[[Path], object]:
    return lambda folder: write_document(document, folder / name)


def _course(request: UseRequest) -> Parts:
    fields = request.shape
    if fields.is_curve:
        curve = fields.curve()
        line = curve.line(curve_depth(curve))
    else:
        line = _line_of(fields.shape(), fields.kind == "wire")
    placed = laid_in(line, _PIXELS * _METRES)
    if crosses_itself(placed):
        raise ShapeError(
            "the line crosses itself", "a course that does not cross itself", "move its points"
        )
    document = {
        "type": "Feature", "window": True, "properties": {},
        "geometry": {"type": "LineString", "coordinates": placed.round(3).tolist()},
    }  # fmt: skip
    entry = f'[[curves]]\nwidth = {request.width:g}\nlay = 0\nfrom = "course.geojson"\npoints = 8'
    return {_city(request): lambda folder: None, entry: _writer("course.geojson", document)}


def _line_of(shape: Shape, is_wire: bool) -> np.ndarray:
    if not is_wire or joint_gap(shape) > 1e-9:
        raise ShapeError(
            "the shape is not a line", "a wire form whose arcs follow each other, or a curve",
            "choose a wire form or a curve, or use the shape as parent or motif",
        )  # fmt: skip
    return segment_line(shape, _LINE_POINTS)


def _motif(request: UseRequest) -> Parts:
    shape = request.shape.shape()
    depth = request.level
    if depth is None:
        frame = Frame.of(shape.box, _PIXELS)
        mask = shape.laid(_PIXELS, frame.scale, frame.offset, MOST_FINE)[0]
    else:
        mask = mask_of(shape, _PIXELS, depth, None, MOST_LEVEL)
    city = CityMap(np.where(mask, np.float32(WALL), np.float32(0)), _METRES, name="motif")
    entry = '[[parents]]\nmap = "motif.tif"'
    return {_city(request): lambda folder: None,
            entry: lambda folder: write_map(city, folder / "motif.tif")}  # fmt: skip


def _city(request: UseRequest) -> str:
    return f'[[parents]]\nmap = "{sorted(DISTRICTS)[request.city]}"'


def recipe_text(request: UseRequest, name: str, entries: list[str]) -> str:
    """Return the recipe of a run called ``name``, with the ``entries`` of `parts_of`."""
    is_parent = request.role == "parent"
    role = "curve" if is_parent and request.shape.is_curve else request.role
    head = _HEAD.format(
        name=name, kind=_KIND[role], seed=request.seed, population=request.population,
        generations=request.generations, pixels=_SHAPE_PIXELS if is_parent else _PIXELS,
        metres=1.0 if is_parent else _METRES,
    )  # fmt: skip
    goals = [f"[[fitness]]\n{goal}" for goal in _GOALS[role]]
    return "\n".join([head, *(f"{part}\n" for part in [*entries, *goals])])
