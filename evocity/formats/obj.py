"""Wavefront OBJ, y up, an object for each solid, for Rhino and Blender."""

from collections.abc import Sequence

import numpy as np

from evocity.formats.solids import WALL, About, Group


def obj(groups: Sequence[Group], about: About) -> str:
    """Write the text of an .obj. Comments have the name and place of the scene; the colours follow
    the coordinates of points, where Rhino, Blender and MeshLab read them."""
    notes = [f"evocity: {about.name}", about.attribution]
    notes.append(f"offset {about.offset[0]:.3f} {about.offset[1]:.3f} {about.crs or ''}")
    lines = [f"# {' '.join(note.split())}" for note in notes if note.strip()]
    base = 1
    for group in groups:
        mesh = group.mesh
        lines.append(f"g {group.name}")
        x, y, z = np.round(mesh.points, 3).T
        colour = " ".join(f"{channel:.3g}" for channel in group.colour)
        lines += [
            f"v {a:.9g} {b:.9g} {c:.9g} {colour}"
            for a, b, c in zip(x.tolist(), z.tolist(), (-y + 0.0).tolist(), strict=True)
        ]
        lines += _faces(group, base)
        base += len(mesh.points)
    return "\n".join(lines) + "\n"


def _faces(group: Group, base: int) -> list[str]:
    """Write the lines of the objects of a group, whose points have numbers from ``base`` on: walls
    have four corners, floors and roofs three."""
    mesh = group.mesh
    walls, owner = mesh.quads
    flat = mesh.part != WALL
    faces = ["f {} {} {} {}".format(*wall) for wall in (walls + base).tolist()]
    faces += ["f {} {} {}".format(*face) for face in (mesh.triangles[flat] + base).tolist()]
    owners = np.r_[owner, mesh.owner[flat]]
    lines, before = [], -1
    for face in np.argsort(owners, kind="stable").tolist():
        if owners[face] != before:
            before = owners[face]
            lines.append(f"o {group.name}-{before + 1}")
        lines.append(faces[face])
    return lines
