"""Scenes on the ground of a surface: buildings stand on a relief, and streets follow the relief."""

import dataclasses
import os
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
import scipy
import shapely

from evocity.errors import MapError
from evocity.formats import About, Group
from evocity.formats import Relief as GroupRelief
from evocity.formats.materials import is_surface
from evocity.scene.cutting import cut_at_grid
from evocity.scene.export import check_suffix, write

if TYPE_CHECKING:
    from evocity.scene.building import Scene

#: The most cells of the ground along an axis.
MOST_CELLS = 100
#: Suffixes of files whose scenes may stand on a relief.
SUFFIXES = (".city.json", ".glb", ".obj", ".wrl", ".x3d", ".dxf", ".3dm")


class HeightGrid(Protocol):
    """Heights of ground on a grid, as `evocity.shapes.DetailedSurface`."""

    @property
    def spacing(self) -> tuple[float, float]:
        """Distances between rows and between columns, metres."""

    def heights(self) -> np.ndarray:
        """Compute heights, float64 ``(H, W)``, metres, from the north-west corner."""


class Relief(Protocol):
    """A grid of heights with its place on Earth, as `evocity.shapes.StoredSurface`."""

    @property
    def surface(self) -> HeightGrid: ...
    @property
    def crs(self) -> str | None: ...
    @property
    def corner(self) -> tuple[float, float]: ...
    @property
    def attribution(self) -> str: ...


def write_on_relief(
    scene: "Scene", relief: Relief, path: str | os.PathLike, **how: Any
) -> tuple[float, float]:
    """Write a ``scene`` with its buildings on a ``relief``, and return the lowest and the highest
    height of the ground. The suffix of ``path`` is one of `SUFFIXES`; ``how`` holds the options of
    `Scene.write`.

    The ground and the streets follow the relief in triangles. The floor of each building lies at
    the lowest ground below its outline, so that no building hovers. If the scene and the relief
    have the same reference system, both keep their coordinates. If one of them has no reference
    system, the north-west height of the relief lies on the north-west corner of the map.

    Raises `MapError` for a scene of footprints, for another suffix, for a relief of another
    reference system, and for a relief that does not cover the map.
    """
    path = Path(path)
    check_relief(path, scene.lod)
    groups, about = scene.placed()
    credits = dict.fromkeys(filter(None, (about.attribution, relief.attribution)))
    about = dataclasses.replace(about, attribution="; ".join(credits))
    raised = stand_on(groups, about, relief)
    write(raised, about, path, **how)
    ground = [group.mesh.points[:, 2] for group in raised if group.is_draped and len(group)]
    return float(min(own.min() for own in ground)), float(max(own.max() for own in ground))


def check_relief(path: Path, lod: str) -> None:
    """Raise `MapError` for a file or a level of detail without a relief."""
    suffix = check_suffix(path)
    if suffix not in SUFFIXES or lod == "0":
        found = "footprints" if lod == "0" else f"the file {path.name}"
        raise MapError(
            f"a relief cannot be used with {found}",
            f"a level of detail with solids, and a file name that ends in {', '.join(SUFFIXES)}",
            "choose another level of detail or suffix, or leave the relief out",
        )


def stand_on(groups: Sequence[Group], about: About, relief: Relief) -> list[Group]:
    """Return the ``groups`` of a scene on the ``relief``; raises `MapError` as
    `write_on_relief`."""
    size = np.array(about.size)
    heights = _sampler(relief, about)
    cells = [
        min(MOST_CELLS, max(1, round(float(side) / step)))
        for side, step in zip(size, relief.surface.spacing[::-1], strict=True)
    ]
    lines = [np.linspace(0, side, count + 1) for side, count in zip(size, cells, strict=True)]
    step = float((size / cells).min())
    found = []
    for group in groups:
        outlines = shapely.segmentize(group.polygons, step)
        points, of = shapely.get_coordinates(outlines, return_index=True)
        lift = np.full(len(group), np.inf)
        np.minimum.at(lift, of, heights(points))
        own = GroupRelief(lift, heights)
        if is_surface(group):
            pieces, row = cut_at_grid(group.polygons, *lines)
            own = dataclasses.replace(own, pieces=pieces, of=row)
        found.append(dataclasses.replace(group, relief=own))
    return found


def _code_of(about: About) -> str | None:
    named = about.grid[0] if about.grid is not None else about.crs or ""
    return named if re.fullmatch(r"\w+:\w+", named) else None


def _sampler(relief: Relief, about: About) -> Callable[[np.ndarray], np.ndarray]:
    """Return a function from places ``(k, 2)``, metres from the corner of the scene, to the heights
    of the relief there, bilinear; raises `MapError`."""
    crs = _code_of(about)
    surface, (x, y) = relief.surface, relief.corner
    offset, size = np.array(about.offset), np.array(about.size)
    is_placed = crs is not None and relief.crs is not None
    if is_placed and crs != relief.crs:
        raise MapError(
            f"the relief has the reference system {relief.crs}, and the scene has {crs}",
            "a relief in the reference system of the scene",
            f"convert the raster of the ground, for example with gdalwarp -t_srs {crs}",
        )
    if not is_placed:
        x, y = offset[0], offset[1] + size[1]
    convert = about.grid[1] if is_placed and about.grid is not None else None
    heights, (down, across) = surface.heights(), surface.spacing
    shape = np.array(heights.shape)
    grid = scipy.interpolate.RegularGridInterpolator([np.arange(side) for side in shape], heights)

    def index(points: np.ndarray) -> np.ndarray:
        places = points + offset
        if convert is not None:
            places = convert(places)
        return np.column_stack([(y - places[:, 1]) / down, (places[:, 0] - x) / across])

    reached = index(np.array([[0, 0], [0, 1], [1, 0], [1, 1]]) * size)
    # a pixel beyond the outer heights belongs to the raster; a map without a common system turns
    slack = np.ones(2) if is_placed else 1 + 0.05 * shape
    if (reached < -slack).any() or (reached > shape - 1 + slack).any():
        corners = [offset.tolist(), (offset + size).tolist()]
        raise MapError(
            "the relief does not cover the map",
            f"a relief from {corners[0]} to {corners[1]}",
            "fit a surface to a larger raster of the ground",
        )

    def sample(points: np.ndarray) -> np.ndarray:
        return grid(np.clip(index(points), 0, shape - 1)) if len(points) else np.zeros(0)

    return sample
