"""The kinds of shapes and curves: a few numbers in a window, without a city."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import ClassVar

import numpy as np
import pyarrow as pa

from evocity.columns import array_of
from evocity.errors import EvocityError, GenomeError, spell
from evocity.kinds.curve_form import CurveForm
from evocity.kinds.form import Form
from evocity.kinds.form_files import form_of, read_form
from evocity.kinds.kind import Expressed, Kind, Window, lists
from evocity.kinds.shape_form import ShapeForm, load_shape

#: The width of a curve's strip in a run of curves, pixels.
_BREADTH = 2.0


class FormKind(Kind):
    """A kind of forms of the class ``form``. Its columns are lists of `Form.arrays`; it ignores
    ``locked``."""

    form: type[Form]
    columns_of: Mapping[str, np.dtype]
    name: str
    ancestry_columns = ()

    def __init_subclass__(cls) -> None:
        cls.subjects = ("city", cls.name)
        cls.factors = cls.sources = (cls.name,)

    def fields(self, header) -> list[tuple[str, pa.DataType]]:
        return [
            (name, pa.list_(pa.from_numpy_dtype(kind))) for name, kind in self.columns_of.items()
        ]

    def columns(self, genomes: Sequence[Form | None], header) -> dict[str, pa.Array]:
        arrays = [None if genome is None else genome.arrays for genome in genomes]
        return {
            name: lists([None if each is None else each[name] for each in arrays], kind)
            for name, kind in self.columns_of.items()
        }

    def genome(self, row, header, locked, made: Mapping) -> Form:
        arrays = {name: array_of(row[name].values) for name in self.columns_of}
        return form_of(self.name, arrays, _common(header) | {"made": made})

    def adopt(self, genome: Form, header, locked, made: Mapping | None = None) -> Form:
        return genome.replace(**_common(header), made=genome.made if made is None else made)

    def faults(self, child, header) -> dict[str, str]:
        return faults_of(child, self.form, header)

    def rename(self, genome: Form, name: str) -> Form:
        return genome.replace(name=name)

    def read(self, path: Path) -> Form:
        return read_as(self.form, path)

    def window_mismatch(self, genome: Form, window: Window) -> tuple[str, str] | None:
        own = Window(genome.pixels, genome.metres_per_pixel)
        return None if own == window else (str(own), str(window))

    def founder(self, genome: Form, name: str, settle: bool | str) -> Form:
        return genome.replace(name=name, made=founder_provenance(genome))

    def express(self, genome: Form) -> Expressed:
        if genome.problem is not None:
            return Expressed(None, genome.problem)
        return Expressed(genome.city, form={self.name: genome})


class Shapes(FormKind):
    """The kind of `ShapeForm`: maps of the unit square, which is the window."""

    name, form = "shape", ShapeForm
    columns_of: ClassVar = {"maps": np.dtype(np.float64)}
    first_operators = ("shape_metamorphosis", "map_exchange"), ("map_perturbation",)
    default_operators: ClassVar = {
        "map_perturbation": {"weight": 4, "step": {"from": 0.01, "to": 0.3}},
        "map_exchange": {"weight": 1},
        "shape_metamorphosis": {"weight": 1},
    }

    def make_parent(self, parent, folder: Path, window: Window, name: str) -> ShapeForm:
        shape = load_shape(parent.shape, (folder / Path(parent.shape).expanduser()).resolve())
        return ShapeForm.of(shape, window.pixels, window.metres_per_pixel, name)


class Curves(FormKind):
    """The kind of `CurveForm`: control points in metres, and maps."""

    name, form = "curve", CurveForm
    columns_of: ClassVar = {
        "points": np.dtype(np.float64),
        "maps": np.dtype(np.float64),
        "sizes": np.dtype(np.int16),
        "laid": np.dtype(np.float64),
        "details": np.dtype(np.float64),
    }
    first_operators = ("curve_metamorphosis", "point_exchange"), ("point_perturbation",)
    default_operators: ClassVar = {
        "point_perturbation": {"weight": 3, "step": {"from": 0.002, "to": 0.15}},
        "part_perturbation": {"weight": 2, "step": {"from": 0.005, "to": 0.2}},
        "point_exchange": {"weight": 1},
        "curve_metamorphosis": {"weight": 1},
    }

    def make_parent(self, parent, folder: Path, window: Window, name: str) -> CurveForm:
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
    """Read the form of a file, of this class. Raises `GenomeError`."""
    form = read_form(path)
    if not isinstance(form, kind):
        raise GenomeError(
            f"the file {path} holds a {form.kind}",
            f"the file of a {kind.kind}, because the run breeds {kind.kind}s",
            f"name the file of a {kind.kind}",
        )
    return form


def faults_of(child, kind: type[Form], header) -> dict[str, str]:
    """List what of a ``child`` does not suit the run, see `Kind.faults`."""
    if not isinstance(child, kind):
        return {f"a child that is {spell(child)}": f"a {kind.__name__}"}
    expected = Window(header.width, header.metres_per_pixel)
    own = Window(child.pixels, child.metres_per_pixel)
    return {} if own == expected else {f"a child of {own}": f"{expected}, as the run"}


def founder_provenance(genome) -> dict:
    """Return the ``made`` of an earlier genome that founds a run."""
    return {"operator": "source", "bred": dict(genome.made)}


def _common(header) -> dict:
    name, attribution = " × ".join(header.cities), header.attribution
    return window_fields(header) | {"name": name, "attribution": attribution}


def window_fields(header) -> dict:
    """Return the window of a run as fields of `Form`."""
    return {
        "pixels": header.width,
        "metres_per_pixel": header.metres_per_pixel,
        "origin": header.origin,
        "crs": header.crs,
    }
