"""Buildings of a source city in a face of a plan: samples, cuts, small pieces, gaps to streets."""

import math
from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from weakref import WeakKeyDictionary

import numpy as np
import scipy

from evocity.citymap import CityMap
from evocity.errors import MapError
from evocity.operators.plans.donor import Donor, donor_of
from evocity.operators.plans.gene import FaceGene
from evocity.operators.plans.plan import STRIP, Plan

#: The smallest part of a cut building that may stand, m², and its least share of the building.
LEAST_PIECE, LEAST_SHARE = 60.0, 0.5
#: Widest gap between a wall and the street that the building behind it fills, px.
GAP = 4.0
#: Share of a building that counts as whole.
_WHOLE = 0.95
#: Largest angle between the way to the wall and the way from the street, as a cosine.
_STRAIGHT = 0.8
#: Cut buildings have no tips and no parts that are narrower than this, metres.
SLENDER = 6.0
#: Least length of a tip that is removed, px; rounded corners are shorter.
_TIP = 3
# Ways from a pixel to the walls from which it may be filled, the shortest first. A notch lies a
# pixel and a half farther from a wall than `GAP`.
_NEAR = np.stack(np.meshgrid(np.arange(-5, 6), np.arange(-5, 6), indexing="ij"), -1).reshape(-1, 2)
_SQUARES = (_NEAR**2).sum(axis=1)
_SHIFTS = _NEAR[np.argsort(_SQUARES, kind="stable")]
_SHIFTS = _SHIFTS[1 : np.count_nonzero(_SQUARES <= (GAP + 1.5) ** 2)]


class Lot:
    """The lot of a face in its window, with the distances from its outline.

    window : rows and columns of the window in the map. mask : bool ``(h, w)``, the lot.
    rows, columns : rows and columns of the lot's pixels in the window, ``(n,)``.
    down, along : offsets of these pixels from the centre of the face, metres, ``(n,)``.
    depth : float64 ``(h, w)``, distance in px to the nearest pixel beyond the lot. The map's frame
        is not an outline.
    strip : bool ``(n,)``, pixels within 3 px of the outline.
    cells : the cells of grids in which the lot lies, kept by those who need them.

    A line through the centre divides a lot into two halves (`side`). The line runs across the
    longer of the two directions of the face's walls.
    """

    def __init__(self, plan: Plan, face: int):
        self.window = plan.window(face)
        self.mask = plan.lots[self.window] == face
        self.rows, self.columns = np.nonzero(self.mask)
        self.pixel = plan.metres_per_pixel
        row, column = plan.centre[face - 1]
        self.down = (self.rows + self.window[0].start - row) * self.pixel
        self.along = (self.columns + self.window[1].start - column) * self.pixel
        rows, columns = (slice(max(one.start - 1, 0), one.stop + 1) for one in self.window)
        wider = plan.lots[rows, columns] == face
        inner = tuple(
            slice(one.start - wide.start, one.stop - wide.start)
            for one, wide in zip(self.window, (rows, columns), strict=True)
        )
        if wider.all():
            depth = np.full(wider.shape, np.inf)
            self.inward = np.zeros((2, *self.mask.shape))
        else:
            depth, nearest = scipy.ndimage.distance_transform_edt(wider, return_indices=True)
            away = np.indices(wider.shape) - nearest
            self.inward = (away / np.maximum(depth, 1e-9))[:, *inner]
        self.depth = depth[inner]
        self.strip = (self.depth <= STRIP)[self.mask]
        self.cells: dict[tuple[int, int], tuple] = {}
        self._angle = float(plan.angle[face - 1])

    @cached_property
    def ring(self) -> np.ndarray:
        """Which of the lot's pixels lie within `GAP` of the outline: int64 ``(k,)``."""
        return np.flatnonzero(self.depth[self.rows, self.columns] <= GAP)

    @cached_property
    def ring_inward(self) -> np.ndarray:
        """Unit vectors from the outline to the pixels of `ring`, float64 ``(2, k)``."""
        return np.ascontiguousarray(self.inward[:, self.rows[self.ring], self.columns[self.ring]])

    @cached_property
    def _second(self) -> np.ndarray:
        """Whether each pixel lies in the second half, bool ``(n,)``."""
        ways = self._angle + np.array([0.0, np.pi / 2])
        reach = np.sin(ways)[:, None] * self.down + np.cos(ways)[:, None] * self.along
        return reach[(reach**2).sum(axis=1).argmax()] >= 0

    def side(self, part: int) -> np.ndarray:
        """Mark the pixels of a half, ``part`` 1 or 2, or of the whole lot, 0: bool ``(n,)``."""
        if part == 0:
            return np.ones(self.down.size, bool)
        return self._second if part == 2 else ~self._second


_lots: WeakKeyDictionary[Plan, dict[int, Lot]] = WeakKeyDictionary()


def lot_of(plan: Plan, face: int) -> Lot:
    """Return the `Lot` of a face; a cache keeps it as long as the plan lives."""
    lots = _lots.setdefault(plan, {})
    if face not in lots:
        lots[face] = Lot(plan, face)
    return lots[face]


def lay(plan: Plan, genes: Iterable[FaceGene | None], sources: Mapping[str, CityMap]) -> np.ndarray:
    """Lay the buildings of ``genes`` on the map of a plan.

    genes : genes of faces; other faces, and None, keep the buildings of the plan's own map. A face
        has one gene for the whole lot, or two genes for its halves.
    sources : the maps of the source cities by the names in the genes.

    Returns float32 ``(H, W)``, metres. The same arguments give the same heights bit for bit. Raises
    `MapError` for a gene that does not suit the plan or the sources, for two genes of the same
    ground, and for a half without the other half.
    """
    heights = plan.heights.copy()
    faces: dict[int, list[FaceGene]] = {}
    for gene in genes:
        if gene is None:
            continue
        if gene.source not in sources:
            raise MapError(
                f"the gene of face {gene.face} needs the source city {gene.source}, whose map is "
                "missing",
                f"one of the cities {', '.join(sources)}",
                "pass the map of this city as well",
            )
        gene.check(plan, sources[gene.source])
        faces.setdefault(gene.face, []).append(gene)
    for face, own in faces.items():
        own.sort(key=lambda gene: gene.part)
        parts = [gene.part for gene in own]
        if len(parts) > 1 and parts != [1, 2]:
            raise MapError(
                f"two genes are for face {face}",
                "one gene for each face, or one gene for each half of the face",
                "remove one of the genes",
            )
        if parts in ([1], [2]):
            raise MapError(
                f"a gene names part {parts[0]} of face {face}",
                "genes for both halves, parts 1 and 2",
                "add the gene of the other half",
            )
        lot = lot_of(plan, face)
        donors = [donor_of(sources[gene.source]) for gene in own]
        heights[lot.window][lot.mask] = lay_pieces(lot, own, donors)[0]
    return heights


def lay_pieces(
    lot: Lot, genes: Sequence[FaceGene], donors: Sequence[Donor]
) -> tuple[np.ndarray, np.ndarray]:
    """Lay the buildings of all ``genes`` of a lot, one gene or one for each half in order.

    Returns the heights of the lot's pixels, float32 ``(n,)``, metres, and the number of the gene
    whose building stands there, int8 ``(n,)``; −1 on ground.
    """
    heights = np.zeros(lot.down.size, np.float32)
    whose = np.full(lot.down.size, -1, np.int8)
    for number, (gene, donor) in enumerate(zip(genes, donors, strict=True)):
        new = lay_piece(lot, gene, donor, standing=whose >= 0)
        heights[new > 0], whose[new > 0] = new[new > 0], number
    return heights, whose


def places_of(lot: Lot, gene: FaceGene, source: CityMap) -> tuple[np.ndarray, np.ndarray]:
    """Find the place in the source city of each pixel of a lot: rows and columns, float64
    ``(n,)``, px."""
    down, along = gene.offsets(lot.down, lot.along)
    pixel = source.metres_per_pixel
    return gene.row + down / pixel, gene.column + along / pixel


def lay_piece(
    lot: Lot,
    gene: FaceGene,
    donor: Donor,
    *,
    standing: np.ndarray | None = None,
    least_share: float = LEAST_SHARE,
) -> np.ndarray:
    """Lay the buildings of a donor in a lot: float32 ``(n,)``, the height of each pixel of the lot,
    metres.

    The outline of the lot cuts the buildings; nothing else does. A cut building stands if at
    least ``least_share`` of it and 60 m² remain, without parts and tips that are narrower than 6 m.
    Buildings then grow over gaps of up to 4 px to the outline.

    A gene of a half lays those buildings whole whose larger part lies in the half. They stand where
    nothing of ``standing`` does, bool ``(n,)``, the pixels of the lot that other buildings have.
    """
    numbers = lay_numbers(lot, gene, donor, standing=standing, least_share=least_share)
    return gene.clamp(donor.heights)[numbers]


def lay_numbers(
    lot: Lot,
    gene: FaceGene,
    donor: Donor,
    *,
    standing: np.ndarray | None = None,
    least_share: float = LEAST_SHARE,
) -> np.ndarray:
    """Lay the buildings of a donor in a lot, as `lay_piece` does: int32 ``(n,)``, the number of the
    donor's building on each pixel of the lot, 0 on ground."""
    from evocity.operators.plans._kernels import drop_pieces, fill_gaps

    numbers = np.zeros(lot.mask.shape, np.int32)
    sampled = _sample(lot, gene, donor)
    ring = lot.ring
    free = np.ones(ring.size, bool)
    if gene.part:
        side = lot.side(gene.part)
        size = np.bincount(sampled, minlength=len(donor.heights))
        inside = np.bincount(sampled[side], minlength=size.size)
        keep = 2 * inside > size if gene.part == 1 else 2 * inside >= size
        free = side[ring]
        if standing is not None:
            keep[sampled[standing]] = False
            free &= ~standing[ring]
        keep[0] = False
        sampled[~keep[sampled]] = 0
    pixel = lot.pixel
    numbers[lot.rows, lot.columns] = sampled
    drop_pieces(
        numbers, donor.areas * gene.stretch, pixel, _WHOLE, least_share, LEAST_PIECE / pixel**2,
        max(2, math.ceil(SLENDER / pixel)), _TIP,
    )  # fmt: skip
    if ring.size:
        fill_gaps(
            numbers, lot.rows[ring], lot.columns[ring], lot.ring_inward, free, _SHIFTS, GAP,
            _STRAIGHT,
        )  # fmt: skip
    return numbers[lot.rows, lot.columns]


def _sample(lot: Lot, gene: FaceGene, donor: Donor) -> np.ndarray:
    """Find the polygon that covers most of each pixel of a lot; ground where less than half of the
    pixel is built: int32 ``(n,)``."""
    from evocity.operators.plans._kernels import sample_polygons

    pixel = donor.city.metres_per_pixel
    turns = np.concatenate(gene.offsets(*np.eye(2)))
    found = np.empty(lot.down.size, np.int32)
    # a place is the centre of a pixel
    row, column = (gene.row + 0.5) * pixel, (gene.column + 0.5) * pixel
    sample_polygons(
        donor.numbers, donor.step, lot.down, lot.along, row, column, turns, lot.pixel / 4, found
    )
    return found


__all__ = [
    "GAP",
    "LEAST_PIECE",
    "LEAST_SHARE",
    "SLENDER",
    "Lot",
    "lay",
    "lay_numbers",
    "lay_piece",
    "lay_pieces",
    "lot_of",
    "places_of",
]
