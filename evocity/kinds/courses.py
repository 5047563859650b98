"""Courses of a recipe's ``[[curves]]``: lines of files, or straight, as curves in its cities."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from evocity.citymap import CityMap
from evocity.errors import EvocityError, GenomeError, blame
from evocity.kinds.curve_form import CurveForm
from evocity.kinds.window_lines import cut_to_window, place_line, read_line

# The most levels of details of a course.
_DEEPEST = 8


def courses_of(curves: Sequence[Any], city: CityMap, folder: Path) -> tuple[CurveForm, ...]:
    """Make the courses of ``[[curves]]`` in the window of a ``city``: each fitted to a line in a
    file, or straight between two ends. Raises `GenomeError` or `MapError`, which name the entry,
    for a course that does not run through the window."""
    courses = []
    for number, section in enumerate(curves):
        with blame(f"curves[{number}]"):
            courses.append(_course(section, city, folder))
    return tuple(courses)


def _course(section: Any, city: CityMap, folder: Path) -> CurveForm:
    from evocity.shapes import Curve, Detailed

    pixel = city.metres_per_pixel
    side = city.shape[1] * pixel
    if section.width < pixel:
        raise GenomeError(
            f"width = {section.width:g} m is less than a pixel of {pixel:g} m",
            "at least one pixel",
            "increase width, or choose smaller pixels in [map]",
        )
    line = None
    if section.file is None:
        ends = np.array([section.start, section.end], float)
        share = np.linspace(0, 1, section.points)[:, None]
        points = (1 - share) * ends[0] + share * ends[1]
    else:
        path = (folder / Path(section.file).expanduser()).resolve()
        line, degrees = read_line(path, section.file)
        line = place_line(line, degrees, side, city.origin, city.crs, section.file)
        line = cut_to_window(line, side, section.file)
        points = np.zeros((section.points, 2))  # fitted below
    details: tuple[np.ndarray, ...] = ()
    try:
        curve = Curve.bezier(points)
        if line is not None:
            coded = Detailed.of(line, curve.maps, _depth_of(line, section.points, pixel))
            points, details = coded.curve.points, coded.details
    except EvocityError as error:
        raise GenomeError(error.found, error.expected, error.remedy) from None
    course = CurveForm(
        points=points,
        maps=curve.maps,
        details=details,
        breadth=section.width,
        lay=section.lay,
        pixels=city.shape[1],
        metres_per_pixel=pixel,
        origin=city.origin,
        crs=city.crs,
    )
    if course.problem is not None:
        raise GenomeError(
            course.problem,
            f"a course within the window of {side:g} m that does not cross itself",
            "move its ends, or choose another number of points",
        )
    return course


def _depth_of(line: np.ndarray, points: int, pixel: float) -> int:
    """Choose the number of levels, 1…`_DEEPEST`, at which points follow each other within a
    pixel."""
    length = float(np.sqrt((np.diff(line, axis=0) ** 2).sum(axis=1)).sum())
    steps = max(1.0, length / pixel / (points - 1))
    return int(np.clip(np.ceil(np.log2(steps)), 1, _DEEPEST))
