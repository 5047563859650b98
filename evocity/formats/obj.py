"""Wavefront OBJ, y up, an object a solid: what Rhino and Blender take."""

from collections.abc import Sequence

import numpy as np

from evocity.formats.solids import About, Group


def obj(groups: Sequence[Group], about: About) -> str:
    """The text of an .obj. Names and places of the scene are in its comments."""
    told = [f"evocity: {about.name}", about.attribution]
    told.append(f"offset {about.offset[0]:.3f} {about.offset[1]:.3f} {about.crs or ''}")
    lines = [f"# {' '.join(one.split())}" for one in told if one.strip()]
    base = 1
    for group in groups:
        mesh = group.mesh
        lines.append(f"g {group.name}")
        x, y, z = np.round(mesh.points, 3).T
        lines += [
            f"v {a:.3f} {b:.3f} {c:.3f}"
            for a, b, c in zip(x.tolist(), z.tolist(), (-y + 0.0).tolist(), strict=True)
        ]
        order = np.argsort(mesh.owner, kind="stable")
        before = -1
        for owner, face in zip(
            mesh.owner[order].tolist(), (mesh.triangles[order] + base).tolist(), strict=True
        ):
            if owner != before:
                lines.append(f"o {group.name}-{owner + 1}")
                before = owner
            lines.append("f {} {} {}".format(*face))
        base += len(mesh.points)
    return "\n".join(lines) + "\n"
