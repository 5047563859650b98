"""Buildings of a source city in a face of a plan: samples, cuts, small pieces, gaps to streets."""

from collections.abc import Iterable, Mapping

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
#: Teeth and notches that are narrower than this square are smoothed away.
_SQUARE = np.ones((3, 3), bool)
#: Samples for each pixel, along a side.
_SAMPLES = 2


class Lot:
    """The lot of a face in its window, with the distances from its outline.

    window : rows and columns of the window in the map. mask : bool ``(h, w)``, the lot.
    rows, columns : rows and columns of the lot's pixels in the window, ``(n,)``.
    down, along : offsets of these pixels from the centre of the face, metres, ``(n,)``.
    depth : float64 ``(h, w)``, distance in px to the nearest pixel beyond the lot. The map's frame
        is not an outline.
    strip : bool ``(n,)``, pixels within 3 px of the outline.
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


def lay(plan: Plan, genes: Iterable[FaceGene | None], sources: Mapping[str, CityMap]) -> np.ndarray:
    """Lay the buildings of ``genes`` on the map of a plan.

    genes : genes of faces; other faces, and None, keep the buildings of the plan's own map.
    sources : the maps of the source cities by the names in the genes.

    Returns float32 ``(H, W)``, metres. The same arguments give the same heights bit for bit. Raises
    `MapError` for a gene that does not suit the plan or the sources, and for two genes of a face.
    """
    heights, faces = plan.heights.copy(), set()
    for gene in genes:
        if gene is None:
            continue
        if gene.source not in sources:
            raise MapError(
                f"the gene of face {gene.face} names the source city {gene.source}",
                f"one of the cities {', '.join(sources)}",
                "pass the map of this city, too",
            )
        gene.check(plan, sources[gene.source])
        if gene.face in faces:
            raise MapError(
                f"two genes name face {gene.face}", "one gene a face", "remove one of the genes"
            )
        faces.add(gene.face)
        lot = Lot(plan, gene.face)
        heights[lot.window][lot.mask] = lay_piece(lot, gene, donor_of(sources[gene.source]))
    return heights


def places_of(lot: Lot, gene: FaceGene, source: CityMap) -> tuple[np.ndarray, np.ndarray]:
    """Find the place in the source city of each pixel of a lot: rows and columns, float64
    ``(n,)``, px."""
    down, along = gene.offsets(lot.down, lot.along)
    pixel = source.metres_per_pixel
    return gene.row + down / pixel, gene.column + along / pixel


def lay_piece(lot: Lot, gene: FaceGene, donor: Donor) -> np.ndarray:
    """Lay the buildings of a donor in a lot: float32 ``(n,)``, the height of each pixel of the lot,
    metres.

    The outline of the lot cuts the buildings; nothing else does. A cut building stands if half of
    it and 60 m² remain. Buildings then grow over gaps of up to 4 px to the outline.
    """
    numbers = np.zeros(lot.mask.shape, np.int32)
    numbers[lot.mask] = _sample(lot, gene, donor)
    _drop_pieces(numbers, lot.pixel, gene.scale, donor)
    _fill_gaps(numbers, lot)
    return donor.heights[numbers[lot.mask]]


def _sample(lot: Lot, gene: FaceGene, donor: Donor) -> np.ndarray:
    """Find the polygon that covers most of each pixel of a lot; ground where less than half of the
    pixel is built: int32 ``(n,)``."""
    pixel = donor.city.metres_per_pixel
    steps = ((np.arange(_SAMPLES) + 0.5) / _SAMPLES - 0.5) * lot.pixel
    seen = []
    for down in steps:
        for along in steps:
            offsets = gene.offsets(lot.down + down, lot.along + along)
            # a place is the centre of a pixel
            rows = offsets[0] + (gene.row + 0.5) * pixel
            columns = offsets[1] + (gene.column + 0.5) * pixel
            seen.append(donor.numbers_at(rows, columns))
    first, second, third, fourth = np.sort(np.maximum(seen, 0), axis=0)
    pair = np.where(first == second, first, np.where(third == fourth, third, second))
    most = np.where((second == third) | (pair == 0), third, pair)
    return np.where(third > 0, most, 0).astype(np.int32)


def _drop_pieces(numbers: np.ndarray, pixel: float, scale: float, donor: Donor) -> None:
    """Remove those parts of cut buildings that are too small."""
    present = np.bincount(numbers.ravel(), minlength=1) * pixel**2
    least = LEAST_PIECE / pixel**2
    boxes = scipy.ndimage.find_objects(numbers)
    for number in np.flatnonzero(present[1:]) + 1:
        whole = donor.areas[number] * scale**2
        if present[number] >= _WHOLE * whole:
            continue
        box = boxes[number - 1]
        here = numbers[box] == number
        if present[number] < LEAST_SHARE * whole:
            numbers[box][here] = 0
            continue
        parts, _ = scipy.ndimage.label(here)
        small = np.bincount(parts.ravel()) < least
        numbers[box][here & small[parts]] = 0


def _fill_gaps(numbers: np.ndarray, lot: Lot) -> None:
    """Let buildings grow over narrow gaps towards the outline of the lot."""
    built = numbers > 0
    gap = lot.mask & ~built & (lot.depth <= GAP)
    if not (gap.any() and built.any()):
        return
    distance, nearest = scipy.ndimage.distance_transform_edt(~built, return_indices=True)
    away = (nearest - np.indices(built.shape)) / np.maximum(distance, 1e-9)
    straight = (away * lot.inward).sum(axis=0) >= _STRAIGHT
    full = built | (gap & straight & (distance <= GAP))
    # fronts without teeth and without notches
    full = scipy.ndimage.binary_closing(full, _SQUARE) & (gap | built)
    full = scipy.ndimage.binary_opening(full, _SQUARE) | built
    gap = full & ~built
    numbers[gap] = numbers[nearest[0][gap], nearest[1][gap]]


__all__ = ["GAP", "LEAST_PIECE", "LEAST_SHARE", "Lot", "lay", "lay_piece", "places_of"]
