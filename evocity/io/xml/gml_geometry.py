"""Geometry of GML: rings of polygons as arrays, and the reference systems that it names."""

import contextlib
import math
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from pyproj import CRS
from pyproj.exceptions import ProjError

from evocity.io.projection import WGS84, flat, parse_crs, transform_points, vertical_unit
from evocity.io.xml.stream import Element, local_name

_OUTER = ("exterior", "outerBoundaryIs")
_INNER = ("interior", "innerBoundaryIs")
#: Elements with rings.
POLYGONS = frozenset({"Polygon", "PolygonPatch", "Triangle", "Rectangle"})

# The names of German surveys.
_ADV = {
    "ETRS89_UTM31": 25831,
    "ETRS89_UTM32": 25832,
    "ETRS89_UTM33": 25833,
    "DE_DHDN_3GK2": 31466,
    "DE_DHDN_3GK3": 31467,
    "DE_DHDN_3GK4": 31468,
    "DE_DHDN_3GK5": 31469,
}


@dataclass(frozen=True)
class NamedCRS:
    """A reference system that a file names.

    crs : horizontal system.
    northing_first : whether its name says that the first coordinate is the one to the north.
    vertical : metres in a unit of the third coordinate.
    axes : number of axes of the whole system, 2 or 3.
    """

    crs: CRS
    northing_first: bool
    vertical: float
    axes: int = 2


def parse_srs_name(text: str, where: str) -> NamedCRS:
    """Parse the attribute ``srsName``: names of EPSG as URN, address or code, names of German
    surveys. Raises `MapError` for other names."""
    text = text.strip()
    codes: list[str] = []
    formal = True  # names that follow the order of axes of the system
    if match := re.match(r"urn:adv:crs:(\w+)", text):
        number = _ADV.get(match[1]) or _ADV.get(match[1].removesuffix("_NH"))
        codes, formal = ([str(number)] if number else []), False
    elif match := re.fullmatch(
        r"(?:EPSG:|https?://www\.opengis\.net/gml/srs/epsg\.xml#)(\d+)", text
    ):
        codes, formal = [match[1]], False
    elif re.search(r"(?:OGC|CRS)[:/][\w.]*[:/]?(?:CRS)?84$", text, re.I):
        return NamedCRS(WGS84, False, 1.0)
    elif text.startswith("urn:"):
        codes = re.findall(r"crs:EPSG:(?:[\w.]*:)?(\d+)", text)
    elif text.startswith("http"):
        codes = re.findall(r"/EPSG/[\w.]+/(\d+)", text)
    name = f"EPSG:{codes[0]}" if codes else text
    parse_crs(name if len(name) < 200 else "", where)  # raises for unknown names
    whole = CRS.from_user_input(name)
    crs = flat(whole)
    first = crs.axis_info[0].direction.lower() if crs.axis_info else ""
    unit = vertical_unit(whole)
    if len(codes) > 1:
        with contextlib.suppress(ProjError):  # the first system's unit, unless PROJ says otherwise
            unit = vertical_unit(CRS.from_user_input(f"EPSG:{codes[1]}"))
    axes = 3 if len(whole.axis_info) > 2 or len(codes) > 1 else 2
    return NamedCRS(crs, formal and first in ("north", "south"), unit, axes)


def is_northing_first(named: NamedCRS, x: float, y: float) -> bool:
    """Tell whether a point's first coordinate is the one to the north: as the name says, unless
    only the other order lies where the system is used."""
    orders = named.northing_first, not named.northing_first
    for order in orders:
        if _is_used_at(named.crs, *((y, x) if order else (x, y))):
            return order
    return orders[0]


def _is_used_at(crs: CRS, x: float, y: float) -> bool:
    area = crs.area_of_use
    try:
        lon, lat = (x, y) if crs.is_geographic else transform_points(x, y, crs, WGS84)
    except ProjError:
        return False
    if not (math.isfinite(lon) and math.isfinite(lat) and abs(lat) <= 90 and abs(lon) <= 180):
        return False
    if area is None or area.west > area.east:
        return True
    near = area.west - 1 <= lon <= area.east + 1
    return near and area.south - 1 <= lat <= area.north + 1


def rings_of(polygon: Element, sizes: Sequence[int]) -> list[np.ndarray]:
    """Return the rings of a polygon, the outer one first, each float ``(n, 3)``.

    sizes : numbers of coordinates that a point may have where no element states them, the likeliest
        first.
    """
    sizes = stated_sizes(polygon, sizes)
    return gather_rings(polygon, lambda boundary: _positions(boundary, sizes))


def gather_rings(
    polygon: Element, points_of: Callable[[Element], Iterable[np.ndarray]]
) -> list[np.ndarray]:
    """Return the rings of a polygon, the outer one first; no rings without an outer one.

    points_of : gives the points of a boundary, in one array or several.
    """
    outer: list[np.ndarray] = []
    inner: list[np.ndarray] = []
    for boundary in polygon:
        kind = local_name(boundary)
        if kind in _OUTER or kind in _INNER:
            parts = list(points_of(boundary))
            if parts:
                (outer if kind in _OUTER else inner).append(np.concatenate(parts))
    return outer[:1] + inner if outer else []


def stated_sizes(element: Element, usual: Sequence[int]) -> Sequence[int]:
    """Return the number of coordinates of a point that ``element`` states, 2 or 3, as the only one;
    ``usual`` if it states no number."""
    stated = element.get("srsDimension") or element.get("dimension")
    if stated is None:
        return usual
    if stated.strip() not in ("2", "3"):
        raise ValueError(f"points of {stated[:20]!r} coordinates")
    return (int(stated),)


def _positions(boundary: Element, sizes: Sequence[int]) -> Iterator[np.ndarray]:
    lists = []
    for element in boundary.iter():
        kind = local_name(element)
        if kind in ("posList", "pos"):
            values = np.array((element.text or "").split(), dtype=np.float64)
            is_point = kind == "pos" and len(values) in (2, 3)
            own = (len(values),) if is_point else stated_sizes(element, sizes)
            lists.append((values, own))
        elif kind == "coordinates":
            lists.append((_old_coordinates(element).ravel(), (3,)))
    size = _size([values for values, own in lists if own is sizes], sizes)
    for values, own in lists:
        width = size if own is sizes else own[0]
        if len(values) % width:
            raise ValueError(f"{len(values)} numbers for points of {width}")
        yield _checked(values.reshape(-1, width))


def _size(lists: Sequence[np.ndarray], sizes: Sequence[int]) -> int:
    """Choose the number of coordinates of the points of a ring: the first of the ``sizes`` that
    closes the ring, otherwise the first that divides its numbers, otherwise the first."""
    whole = [size for size in sizes if all(len(values) % size == 0 for values in lists)]
    for size in whole:
        if lists and np.array_equal(lists[0][:size], lists[-1][-size:]):
            return size
    return (whole or sizes)[0]


def _old_coordinates(element: Element) -> np.ndarray:
    """The points of GML 2: by default ``x,y[,z] x,y[,z]``."""
    decimal, comma, space = (
        element.get(name, usual) for name, usual in (("decimal", "."), ("cs", ","), ("ts", " "))
    )
    text = element.text or ""
    if not (decimal and comma.strip() and space):
        raise ValueError("its coordinates have no marks between the numbers")
    points = text.split() if space.isspace() else text.split(space)
    rows = [
        [float(number.replace(decimal, ".")) for number in point.split(comma)[:3]]
        for point in points
        if point.strip()
    ]
    if any(len(row) < 2 for row in rows):
        raise ValueError("a point of one number")
    return np.array([[*row, 0.0][:3] for row in rows], dtype=np.float64).reshape(-1, 3)


def _checked(points: np.ndarray) -> np.ndarray:
    """The ``points`` in three columns; raises ValueError for numbers that are not finite."""
    if points.shape[1] < 2 or not np.isfinite(points).all():
        raise ValueError("a coordinate is NaN or infinite")
    if points.shape[1] == 2:
        return np.column_stack([points, np.zeros(len(points))])
    return points[:, :3]
