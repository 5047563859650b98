"""The courses that a recipe lays through its cities, see ``[[curves]]``."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from evocity.citymap import CityMap
from evocity.errors import EvocityError, GenomeError, blaming
from evocity.forms.curve import CurveForm
from evocity.forms.lines import cut_to, placed, read_line

# Levels of details of a course at most.
_DEEPEST = 8


def courses_of(curves: Sequence[Any], city: CityMap, folder: Path) -> tuple[CurveForm, ...]:
    """The courses of ``[[curves]]``, in the window of a ``city``: each of a line in a file,
    fitted, or straight between two ends. Raises `GenomeError` or `MapError`, which name the entry,
    for one that does not run through the window."""
    found = []
    for number, one in enumerate(curves):
        with blaming(f"curves[{number}]"):
            found.append(_course(one, city, folder))
    return tuple(found)


def _course(one: Any, city: CityMap, folder: Path) -> CurveForm:
    from evocity.shapes import Curve, Detailed

    pixel = city.metres_per_pixel
    side = city.shape[1] * pixel
    if one.width < pixel:
        raise GenomeError(
            f"width = {one.width:g} m, of pixels of {pixel:g} m",
            "a pixel or wider",
            "widen it, or take smaller pixels in [map]",
        )
    line = None
    if one.file is None:
        ends = np.array([one.start, one.end], float)
        share = np.linspace(0, 1, one.points)[:, None]
        points = (1 - share) * ends[0] + share * ends[1]
    else:
        path = (folder / Path(one.file).expanduser()).resolve()
        line, degrees = read_line(path, one.file)
        line = placed(line, degrees, side, city.origin, city.crs, one.file)
        line = cut_to(line, side, one.file)
        points = np.zeros((one.points, 2))  # they are found
    details: tuple[np.ndarray, ...] = ()
    try:
        curve = Curve.bezier(points)
        if line is not None:
            coded = Detailed.of(line, curve.maps, _depth_of(line, one.points, pixel))
            points, details = coded.curve.points, coded.details
    except EvocityError as error:
        raise GenomeError(error.found, error.expected, error.remedy) from None
    course = CurveForm(
        points=points,
        maps=curve.maps,
        details=details,
        breadth=one.width,
        lay=one.lay,
        pixels=city.shape[1],
        metres_per_pixel=pixel,
        origin=city.origin,
        crs=city.crs,
    )
    if course.problem is not None:
        raise GenomeError(
            course.problem,
            f"a course within the window of {side:g} m that does not cross itself",
            "move its ends, or change its number of points",
        )
    return course


def _depth_of(line: np.ndarray, points: int, pixel: float) -> int:
    """So many levels, 1…`_DEEPEST`, that its points follow each other within a pixel."""
    length = float(np.sqrt((np.diff(line, axis=0) ** 2).sum(axis=1)).sum())
    steps = max(1.0, length / pixel / (points - 1))
    return int(np.clip(np.ceil(np.log2(steps)), 1, _DEEPEST))


__all__ = ["courses_of"]
