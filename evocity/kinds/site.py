"""The kind of sites: a fabric and courses through it, bred together."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import ClassVar

import numpy as np
import pyarrow as pa

from evocity.citymap import CityMap
from evocity.columns import array_of
from evocity.condensation import Condensation
from evocity.genome import Genome
from evocity.kinds.courses import courses_of
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

_FABRIC, _CURVES = Fabric(), Curves()


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

    def founder(self, genome: Site, name: str, settle: bool) -> Site:
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
