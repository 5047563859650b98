"""CityJSON (1.0 to 2.0): footprints from ground surfaces, or from the shadow of a solid.

A building's footprint is, in this order: its surfaces that say ``GroundSurface``; its LoD 0
geometry; all faces of its lowest level of detail, seen from above. Each part of a building counts
as a building and inherits the attributes.
"""

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import shapely
from pyproj import CRS

from evocity.errors import MapError
from evocity.formats.cityjson import PLACE
from evocity.io.polygon_repair import MOST, crossings
from evocity.io.projection import WGS84, is_metric, parse_crs, plane, transform_points
from evocity.io.reader_types import Footprints

_KINDS = ("Building", "BuildingPart", "BuildingUnit")
#: Other objects that stand on a map in evocity's own scenes.
_BESIDE = ("CityFurniture", "SolitaryVegetationObject", "OtherConstruction")

# how deep surfaces (lists of rings) lie in `boundaries`
_DEPTH = {
    "MultiSurface": 0,
    "CompositeSurface": 0,
    "Solid": 1,
    "MultiSolid": 2,
    "CompositeSolid": 2,
}


def read_cityjson(path: Path, document: dict) -> Footprints:
    """Read the buildings of a CityJSON document, each with ``solid_height`` among its tags."""
    try:
        own = _scene_attributes(document.get("CityObjects") or {})
        crs = _crs(path, document, own)
        window = _window(own, crs)
        kinds = _KINDS + _BESIDE if own else _KINDS
        vertices = _vertices(document)
        objects = document["CityObjects"]
        polygons, tags = [], []
        for item in objects.values():
            if item["type"] not in kinds:
                continue
            geometries = [g for g in item.get("geometry", []) if g["type"] in _DEPTH]
            footprint = _footprint(geometries, vertices)
            if footprint is None:
                continue
            polygons.append(footprint)
            height = _extent(geometries, vertices)
            tags.append({"solid_height": height} | _attributes(item, objects))
    except (
        *(TypeError, KeyError, IndexError, ValueError, AttributeError, OverflowError),
        shapely.errors.GEOSException,
    ) as error:
        raise MapError(
            f"{path.name}: the CityJSON cannot be read ({type(error).__name__}: {error})",
            "CityJSON 1.0 to 2.0 with CityObjects, vertices and their geometry",
            "check the file with a CityJSON validator, or export it again",
        ) from error
    bare = bool(own) and not polygons
    return Footprints(np.array(polygons, dtype=object), tags, crs, **window, bare=bare)


def _scene_attributes(objects: dict) -> dict:
    """Find the attributes with which evocity writes the place of a scene; {} in other files."""
    for first in objects.values():
        attributes = first.get("attributes") or {}
        return attributes if PLACE[1] in attributes else {}
    return {}


def _crs(path: Path, document: dict, own: dict):
    """Parse the document's reference system; without one, metres without a place on Earth."""
    named = document.get("metadata", {}).get("referenceSystem")
    if named is not None:
        return parse_crs(named, f"{path.name}, metadata.referenceSystem")
    if PLACE[0] in own:
        return parse_crs(own[PLACE[0]], f"{path.name}, {PLACE[0]}")
    return plane()


def _window(own: dict, crs: CRS) -> dict:
    """Read the window of evocity's own scene, as fields of `Footprints`."""
    if not own:
        return {}
    x, y = (float(number) for number in own[PLACE[1]])
    if not (math.isfinite(x) and math.isfinite(y)):
        raise ValueError(f"{PLACE[1]} is not finite")
    if not crs.is_engineering:
        x, y = transform_points(x, y, crs, WGS84)
    placed = {"projection": crs} if is_metric(crs) else {}
    attribution = own.get("attribution", "")
    return {
        "center": (float(x), float(y)),
        "attribution": attribution if isinstance(attribution, str) else "",
    } | placed


def _vertices(document: dict) -> np.ndarray:
    """Unpack the vertices by ``transform``: float64 ``(n, 3)``."""
    vertices = np.array(document["vertices"], dtype=float).reshape(-1, 3)
    if packing := document.get("transform"):
        vertices = vertices * packing["scale"] + packing["translate"]
    if not np.isfinite(vertices).all():
        raise ValueError("a vertex is NaN or infinite")
    return vertices


def _attributes(item: dict, objects: dict) -> dict:
    inherited = {}
    for parent in item.get("parents", [])[:1]:
        inherited = objects.get(parent, {}).get("attributes", {})
    return inherited | item.get("attributes", {})


def _surfaces(geometry: dict) -> Iterator[tuple[list, str | None]]:
    """Yield each surface (a list of rings of vertex indices) with its semantic type."""
    semantics = geometry.get("semantics") or {}
    types = [surface["type"] for surface in semantics.get("surfaces", [])]
    pairs = [(geometry["boundaries"], semantics.get("values"))]
    for _ in range(_DEPTH[geometry["type"]]):
        pairs = [
            (inner, None if values is None else values[i])
            for boundaries, values in pairs
            for i, inner in enumerate(boundaries)
        ]
    for boundaries, values in pairs:
        for i, surface in enumerate(boundaries):
            index = None if values is None else values[i]
            yield surface, None if index is None else types[index]


def _footprint(geometries: list[dict], vertices: np.ndarray) -> shapely.Geometry | None:
    by_lod = sorted(geometries, key=lambda geometry: str(geometry.get("lod", "")))
    ground = [s for g in by_lod[-1:] for s, kind in _surfaces(g) if kind == "GroundSurface"]
    surfaces = ground or [s for g in by_lod[:1] for s, _ in _surfaces(g)]
    areas = [area for surface in surfaces if (area := _project_down(surface, vertices))]
    return shapely.union_all(areas) if areas else None


def _project_down(surface: list, vertices: np.ndarray) -> shapely.Geometry | None:
    rings = [vertices[np.asarray(ring, dtype=np.intp), :2] for ring in surface]
    if not rings or any(len(ring) < 3 for ring in rings):
        return None
    polygon = shapely.Polygon(rings[0], rings[1:])
    if polygon.area <= 1e-6:  # a wall
        return None
    if polygon.is_valid:
        return polygon
    if crossings(polygon) > MOST:
        raise ValueError(f"a surface that crosses itself more than {MOST} times")
    return polygon.buffer(0)


def _extent(geometries: list[dict], vertices: np.ndarray) -> float:
    """Measure metres from the lowest to the highest point, 0 for a flat footprint."""
    used = [i for g in geometries for s, _ in _surfaces(g) for ring in s for i in ring]
    return float(np.ptp(vertices[used, 2])) if used else 0.0
