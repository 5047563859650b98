"""Tilesets of 3D Tiles 1.1: which files hold which boxes, and at which distance."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Content:
    """File of a tile at one level of detail.

    uri : path of the file from the tileset.
    least, most : corners of its box, three numbers each, metres; x to the east, y to the north, z
        up.
    error : metres by which this level differs from the finest, the geometric error.
    """

    uri: str
    least: tuple[float, float, float]
    most: tuple[float, float, float]
    error: float


def tileset(
    tiles: Sequence[Sequence[Content]],
    transform: Sequence[float] | None,
    asset: Mapping[str, Any],
    extras: Mapping[str, Any],
) -> str:
    """Write a tileset.json (OGC 22-025r4, 3D Tiles 1.1), in which finer levels replace coarser
    ones.

    tiles : of each tile, its levels from the coarsest to the finest, at least one.
    transform : 16 numbers, column by column, from the tiles' metres to the globe; None for a map
        without a place.
    asset, extras : further members of the asset; members for other programs.
    """
    children = [_nested(levels) for levels in tiles]
    boxes = [_corners(child["boundingVolume"]["box"]) for child in children]
    error = 2 * max(levels[0].error for levels in tiles) + 1
    root: dict[str, Any] = {
        "boundingVolume": {
            "box": _box(
                np.min([least for least, _ in boxes], axis=0),
                np.max([most for _, most in boxes], axis=0),
            )
        },
        "geometricError": error,
        "refine": "REPLACE",
    }
    if transform is not None:
        root["transform"] = list(transform)
    root["children"] = children
    document = {
        "asset": {"version": "1.1", "generator": "evocity"} | dict(asset),
        "geometricError": 2 * error,
        "root": root,
        "extras": dict(extras),
    }
    return json.dumps(document, ensure_ascii=False, allow_nan=False, indent=1) + "\n"


def _nested(levels: Sequence[Content]) -> dict[str, Any]:
    """Make the tile of the coarsest of the ``levels``, with finer ones below it."""
    first, *finer = levels
    least, most = np.array(first.least), np.array(first.most)
    tile: dict[str, Any] = {"boundingVolume": {}, "geometricError": first.error}
    tile["content"] = {"uri": first.uri}
    if finer:
        child = _nested(finer)
        tile["children"] = [child]
        low, high = _corners(child["boundingVolume"]["box"])
        least, most = np.minimum(least, low), np.maximum(most, high)
    else:
        tile["geometricError"] = 0.0
    tile["boundingVolume"] = {"box": _box(least, most)}
    return tile


def _box(least: np.ndarray, most: np.ndarray) -> list[float]:
    """Write a box along the axes: its middle and its half axes."""
    middle, (x, y, z) = (least + most) / 2, ((most - least) / 2).tolist()
    return [*middle.tolist(), x, 0.0, 0.0, 0.0, y, 0.0, 0.0, 0.0, z]


def _corners(box: Sequence[float]) -> tuple[np.ndarray, np.ndarray]:
    middle, half = np.array(box[:3]), np.array([box[3], box[7], box[11]])
    return middle - half, middle + half
