"""An endless plane of quarters between streets: `QuarterPlane`."""

import contextlib
from collections import OrderedDict
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy

from evocity import isometries
from evocity.citymap import CityMap
from evocity.growth.avenues import Avenues, District
from evocity.growth.quarters import draw_places, fill_quarter, find_mouths
from evocity.growth.repetition import Windows
from evocity.growth.shares import Shares
from evocity.operators.plans.donor import Donor, donor_of
from evocity.operators.plans.gene import FaceGene
from evocity.operators.plans.laying import lot_of
from evocity.operators.plans.plan import Plan, centres_of

# Districts in the cache, some 100 MB.
_DISTRICTS = 256
# Kind of the draws of quarters; those of avenues have other kinds.
_QUARTERS = 14


@dataclass(frozen=True, eq=False)
class Laid:
    """A district with buildings: its quarters, their genes, and heights in its window, metres.

    owners : number of the original of each quarter. front : built share of the strip along the
    outline of each quarter, 0…1. forced : quarters without any candidate, which stay open.
    """

    district: District
    genes: list[FaceGene | None]
    owners: np.ndarray
    centres: np.ndarray
    heights: np.ndarray
    front: np.ndarray


class QuarterPlane:
    """An endless plane of quarters, a function of seed and place, around the first original.

    Avenues divide the plane into districts, and streets divide each district into quarters
    (`evocity.growth.avenues`). A quarter shows the buildings of one place of an original, turned to
    the quarter's streets. ``sides`` are the smallest and the largest side of quarters, px. The
    attributes that `Growth` reads are those of `evocity.growth.plane.Plane`.
    """

    def __init__(
        self,
        cities: Sequence[CityMap],
        cell: int,
        sides: tuple[float, float],
        shares: Shares,
        seed: int,
        *,
        candidates: int,
        turned: bool,
    ):
        self.cities, self.cell, self.shares, self.seed = tuple(cities), cell, shares, seed
        self._candidates, self._turned = candidates, turned
        first = cities[0]
        counts = np.array([np.array(city.shape) // cell for city in cities])
        self.sides = np.column_stack([counts, np.cumsum([0, *counts.prod(axis=1)])[:-1]])
        pixel = first.metres_per_pixel
        self.avenues = Avenues(first.shape, sides, pixel, seed, _widths(cities))
        self._regions: OrderedDict[tuple[int, int], Laid] = OrderedDict()

    @cached_property
    def windows(self) -> Windows:
        """The windows that the originals repeat."""
        isos = range(isometries.COUNT if self._turned else 1)
        return Windows([city.heights + np.float32(0) for city in self.cities], isos, 1 << 28)

    @cached_property
    def donors(self) -> tuple[Donor, ...]:
        """The originals with straight walls."""
        return tuple(donor_of(city) for city in self.cities)

    def __getstate__(self):
        state = {**self.__dict__, "_regions": OrderedDict()}
        return {key: value for key, value in state.items() if key not in ("windows", "donors")}

    def window(self, top: int, left: int, height: int, width: int) -> np.ndarray:
        """Compute float32 ``(height, width)`` heights from pixel (top, left) on."""
        out = np.zeros((height, width), np.float32)
        for i, j in self.avenues.districts(top, left, top + height, left + width):
            if (i, j) == (0, 0):
                piece, corner = self.cities[0].heights, (0, 0)
            else:
                laid = self.laid(i, j)
                piece, corner = laid.heights, laid.district.corner
            _add(out, piece, corner[0] - top, corner[1] - left)
        return out

    def stones(self, top: int, left: int, bottom: int, right: int) -> np.ndarray:
        """Find the original's cell and isometry next to what stands in each cell of a rectangle of
        cells: int32, as in `evocity.growth.plane.Plane`."""
        cell = self.cell
        out = np.full((bottom - top, right - left), -1, np.int32)
        middle = cell // 2
        ends = ((bottom - 1) * cell + middle + 1, (right - 1) * cell + middle + 1)
        begin = top * cell + middle, left * cell + middle
        for i, j in self.avenues.districts(*begin, *ends):
            rows = np.arange(top, bottom)[:, None] * cell + middle
            columns = np.arange(left, right)[None] * cell + middle
            here = self.avenues.within(i, j, rows, columns)
            y, x = np.nonzero(here)
            if y.size:
                out[y, x] = self._stones_of(i, j, rows[y, 0], columns[0, x])
        return out

    def _stones_of(self, i: int, j: int, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
        """Find the stones at pixels within a district."""
        if (i, j) == (0, 0):
            return self._stone(0, rows, columns, 0)
        laid = self.laid(i, j)
        down, along = rows - laid.district.corner[0], columns - laid.district.corner[1]
        numbers = laid.district.labels[down, along]
        stones = np.zeros(rows.size, np.int32)
        pixel = self.avenues.pixel
        for number in np.unique(numbers):
            here, gene = numbers == number, laid.genes[number - 1]
            owner = int(laid.owners[number - 1])
            if gene is None:
                stones[here] = 8 * self.sides[owner, 2]
                continue
            row, column = laid.centres[number - 1]
            away = gene.offsets((down[here] - row) * pixel, (along[here] - column) * pixel)
            places = (gene.row + away[0] / pixel, gene.column + away[1] / pixel)
            stones[here] = self._stone(owner, *places, gene.nearest_isometry())
        return stones

    def _stone(self, owner: int, rows, columns, iso: int) -> np.ndarray:
        high, wide, first = self.sides[owner]
        row = np.clip(np.floor(np.asarray(rows) / self.cell), 0, high - 1).astype(np.int64)
        column = np.clip(np.floor(np.asarray(columns) / self.cell), 0, wide - 1).astype(np.int64)
        return (8 * (first + row * wide + column) + iso).astype(np.int32)

    def account(
        self,
        top: int,
        left: int,
        bottom: int,
        right: int,
        progress: Callable[[int, int], None] | None = None,
    ) -> dict:
        """Report on the districts that a rectangle of cells touches, see `Growth.account`."""
        box = [at * self.cell for at in (top, left, bottom, right)]
        districts = self.avenues.districts(*box)
        fronts, open_quarters = [np.empty(0)], 0
        for done, (i, j) in enumerate(districts):
            if (i, j) != (0, 0):
                laid = self.laid(i, j)
                fronts.append(laid.front)
                open_quarters += sum(gene is None for gene in laid.genes)
            if progress is not None:
                progress(done + 1, len(districts))
        front = np.concatenate(fronts)
        return {
            "groups": front.size,
            "front": round(float(front.mean()), 4) if front.size else 0.0,
            "forced": open_quarters,
        }

    def laid(self, i: int, j: int) -> Laid:
        """Return a district from the cache, or lay its buildings now."""
        laid = self._regions.get((i, j))
        if laid is None:
            laid = self._lay(i, j)
            self._regions[i, j] = laid
            while len(self._regions) > _DISTRICTS:
                self._regions.popitem(last=False)
        with contextlib.suppress(KeyError):  # another thread may have dropped it
            self._regions.move_to_end((i, j))
        return laid

    def _lay(self, i: int, j: int) -> Laid:
        district = self.avenues.district(i, j)
        plan = _plan_of(district, self.avenues.pixel)
        rng = self.avenues.generator(_QUARTERS, i, j)
        middles = plan.centre + 0.5 + np.array(district.corner)
        owners = self.shares.owners(middles, rng.random(len(plan)))
        swap = int(rng.integers(4))
        heights = np.zeros(plan.labels.shape, np.float32)
        genes: list[FaceGene | None] = []
        front = np.zeros(len(plan))
        covered = float((district.lots > 0).sum() / max((district.labels > 0).sum(), 1))
        for k, owner in enumerate(owners.tolist()):
            donor, lot = self.donors[owner], lot_of(plan, k + 1)
            colour = int(district.colour[k]) ^ swap
            draws = draw_places(
                lot, float(plan.angle[k]), donor, colour, self.avenues.side,
                candidates=self._candidates, turned=self._turned, rng=rng,
            )  # fmt: skip
            goal = min(float(donor.city.built.mean()) / max(covered, 0.1), 1.0)
            gene: FaceGene | None = None
            if lot.rows.size and len(donor.middles):
                mouths = find_mouths(lot, k + 1, plan.lots, heights > 0)
                found = fill_quarter(lot, k + 1, donor, draws, goal, mouths)
                if found is not None:
                    gene, heights[lot.window][lot.mask], front[k] = found
            genes.append(gene)
        heights.setflags(write=False)
        return Laid(district, genes, owners, plan.centre, heights, front)


def _widths(cities: Sequence[CityMap]) -> np.ndarray:
    """List the widths of the originals' streets, metres, one for each 10 m of a street."""
    widths = []
    for city in cities:
        graph = city.alley_graph
        many = np.maximum(np.rint(graph.length / 10), 0).astype(np.int64)
        widths.append(np.repeat(graph.clear, many))
    return np.concatenate(widths)


def _add(out: np.ndarray, piece: np.ndarray, top: int, left: int) -> None:
    """Add ``piece`` to ``out`` at (top, left), as far as ``out`` reaches; buildings of two pieces
    never meet."""
    bottom, right = top + piece.shape[0], left + piece.shape[1]
    within = out[max(top, 0) : max(bottom, 0), max(left, 0) : max(right, 0)]
    y, x = max(-top, 0), max(-left, 0)
    within += piece[y : y + within.shape[0], x : x + within.shape[1]]


def _plan_of(district: District, pixel: float) -> Plan:
    """Make the plan of a district: its quarters are faces."""
    count = district.angle.size
    labels, lots = district.labels.astype(np.int32), district.lots.astype(np.int32)
    windows = np.zeros((count, 4), np.int32)
    for face, found in enumerate(scipy.ndimage.find_objects(labels, count)):
        if found is not None:  # a quarter between crossings that lie close may have no pixel
            windows[face] = *(one.start for one in found), *(one.stop for one in found)
    ones = np.ones(count)
    return Plan(
        heights=np.zeros(labels.shape, np.float32),
        metres_per_pixel=pixel,
        corner=(0.0, 0.0),
        name="district",
        attribution="",
        labels=labels,
        lots=lots,
        windows=windows,
        area=np.bincount(labels.ravel(), minlength=count + 1)[1:] * pixel**2,
        lot_area=np.bincount(lots.ravel(), minlength=count + 1)[1:] * pixel**2,
        coverage=ones,
        front=ones,
        angle=district.angle,
        order=ones,
        centre=centres_of(labels, lots, count),
        open=np.zeros(count, bool),
        at_frame=np.zeros(count, bool),
        neighbours=np.zeros((0, 2), np.int32),
    )
