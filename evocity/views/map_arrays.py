"""Checks of the arrays of a map: its heights, and the mask of its site."""

import numpy as np

from evocity.errors import MapError
from evocity.views.limit_tables import read_only


def check_heights(heights: np.ndarray, name: str) -> np.ndarray:
    """Copy the ``heights`` of the map ``name``, float32 ``(H, W)``, read-only. Raises `MapError`
    unless they are finite numbers of 0 or more."""
    try:
        array = np.array(heights, dtype=np.float32, order="C")
    except (TypeError, ValueError):
        array = np.empty(0, np.float32)
    if array.ndim != 2 or array.size == 0:
        raise MapError(
            f"{name}: the array of heights has the shape {array.shape}",
            "an array with two axes and at least one height, with rows from north to south",
            "pass an array with one height per pixel, in metres",
        )
    lowest = array.min()  # NaN if any is NaN
    if not (np.isfinite(lowest) and np.isfinite(array.max())):
        raise MapError(
            f"{name}: {np.count_nonzero(~np.isfinite(array))} heights are NaN or infinite",
            "only finite heights, in metres",
            "replace the unknown heights with 0 (ground) or with a default height",
        )
    if lowest < 0:
        raise MapError(
            f"{name}: {np.count_nonzero(array < 0)} heights are below ground; the lowest is "
            f"{lowest:g} m",
            "only heights above ground, 0 m or more",
            "subtract the terrain from the heights, or set negative heights to 0",
        )
    return read_only(array)


def check_site(site: np.ndarray, shape: tuple[int, int], name: str) -> np.ndarray:
    """Copy the mask of a part of the map ``name``, bool, read-only. Raises `MapError` unless it has
    the ``shape`` of the map, and marks a pixel."""
    array = np.asarray(site)
    if array.dtype != bool or array.shape != shape:
        raise MapError(
            f"{name}: the mask of a part of the map has the type {array.dtype} and the shape "
            f"{array.shape}",
            f"an array of booleans with the shape {shape}, one for each pixel of the map",
            "compare the array with a number to get booleans, for example array > 0",
        )
    if not array.any():
        raise MapError(
            f"{name}: the mask of a part of the map marks no pixel",
            "a mask that is True for at least one pixel",
            "set the mask to True for at least one pixel",
        )
    return read_only(array.copy())
