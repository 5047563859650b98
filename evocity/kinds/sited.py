"""Sites: a fabric, and courses that run through it, bred together."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import ClassVar

import numpy as np
import pyarrow as pa

from evocity.citymap import CityMap
from evocity.columns import array_of
from evocity.condensation import Condensation
from evocity.forms import CurveForm, Site
from evocity.forms.courses import courses_of
from evocity.forms.files import course_arrays, curves_of
from evocity.genome import Genome
from evocity.kinds.fabric import Fabric
from evocity.kinds.kind import Expressed, Window, lists
from evocity.kinds.lined import Curves, faults_of, founder_made, read_as

_FABRIC, _CURVES = Fabric(), Curves()


class Sites:
    """The kind of `Site`: the columns of its fabric, then those of its courses. A birth changes
    one factor: an operator of fabrics the fabric, one of curves the first course or another, drawn
    alike; the other factor is the first parent's."""

    name = "site"
    first = _FABRIC.first[0], ("point_perturbation",)
    usual: ClassVar = _FABRIC.usual | {
        "point_perturbation": {"weight": 8, "step": {"from": 0.01, "to": 0.4}},
        "point_exchange": {"weight": 4},
    }
    subjects = ("city", "curve", "site")
    factors = ("fabric", "curve")
    sources = ("map",)
    stones = _FABRIC.stones

    def fields(self, header) -> list[tuple[str, pa.DataType]]:
        courses = [(f"course_{name}", kind) for name, kind in _CURVES.fields(header)]
        return _FABRIC.fields(header) + courses

    def columns(self, genomes: Sequence[Site | None], header) -> dict[str, pa.Array]:
        fabrics = [None if one is None else one.fabric for one in genomes]
        courses = [None if one is None else one.course_arrays for one in genomes]
        found = _FABRIC.columns(fabrics, header)
        for name, kind in _CURVES.columns_of.items():
            name = f"course_{name}"
            found[name] = lists([None if one is None else one[name] for one in courses], kind)
        return found

    def genome(self, row, header, locked: Condensation | None, made: Mapping) -> Site:
        fabric = _FABRIC.genome(row, header, locked, made)
        names = [f"course_{name}" for name in _CURVES.columns_of]
        arrays = course_arrays({name: array_of(row[name].values) for name in names})
        return Site.of(fabric, curves_of(arrays, _window(header)), made)

    def adopt(
        self, genome: Site, header, locked: Condensation | None, made: Mapping | None = None
    ) -> Site:
        made = genome.made if made is None else made
        courses = tuple(one.replace(**_window(header)) for one in genome.courses)
        return Site.of(_FABRIC.adopt(genome.fabric, header, locked, made), courses, made)

    def faults(self, child, header) -> dict[str, str]:
        found = faults_of(child, Site, header)
        return found or _FABRIC.faults(child.fabric, header)

    def prepare(self, city: CityMap, how: Mapping, locked: Condensation | None):
        return _FABRIC.prepare(city, how, locked)

    def begun(self, parent, folder: Path, window: Window, name: str) -> Site:
        raise NotImplementedError("its parents are maps")

    def called(self, genome: Site, name: str) -> Site:
        return Site.of(_FABRIC.called(genome.fabric, name), genome.courses, genome.made)

    def completed(self, genome, city: CityMap, recipe) -> Site:
        if isinstance(genome, Site):  # it was bred before
            return genome
        return Site.of(genome, courses_of(recipe.curves, city, recipe.folder))

    def read(self, path: Path) -> Site:
        return read_as(Site, path)

    def unsuited(self, genome: Site, window: Window) -> tuple[str, str] | None:
        return _FABRIC.unsuited(genome.fabric, window)

    def founder(self, genome: Site, name: str, settle: bool) -> Site:
        fabric = _FABRIC.founder(genome.fabric, name, settle)
        return Site.of(fabric, genome.courses, founder_made(genome))

    def bred(self, operator, parents: Sequence[Site], rng: np.random.Generator) -> Site:
        first = parents[0]
        if getattr(operator, "of", "fabric") == "fabric":
            child = operator([one.fabric for one in parents], rng)
            return Site.of(child, first.courses) if isinstance(child, Genome) else child
        at = int(rng.integers(len(first.courses))) if len(first.courses) > 1 else 0
        child = operator([one.courses[at] for one in parents], rng)
        if not isinstance(child, CurveForm):
            return child  # the door of the run tells it
        courses = (*first.courses[:at], child.replace(made={}), *first.courses[at + 1 :])
        made = dict(child.made) | ({"course": at} if len(courses) > 1 else {})
        return Site.of(first.fabric, courses, made)

    def fabric(self, genome: Site):
        return genome.fabric

    def express(self, genome: Site) -> Expressed:
        if genome.problem is not None:
            return Expressed(None, genome.problem)
        return Expressed(genome.city, form={"site": genome, "curve": genome.courses[0]})


def _window(header) -> dict:
    return {
        "pixels": header.width,
        "metres_per_pixel": header.metres_per_pixel,
        "origin": header.origin,
        "crs": header.crs,
    }


__all__ = ["Sites"]
