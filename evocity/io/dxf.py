"""DXF drawings: closed polylines of a layer, in metres without a place on Earth.

The height of a building is the thickness of its polyline, or its elevation if it has no thickness.
Blocks are not expanded, and references to other drawings are not followed. A layer ``NAME-holes``,
which evocity writes, has the holes of the polygons of the layer ``NAME``.
"""

import math
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import numpy as np
import shapely

from evocity.errors import MapError, format_bytes
from evocity.io.account import DEGENERATE, NO_POLYGON, Account
from evocity.io.heights import is_building_name
from evocity.io.layer_choice import choose_layer
from evocity.io.projection import plane
from evocity.io.reader_types import Footprints, Request

#: Bytes of a drawing, at most.
MOST_BYTES = 500_000_000

# $INSUNITS -> metres; 0 is "no unit", which is taken for metres.
_UNITS = {
    0: 1.0, 1: 0.0254, 2: 0.3048, 3: 1609.344, 4: 0.001, 5: 0.01, 6: 1.0, 7: 1000.0,
    10: 0.9144, 14: 0.1, 15: 10.0, 16: 100.0, 21: 1200 / 3937,
}  # fmt: skip
# An arc gets a corner for each of these angles.
_STEP = math.radians(10)
_LONGEST = 10_000
_BINARY = b"AutoCAD Binary DXF"
# The end of the name of a layer of holes, and the most that a hole has of the area of its polygon.
_HOLES, _MOST_HOLE = "-holes", 0.999

Pair = tuple[int, str]


@dataclass
class _Polyline:
    """A polyline: its layer, flags, thickness and elevation, and points (x, y, z, bulge); and
    whether it lies on the sheet of a plan, not in the drawing."""

    layer: str = "0"
    flags: int = 0
    thickness: float = 0.0
    elevation: float = 0.0
    upwards: float = 1.0
    on_paper: bool = False
    points: list[list[float]] = field(default_factory=list)


@dataclass
class _Layer:
    polygons: list[shapely.Polygon] = field(default_factory=list)
    tags: list[dict] = field(default_factory=list)
    account: Account = field(default_factory=Account)


def read_dxf(path: Path, request: Request) -> Footprints:
    """Read the closed polylines of a drawing: of the named layer, or of the only fitting one."""
    size = path.stat().st_size
    if size > MOST_BYTES:
        raise MapError(
            f"{path.name} has {format_bytes(size)}",
            f"a drawing of at most {format_bytes(MOST_BYTES)}",
            "save the layer of the buildings as a drawing of its own",
        )
    layers: dict[str, _Layer] = defaultdict(_Layer)
    try:
        unit = _read_drawing(path, layers)
    except (ValueError, TypeError, OverflowError, IndexError, OSError) as error:
        raise MapError(
            f"{path.name} cannot be read as DXF: {str(error)[:200]}",
            "a complete DXF file in text form (ASCII)",
            "save the drawing again as DXF, for example as AutoCAD 2000 DXF",
        ) from error
    closed = {
        name: any(tags["solid_height"] for tags in layer.tags)
        for name, layer in layers.items()
        if layer.polygons and not _has_holes_of(name, layers)
    }
    if not closed:
        raise MapError(
            f"{path.name} has no closed polyline",
            "a drawing whose buildings are closed polylines (LWPOLYLINE or POLYLINE)",
            "close the outlines in the CAD program, and explode blocks that hold buildings",
        )
    name = choose_layer(path.name, closed, request.layer, list(layers))
    chosen = layers[name]
    if not chosen.polygons:
        raise MapError(
            f"{path.name}: the layer {request.layer!r} has no closed polyline",
            f"a layer with closed polylines: {', '.join(closed)}",
            "close the outlines in the CAD program, or name another layer",
        )
    made = np.array(chosen.polygons, dtype=object)
    if name + _HOLES in layers:
        made = _cut_holes(made, layers[name + _HOLES].polygons)
    polygons = shapely.transform(made, lambda at: at * unit)
    tags = [{"solid_height": own["solid_height"] * unit} for own in chosen.tags]
    return Footprints(
        polygons, tags, plane(), of_buildings=is_building_name(name), account=chosen.account
    )


def _has_holes_of(name: str, layers: Mapping[str, _Layer]) -> bool:
    """Whether the layer ``name`` has the holes of the polygons of another layer."""
    other = layers.get(name.removesuffix(_HOLES))
    return name.endswith(_HOLES) and other is not None and bool(other.polygons)


def _cut_holes(polygons: np.ndarray, holes: Sequence[shapely.Polygon]) -> np.ndarray:
    """Cut each hole out of the larger polygons around it."""
    if not len(holes):
        return polygons
    inner = np.array(holes, dtype=object)
    inner = inner[shapely.is_valid(inner)]
    points = shapely.point_on_surface(inner)
    hole, polygon = shapely.STRtree(polygons).query(points, predicate="within")
    larger = shapely.area(inner[hole]) < _MOST_HOLE * shapely.area(polygons[polygon])
    rings: dict[int, list[shapely.LinearRing]] = defaultdict(list)
    for k, one in zip(polygon[larger].tolist(), inner[hole[larger]].tolist(), strict=True):
        rings[k].append(one.exterior)
    cut = polygons.copy()
    for k, own in rings.items():
        cut[k] = shapely.Polygon(polygons[k].exterior, own)
    return cut


def _read_drawing(path: Path, layers: dict[str, _Layer]) -> float:
    """Fill ``layers`` with the entities of a drawing, and return its unit in metres."""
    pairs = _pairs(path)
    section, unit, ended = "", 1.0, False
    variable = ""
    for code, value in pairs:
        if (code, value) == (0, "SECTION"):
            code, section = next(pairs, (2, ""))
            if section == "ENTITIES":
                _read_entities(pairs, layers)
        elif (code, value) == (0, "EOF"):
            ended = True
            break
        elif section == "HEADER" and code == 9:
            variable = value
        elif section == "HEADER" and variable == "$INSUNITS" and code == 70:
            known = _UNITS.get(int(value))
            if known is None:
                raise ValueError(f"its unit $INSUNITS is {value[:20]}, which is not a usual one")
            unit = known
    if not ended:
        raise ValueError("it does not end with EOF")
    return unit


def _pairs(path: Path) -> Iterator[Pair]:
    """Yield the codes and values of a drawing."""
    with open(path, "rb") as file:
        if file.read(len(_BINARY)) == _BINARY:
            raise ValueError("it is a binary drawing")
        file.seek(0)
        while code := file.readline(_LONGEST):
            value = file.readline(_LONGEST)
            if not value:
                if code.strip() in (b"", b"\x1a"):
                    return
                raise ValueError("it is cut off")
            yield int(code), _decode(value.strip())


def _decode(value: bytes) -> str:
    try:
        return value.decode("utf-8")
    except UnicodeDecodeError:
        return value.decode("cp1252", errors="replace")


def _read_entities(pairs: Iterator[Pair], layers: dict[str, _Layer]) -> None:
    """Read entities up to the end of their section."""
    kind, current, vertex = "", _Polyline(), False
    for code, value in pairs:
        if code != 0:
            if kind in ("LWPOLYLINE", "POLYLINE"):
                _set(current, kind, code, value, vertex)
            elif code == 8:
                current.layer = value
            continue
        if value == "VERTEX" and kind == "POLYLINE":
            current.points.append([0.0, 0.0, 0.0, 0.0])
            vertex = True
            continue
        if kind and kind != "SEQEND":
            _finish(kind, current, layers[current.layer])
        if value == "ENDSEC":
            return
        kind, current, vertex = value, _Polyline(), False
    raise ValueError("its entities are cut off")


def _set(line: _Polyline, kind: str, code: int, value: str, vertex: bool) -> None:
    """Set what a ``code`` says of a polyline, or of its last vertex."""
    if code == 8 and not vertex:
        line.layer = value
    elif code == 70 and not vertex:
        line.flags = int(value)
    elif code == 39 and not vertex:
        line.thickness = _number(value)
    elif code == 67 and not vertex:
        line.on_paper = int(value) == 1
    elif code == 230 and not vertex:
        line.upwards = _number(value)
    elif kind == "LWPOLYLINE":
        if code == 38:
            line.elevation = _number(value)
        elif code == 10:
            line.points.append([_number(value), 0.0, 0.0, 0.0])
        elif code in (20, 42) and line.points:
            line.points[-1][1 if code == 20 else 3] = _number(value)
    elif vertex and code in (10, 20, 30, 42):
        line.points[-1][{10: 0, 20: 1, 30: 2, 42: 3}[code]] = _number(value)
    elif code == 30 and not vertex:
        line.elevation = _number(value)


def _number(value: str) -> float:
    number = float(value)
    if not math.isfinite(number):
        raise ValueError(f"the number {value[:30]!r}")
    return number


def _finish(kind: str, line: _Polyline, layer: _Layer) -> None:
    """Add the polygon of a closed polyline to its layer, or count why it has no polygon."""
    if line.on_paper:
        return
    layer.account.features += 1
    points = line.points
    closed = line.flags & 1 or (len(points) > 3 and points[0][:2] == points[-1][:2])
    mesh = line.flags & (16 | 64)
    if kind not in ("LWPOLYLINE", "POLYLINE") or not closed or mesh or line.upwards == 0:
        layer.account.drop(NO_POLYGON)
        return
    ring = [corner for one, other in pairwise([*points, points[0]]) for corner in _arc(one, other)]
    if len({*ring}) < 3:
        layer.account.drop(DEGENERATE)
        return
    if line.upwards < 0:  # seen from below: the drawing is mirrored
        ring = [(-x, y) for x, y in ring]
    polygon = shapely.Polygon(ring)
    if not polygon.area > 0:
        layer.account.drop(DEGENERATE)
        return
    elevation = max([line.elevation, *(point[2] for point in points)])
    layer.polygons.append(polygon)
    layer.tags.append({"solid_height": abs(line.thickness) or elevation})


def _arc(start: list[float], end: list[float]) -> list[tuple[float, float]]:
    """The corners from ``start`` up to ``end``, without it; a bulge is the tangent of a quarter of
    the arc's angle."""
    (x, y, _, bulge), (to_x, to_y) = start, end[:2]
    if not bulge or (x, y) == (to_x, to_y):
        return [(x, y)]
    angle = 4 * math.atan(bulge)
    count = max(1, math.ceil(abs(angle) / _STEP))
    half_x, half_y = (to_x - x) / 2, (to_y - y) / 2
    away = (1 / bulge - bulge) / 2  # from the middle of the chord to the centre, in half chords
    center_x, center_y = x + half_x - half_y * away, y + half_y + half_x * away
    corners = [(x, y)]
    for step in range(1, count):
        turn = angle * step / count
        dx, dy = x - center_x, y - center_y
        corners.append(
            (
                center_x + dx * math.cos(turn) - dy * math.sin(turn),
                center_y + dx * math.sin(turn) + dy * math.cos(turn),
            )
        )
    return corners
