"""`ShapeForm`: a shape as chromosome: affine maps of the unit square, which is the window."""

import warnings
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from evocity.errors import GenomeError
from evocity.kinds.form import WALL, Form

if TYPE_CHECKING:
    from evocity.shapes import Shape

#: The most pieces of a shape: more take too long to draw.
MOST_PIECES = 200_000
#: The greatest factor of a map on a segment's length: nearer to 1 pieces shrink too slowly.
LEAST_SHRUNK = 0.95
# The free share of the window on each side of a shape in its middle.
_MARGIN = 0.05


@dataclass(frozen=True, eq=False, kw_only=True)
class ShapeForm(Form):
    """Affine ``maps`` ``(N, 2, 3)`` of the unit square, x east, y north; all words act.

    Raises `evocity.shapes.ShapeError` for invalid maps, and names maps that do not contract.
    """

    kind: ClassVar[str] = "shape"
    maps: np.ndarray

    def __post_init__(self):
        object.__setattr__(self, "maps", self.shape.maps)

    @classmethod
    def of(
        cls, shape: "Shape", pixels: int, metres_per_pixel: float, name: str = ""
    ) -> "ShapeForm":
        """Lay a ``shape`` of the plane in the middle of the window, as large as fits. Raises
        `GenomeError` for a shape of space, or with a restricted language."""
        if shape.size != 2 or shape.language != type(shape.language).every(len(shape)):
            problem = "is three-dimensional" if shape.size != 2 else "has a restricted language"
            raise GenomeError(
                f"the shape {name}".rstrip() + f" {problem}",
                "a two-dimensional shape that applies its affine maps in every order",
                "choose another shape, such as sierpinski or koch",
            )
        low, high = shape.box
        scale = (1 - 2 * _MARGIN) / max(float((high - low).max()), 1e-300)
        at = 0.5 - scale * (low + high) / 2
        moved = shape.moved(np.column_stack([scale * np.eye(2), at]))
        return cls(maps=moved.maps, pixels=pixels, metres_per_pixel=metres_per_pixel, name=name)

    @cached_property
    def shape(self) -> "Shape":
        from evocity.shapes import Shape  # reading a run does not need it

        with warnings.catch_warnings():  # `problem` reports unproved contraction
            warnings.simplefilter("ignore")
            return Shape(self.maps)

    @property
    def arrays(self) -> dict[str, np.ndarray]:
        return {"maps": self.maps.ravel()}

    @cached_property
    def problem(self) -> str | None:
        norms = _norms(self.maps)
        if norms.max() > LEAST_SHRUNK:
            return (
                f"map {norms.argmax()} does not contract enough: it scales a segment by up to "
                f"{norms.max():.4g}, and the limit is {LEAST_SHRUNK:g}"
            )
        if self._cells is None:
            return f"more than {MOST_PIECES} pieces of a pixel"
        return None if self.mask.any() else "no piece within the window"

    @cached_property
    def mask(self) -> np.ndarray:
        """Bool ``(pixels, pixels)``, rows from the north: its pixels."""
        mask = np.zeros(self.pixels**2, bool)
        mask[[] if self._cells is None else self._cells] = True
        return mask.reshape(self.pixels, self.pixels)

    @cached_property
    def _cells(self) -> np.ndarray | None:
        """The pixels of its pieces, each smaller than a pixel; None for more than `MOST_PIECES`. It
        goes level by level, and skips pieces outside the window: a bred shape may have any
        number."""
        maps = self.maps
        middle, radius = _ball(maps)
        pieces, found, count = np.eye(2, 3)[None], [], 0
        while len(pieces):
            at = np.einsum("kij,j->ki", pieces[:, :, :2], middle) + pieces[:, :, 2]
            reach = np.sqrt((pieces[:, :, :2] ** 2).sum(axis=2)) * radius
            near = ((at > -reach) & (at < 1 + reach)).all(axis=1)
            pieces, at = pieces[near], at[near]
            fine = (2 * reach[near] * self.pixels < 1).all(axis=1)
            inside = fine & (at >= 0).all(axis=1) & (at < 1).all(axis=1)
            across, up = (at[inside] * self.pixels).astype(np.int64).T
            found.append((self.pixels - 1 - up) * self.pixels + across)
            pieces = pieces[~fine]
            count += np.count_nonzero(fine) + len(pieces) * len(maps)
            if count > MOST_PIECES:
                return None
            parts = np.einsum("kij,njl->knil", pieces[:, :, :2], maps)
            parts[..., 2] += pieces[:, None, :, 2]
            pieces = parts.reshape(-1, 2, 3)
        return np.unique(np.concatenate(found))

    def _heights(self) -> np.ndarray:
        return np.where(self.mask, np.float32(WALL), np.float32(0))


def _norms(maps: np.ndarray) -> np.ndarray:
    """Spectral norms ``(k,)`` of the linear parts of maps ``(k, 2, 3)`` of the plane."""
    a, b, c, d = (maps[:, i, j] for i, j in ((0, 0), (0, 1), (1, 0), (1, 1)))
    whole, turn = a * a + b * b + c * c + d * d, np.abs(a * d - b * c)
    return (np.sqrt(np.maximum(whole + 2 * turn, 0)) + np.sqrt(np.maximum(whole - 2 * turn, 0))) / 2


def _ball(maps: np.ndarray) -> tuple[np.ndarray, float]:
    """Find the middle ``(2,)`` and radius of a small disc that contracting maps take into itself;
    it moves from the mean of the fixed points towards the one that reaches furthest."""
    from evocity.shapes.linear import solve

    fixed = np.stack([solve(np.eye(2) - one[:, :2], one[:, 2]) for one in maps])
    norms, middle = _norms(maps), fixed.mean(axis=0)
    best = middle, np.inf
    for step in range(30):
        at = np.einsum("kij,j->ki", maps[:, :, :2], middle) + maps[:, :, 2]
        reach = np.sqrt(((at - middle) ** 2).sum(axis=1)) / (1 - norms)
        if reach.max() < best[1]:
            best = middle, float(reach.max())
        middle = middle + (fixed[reach.argmax()] - middle) / (step + 3)
    return best


def load_shape(name: str, path) -> "Shape":
    """Load the shape of a known ``name``, or of the file ``path``. Raises `ShapeError`."""
    from evocity.shapes import known
    from evocity.shapes.files import read_shape

    return read_shape(path) if path.is_file() else known(name)
