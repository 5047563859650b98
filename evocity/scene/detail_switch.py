"""Scenes of one code at several zooms, in one file that shows one of them by the distance.

The papers propose fractal zoom for continuous levels of detail (Marsault 2002 §5.4, 2005 §2.4).
VRML97 and X3D have the node LOD for such levels.
"""

import dataclasses
import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from evocity import formats
from evocity.errors import MapError
from evocity.io.writers import check_place, open_output
from evocity.scene.building import Scene

_FORMATS = {".wrl": formats.vrml97, ".x3d": formats.x3d}
#: The distance from which the second level is shown, in sides of the ground; each further level
#: begins at twice the distance of the previous one.
FIRST_RANGE = 0.75


def write_levels(
    scenes: Sequence[Scene],
    path: str | os.PathLike,
    *,
    ranges: Sequence[float] | None = None,
    crs: str | None = None,
) -> tuple[float, ...]:
    """Write ``scenes`` of one ground, the finest first, to a .wrl or .x3d file with a node LOD.

    scenes : two or more scenes, for example of one genome at the zooms 2, 1 and 0.5.
    ranges : rising distances of the viewer from the middle of the ground, metres: at the first, the
        second scene replaces the first, and so on. By default, .75 of the ground's larger side,
        then 1.5, 3, … sides.
    crs : reference system of the coordinates, as in `Scene.write`.

    Returns the ranges. Raises `MapError` for a single scene, scenes of different sizes, another
    suffix, or ranges that are not rising distances, one fewer than scenes.
    """
    path = Path(path)
    if path.suffix.lower() not in _FORMATS:
        raise MapError(
            f"{path.name}: levels cannot be written to {path.suffix or 'a file without a suffix'}",
            "a name that ends in .wrl (VRML97) or .x3d",
            "choose another file name, or write one file for each level",
        )
    sizes = [tuple(round(length, 6) for length in scene.about.size) for scene in scenes]
    if len(scenes) < 2 or len(set(sizes)) > 1:
        raise MapError(
            f"scenes of {' and '.join(f'{w:g} × {d:g} m' for w, d in sizes) or 'nothing'}",
            "two or more scenes of one ground",
            "decode one genome at several zooms, for example 0.5, 1 and 2",
        )
    if ranges is None:
        ranges = [FIRST_RANGE * max(sizes[0]) * 2**k for k in range(len(scenes) - 1)]
    numbers = np.asarray(ranges, float)
    if (
        numbers.shape != (len(scenes) - 1,)
        or not np.isfinite(numbers).all()
        or not (np.diff(numbers, prepend=0.0) > 0).all()
    ):
        raise MapError(
            f"ranges = {list(ranges)}",
            f"{len(scenes) - 1} rising distances above 0 m",
            "leave the ranges out, or give one fewer than scenes",
        )
    check_place(path)
    placed = [scene.placed(crs) for scene in scenes]
    (groups, about), coarser = placed[0], [groups for groups, _ in placed[1:]]
    credits = dict.fromkeys(one.attribution for _, one in placed if one.attribution)
    about = dataclasses.replace(about, attribution="; ".join(credits))
    text = _FORMATS[path.suffix.lower()](groups, about, coarser, numbers.tolist())
    with open_output(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return tuple(numbers.tolist())
