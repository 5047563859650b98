"""Wavefront OBJ, y up, an object for each solid, and its materials, for Rhino and Blender."""

from collections.abc import Sequence

import numpy as np

from evocity.formats.facets import pair_walls
from evocity.formats.materials import is_surface, materials_of, names_of
from evocity.formats.solids import ROOF, About, Group, Mesh
from evocity.formats.trees import mesh_of


def obj(groups: Sequence[Group], about: About, materials: str = "") -> str:
    """Write the text of an .obj. Comments have the name and place of the scene. The colours of
    classes also follow the coordinates of points, where Rhino, Blender and MeshLab read them.

    materials : name of the .mtl file beside it (`mtl`); without a name, the text names no file.
    """
    place = f"offset {about.offset[0]:.3f} {about.offset[1]:.3f} {about.crs or ''}"
    lines = _comments(about, place)
    if materials:
        lines.append(f"mtllib {materials}")
    base = 1
    for group in groups:
        mesh = mesh_of(group)
        lines.append(f"g {_word(group.name)}")
        x, y, z = np.round(mesh.points, 3).T
        colour = " ".join(f"{channel:.3g}" for channel in group.colour)
        lines += [
            f"v {a:.9g} {b:.9g} {c:.9g} {colour}"
            for a, b, c in zip(x.tolist(), z.tolist(), (-y + 0.0).tolist(), strict=True)
        ]
        lines += _faces(group, mesh, base)
        base += len(mesh.points)
    return "\n".join(lines) + "\n"


def mtl(groups: Sequence[Group], about: About) -> str:
    """Write the text of the .mtl file of an .obj: its materials. The roughness also is an exponent
    of highlights, for programs without physical materials."""
    lines = _comments(about)
    listed = (one for group in groups if len(group) for one in materials_of(group))
    for one in dict.fromkeys(listed):
        colour = " ".join(f"{channel:.4g}" for channel in one.colour)
        shine = 1000 * (1 - one.roughness) ** 2
        lines += ["", f"newmtl {_word(one.name)}", f"Kd {colour}", "Ks 0.05 0.05 0.05"]
        lines += [f"Ns {shine:.4g}", f"Pr {one.roughness:g}", "d 1", "illum 2"]
    return "\n".join(lines) + "\n"


def _comments(about: About, *more: str) -> list[str]:
    """Return the name and the attribution of a scene, and ``more`` notes, as lines of comments."""
    notes = (f"evocity: {about.name}", about.attribution, *more)
    return [f"# {' '.join(note.split())}" for note in notes if note.strip()]


def _faces(group: Group, mesh: Mesh, base: int) -> list[str]:
    """Write the lines of the objects of a group, whose points have numbers from ``base`` on: walls
    have four corners, floors and roofs three."""
    quads, owner, threes, rows = pair_walls(mesh)
    faces = ["f {} {} {} {}".format(*wall) for wall in (quads + base).tolist()]
    faces += ["f {} {} {}".format(*face) for face in (threes + base).tolist()]
    owners = np.r_[owner, mesh.owner[rows]]
    walls, roofs = (_word(one.name) for one in materials_of(group))
    roof = np.r_[np.zeros(len(quads), bool), mesh.part[rows] == ROOF] & (walls != roofs)
    whole = is_surface(group)
    names = [group.name] * len(group) if whole else names_of(group)
    lines: list[str] = []
    order = np.lexsort([roof, owners])
    if whole:
        owners = np.zeros_like(owners)
    keys = (owners * 2 + roof)[order].tolist()
    before = (-1, -1)
    for face, key in zip(order.tolist(), keys, strict=True):
        if (now := (key // 2, key % 2)) != before:
            if now[0] != before[0]:
                lines.append(f"o {_word(names[now[0]])}")
            lines.append(f"usemtl {roofs if now[1] else walls}")
            before = now
        lines.append(faces[face])
    return lines


def _word(text: str) -> str:
    """Join the words of a name, which end names in this format."""
    return "_".join(text.split())
