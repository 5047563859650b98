"""`Site`: a fabric and courses through it as chromosome: a watercourse, a boulevard, an edge."""

from dataclasses import dataclass
from functools import cached_property
from hashlib import blake2b
from typing import ClassVar

import numpy as np

from evocity.citymap import CityMap
from evocity.condensation import Condensation
from evocity.errors import EvocityError
from evocity.genome import FIELDS, Genome
from evocity.kinds.curve_form import CurveForm
from evocity.kinds.form import Form

# Fields of the fabric in a file, besides its arrays.
_OF_FABRIC = ("cities", "sigma_max", "attribution", "origin", "crs", "settle")


@dataclass(frozen=True, eq=False, kw_only=True)
class Site(Form):
    """A ``fabric`` with ``courses`` condensed in it: decoding keeps them, and the fabric grows up
    to them. No course may cut a locked part of the fabric."""

    kind: ClassVar[str] = "site"
    fabric: Genome
    courses: tuple[CurveForm, ...]

    @classmethod
    def of(cls, fabric: Genome, courses: tuple[CurveForm, ...], made=None) -> "Site":
        return cls(
            fabric=fabric,
            courses=tuple(courses),
            pixels=fabric.pavement.width,
            metres_per_pixel=fabric.metres_per_pixel,
            name=" × ".join(fabric.cities),
            attribution=fabric.attribution,
            origin=fabric.origin,
            crs=fabric.crs,
            made=dict(fabric.made if made is None else made),
        )

    @property
    def cities(self) -> tuple[str, ...]:
        return self.fabric.cities

    @property
    def arrays(self) -> dict[str, np.ndarray]:
        fabric = {name: getattr(self.fabric, name) for name in FIELDS}
        return fabric | {"side": self.fabric.pavement.side.astype(np.int16)} | self.course_arrays

    @property
    def course_arrays(self) -> dict[str, np.ndarray]:
        """The arrays of all courses, one after the other."""
        each = [course.arrays for course in self.courses]
        return {f"course_{name}": np.concatenate([one[name] for one in each]) for name in each[0]}

    def _file_content(self) -> tuple[dict[str, np.ndarray], dict]:
        arrays, about = super()._file_content()
        about["fabric"] = {name: getattr(self.fabric, name) for name in _OF_FABRIC}
        if self.fabric.condensation is not None:
            arrays = arrays | {"locked": self.fabric.condensation.raster.ravel()}
        return arrays, about

    @cached_property
    def digest(self) -> str:
        state = blake2b(self.fabric.digest.encode(), digest_size=16)
        for course in self.courses:
            state.update(course.digest.encode())
        return state.hexdigest()

    @cached_property
    def mask(self) -> np.ndarray:
        """Bool ``(pixels, pixels)``, rows from the north: the pixels of courses."""
        return np.logical_or.reduce([course.mask for course in self.courses])

    @cached_property
    def problem(self) -> str | None:
        for course in self.courses:
            if course.problem is not None:
                return course.problem
            locked = self.fabric.condensation
            if locked is not None and (course.mask & locked.mask).any():
                return "a course that cuts a locked part"
        try:
            decoding = self._decoding
        except EvocityError as error:
            return f"{error.found} (expected: {error.expected})"
        if not decoding.converged:
            return f"decoding did not converge: still {decoding.change:.3g} m"
        return None

    @cached_property
    def whole(self) -> Genome:
        """The fabric with the courses as condensation."""
        heights = np.zeros(self.mask.shape, np.float32)
        for course in reversed(self.courses):  # where they meet, the first wins
            heights[course.mask] = course.lay
        layer, locked = Condensation(heights, self.mask), self.fabric.condensation
        return self.fabric.replace(condensation=layer if locked is None else layer.over(locked))

    @cached_property
    def _decoding(self):
        from evocity.coding.decoding_cache import decoded  # reading a run does not need it

        return decoded(self.whole)

    @cached_property
    def city(self) -> CityMap:
        """The map with the courses. Raises `GenomeError` if it is not a valid individual."""
        return self._decoding.city if self.problem is None else super().city

    @cached_property
    def before(self) -> CityMap:
        """The map of the fabric without courses."""
        from evocity.coding.decoding_cache import decoded

        return decoded(self.fabric).city
