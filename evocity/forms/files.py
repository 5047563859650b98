"""Forms read from Parquet, as `Form.write` writes them: one row, a list a column; what describes
them stands in the schema's metadata."""

import json
import os
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from evocity.columns import array_of
from evocity.condensation import Condensation
from evocity.errors import GenomeError
from evocity.forms.curve import CurveForm, details_of, flat
from evocity.forms.form import ABOUT, TOLD, VERSION, Form
from evocity.forms.shape import ShapeForm
from evocity.forms.site import Site
from evocity.genome import FIELDS, Genome
from evocity.pavement import Pavement


def is_form(path: str | os.PathLike) -> bool:
    """Whether a file is a form's."""
    try:
        return ABOUT in (pq.read_schema(path).metadata or {})
    except (OSError, pa.ArrowInvalid):
        return False


def read_form(path: str | os.PathLike) -> Form:
    """The form of a file. Raises `GenomeError`, or `ShapeError`, for what is none."""
    try:
        table = pq.read_table(path)
        about = json.loads(table.schema.metadata[ABOUT])
        if about["version"] != VERSION:
            raise GenomeError(
                f"{Path(path).name}: version {about['version']} of forms",
                f"version {VERSION}",
                "update evocity",
            )
        arrays = {
            name: array_of(table[name].combine_chunks()[0].values) for name in table.column_names
        }
        common = {name: about[name] for name in TOLD}
        common["made"] = about["made"]
        common["origin"] = common["origin"] and tuple(map(float, common["origin"]))
        if about["kind"] == "site":
            return _site(arrays, about, common)
        return form_of(about["kind"], arrays, common)
    except (
        OSError,
        pa.ArrowException,
        LookupError,
        TypeError,
        ValueError,
        AttributeError,
    ) as error:
        raise GenomeError(
            f"{path} is no form that can be read ({type(error).__name__}: {error})",
            "a Parquet file that evocity wrote, of a shape, a curve or a site",
            "name another, or bring it back from a copy",
        ) from None


def form_of(kind: str, arrays: Mapping[str, np.ndarray], common: Mapping) -> Form:
    """The shape or the curve of these ``arrays``, as `Form.arrays` tells them; ``common`` is what
    all forms have. Raises ValueError, TypeError or LookupError for damage."""
    if kind == "shape":
        return ShapeForm(maps=arrays["maps"].reshape(-1, 2, 3), **common)
    if kind == "curve":
        (curve,) = curves_of(arrays, common)
        return curve
    raise ValueError(f"a form of kind {kind!r}")


def curves_of(arrays: Mapping[str, np.ndarray], common: Mapping) -> tuple[CurveForm, ...]:
    """The curves whose arrays follow each other. Raises as `form_of`."""
    sizes, laid = arrays["sizes"].reshape(-1, 3).astype(int), arrays["laid"].reshape(-1, 2)
    points, maps, details = (arrays[name] for name in ("points", "maps", "details"))
    found = []
    for (count, parts, depth), (breadth, lay) in zip(sizes.tolist(), laid.tolist(), strict=True):
        own, points = points[: 2 * count], points[2 * count :]
        ours, maps = maps[: parts * count**2], maps[parts * count**2 :]
        inner = details_of(details, count, parts, depth)
        details = details[flat(inner).size :]
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
        raise ValueError("numbers of curves that are too many, or none")
    return tuple(found)


def course_arrays(arrays: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Those of a site's courses, as `curves_of` takes them."""
    return {n.removeprefix("course_"): one for n, one in arrays.items() if n.startswith("course_")}


def _site(arrays: Mapping[str, np.ndarray], about: Mapping, common: Mapping) -> Site:
    told, pixels = about["fabric"], common["pixels"]
    locked = None
    if "locked" in arrays:
        locked = Condensation.from_raster(arrays["locked"].reshape(pixels, pixels))
    fabric = Genome(
        Pavement(pixels, pixels, arrays["side"]),
        **{name: arrays[name] for name in FIELDS},
        metres_per_pixel=common["metres_per_pixel"],
        condensation=locked,
        made=common["made"],
        **told | {"origin": common["origin"]},
    )
    own = {key: common[key] for key in ("pixels", "metres_per_pixel", "origin", "crs")}
    return Site.of(fabric, curves_of(course_arrays(arrays), own), common["made"])


__all__ = ["course_arrays", "curves_of", "form_of", "is_form", "read_form"]
