"""Buildings of CityGML 1.0 to 3.0: footprints and heights from their surfaces.

A building's footprint is, in this order: its surfaces that say ``GroundSurface``; its LoD 0
geometry; all faces of its lowest level of detail, seen from above. Each part of a building counts
as a building and inherits the attributes; a part with a height or a solid of its own inherits no
heights. A building gives way to its parts where they lie, if they have more detail. A part that
stands on other parts has the height of its top above their foot.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import shapely

from evocity.io.account import LOST_RINGS, NO_POLYGON, REPLACED, Account
from evocity.io.building_feet import find_feet
from evocity.io.building_rest import rest_of
from evocity.io.heights import inherit, metres
from evocity.io.surfaces import WALL, shadow, sound_rings
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
# Attributes of a building, at most; heights that differ by less are equal, metres.
_MOST, _STEP = 100, 0.5


@dataclass
class _Face:
    lod: int
    kind: str
    rings: list[np.ndarray]


@dataclass(eq=False)
class _Body:
    """A building, or a part of one: its faces, attributes and parts, the number of ``lost_rings``,
    and the bodies ``above`` it, of which it is a part, the nearest first."""

    faces: list[_Face] = field(default_factory=list)
    attributes: dict[str, object] = field(default_factory=dict)
    parts: list[Element] = field(default_factory=list)
    above: list["_Body"] = field(default_factory=list)
    lost_rings: int = 0

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

    @cached_property
    def lod(self) -> int:
        """The finest level of detail."""
        return max((face.lod for face in self.faces), default=0)

    @property
    def is_flat(self) -> bool:
        """Whether the body has only LoD 0 geometry."""
        return self.lod == 0

    @cached_property
    def span(self) -> tuple[float, float]:
        """The lowest and highest z; (0, 0) for a flat body."""
        z = [ring[:, 2] for face in self.faces if face.lod for ring in face.rings]
        return (float(min(map(np.min, z))), float(max(map(np.max, z)))) if z else (0.0, 0.0)


def read_building(
    building: Element, vertical: float, unit: float, account: Account
) -> Iterator[tuple[shapely.Geometry, dict[str, object]]]:
    """Yield the footprints of a building and of its parts, each with its attributes, and
    ``solid_height`` in metres.

    vertical : metres in a unit of height.
    unit : metres in a unit of the coordinates, about.
    account : the account of the file, in which the building and its parts are counted.
    """
    bodies = [_body(building)]
    for body in bodies:
        if len(bodies) < 10_000:
            for element in body.parts:
                part = _body(element)
                part.above = [body, *body.above]
                bodies.append(part)
    wall = WALL / unit**2
    found = [(body, body.footprint(wall) if body.faces else None) for body in bodies]
    placed = [(body, area) for body, area in found if area is not None]
    account.features += len(placed)
    if not placed:
        account.features += 1
        account.drop(NO_POLYGON)
        return
    account.remark(LOST_RINGS, sum(body.lost_rings for body, _ in placed))
    finer: dict[_Body, list[shapely.Geometry]] = {}
    for part, area in placed:
        for body in part.above:
            if part.lod > body.lod:
                finer.setdefault(body, []).append(area)
    spans = np.array([body.span for body, _ in placed]) * vertical
    feet = find_feet(
        [area for _, area in placed],
        spans[:, 0],
        spans[:, 1],
        [any(face.kind == "GroundSurface" for face in body.faces) for body, _ in placed],
        unit,
    )
    for (body, area), (low, high), foot in zip(placed, spans.tolist(), feet.tolist(), strict=True):
        parts = finer.get(body)
        rest = rest_of(area, np.array(parts, dtype=object), np.full(2, unit)) if parts else area
        if rest is None:
            account.drop(REPLACED)
            continue
        own = body.attributes
        if foot < low - _STEP and _repeats_extent(own, high - low, vertical):
            own = {name: value for name, value in own.items() if name != "measuredHeight"}
        own = {"solid_height": high - foot if high > low else 0.0} | own
        yield rest, inherit(own, (other.attributes for other in body.above))


def _repeats_extent(attributes: dict[str, object], extent: float, vertical: float) -> bool:
    """Whether the measured height of a part is that of its own solid, metres."""
    measured = metres(attributes.get("measuredHeight"), vertical)
    return measured is not None and abs(measured - extent) < _STEP


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
            rings, lost = sound_rings(rings_of(element, (3,)))
            body.lost_rings += lost
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
