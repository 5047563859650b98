"""The reader of forms in Parquet, as `Form.write` writes them: one row, a list in each column, and
the description in the schema's metadata."""

import json
import os
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq

from evocity.citymap import MAX_PIXELS
from evocity.columns import array_of
from evocity.condensation import Condensation
from evocity.errors import GenomeError, spell
from evocity.genome import FIELDS, Genome, read_genome
from evocity.genome.reader import DAMAGE, changed_error, genome_in, open_chromosome
from evocity.kinds.curve_form import CurveForm, flatten_details, split_details
from evocity.kinds.form import ABOUT, DESCRIBED, VERSION, Form
from evocity.kinds.shape_form import ShapeForm
from evocity.kinds.site_form import Site
from evocity.pavement import Pavement
from evocity.sealed_parquet import ChangedFileError


def read_chromosome(path: str | os.PathLike) -> Genome | Form:
    """Read the chromosome of a file, of any kind. Raises `GenomeError`, or `ShapeError`."""
    try:
        with open_chromosome(path) as file:
            if ABOUT in (file.schema_arrow.metadata or {}):
                return _form_in(file, path)
            return genome_in(file, Path(path))
    except DAMAGE:
        return read_genome(path)  # describes the damage


def read_form(path: str | os.PathLike) -> Form:
    """Read the form of a file. Raises `GenomeError`, or `ShapeError`, for other files."""
    try:
        with open_chromosome(path) as file:
            return _form_in(file, path)
    except ChangedFileError as error:
        raise changed_error(path, error) from None
    except DAMAGE as error:
        raise _not_form(path, error) from None


def _not_form(path: str | os.PathLike, error: BaseException) -> GenomeError:
    return GenomeError(
        f"{path} cannot be read as a shape, a curve or a site ({type(error).__name__}: "
        f"{str(error)[:200]})",
        "a Parquet file that evocity wrote for a shape, a curve or a site",
        "name another file, or restore this file from a copy",
    )


def _form_in(file: pq.ParquetFile, path: str | os.PathLike) -> Form:
    try:
        about = json.loads(file.schema_arrow.metadata[ABOUT])
        if about["version"] != VERSION:
            raise GenomeError(
                f"{Path(path).name} has the unknown file version {spell(about['version'])}",
                f"a file of a shape, a curve or a site, with the version {VERSION}",
                "update evocity, or write the file again",
            )
        size = file.metadata
        groups = map(size.row_group, range(size.num_row_groups))
        columns = [group.column(k) for group in groups for k in range(group.num_columns)]
        if size.num_rows != 1 or any(column.num_values > MAX_PIXELS for column in columns):
            raise ValueError(f"{size.num_rows} rows, or too many values")
        table = file.read()
        arrays = {
            name: array_of(table[name].combine_chunks()[0].values) for name in table.column_names
        }
        common = {name: about[name] for name in DESCRIBED}
        common["made"] = about["made"]
        common["origin"] = common["origin"] and tuple(map(float, common["origin"]))
        if about["kind"] == "site":
            return _site(arrays, about, common)
        return form_of(about["kind"], arrays, common)
    except DAMAGE as error:
        raise _not_form(path, error) from None


def form_of(kind: str, arrays: Mapping[str, np.ndarray], common: Mapping) -> Form:
    """Make the shape or the curve of ``arrays`` of `Form.arrays`; ``common``: the fields of all
    forms. Raises ValueError, TypeError or LookupError for damaged arrays."""
    if kind == "shape":
        return ShapeForm(maps=arrays["maps"].reshape(-1, 2, 3), **common)
    if kind == "curve":
        (curve,) = curves_of(arrays, common)
        return curve
    raise ValueError(f"a form of kind {kind!r}")


def curves_of(arrays: Mapping[str, np.ndarray], common: Mapping) -> tuple[CurveForm, ...]:
    """Make the curves whose arrays follow each other. Raises as `form_of`."""
    sizes, laid = arrays["sizes"].reshape(-1, 3).astype(int), arrays["laid"].reshape(-1, 2)
    points, maps, details = (arrays[name] for name in ("points", "maps", "details"))
    found = []
    for (count, parts, depth), (breadth, lay) in zip(sizes.tolist(), laid.tolist(), strict=True):
        own, points = points[: 2 * count], points[2 * count :]
        ours, maps = maps[: parts * count**2], maps[parts * count**2 :]
        inner = split_details(details, count, parts, depth)
        details = details[flatten_details(inner).size :]
        found.append(
            CurveForm(
                details=inner,
                points=own.reshape(count, 2),
                maps=ours.reshape(parts, count, count),
                breadth=breadth,
                lay=lay,
                **common,
            )
        )
    if points.size or maps.size or details.size or not found:
        raise ValueError("too many numbers of curves, or no curve")
    return tuple(found)


def course_arrays(arrays: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Select the arrays of a site's courses, for `curves_of`."""
    prefix = "course_"
    return {n.removeprefix(prefix): array for n, array in arrays.items() if n.startswith(prefix)}


def _site(arrays: Mapping[str, np.ndarray], about: Mapping, common: Mapping) -> Site:
    described, pixels = about["fabric"], common["pixels"]
    locked = None
    if "locked" in arrays:
        locked = Condensation.from_raster(arrays["locked"].reshape(pixels, pixels))
    fabric = Genome(
        Pavement(pixels, pixels, arrays["side"]),
        **{name: arrays[name] for name in FIELDS},
        metres_per_pixel=common["metres_per_pixel"],
        condensation=locked,
        made=common["made"],
        **described | {"origin": common["origin"]},
    )
    own = {key: common[key] for key in ("pixels", "metres_per_pixel", "origin", "crs")}
    return Site.of(fabric, curves_of(course_arrays(arrays), own), common["made"])
