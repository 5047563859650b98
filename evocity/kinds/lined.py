"""Shapes and curves: a few numbers in a window, without any city."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import ClassVar

import numpy as np
import pyarrow as pa

from evocity.columns import array_of
from evocity.errors import EvocityError, GenomeError, shown
from evocity.forms import CurveForm, Form, ShapeForm, read_form
from evocity.forms.files import form_of
from evocity.forms.shape import named_shape
from evocity.kinds.kind import Expressed, Window, lists

#: Pixels that a curve is laid wide, in a run of curves alone.
_BREADTH = 2.0


class Lined:
    """A kind of forms that are no fabric: ``form`` is their class. Its columns are lists, those of
    `Form.arrays`; what is locked is no matter of theirs."""

    form: type[Form]
    columns_of: Mapping[str, np.dtype]
    name: str
    stones = ()

    @property
    def subjects(self) -> tuple[str, ...]:
        return ("city", self.name)

    @property
    def factors(self) -> tuple[str, ...]:
        return (self.name,)

    @property
    def sources(self) -> tuple[str, ...]:
        return (self.name,)

    def fields(self, header) -> list[tuple[str, pa.DataType]]:
        return [
            (name, pa.list_(pa.from_numpy_dtype(kind))) for name, kind in self.columns_of.items()
        ]

    def columns(self, genomes: Sequence[Form | None], header) -> dict[str, pa.Array]:
        arrays = [None if one is None else one.arrays for one in genomes]
        return {
            name: lists([None if one is None else one[name] for one in arrays], kind)
            for name, kind in self.columns_of.items()
        }

    def genome(self, row, header, locked, made: Mapping) -> Form:
        arrays = {name: array_of(row[name].values) for name in self.columns_of}
        return form_of(self.name, arrays, _common(header) | {"made": made})

    def adopt(self, genome: Form, header, locked, made: Mapping | None = None) -> Form:
        return genome.replace(**_common(header), made=genome.made if made is None else made)

    def faults(self, child, header) -> dict[str, str]:
        return faults_of(child, self.form, header)

    def prepare(self, city, how: Mapping, locked) -> Form:
        raise NotImplementedError("its parents are no maps")

    def called(self, genome: Form, name: str) -> Form:
        return genome.replace(name=name)

    def completed(self, genome: Form, city, recipe) -> Form:
        return genome

    def read(self, path: Path) -> Form:
        return read_as(self.form, path)

    def unsuited(self, genome: Form, window: Window) -> tuple[str, str] | None:
        own = Window(genome.pixels, genome.metres_per_pixel)
        return None if own == window else (str(own), str(window))

    def founder(self, genome: Form, name: str, settle: bool) -> Form:
        return genome.replace(name=name, made=founder_made(genome))

    def bred(self, operator, parents: Sequence[Form], rng: np.random.Generator):
        return operator(parents, rng)

    def fabric(self, genome: Form) -> None:
        return None

    def express(self, genome: Form) -> Expressed:
        if genome.problem is not None:
            return Expressed(None, genome.problem)
        return Expressed(genome.city, form={self.name: genome})


class Shapes(Lined):
    """The kind of `ShapeForm`: maps of the unit square, which is the window."""

    name, form = "shape", ShapeForm
    columns_of: ClassVar = {"maps": np.dtype(np.float64)}
    first = ("shape_metamorphosis", "map_exchange"), ("map_perturbation",)
    usual: ClassVar = {
        "map_perturbation": {"weight": 4, "step": {"from": 0.01, "to": 0.3}},
        "map_exchange": {"weight": 1},
        "shape_metamorphosis": {"weight": 1},
    }

    def begun(self, parent, folder: Path, window: Window, name: str) -> ShapeForm:
        shape = named_shape(parent.shape, (folder / Path(parent.shape).expanduser()).resolve())
        return ShapeForm.of(shape, window.pixels, window.metres_per_pixel, name)


class Curves(Lined):
    """The kind of `CurveForm`: control points in metres, and maps."""

    name, form = "curve", CurveForm
    columns_of: ClassVar = {
        "points": np.dtype(np.float64),
        "maps": np.dtype(np.float64),
        "sizes": np.dtype(np.int16),
        "laid": np.dtype(np.float64),
        "details": np.dtype(np.float64),
    }
    first = ("curve_metamorphosis", "point_exchange"), ("point_perturbation",)
    usual: ClassVar = {
        "point_perturbation": {"weight": 3, "step": {"from": 0.002, "to": 0.15}},
        "part_perturbation": {"weight": 2, "step": {"from": 0.005, "to": 0.2}},
        "point_exchange": {"weight": 1},
        "curve_metamorphosis": {"weight": 1},
    }

    def begun(self, parent, folder: Path, window: Window, name: str) -> CurveForm:
        from evocity.shapes import Curve

        try:
            curve = Curve.bezier(np.array(parent.curve, float))
        except EvocityError as error:
            raise GenomeError(f"{name}: {error.found}", error.expected, error.remedy) from None
        return CurveForm(
            points=curve.points,
            maps=curve.maps,
            breadth=_BREADTH * window.metres_per_pixel,
            pixels=window.pixels,
            metres_per_pixel=window.metres_per_pixel,
            name=name,
        )


def read_as(kind: type[Form], path: Path) -> Form:
    """The form in a file, of this class. Raises `GenomeError`."""
    found = read_form(path)
    if not isinstance(found, kind):
        raise GenomeError(
            f"{path} is a {found.kind}", f"a {kind.kind}, as the run breeds", "name another"
        )
    return found


def faults_of(child, kind: type[Form], header) -> dict[str, str]:
    """What of a ``child`` does not suit the run, see `Kind.faults`."""
    if not isinstance(child, kind):
        return {f"a child that is {shown(child)}": f"a {kind.__name__}"}
    faults, wanted = {}, Window(header.width, header.metres_per_pixel)
    own = Window(child.pixels, child.metres_per_pixel)
    if own != wanted:
        faults[f"a child of {own}"] = f"{wanted}, as the run"
    return faults


def founder_made(genome) -> dict:
    """``made`` of one that was bred before, and begins a run."""
    return {"operator": "source", "bred": dict(genome.made)}


def _common(header) -> dict:
    """What all forms of a run have alike."""
    return {
        "pixels": header.width,
        "metres_per_pixel": header.metres_per_pixel,
        "name": " × ".join(header.cities),
        "attribution": header.attribution,
        "origin": header.origin,
        "crs": header.crs,
    }


__all__ = ["Curves", "Lined", "Shapes", "faults_of", "founder_made", "read_as"]
