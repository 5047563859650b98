"""Wavefront OBJ, y up, an object a solid: what Rhino and Blender take."""

from collections.abc import Sequence

import numpy as np

from evocity.formats.solids import WALL, About, Group


def obj(groups: Sequence[Group], about: About) -> str:
    """The text of an .obj. Names and places of the scene are in its comments; colours are those of
    points, which Rhino, Blender and MeshLab take from behind their coordinates."""
    told = [f"evocity: {about.name}", about.attribution]
    told.append(f"offset {about.offset[0]:.3f} {about.offset[1]:.3f} {about.crs or ''}")
    lines = [f"# {' '.join(one.split())}" for one in told if one.strip()]
    base = 1
    for group in groups:
        mesh = group.mesh
        lines.append(f"g {group.name}")
        x, y, z = np.round(mesh.points, 3).T
        colour = " ".join(f"{one:.3g}" for one in group.colour)
        lines += [
            f"v {a:.9g} {b:.9g} {c:.9g} {colour}"
            for a, b, c in zip(x.tolist(), z.tolist(), (-y + 0.0).tolist(), strict=True)
        ]
        lines += _faces(group, base)
        base += len(mesh.points)
    return "\n".join(lines) + "\n"


def _faces(group: Group, base: int) -> list[str]:
    """Lines of the objects of a group, whose points are numbered from ``base`` on: walls have four
    corners, floors and roofs are of triangles."""
    mesh = group.mesh
    walls, owner = mesh.quads
    flat = mesh.part != WALL
    faces = ["f {} {} {} {}".format(*one) for one in (walls + base).tolist()]
    faces += ["f {} {} {}".format(*one) for one in (mesh.triangles[flat] + base).tolist()]
    owners = np.r_[owner, mesh.owner[flat]]
    lines, before = [], -1
    for face in np.argsort(owners, kind="stable").tolist():
        if owners[face] != before:
            before = owners[face]
            lines.append(f"o {group.name}-{before + 1}")
        lines.append(faces[face])
    return lines
