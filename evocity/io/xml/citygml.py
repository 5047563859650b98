"""Buildings of CityGML 1.0 to 3.0: footprints and heights from their surfaces.

A building's footprint is, in this order: its surfaces that say ``GroundSurface``; its LoD 0
geometry; all faces of its lowest level of detail, seen from above. Each part of a building counts
as a building and inherits the attributes, but no heights. A part that stands on another part has
the height of its top above the foot of the lower part.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
import shapely

from evocity.io.account import NO_POLYGON, REPLACED, Account
from evocity.io.surfaces import shadow
from evocity.io.xml.gml_geometry import POLYGONS, rings_of
from evocity.io.xml.stream import Element, local_name

_LOD = re.compile(r"lod([0-4])")
# Things of a building that are not its body.
_ASIDE = frozenset(
    {
        "interiorRoom", "interiorFurniture", "interiorBuildingInstallation", "buildingRoom",
        "outerBuildingInstallation", "buildingInstallation", "buildingFurniture", "opening",
        "fillingSurface", "address", "appearance", "appearanceMember", "externalReference",
        "roomInstallation", "buildingSubdivision", "Appearance",
    }
)  # fmt: skip
_HEIGHTS = ("measuredHeight", "storeysAboveGround")
# Attributes of a building, at most.
_MOST = 100


@dataclass
class _Face:
    lod: int
    kind: str
    rings: list[np.ndarray]


@dataclass
class _Body:
    """A building, or a part of one: its faces, attributes and parts."""

    faces: list[_Face] = field(default_factory=list)
    attributes: dict[str, object] = field(default_factory=dict)
    parts: list[Element] = field(default_factory=list)

    def footprint(self, wall: float) -> shapely.Geometry | None:
        """The area of the body on the ground; faces of at most ``wall`` are walls."""
        ground = [face for face in self.faces if face.kind == "GroundSurface"]
        finest = max((face.lod for face in ground), default=0)
        chosen = [face for face in ground if face.lod == finest]
        if not chosen:
            lowest = min((face.lod for face in self.faces), default=0)
            chosen = [face for face in self.faces if face.lod == lowest]
            feet = [face for face in chosen if face.kind == "lod0FootPrint"]
            chosen = feet or chosen
        return shadow((face.rings for face in chosen), wall)

    @property
    def is_flat(self) -> bool:
        """Whether the body has only LoD 0 geometry."""
        return all(face.lod == 0 for face in self.faces)

    @property
    def span(self) -> tuple[float, float]:
        """The lowest and highest z; (0, 0) for a flat body."""
        z = [ring[:, 2] for face in self.faces if face.lod for ring in face.rings]
        return (float(min(map(np.min, z))), float(max(map(np.max, z)))) if z else (0.0, 0.0)


def read_building(
    building: Element, vertical: float, wall: float, account: Account
) -> Iterator[tuple[shapely.Geometry, dict[str, object]]]:
    """Yield the footprints of a building and of its parts, each with its attributes, and
    ``solid_height`` in metres.

    vertical : metres in a unit of height.
    wall : greatest area of a wall, in the square of the coordinates' unit.
    account : the account of the file, in which the building and its parts are counted.
    """
    bodies = [_body(building)]
    for body in bodies:
        if len(bodies) < 10_000:
            bodies += [_inherit(_body(part), body) for part in body.parts]
    found = [(body, body.footprint(wall) if body.faces else None) for body in bodies]
    placed = [(body, area) for body, area in found if area is not None]
    account.features += len(placed)
    if not placed:
        account.features += 1
        account.drop(NO_POLYGON)
        return
    if placed[0][0] is bodies[0] and bodies[0].is_flat:
        # the outline of the whole has no height, but its parts may have one
        solid = [(body, area) for body, area in placed[1:] if not body.is_flat]
        if solid:
            account.drop(REPLACED)
            placed = placed[1:]
    for body, area in placed:
        low, high = body.span
        foot = min(
            (other.span[0] for other, there in placed if _stands_on(body, area, other, there)),
            default=low,
        )
        yield area, {"solid_height": (high - min(foot, low)) * vertical} | body.attributes


def _stands_on(body: _Body, area: shapely.Geometry, other: _Body, there: shapely.Geometry) -> bool:
    """Whether a body stands on another: over its area, and not below its foot."""
    if body is other or body.is_flat or other.is_flat or body.span[0] <= other.span[0]:
        return False
    return bool(shapely.area(shapely.intersection(area, there)) > area.area / 2)


def _inherit(part: _Body, whole: _Body) -> _Body:
    inherited = {
        name: value
        for name, value in whole.attributes.items()
        if name not in _HEIGHTS or part.is_flat
    }
    part.attributes = inherited | part.attributes
    return part


def _body(building: Element) -> _Body:
    """Gather the faces, attributes and parts of a building, without those of its parts."""
    body = _Body()
    waiting: list[tuple[Element, int, str]] = [(child, -1, "") for child in reversed(building)]
    while waiting:
        element, lod, kind = waiting.pop()
        name = local_name(element)
        if name == "BuildingPart":
            body.parts.append(element)
            continue
        if name in _ASIDE:
            continue
        if name in POLYGONS:
            rings = [ring for ring in rings_of(element, 3) if len(ring) > 2]
            if rings:
                body.faces.append(_Face(max(lod, 0), kind, rings))
            continue
        if match := _LOD.match(name):
            lod = int(match[1])
            kind = kind or (name if lod == 0 else "")
        elif name.endswith("Surface") and lod < 0:
            kind = name
        if len(element):
            waiting += [(child, lod, kind) for child in reversed(element)]
        if lod < 0 and len(body.attributes) < _MOST:
            _take_attribute(element, name, body.attributes)
    return body


def _take_attribute(element: Element, name: str, attributes: dict[str, object]) -> None:
    """Keep the value of an attribute of a building, in metres if it states feet."""
    if name.endswith("Attribute") and element.get("name"):
        value = next((child for child in element if local_name(child) == "value"), None)
        if value is not None and value.text:
            attributes[str(element.get("name"))] = value.text.strip()[:1000]
    elif not len(element) and element.text and element.text.strip() and name != "value":
        attributes.setdefault(name, with_unit(element))


def with_unit(element: Element) -> str:
    """Return the text of an element, with its unit if the element states metres or feet."""
    text: str = (element.text or "").strip()[:1000]
    unit = re.split("[:#]", (element.get("uom") or "").lower())[-1]
    if unit in ("ft", "foot", "feet"):
        return text + " ft"
    return text + " m" if unit in ("m", "metre", "meter") else text
