"""The kind of sites: a fabric and courses through it, bred together; courses of a recipe."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pyarrow as pa

from evocity.citymap import CityMap
from evocity.columns import array_of
from evocity.condensation import Condensation
from evocity.errors import EvocityError, GenomeError, blame
from evocity.genome import Genome
from evocity.kinds.curve_form import CurveForm
from evocity.kinds.fabric import Fabric
from evocity.kinds.form_files import course_arrays, curves_of
from evocity.kinds.kind import Expressed, Kind, Window, lists
from evocity.kinds.shape_and_curve import (
    Curves,
    faults_of,
    founder_provenance,
    read_as,
    window_fields,
)
from evocity.kinds.site_form import Site
from evocity.kinds.window_lines import cut_to_window, place_line, read_line

_FABRIC, _CURVES = Fabric(), Curves()
# The most levels of details of a course.
_DEEPEST = 8


class Sites(Kind):
    """The kind of `Site`: the columns of its fabric, then those of its courses. A birth changes
    one factor: an operator of fabrics the fabric, an operator of curves a random course; the other
    factor is the first parent's."""

    name = "site"
    first_operators = _FABRIC.first_operators[0], ("point_perturbation",)
    default_operators: ClassVar = _FABRIC.default_operators | {
        "point_perturbation": {"weight": 8, "step": {"from": 0.01, "to": 0.4}},
        "point_exchange": {"weight": 4},
    }
    subjects = ("city", "curve", "site")
    factors = ("fabric", "curve")
    sources = ("map",)
    ancestry_columns = _FABRIC.ancestry_columns

    def fields(self, header) -> list[tuple[str, pa.DataType]]:
        courses = [(f"course_{name}", kind) for name, kind in _CURVES.fields(header)]
        return _FABRIC.fields(header) + courses

    def columns(self, genomes: Sequence[Site | None], header) -> dict[str, pa.Array]:
        fabrics = [None if site is None else site.fabric for site in genomes]
        courses = [None if site is None else site.course_arrays for site in genomes]
        columns = _FABRIC.columns(fabrics, header)
        for name, kind in _CURVES.columns_of.items():
            name = f"course_{name}"
            columns[name] = lists([None if each is None else each[name] for each in courses], kind)
        return columns

    def genome(self, row, header, locked: Condensation | None, made: Mapping) -> Site:
        fabric = _FABRIC.genome(row, header, locked, made)
        names = [f"course_{name}" for name in _CURVES.columns_of]
        arrays = course_arrays({name: array_of(row[name].values) for name in names})
        return Site.of(fabric, curves_of(arrays, window_fields(header)), made)

    def adopt(
        self, genome: Site, header, locked: Condensation | None, made: Mapping | None = None
    ) -> Site:
        made = genome.made if made is None else made
        courses = tuple(course.replace(**window_fields(header)) for course in genome.courses)
        return Site.of(_FABRIC.adopt(genome.fabric, header, locked, made), courses, made)

    def faults(self, child, header) -> dict[str, str]:
        return faults_of(child, Site, header) or _FABRIC.faults(child.fabric, header)

    def prepare(self, city: CityMap, how: Mapping, locked: Condensation | None):
        return _FABRIC.prepare(city, how, locked)

    def rename(self, genome: Site, name: str) -> Site:
        return Site.of(_FABRIC.rename(genome.fabric, name), genome.courses, genome.made)

    def complete(self, genome, city: CityMap, recipe) -> Site:
        if isinstance(genome, Site):  # an earlier individual
            return genome
        return Site.of(genome, courses_of(recipe.curves, city, recipe.folder))

    def read(self, path: Path) -> Site:
        return read_as(Site, path)

    def window_mismatch(self, genome: Site, window: Window) -> tuple[str, str] | None:
        return _FABRIC.window_mismatch(genome.fabric, window)

    def founder(self, genome: Site, name: str, settle: bool | str) -> Site:
        fabric = _FABRIC.founder(genome.fabric, name, settle)
        return Site.of(fabric, genome.courses, founder_provenance(genome))

    def breed(self, operator, parents: Sequence[Site], rng: np.random.Generator) -> Site:
        first = parents[0]
        if getattr(operator, "of", "fabric") == "fabric":
            child = operator([parent.fabric for parent in parents], rng)
            return Site.of(child, first.courses) if isinstance(child, Genome) else child
        at = int(rng.integers(len(first.courses))) if len(first.courses) > 1 else 0
        child = operator([parent.courses[at] for parent in parents], rng)
        if not isinstance(child, CurveForm):
            return child  # admission reports it
        courses = (*first.courses[:at], child.replace(made={}), *first.courses[at + 1 :])
        made = dict(child.made) | ({"course": at} if len(courses) > 1 else {})
        return Site.of(first.fabric, courses, made)

    def fabric(self, genome: Site):
        return genome.fabric

    def express(self, genome: Site) -> Expressed:
        if genome.problem is not None:
            return Expressed(None, genome.problem)
        return Expressed(genome.city, form={"site": genome, "curve": genome.courses[0]})


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
            f"the width of the curve, {section.width:g} m, is less than the side of a pixel, "
            f"{pixel:g} m",
            "a width of at least one pixel",
            "increase the width of the curve, or choose smaller pixels in [map]",
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
