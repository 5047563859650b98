"""Buildings on the ground of a surface: CityJSON whose buildings stand on a relief."""

import dataclasses
import json
import os
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
import scipy

from evocity.errors import MapError
from evocity.formats import cityjson
from evocity.io.writers import check_place, open_output

if TYPE_CHECKING:
    from evocity.scene.building import Scene

#: The most cells of the ground along an axis.
MOST_CELLS = 100


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


def write_on_relief(scene: "Scene", relief: Relief, path: str | os.PathLike) -> None:
    """Write a ``scene`` without streets as ``.city.json``, with its buildings on a ``relief``.

    The ground becomes a `TINRelief` of triangles. The floor of each building lies at the lowest
    ground below its corners, so that no building hovers. If the scene and the relief have the same
    reference system, both keep their coordinates. If one of them has no reference system, the
    north-west height of the relief lies on the north-west corner of the map.

    Raises `MapError` for a scene with streets, for another suffix, for a relief of another
    reference system, and for a relief that does not cover the map.
    """
    path = Path(path)
    if scene.streets or scene.lod == "0" or not path.name.lower().endswith(".city.json"):
        raise MapError(
            f"a relief cannot be used with streets, with footprints, or with the file {path.name}",
            "a scene of solids without streets, and a file name that ends in .city.json",
            "leave streets out, or write .city.json",
        )
    check_place(path)
    groups, about = scene.placed()
    credits = dict.fromkeys(filter(None, (about.attribution, relief.attribution)))
    about = dataclasses.replace(about, attribution="; ".join(credits))
    document = stand_on(json.loads(cityjson(groups, about)), relief)
    text = json.dumps(document, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    with open_output(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def stand_on(document: dict[str, Any], relief: Relief) -> dict[str, Any]:
    """Return a CityJSON ``document`` whose objects stand on the ``relief``; raises `MapError` as
    `write_on_relief`."""
    scale, (left, bottom, _) = document["transform"]["scale"][0], document["transform"]["translate"]
    vertices = np.array(document["vertices"], np.int64).reshape(-1, 3)
    points = vertices[:, :2] * scale + (left, bottom)
    low, high = points.min(axis=0), points.max(axis=0)
    heights = _sampler(relief, _code_of(document), (low, high))
    at = np.round(heights(points) / scale).astype(np.int64)
    objects, found, count = {}, [], 0
    for name, given in document["CityObjects"].items():
        if given["type"] == "LandUse" and name.startswith("ground"):
            continue
        corners = np.unique(np.array(_numbers(given["geometry"]), np.int64))
        base = at[corners].min()
        number = dict(zip(corners.tolist(), range(count, count + len(corners)), strict=True))
        objects[name] = given | {"geometry": _renumbered(given["geometry"], number)}
        found.append(vertices[corners] + (0, 0, base))
        count += len(corners)
    own, triangles = _triangulated(heights, low, high, relief.surface.spacing)
    own = np.round((own - (left, bottom, 0)) / scale).astype(np.int64)
    ground = {"type": "CompositeSurface", "lod": "1", "boundaries": (triangles + count).tolist()}
    ground["boundaries"] = [[face] for face in ground["boundaries"]]
    objects["ground"] = {"type": "TINRelief", "geometry": [ground]}
    vertices = np.concatenate([*found, own])
    extent = document["metadata"]["geographicalExtent"]
    extent[2], extent[5] = (
        float(end * scale) for end in (vertices[:, 2].min(), vertices[:, 2].max())
    )
    return document | {"CityObjects": objects, "vertices": vertices.tolist()}


def _code_of(document: dict[str, Any]) -> str | None:
    system = document["metadata"].get("referenceSystem", "")
    found = re.search(r"/crs/(\w+)/\w+/(\w+)$", system)
    return f"{found[1]}:{found[2]}" if found else None


def _sampler(relief: Relief, crs: str | None, box: tuple[np.ndarray, np.ndarray]):
    """Return a function from places ``(k, 2)`` to heights, bilinear; raises `MapError`."""
    surface, (x, y) = relief.surface, relief.corner
    if crs is None or relief.crs is None:
        x, y = box[0][0], box[1][1]
    elif crs != relief.crs:
        raise MapError(
            f"the relief has the reference system {relief.crs}, and the scene has {crs}",
            "a relief in the reference system of the scene",
            f"convert the raster of the ground, for example with gdalwarp -t_srs {crs}",
        )
    heights, (down, across) = surface.heights(), surface.spacing
    rows, columns = (np.arange(side) for side in heights.shape)
    places = np.array([[box[0][0], box[1][1]], [box[1][0], box[0][1]]])
    reached = np.column_stack([(y - places[:, 1]) / down, (places[:, 0] - x) / across])
    # a pixel beyond the outer heights belongs to the raster; a map without a common system turns
    shape = np.array(heights.shape)
    slack = np.ones(2) if crs is not None and crs == relief.crs else 1 + 0.05 * shape
    if (reached < -slack).any() or (reached > shape - 1 + slack).any():
        raise MapError(
            "the relief does not cover the map",
            f"a relief from {box[0].tolist()} to {box[1].tolist()}",
            "fit a surface to a larger raster of the ground",
        )
    grid = scipy.interpolate.RegularGridInterpolator((rows, columns), heights)

    def sample(points: np.ndarray) -> np.ndarray:
        place = np.column_stack([(y - points[:, 1]) / down, (points[:, 0] - x) / across])
        return grid(np.clip(place, 0, np.array(heights.shape) - 1))

    return sample


def _triangulated(heights, low: np.ndarray, high: np.ndarray, spacing: tuple[float, float]):
    """Triangulate the ground between two corners: points ``(k, 3)``, triangles ``(t, 3)``."""
    cells = [
        min(MOST_CELLS, max(1, round(float(side) / step)))
        for side, step in zip(high - low, spacing[::-1], strict=True)
    ]
    x, y = (np.linspace(low[k], high[k], cells[k] + 1) for k in range(2))
    places = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    corner = np.arange(len(places)).reshape(len(y), len(x))
    a, b, c, d = (
        corner[rows, columns].ravel()
        for rows, columns in (
            (slice(None, -1), slice(None, -1)), (slice(None, -1), slice(1, None)),
            (slice(1, None), slice(1, None)), (slice(1, None), slice(None, -1)),
        )
    )  # fmt: skip
    triangles = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    return np.column_stack([places, heights(places)]), triangles


def _numbers(geometry: list[dict[str, Any]]) -> list[int]:
    found: list[int] = []
    stack: list[Any] = [one["boundaries"] for one in geometry]
    while stack:
        node = stack.pop()
        if isinstance(node, list):
            stack += node
        else:
            found.append(node)
    return found


def _renumbered(geometry: list[dict[str, Any]], number: dict[int, int]) -> list[dict[str, Any]]:
    def renumber(node: Any) -> Any:
        return [renumber(below) for below in node] if isinstance(node, list) else number[node]

    return [own | {"boundaries": renumber(own["boundaries"])} for own in geometry]
