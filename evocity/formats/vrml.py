"""VRML97, the format of the papers (Marsault 2002 §5.6), and its successor X3D; y up.

Each group is a Group, each solid a Shape with the name of the object: an IndexedFaceSet. Lengths
are whole millimetres from the north-west corner, which makes short numbers; a Transform converts
them to metres from the south-west corner.
"""

import math
from collections.abc import Iterator, Sequence
from xml.sax.saxutils import quoteattr

import numpy as np

from evocity.formats.facets import pair_walls
from evocity.formats.materials import materials_of, names_of
from evocity.formats.solids import About, Group
from evocity.formats.trees import mesh_of

#: The unit of lengths, metres.
GRAIN = 1e-3
_SCALE = f"{GRAIN} {GRAIN} {GRAIN}"

# Geometries by their points and faces, and viewpoints by their positions.
_VRML97 = "IndexedFaceSet{{coord Coordinate{{point[{}]}}coordIndex[{}]}}"
_VIEWPOINT = 'Viewpoint {{ position {} orientation 1 0 0 -0.785 description "from the south" }}'
_VIEWPOINT_X3D = (
    '<Viewpoint position="{}" orientation="1 0 0 -0.785" description="from the south"/>'
)
_X3D = '<IndexedFaceSet coordIndex="{1}"><Coordinate point="{0}"/></IndexedFaceSet>'


def vrml97(groups: Sequence[Group], about: About) -> str:
    """Write the text of a .wrl. Source: ISO/IEC 14772-1:1997."""
    notes = [f"offset {x:.3f}" for x in about.offset] + [about.crs or "", about.attribution]
    info = ", ".join(_quote(line) for line in notes if line)
    parts = ["#VRML V2.0 utf8", f"WorldInfo {{ title {_quote(about.name)} info [ {info} ] }}"]
    parts.append('NavigationInfo { type [ "EXAMINE", "WALK", "ANY" ] }')
    parts.append(_viewpoint(about, _VIEWPOINT))
    deep = _ground_depth(about)
    parts.append(f"Transform {{ translation 0 0 {-deep * GRAIN:.10g} scale {_SCALE} children [")
    for group, name, material, colour in _listed(groups):
        look = f"DEF {material}-material Material {{ diffuseColor {colour} }}"
        look = f"DEF {material}-look Appearance {{ material {look} }}"
        parts.append(f"DEF {name} Group {{ children [")
        for own, geometry in _geometries(group, deep, _VRML97):
            # Blender reads nothing behind USE on its line
            parts.append(f"DEF {own} Shape{{appearance {look}\ngeometry {geometry}}}")
            look = f"USE {material}-look"
        parts.append("] }")
    return "\n".join([*parts, "] }", ""])


def x3d(groups: Sequence[Group], about: About) -> str:
    """Write the text of an .x3d, XML: the profile Interchange. Source: ISO/IEC 19776-1, X3D
    3.3."""
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
        *(
            f'<meta name="{name}" content={quoteattr(text)}/>'
            for name, text in metas.items()
            if text
        ),
        "</head>",
        "<Scene>",
        '<NavigationInfo type=\'"EXAMINE" "WALK" "ANY"\'/>',
        _viewpoint(about, _VIEWPOINT_X3D),
    ]
    deep = _ground_depth(about)
    parts.append(f'<Transform translation="0 0 {-deep * GRAIN:.10g}" scale="{_SCALE}">')
    for group, name, material, colour in _listed(groups):
        look = f'<Material DEF="{material}-material" diffuseColor="{colour}"/>'
        look = f'<Appearance DEF="{material}-look">{look}</Appearance>'
        parts.append(f'<Group DEF="{name}">')
        for own, geometry in _geometries(group, deep, _X3D):
            parts.append(f'<Shape DEF="{own}">{look}{geometry}</Shape>')
            look = f'<Appearance USE="{material}-look"/>'
        parts.append("</Group>")
    return "\n".join([*parts, "</Transform>", "</Scene>", "</X3D>", ""])


def _listed(groups: Sequence[Group]) -> Iterator[tuple[Group, str, str, str]]:
    """Yield each group with solids, with its name, the name of its material, and its colour."""
    for group in groups:
        if len(group):
            colour = " ".join(f"{c:.4g}" for c in group.colour)
            walls, roofs = materials_of(group)
            material = (walls if walls.colour == group.colour else roofs).name
            yield group, _word(group.name), _word(material), colour


def _word(text: str) -> str:
    """Replace characters that names of nodes cannot hold."""
    word = "".join(c if c.isascii() and (c.isalnum() or c == "-") else "_" for c in text)
    return word if word[:1].isalpha() else f"_{word}"


def _viewpoint(about: About, template: str) -> str:
    """Fill a template of viewpoints with a point above the south of the ground."""
    wide, deep = about.size
    away = max(wide, deep)
    return template.format(f"{wide / 2:.2f} {away:.2f} {0.6 * away:.2f}")


def _ground_depth(about: About) -> int:
    """Return the length of the ground from north to south, in units of `GRAIN`."""
    return math.ceil(about.size[1] / GRAIN)


def _geometries(group: Group, deep: int, template: str) -> Iterator[tuple[str, str]]:
    """Yield the name and the faces of each solid: walls have four corners, other faces three. A
    solid lists its own points."""
    mesh = mesh_of(group)
    quads, owner, threes, rows = pair_walls(mesh)
    owners = mesh.owner[rows]
    corner_of = np.concatenate([np.repeat(owner, 4), np.repeat(owners, 3)]).astype(np.int64)
    corners = np.concatenate([quads.ravel(), threes.ravel()]).astype(np.int64)
    wide = max(len(mesh.points), 1)
    pairs, index = np.unique(corner_of * wide + corners, return_inverse=True)
    of, used = pairs // wide, pairs % wide
    first = np.searchsorted(of, np.arange(len(group) + 1))
    local = index - first[corner_of]
    split = 4 * len(quads)
    faces = [np.column_stack([local[:split].reshape(-1, 4), np.full(len(quads), -1)]).ravel()]
    faces.append(np.column_stack([local[split:].reshape(-1, 3), np.full(len(threes), -1)]).ravel())
    of_face = np.concatenate([np.repeat(owner, 5), np.repeat(owners, 4)])
    order = np.argsort(of_face, kind="stable")
    # each text is made once; -1 is the last
    texts = np.array([*map(str, range(int(local.max(initial=0)) + 1)), "-1"], object)
    numbers = texts[np.concatenate(faces)[order]].tolist()
    ends = np.searchsorted(of_face[order], np.arange(len(group) + 1)).tolist()
    x, y, z = np.round(mesh.points[used] / GRAIN).astype(np.int64).T
    points = [
        f"{a} {b} {c}" for a, b, c in zip(x.tolist(), z.tolist(), (deep - y).tolist(), strict=True)
    ]
    starts = first.tolist()
    for k, name in enumerate(names_of(group)):
        own = " ".join(points[starts[k] : starts[k + 1]])
        yield _word(name), template.format(own, " ".join(numbers[ends[k] : ends[k + 1]]))


def _quote(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'
