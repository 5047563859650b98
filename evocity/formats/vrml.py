"""VRML97, which the papers write (Marsault 2002 §5.6), and X3D, which came after it; y up."""

from collections.abc import Sequence
from xml.sax.saxutils import quoteattr

import numpy as np

from evocity.formats.solids import WALL, About, Group


def vrml97(groups: Sequence[Group], about: About) -> str:
    """The text of a .wrl: a Shape a group. Source: ISO/IEC 14772-1:1997."""
    told = [f"offset {x:.3f}" for x in about.offset] + [about.crs or "", about.attribution]
    shown = ", ".join(_quoted(line) for line in told if line)
    parts = ["#VRML V2.0 utf8", f"WorldInfo {{ title {_quoted(about.name)} info [ {shown} ] }}"]
    parts.append('NavigationInfo { type [ "EXAMINE", "WALK", "ANY" ] }')
    parts.append(_viewpoint(about))
    for group in groups:
        if len(group.mesh.triangles):
            points, faces = _lists(group)
            colour = " ".join(f"{c:.4g}" for c in group.colour)
            parts.append(
                f"DEF {_word(group.name)} Shape {{\n"
                f"appearance Appearance {{ material Material {{ diffuseColor {colour} }} }}\n"
                "geometry IndexedFaceSet { creaseAngle 0\n"
                f"coord Coordinate {{ point [\n{points}\n] }}\ncoordIndex [\n{faces}\n] }}\n}}"
            )
    return "\n".join(parts) + "\n"


def x3d(groups: Sequence[Group], about: About) -> str:
    """The text of an .x3d, XML, profile Interchange. Source: ISO/IEC 19776-1, X3D 3.3."""
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
    ]
    for group in groups:
        if len(group.mesh.triangles):
            points, faces = _lists(group)
            colour = " ".join(f"{c:.4g}" for c in group.colour)
            parts.append(
                f'<Shape DEF="{_word(group.name)}">'
                f'<Appearance><Material diffuseColor="{colour}"/></Appearance>\n'
                f'<IndexedFaceSet creaseAngle="0" coordIndex="{faces}">'
                f'<Coordinate point="{points}"/></IndexedFaceSet></Shape>'
            )
    return "\n".join([*parts, "</Scene>", "</X3D>", ""])


def _viewpoint(about: About) -> str:
    wide, deep = about.size
    away = max(wide, deep)
    return (
        f"Viewpoint {{ position {wide / 2:.2f} {away:.2f} {0.6 * away:.2f} "
        'orientation 1 0 0 -0.785 description "from the south" }'
    )


def _lists(group: Group) -> tuple[str, str]:
    """Points, and faces by their numbers: walls of four corners, floors and roofs of three."""
    mesh = group.mesh
    walls, _ = mesh.quads
    flat = mesh.triangles[mesh.part != WALL]
    used, index = np.unique(np.r_[walls.ravel(), flat.ravel()], return_inverse=True)
    walls, flat = index[: walls.size].reshape(-1, 4), index[walls.size :].reshape(-1, 3)
    x, y, z = np.round(mesh.points[used], 3).T
    points = ",\n".join(
        f"{a:g} {b:g} {c:g}" if max(a, b, -c) < 1000 else f"{a:.3f} {b:.3f} {c:.3f}"
        for a, b, c in zip(x.tolist(), z.tolist(), (-y + 0.0).tolist(), strict=True)
    )
    faces = [f"{a} {b} {c} {d} -1" for a, b, c, d in walls.tolist()]
    faces += [f"{a} {b} {c} -1" for a, b, c in flat.tolist()]
    return points, "\n".join(faces)


def _quoted(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'


def _word(text: str) -> str:
    return "".join(c if c.isascii() and c.isalnum() else "_" for c in text)
