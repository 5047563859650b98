"""Scenes in another reference system than that of their map."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import shapely
from pyproj import CRS

from evocity.citymap import CityMap
from evocity.formats import About, Copies, Group
from evocity.io.export.reference_systems import corners
from evocity.io.projection import code_of, is_metric, portable_code, transform_points
from evocity.io.rasterization import crs_of

Convert = Callable[[np.ndarray], np.ndarray]


def reproject_scene(
    groups: Sequence[Group], about: About, city: CityMap, target: CRS
) -> tuple[tuple[Group, ...], About]:
    """Convert the ``groups`` of a scene of ``city`` to the metres of ``target``.

    Coordinates count from a new corner, whole metres in ``target``: `About.offset`. Heights stay as
    they are. Points that solids share stay shared.
    """
    placed, moved = _converter(city, target), reproject_about(about, city, target)

    def convert(points: np.ndarray) -> np.ndarray:
        at = placed(points[:, :2] + about.offset) - moved.offset
        return np.column_stack([at, points[:, 2:]])

    return tuple(_reproject_group(group, convert) for group in groups), moved


def reproject_about(about: About, city: CityMap, target: CRS) -> About:
    """Convert the place of a scene of ``city`` to ``target``: a corner of whole metres, or of
    degrees."""
    placed = _converter(city, target)
    edges = placed(corners(city))
    corner, end = edges.min(axis=0), edges.max(axis=0)
    if not target.is_geographic:
        corner, end = np.floor(corner), np.ceil(end)
    wide, deep = end - corner
    (middle,) = placed(np.array([about.window[:2]]))
    return replace(
        about,
        crs=portable_code(target) if is_metric(target) else code_of(target),
        offset=(float(corner[0]), float(corner[1])),
        size=(float(wide), float(deep)),
        window=(float(middle[0]), float(middle[1]), about.window[2]),
        grid=None,
    )


def _converter(city: CityMap, target: CRS) -> Convert:
    """Return the function that converts points of ``city`` to ``target``."""
    own = crs_of(city, city.name)
    return lambda points: np.column_stack(transform_points(points[:, 0], points[:, 1], own, target))


def _reproject_group(group: Group, convert: Convert) -> Group:
    polygons = shapely.transform(group.polygons, convert)
    copies = None if group.copies is None else _reproject_copies(group.copies, convert)
    roofs, kerbs = group.roofs, group.kerbs
    if roofs is not None:
        roofs = replace(roofs, points=convert(roofs.points))
    if kerbs is not None:
        kerbs = shapely.transform(kerbs, convert)
    return replace(group, polygons=polygons, copies=copies, roofs=roofs, kerbs=kerbs)


def _reproject_copies(copies: Copies, convert: Convert) -> Copies:
    """Convert the places of ``copies``, and turn and scale them as the projection does there."""
    places = convert(copies.places)
    east = convert(copies.places + np.array([1.0, 0.0])) - places
    scales = copies.scales.copy()
    scales[:, :2] *= np.hypot(*east.T)[:, None]
    turns = copies.turns + np.arctan2(east[:, 1], east[:, 0])
    return replace(copies, places=places, scales=scales, turns=turns % (2 * math.pi))
