"""A child while faces of its plan change: lifs, heights, genes, and the places that it shows."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from evocity.citymap import BUILT_ABOVE, CityMap
from evocity.coding.decoding_cache import decoded
from evocity.genome import Genome, Pieces, laid
from evocity.operators.crossover import raw_heights
from evocity.operators.pavement_fusion import ground
from evocity.operators.plans.donor import donor_of
from evocity.operators.plans.gene import FaceGene
from evocity.operators.plans.inheritance import (
    PLAN_KEY,
    InheritedPlan,
    find_plan,
    founders_of,
    names,
)
from evocity.operators.plans.laying import Lot, lay_pieces, lot_of
from evocity.operators.plans.plan import Plan
from evocity.operators.street_blocks.refill import Origins
from evocity.pavement import Pavement

#: Faces of two parents are the same if their heights differ by less, on average, metres.
_SAME = 0.25
#: Least weight of a donor.
_LITTLE = 0.01


class PlannedChild:
    """The first parent, while faces of its plan get other buildings.

    plan : the plan of the first parent (see `find_plan`). state : its inherited plan; None if
        children do not inherit it. states : the same of each parent with the same plan, else None.
    second : the plan of the second parent and its state, whatever plan it is; None without one.
    founders : numbers of the founders among the parents, by the names of their cities.
    genes, halves, edited : face genes by number, those of second halves, and the edited faces, of
        the child.
    laid : the genes that this birth laid, in their order.
    intended : float32 ``(H, W)``, metres.
    names : names of the cities of each parent. Donors are numbered as parents.
    donors : numbers of the parents whose buildings may be laid: the founders behind the first
        parent. Without one, all other parents, or else the first parent.
    """

    def __init__(self, parents: Sequence[Genome], grid: Pavement, others: int = 0):
        """Prepare a child of ``parents``; ``others`` is the number of further parents that are not
        founders, and whose faces the child may take."""
        self._parents, self._grid = parents, grid
        self.names = names(parents)
        self.founders = founders_of(parents)
        founders = {name: parents[number] for name, number in self.founders.items()}
        found = [find_plan(parent, founders) for parent in parents[: 1 + others]]
        self.plan, self.state = found[0]
        self.states = [state if self._same(state) else None for _, state in found]
        self.second = found[1] if len(found) > 1 else None
        self.genes: dict[int, FaceGene] = dict(self.state.genes) if self.state else {}
        self.halves: dict[int, FaceGene] = dict(self.state.halves) if self.state else {}
        self.edited: set[int] = set(self.state.edited) if self.state else set()
        self.laid: list[FaceGene] = []
        self.intended = raw_heights(parents[0]).copy()
        behind = founders_of(parents[1 + others :]).values()
        self.donors = np.array(sorted(1 + others + number for number in behind), np.int64)
        if not self.donors.size:
            self.donors = np.arange(1, len(parents)) if len(parents) > 1 else np.zeros(1, np.int64)
        self._origins = Origins(parents, grid)
        self._origins.count(self._origins.of[0].ravel(), 1)
        shape = grid.rows, grid.columns
        self._whose = np.zeros(shape, np.int64)
        self._cells = np.indices(shape)
        self._iso = np.zeros(shape, np.uint8)
        self._built: dict[int, np.ndarray] = {}

    def _same(self, state: InheritedPlan | None) -> bool:
        return state is not None and self.state is not None and state.key == self.state.key

    def city(self, number: int) -> CityMap:
        """Return the decoded map of a parent."""
        return decoded(self._parents[number]).city

    @cached_property
    def locked(self) -> np.ndarray | None:
        """Pixels that a condensation locks, bool ``(H, W)``, or None."""
        layer = self._parents[0].condensation
        return None if layer is None else layer.mask

    def faces(self, area_min: float) -> np.ndarray:
        """List the faces that may change: they are not open, their lots have ``area_min`` m² or
        more, and nothing in them is locked."""
        free = ~self.plan.open & (self.plan.lot_area >= max(area_min, 1e-9))
        if self.locked is not None:
            locked = np.unique(self.plan.labels[self.locked])
            free[locked[locked > 0] - 1] = False
        return np.flatnonzero(free) + 1

    def differing(self, number: int) -> np.ndarray:
        """List the faces in which a parent with the same plan has other buildings: another gene, or
        edits and other heights."""
        first, second = self.state, self.states[number]
        if first is None or second is None:
            return np.zeros(0, np.int64)
        heights = [raw_heights(self._parents[k]) for k in (0, number)]
        step = np.abs(heights[0] - heights[1])
        total = np.bincount(self.plan.lots.ravel(), step.ravel(), len(self.plan) + 1)
        other = total * self.plan.metres_per_pixel**2 > _SAME * np.concatenate(
            [[0], self.plan.lot_area]
        )
        edited = first.edited | second.edited
        return np.array(
            [
                face
                for face in self.faces(0).tolist()
                if first.genes.get(face) != second.genes.get(face)
                or first.halves.get(face) != second.halves.get(face)
                or (face in edited and other[face])
            ],
            np.int64,
        )

    def foreign(self, face: int) -> bool:
        """Tell whether a ``face`` has other buildings than its own, or edited ones."""
        return face in self.genes or face in self.edited

    def shares(self, number: int) -> np.ndarray:
        """Compute a weight for each donor: the share of a parent's map that comes from its city,
        and a little for each."""
        parent = self._parents[number]
        area = np.bincount(parent.parent, parent.pavement.area, len(parent.cities))
        share = dict(zip(parent.cities, area / area.sum(), strict=True))
        return np.array([_LITTLE + share.get(self.names[donor], 0.0) for donor in self.donors])

    def draw_donors(
        self, rng: np.random.Generator, preferred: np.ndarray | None = None
    ) -> np.ndarray:
        """Draw the order in which donors are tried, by their built ground that is not on the map
        yet, and by the weights ``preferred`` of the donors."""
        fresh = np.array(
            [np.count_nonzero(self._built_of(n) & ~self._stale(n)) + 1.0 for n in self.donors]
        )
        if preferred is not None:
            fresh *= preferred
        # the order of exponential variables, each by the ground of its donor
        return self.donors[np.argsort(rng.exponential(size=fresh.size) / fresh, kind="stable")]

    def used(self, donor: int) -> np.ndarray:
        """Mark the pixels of a donor that stand on the map already, or that a condensation locks:
        bool ``(H, W)``."""
        cell = self._grid.block
        used = self._stale(donor).repeat(cell, axis=0).repeat(cell, axis=1)
        return used if self.locked is None else used | self.locked

    def _built_of(self, number: int) -> np.ndarray:
        if number not in self._built:
            built = self._grid.blocks(self.city(number).built).any(axis=(1, 2))
            self._built[number] = built.reshape(self._grid.rows, self._grid.columns)
        return self._built[number]

    def _stale(self, donor: int) -> np.ndarray:
        return self._origins.stale(donor, self._built_of(donor), 1.0) > 0

    def lay(self, donor: int, gene: FaceGene, heights: np.ndarray) -> None:
        """Lay the buildings of a ``gene`` with these ``heights`` in its face."""
        lot = lot_of(self.plan, gene.face)
        self.intended[lot.window][lot.mask] = heights
        self._show(self._cells_of(lot)[0], donor, gene)
        self._forget(gene.face)
        self.genes[gene.face] = gene
        self.laid.append(gene)

    def lay_halves(self, donors: Sequence[int], genes: Sequence[FaceGene]) -> None:
        """Lay the buildings of two ``genes``, one for each half of a face, of two ``donors``."""
        face = genes[0].face
        lot = lot_of(self.plan, face)
        heights, whose = lay_pieces(lot, genes, [donor_of(self.city(n)) for n in donors])
        self.intended[lot.window][lot.mask] = heights
        second = np.where(whose < 0, lot.side(2), whose == 1)
        cells, mixed = self._cells_of(lot)[0], self._cell_numbers(lot)
        share = np.bincount(mixed, second, cells.max() + 1) / np.maximum(np.bincount(mixed), 1)
        later = share[cells] > 0.5
        for donor, gene, own in zip(donors, genes, (~later, later), strict=True):
            self._show(cells[own], donor, gene)
        self._forget(face)
        self.genes[face], self.halves[face] = genes
        self.laid += genes

    def _show(self, cells: np.ndarray, donor: int, gene: FaceGene) -> None:
        """Let ``cells`` show the places of a donor that a ``gene`` names."""
        grid = self._grid
        here = np.divmod(cells, grid.columns)
        pixel, middle = self.plan.metres_per_pixel, (grid.block - 1) / 2
        row, column = self.plan.centre[gene.face - 1]
        down, along = gene.offsets(
            (here[0] * grid.block + middle - row) * pixel,
            (here[1] * grid.block + middle - column) * pixel,
        )
        there = [
            np.clip(np.floor((at + off / pixel + 0.5) / grid.block), 0, side - 1).astype(np.int64)
            for at, off, side in zip(
                (gene.row, gene.column), (down, along), self._whose.shape, strict=True
            )
        ]
        meant = self._meant_at(cells)
        bare = ~meant & self._built_of(donor)[tuple(there)]
        self._count(here, -1)
        self._whose[here] = np.where(bare, len(self._parents), donor)
        for axis in range(2):
            self._cells[axis][here] = np.where(bare, here[axis], there[axis])
        self._iso[here] = np.where(bare, 0, gene.nearest_isometry())
        self._count(here, 1)

    def take(self, face: int, number: int) -> None:
        """Take a ``face`` as another parent with the same plan has it: its lifs in place, its gene,
        and whether it is edited."""
        lot, state = lot_of(self.plan, face), self.states[number]
        self._put(lot, number, raw_heights(self._parents[number])[lot.window][lot.mask])
        self._forget(face)
        if state is not None and face in state.genes:
            self.genes[face] = state.genes[face]
            self.halves.update({face: state.halves[face]} if face in state.halves else {})
        if state is not None and face in state.edited:
            self.edited.add(face)

    def restore(self, face: int) -> None:
        """Give a ``face`` the buildings that the plan has there, with the lifs of its founder."""
        lot, number = lot_of(self.plan, face), self.owner(face)
        if number is None:
            return
        window, mask = lot.window, lot.mask
        own, raw = self.city(number).heights, raw_heights(self._parents[number])
        planned = self.plan.heights[window][mask]
        same = planned == own[window][mask]
        self._put(lot, number, np.where(same, raw[window][mask], planned))
        self._forget(face)

    def owner(self, face: int) -> int | None:
        """Find the founder whose buildings the plan has in a ``face``, among the parents; None
        without one. A plan with a seam has faces of several founders."""
        if self.state is None:
            return None
        numbers = list(self.founders.values())
        if not self.state.changes:
            return self.founders.get(self.state.city)
        lot = lot_of(self.plan, face)
        planned = self.plan.heights[lot.window][lot.mask]
        apart = [
            np.abs(self.city(number).heights[lot.window][lot.mask] - planned).sum()
            for number in numbers
        ]
        return numbers[int(np.argmin(apart))] if numbers else None

    def _put(self, lot: Lot, number: int, heights: np.ndarray) -> None:
        """Put the lifs of a parent in a lot, in place, and mean these ``heights``."""
        self.intended[lot.window][lot.mask] = heights
        cells, here = self._cells_of(lot)
        meant = self._meant_at(cells)
        bare = ~meant & self._built_of(number)[here]
        self._count(here, -1)
        self._whose[here] = np.where(bare, len(self._parents), number)
        for axis in range(2):
            self._cells[axis][here] = here[axis]
        self._iso[here] = 0
        self._count(here, 1)

    def _forget(self, face: int) -> None:
        self.genes.pop(face, None)
        self.halves.pop(face, None)
        self.edited.discard(face)

    def repeated(self, face: int, number: int) -> float:
        """Compute the share of a parent's built ground in a ``face`` whose place stands elsewhere
        on the map already."""
        _, here = self._cells_of(lot_of(self.plan, face))
        self._count(here, -1)
        built = self._built_of(number)
        stale = self._origins.stand(number, here)[built[here]]
        self._count(here, 1)
        return float(stale.sum() / max(built[here].sum(), 1))

    def doubled(self, face: int) -> float:
        """Compute the share of the built ground of a ``face`` whose place in a source city stands
        elsewhere on the map, too."""
        _, here = self._cells_of(lot_of(self.plan, face))
        whose = self._whose[here]
        self._count(here, -1)
        built, again = 0, 0
        for parent in self._shown(whose):
            places = tuple(axis[here][whose == parent] for axis in self._cells)
            own = self._built_of(parent)[places]
            built += int(np.count_nonzero(own))
            again += int(np.count_nonzero(self._origins.stand(parent, places)[own]))
        self._count(here, 1)
        return again / built if built else 0.0

    def _meant(self) -> np.ndarray:
        """Find the cells that buildings are meant to stand on, bool ``(n,)``."""
        return np.asarray(self._grid.blocks(self.intended > BUILT_ABOVE).any(axis=(1, 2)))

    def _meant_at(self, cells: np.ndarray) -> np.ndarray:
        """Find which of these ``cells`` buildings are meant to stand on, bool ``(k,)``."""
        grid = self._grid
        cut = self.intended.reshape(grid.rows, grid.block, grid.columns, grid.block)
        row, column = np.divmod(cells, grid.columns)
        return np.asarray((cut[row, :, column, :] > BUILT_ABOVE).any(axis=(1, 2)))

    def _cells_of(self, lot: Lot) -> tuple[np.ndarray, tuple[np.ndarray, np.ndarray]]:
        """List the cells of a lot by number, and by row and column."""
        key = self._grid.block, self._grid.columns
        if key not in lot.cells:
            cells = np.unique(self._cell_numbers(lot))
            lot.cells[key] = cells, np.divmod(cells, self._grid.columns)
        return lot.cells[key]

    def _cell_numbers(self, lot: Lot) -> np.ndarray:
        """Number the cell of each pixel of a lot."""
        grid = self._grid
        rows = (lot.rows + lot.window[0].start) // grid.block
        return rows * grid.columns + (lot.columns + lot.window[1].start) // grid.block

    def _count(self, here, step: int) -> None:
        whose = self._whose[here]
        for parent in self._shown(whose):
            own = whose == parent
            places = tuple(axis[here][own] for axis in self._cells)
            self._origins.count(self._origins.of[parent][places], step)

    def _shown(self, whose: np.ndarray) -> list[int]:
        """List the parents among the numbers ``whose`` of cells, in their order."""
        counts = np.bincount(whose, minlength=1)[: len(self._parents)]
        return np.flatnonzero(counts).tolist()

    def replan(
        self,
        plan: Plan,
        state: InheritedPlan | None,
        genes: dict[int, FaceGene],
        edited: set[int],
    ) -> None:
        """Set another plan, with the state, genes and edited faces that belong to it; set the
        genes of second halves after it."""
        self.plan, self.state, self.genes, self.edited = plan, state, genes, edited
        self.states = [state] + [None] * (len(self.states) - 1)
        self.laid, self.halves = [], {}

    def clear(self, where: np.ndarray) -> None:
        """Make ground of the pixels ``where``, bool ``(H, W)``."""
        before = self._meant()
        self.intended[where] = 0
        here = np.divmod(np.flatnonzero(before & ~self._meant()), self._grid.columns)
        self._count(here, -1)
        self._whose[here] = len(self._parents)
        for axis in range(2):
            self._cells[axis][here] = here[axis]
        self._iso[here] = 0

    def genome(self) -> Genome:
        """Lay the lifs of all parents."""
        row, column = self._cells
        pieces = Pieces(self._grid.block, self._whose, row, column, self._iso)
        return laid([*self._parents, ground(self._parents[0])], pieces, carried=True).genome

    def made(self) -> dict[str, Any]:
        """Describe the birth: the genes that it laid, and the plan that the child inherits."""
        made: dict[str, Any] = {"genes": [gene.as_dict() for gene in self.laid]}
        if self.state is not None:
            edited = frozenset(self.edited)
            state = replace(self.state, genes=self.genes, halves=self.halves, edited=edited)
            made[PLAN_KEY] = state.as_dict()
        return made


__all__ = ["PlannedChild"]
