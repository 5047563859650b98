"""KML and KMZ: polygons of placemarks, in longitude and latitude. A folder is a layer.

The height of a polygon whose altitudes are relative to the ground is its greatest altitude; other
altitudes say nothing about heights. Links to other files are not followed.
"""

import math
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import shapely

from evocity.errors import MapError
from evocity.io.account import DEGENERATE, LOST_RINGS, NO_POLYGON, Account
from evocity.io.archives import open_archive, read_member
from evocity.io.heights import check_columns, has_building_fields, is_building_name
from evocity.io.layer_choice import choose_layer
from evocity.io.projection import WGS84
from evocity.io.reader_types import Footprints, Request
from evocity.io.surfaces import shadow, sound_rings
from evocity.io.xml.gml_geometry import gather_rings
from evocity.io.xml.stream import Element, elements, local_name, xml_errors

# Area of a wall, square degrees: about a square centimetre.
_WALL = 1e-14
_ROOT = "kml"


def read_kml(path: Path, request: Request) -> Footprints:
    """Read the buildings of a KML file: the polygons of the named folder, or of the only fitting
    one."""
    layers: dict[str, list[tuple[shapely.Geometry, dict]]] = defaultdict(list)
    accounts: dict[str, Account] = defaultdict(Account)
    linked = 0
    with xml_errors(path, "KML"):
        for event, element, above in elements(path):
            name = local_name(element)
            if not above and name != _ROOT:
                raise ValueError(f"its root is <{name[:40]}>")
            if event == "start":
                continue
            linked += name == "NetworkLink"
            if name == "Placemark":
                _take_placemark(element, _folder(above), layers, accounts)
            if name in ("Placemark", "Style", "GroundOverlay", "NetworkLink"):
                element.clear()
    if linked and not layers:
        raise MapError(
            f"{path.name} has no polygon, and {linked} links to other files",
            "a KML file with the polygons of the buildings in it",
            "open the file in Google Earth, and save the place with its contents as KMZ",
        )
    heights = {
        layer: any(tags.get("solid_height") for _, tags in found) for layer, found in layers.items()
    }
    chosen = choose_layer(path.name, heights, request.layer, list(accounts))
    polygons = np.array([polygon for polygon, _ in layers[chosen]], dtype=object)
    tags = [own for _, own in layers[chosen]]
    columns = {name for own in tags for name in own}
    check_columns(path.name, columns, (request.height_column, request.levels_column))
    return Footprints(
        polygons,
        tags,
        WGS84,
        of_buildings=is_building_name(chosen) or has_building_fields(columns),
        account=accounts[chosen],
    )


def read_kmz(path: Path, request: Request) -> Footprints:
    """Read the buildings of a KMZ file, which is a KML file in a zip."""
    with open_archive(path) as (archive, folder):
        names = [name for name in archive.names if name.lower().endswith(".kml")]
        main = next((name for name in names if name.lower() == "doc.kml"), names[:1])
        if not main:
            raise MapError(
                f"{path.name} has no KML file in it",
                "a KMZ file with a file doc.kml",
                "save the place as KMZ again",
            )
        inner = read_member(archive, main if isinstance(main, str) else main[0], folder)
        return read_kml(inner.rename(folder / f"{path.stem}.kml"), request)


def _folder(above: list[Element]) -> str:
    """The name of the innermost folder or document among the elements ``above``."""
    for element in reversed(above):
        if local_name(element) in ("Folder", "Document"):
            named = next((child for child in element if local_name(child) == "name"), None)
            if named is not None and (named.text or "").strip():
                return (named.text or "").strip()
    return ""


def _take_placemark(placemark: Element, layer: str, layers: dict, accounts: dict) -> None:
    account = accounts[layer]
    account.features += 1
    found = [one for one in placemark.iter() if local_name(one) == "Polygon"]
    if not found:
        account.drop(NO_POLYGON)
        return
    faces, height, lost = [], 0.0, 0
    for polygon in found:
        rings, degenerate = sound_rings(gather_rings(polygon, _boundary_points))
        faces.append(rings)
        lost += degenerate
        if _text(polygon, "altitudeMode") in ("relativeToGround", "relativeToSeaFloor"):
            height = max([height, *(float(ring[:, 2].max()) for ring in rings if len(ring))])
    area = shadow(faces, _WALL)
    if area is None:
        account.drop(DEGENERATE)
        return
    account.remark(LOST_RINGS, lost)
    layers[layer].append((area, {"solid_height": height} | _attributes(placemark)))


def _boundary_points(boundary: Element) -> Iterator[np.ndarray]:
    """Yield the points of the ring of a boundary, float ``(n, 3)``."""
    for element in boundary.iter():
        if local_name(element) == "coordinates":
            yield _points(element.text or "")


def _points(text: str) -> np.ndarray:
    points = []
    for item in text.split():
        values = [float(number) for number in item.split(",")[:3] if number]
        if len(values) < 2 or not all(map(math.isfinite, values)):
            raise ValueError(f"the point {item[:60]!r}")
        points.append((*values, 0.0)[:3])
    return np.array(points, dtype=np.float64).reshape(-1, 3)


def _attributes(placemark: Element) -> dict[str, str]:
    """The attributes of ``ExtendedData``, and the name of a placemark."""
    found: dict[str, str] = {}
    for element in placemark.iter():
        kind, name = local_name(element), element.get("name")
        if kind == "SimpleData" and name and element.text:
            found[name] = element.text.strip()
        elif kind == "Data" and name:
            found[name] = _text(element, "value")
    return found


def _text(element: Element, name: str) -> str:
    """The text of the child called ``name``; "" without one."""
    child = next((one for one in element if local_name(one) == name), None)
    return (child.text or "").strip() if child is not None else ""
