"""VRML97, the format of the papers (Marsault 2002 §5.6), and its successor X3D; y up.

Each group is a Group, each solid a Shape: an Extrusion, or an IndexedFaceSet if it has courtyards.
Lengths are whole millimetres from the north-west corner, which makes short numbers; a Transform
converts them to metres from the south-west corner.
"""

import math
from collections.abc import Iterator, Sequence
from xml.sax.saxutils import quoteattr

import numpy as np
import shapely

from evocity.formats.solids import WALL, About, Group

#: The unit of lengths, metres.
GRAIN = 1e-3
_SCALE = f"{GRAIN} {GRAIN} {GRAIN}"

# Geometries: a prism by its cross-section and height, anything else by its points and faces.
_VRML97 = (
    "Extrusion{{convex FALSE crossSection[{}]spine[0 0 0 0 {} 0]}}",
    "IndexedFaceSet{{coord Coordinate{{point[{}]}}coordIndex[{}]}}",
)
_X3D = (
    '<Extrusion convex="false" crossSection="{}" spine="0 0 0 0 {} 0"/>',
    '<IndexedFaceSet coordIndex="{1}"><Coordinate point="{0}"/></IndexedFaceSet>',
)


def vrml97(groups: Sequence[Group], about: About) -> str:
    """Write the text of a .wrl. Source: ISO/IEC 14772-1:1997."""
    notes = [f"offset {x:.3f}" for x in about.offset] + [about.crs or "", about.attribution]
    info = ", ".join(_quote(line) for line in notes if line)
    parts = ["#VRML V2.0 utf8", f"WorldInfo {{ title {_quote(about.name)} info [ {info} ] }}"]
    parts.append('NavigationInfo { type [ "EXAMINE", "WALK", "ANY" ] }')
    parts.append(_viewpoint(about))
    deep = _ground_depth(about)
    parts.append(f"Transform {{ translation 0 0 {-deep * GRAIN:.10g} scale {_SCALE} children [")
    for name, colour, geometries in _fill_templates(groups, deep, _VRML97):
        look = f"DEF {name}-look Appearance {{ material Material {{ diffuseColor {colour} }} }}"
        parts.append(f"DEF {name} Group {{ children [")
        for geometry in geometries:
            parts.append(f"Shape{{appearance {look} geometry {geometry}}}")
            look = f"USE {name}-look"
        parts.append("] }")
    return "\n".join([*parts, "] }", ""])


def x3d(groups: Sequence[Group], about: About) -> str:
    """Write the text of an .x3d, XML: the profile Interchange, with the level of Geometry3D that
    has extrusions. Source: ISO/IEC 19776-1, X3D 3.3."""
    metas = {
        "title": about.name,
        "rights": about.attribution,
        "crs": about.crs or "",
        "offset": " ".join(f"{x:.3f}" for x in about.offset),
        "generator": "evocity",
    }
    parts = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        '<!DOCTYPE X3D PUBLIC "ISO//Web3D//DTD X3D 3.3//EN" '
        '"https://www.web3d.org/specifications/x3d-3.3.dtd">',
        '<X3D profile="Interchange" version="3.3">',
        "<head>",
        '<component name="Geometry3D" level="4"/>',
        *(
            f'<meta name="{name}" content={quoteattr(text)}/>'
            for name, text in metas.items()
            if text
        ),
        "</head>",
        "<Scene>",
    ]
    deep = _ground_depth(about)
    parts.append(f'<Transform translation="0 0 {-deep * GRAIN:.10g}" scale="{_SCALE}">')
    for name, colour, geometries in _fill_templates(groups, deep, _X3D):
        material = f'<Material diffuseColor="{colour}"/>'
        look = f'<Appearance DEF="{name}-look">{material}</Appearance>'
        parts.append(f'<Group DEF="{name}">')
        for geometry in geometries:
            parts.append(f"<Shape>{look}{geometry}</Shape>")
            look = f'<Appearance USE="{name}-look"/>'
        parts.append("</Group>")
    return "\n".join([*parts, "</Transform>", "</Scene>", "</X3D>", ""])


def _fill_templates(
    groups: Sequence[Group], deep: int, templates: tuple[str, str]
) -> Iterator[tuple[str, str, list[str]]]:
    for group in groups:
        if len(group):
            colour = " ".join(f"{c:.4g}" for c in group.colour)
            name = "".join(c if c.isascii() and c.isalnum() else "_" for c in group.name)
            yield name, colour, _geometries(group, deep, *templates)


def _viewpoint(about: About) -> str:
    wide, deep = about.size
    away = max(wide, deep)
    return (
        f"Viewpoint {{ position {wide / 2:.2f} {away:.2f} {0.6 * away:.2f} "
        'orientation 1 0 0 -0.785 description "from the south" }'
    )


def _ground_depth(about: About) -> int:
    """Return the length of the ground from north to south, in units of `GRAIN`."""
    return math.ceil(about.size[1] / GRAIN)


def _geometries(group: Group, deep: int, prism: str, faced: str) -> list[str]:
    plain = (group.heights > 0) & (shapely.get_num_interior_rings(group.polygons) == 0)
    tall = np.round(group.heights / GRAIN).astype(np.int64).tolist()
    texts = [""] * len(group)
    rings = group.rings.on_grid(GRAIN)
    at = rings.starts[rings.first(len(group))].tolist()
    corners = _corners(rings.points, deep, "{} {}")
    for k in np.flatnonzero(plain).tolist():
        section = corners[at[k] : at[k + 1]]
        texts[k] = prism.format(" ".join([*section, section[0]]), tall[k])
    if plain.all():
        return texts
    at = group.rings.starts[group.rings.first(len(group))].tolist()
    corners = _corners(group.rings.points / GRAIN, deep, "{} %d {}")
    faces = _faces(group, ~plain)
    for k in np.flatnonzero(~plain).tolist():
        level = " ".join(corners[at[k] : at[k + 1]])
        points = [level.replace("%d", str(high)) for high in dict.fromkeys((0, tall[k]))]
        texts[k] = faced.format(" ".join(points), faces[k])
    return texts


def _corners(points: np.ndarray, deep: int, template: str) -> list[str]:
    """Write each of the ``points``: units of `GRAIN` to the east and, from the north, south."""
    x, y = np.round(points).astype(np.int64).T
    return list(map(template.format, x.tolist(), (deep - y).tolist()))


def _faces(group: Group, chosen: np.ndarray) -> list[str]:
    """Write the faces of each ``chosen`` solid: walls of four corners, floors and roofs of three.
    Indices are those of its own points, all on the ground before all on top."""
    mesh = group.mesh.select(chosen[group.mesh.owner])
    flat = mesh.part != WALL
    start = group.rings.starts[group.rings.first(len(group))]
    count = start[-1]
    numbers, owners = [], []
    for rows, owner in (mesh.quads, (mesh.triangles[flat], mesh.owner[flat])):
        begin, end = start[owner, None], start[owner + 1, None]
        own = np.where(rows < count, rows - begin, rows - count - begin + end - begin)
        ended = np.column_stack([own, np.full(len(own), -1)])
        numbers.append(ended.ravel())
        owners.append(np.repeat(owner, ended.shape[1]))
    owner = np.concatenate(owners)
    texts = list(map(str, np.concatenate(numbers)[np.argsort(owner, kind="stable")].tolist()))
    ends = np.cumsum(np.bincount(owner, minlength=len(group))).tolist()
    return [" ".join(texts[a:b]) for a, b in zip([0, *ends], ends, strict=False)]


def _quote(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'
