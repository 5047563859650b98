"""VRML97, the format of the papers (Marsault 2002 §5.6), and its successor X3D; y up.

Each group is a Group, each solid a Shape with the name of the object: an IndexedFaceSet. Lengths
are whole millimetres from the north-west corner, which makes short numbers; a Transform converts
them to metres from the south-west corner. A Shape has one material, so a solid of two materials
also has a colour for each face.
"""

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple
from xml.sax.saxutils import quoteattr

import numpy as np

from evocity.formats.facets import pair_walls
from evocity.formats.materials import materials_of, names_of
from evocity.formats.solids import ROOF, About, Group
from evocity.formats.trees import mesh_of

#: The unit of lengths, metres.
GRAIN = 1e-3
_SCALE = f"{GRAIN} {GRAIN} {GRAIN}"


class _Language(NamedTuple):
    """Templates of nodes in a language, and the ends of those that hold others."""

    viewpoint: str
    switch: str
    level: str
    group: str
    ends: tuple[str, str, str]
    look: str
    use: str
    shape: str
    #: A geometry, by its points, faces and colours.
    faces: str
    #: The colours of faces, and what a geometry of one colour has in their place.
    colours: str
    bare: str


_VRML97 = _Language(
    'Viewpoint {{ position {} orientation 1 0 0 -0.785 description "from the south" }}',
    "LOD {{ center {} range [ {} ] level [",
    "Transform {{ translation 0 0 {} scale {} children [",
    "DEF {} Group {{ children [",
    ("] }", "] }", "] }"),
    "DEF {0}-look Appearance {{ material DEF {0}-material Material {{ diffuseColor {1} }} }}",
    "USE {}-look",
    # Blender reads nothing behind USE on its line
    "DEF {} Shape{{appearance {}\ngeometry {}}}",
    "IndexedFaceSet{{coord Coordinate{{point[{}]}}coordIndex[{}]{}}}",
    "\ncolorPerVertex FALSE color Color{{color[{}, {}]}}colorIndex[{}]",
    "",
)
_X3D = _Language(
    '<Viewpoint position="{}" orientation="1 0 0 -0.785" description="from the south"/>',
    '<LOD center="{}" range="{}">',
    '<Transform translation="0 0 {}" scale="{}">',
    '<Group DEF="{}">',
    ("</LOD>", "</Transform>", "</Group>"),
    '<Appearance DEF="{0}-look"><Material DEF="{0}-material" diffuseColor="{1}"/></Appearance>',
    '<Appearance USE="{}-look"/>',
    '<Shape DEF="{}">{}{}</Shape>',
    '<IndexedFaceSet coordIndex="{1}"{2}<Coordinate point="{0}"/></IndexedFaceSet>',
    ' colorPerVertex="false" colorIndex="{2}"><Color color="{0} {1}"/>',
    ">",
)


def vrml97(
    groups: Sequence[Group],
    about: About,
    coarser: Sequence[Sequence[Group]] = (),
    ranges: Sequence[float] = (),
) -> str:
    """Write the text of a .wrl. Source: ISO/IEC 14772-1:1997.

    coarser : the same ground in less and less detail, levels of a node LOD.
    ranges : for each of these, the distance from the ground's middle at which it begins, metres.
    """
    notes = [f"offset {x:.3f}" for x in about.offset] + [about.crs or "", about.attribution]
    info = ", ".join(_quote(line) for line in notes if line)
    parts = ["#VRML V2.0 utf8", f"WorldInfo {{ title {_quote(about.name)} info [ {info} ] }}"]
    parts.append('NavigationInfo { type [ "EXAMINE", "WALK", "ANY" ] }')
    parts += _nodes((groups, *coarser), about, ranges, _VRML97)
    return "\n".join([*parts, ""])


def x3d(
    groups: Sequence[Group],
    about: About,
    coarser: Sequence[Sequence[Group]] = (),
    ranges: Sequence[float] = (),
) -> str:
    """Write the text of an .x3d, XML: the profile Interchange, or with a node LOD the profile
    Immersive. Source: ISO/IEC 19776-1, X3D 3.3. ``coarser`` and ``ranges`` are as in `vrml97`."""
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
        f'<X3D profile="{"Immersive" if coarser else "Interchange"}" version="3.3">',
        "<head>",
        *(
            f'<meta name="{name}" content={quoteattr(text)}/>'
            for name, text in metas.items()
            if text
        ),
        "</head>",
        "<Scene>",
        '<NavigationInfo type=\'"EXAMINE" "WALK" "ANY"\'/>',
    ]
    parts += _nodes((groups, *coarser), about, ranges, _X3D)
    return "\n".join([*parts, "</Scene>", "</X3D>", ""])


def _nodes(
    levels: Sequence[Sequence[Group]], about: About, ranges: Sequence[float], language: _Language
) -> Iterator[str]:
    """Yield the lines of the viewpoint and of all groups: of one level, or of a node LOD."""
    yield _viewpoint(about, language.viewpoint)
    deep, several = _ground_depth(about), len(levels) > 1
    end_switch, end_level, end_group = language.ends
    if several:
        yield language.switch.format(_middle(about), " ".join(f"{one:.10g}" for one in ranges))
    for number, groups in enumerate(levels):
        prefix = f"level-{number}-" if several else ""
        yield language.level.format(f"{-deep * GRAIN:.10g}", _SCALE)
        for group, name, material, colour in _listed(groups, prefix):
            look = language.look.format(material, colour)
            yield language.group.format(name)
            for own, geometry in _geometries(group, deep, language):
                yield language.shape.format(prefix + own, look, geometry)
                look = language.use.format(material)
            yield end_group
        yield end_level
    if several:
        yield end_switch


def _middle(about: About) -> str:
    """Write the middle of the ground, metres, y up."""
    wide, deep = about.size
    return f"{wide / 2:.10g} 0 {-deep / 2:.10g}"


def _listed(groups: Sequence[Group], prefix: str) -> Iterator[tuple[Group, str, str, str]]:
    """Yield each group with solids, with its name, the name of its material, and its colour; names
    begin with the ``prefix``, since names of nodes occur once in a file."""
    for group in groups:
        if len(group):
            walls, roofs = materials_of(group)
            material = (walls if walls.colour == group.colour else roofs).name
            yield (
                group,
                prefix + _word(group.name),
                prefix + _word(material),
                _numbers(group.colour),
            )


def _numbers(colour: Sequence[float]) -> str:
    return " ".join(f"{c:.4g}" for c in colour)


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


def _geometries(group: Group, deep: int, language: _Language) -> Iterator[tuple[str, str]]:
    """Yield the name and the faces of each solid: walls have four corners, other faces three. A
    solid lists its own points. Where a group has two materials, faces have colours."""
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
    walls, roofs = materials_of(group)
    pair = _numbers(walls.colour), _numbers(roofs.colour)
    two, parts, places = walls != roofs, "", [0] * (len(group) + 1)
    if two:
        face_of = np.concatenate([owner, owners])
        order = np.argsort(face_of, kind="stable")
        is_roof = np.concatenate([np.zeros(len(quads), bool), mesh.part[rows] == ROOF])[order]
        digits = np.full(2 * len(is_roof), ord(" "), np.uint8)
        digits[::2] = ord("0") + is_roof
        parts = digits.tobytes().decode()
        places = np.searchsorted(face_of[order], np.arange(len(group) + 1)).tolist()
    for k, name in enumerate(names_of(group)):
        own = " ".join(points[starts[k] : starts[k + 1]])
        faces_text = " ".join(numbers[ends[k] : ends[k + 1]])
        look = language.bare
        if two:
            look = language.colours.format(*pair, parts[2 * places[k] : 2 * places[k + 1] - 1])
        yield _word(name), language.faces.format(own, faces_text, look)


def _quote(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'
