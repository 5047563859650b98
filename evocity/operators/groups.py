"""Groups of cells and their moves on one map; buildings that stand on cells."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
import scipy

from evocity import isometries
from evocity.citymap import MAX_PIXELS, CityMap
from evocity.genome import Genome, Pieces, laid
from evocity.genome.genome import derived
from evocity.operators._kernels import best_move, grown, outline_sides, tallied
from evocity.operators.crossover import Draft, raw_heights
from evocity.operators.grid import common_grid, in_cells, swaps_axes, turn_blocks, turn_places
from evocity.operators.parameters import Check, at_fault
from evocity.pavement import Pavement

#: Draws of a group until one has an admissible place.
_TRIES = 64


def square(size: int) -> np.ndarray:
    """List the cells of a macro-block, ``(2, size²)``: rows and columns from its corner."""
    return np.stack(np.divmod(np.arange(size * size), size))


def macro_block(
    pavement: Pavement, size_min: int, size_max: int, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Draw side and place of a macro-block: its cells as from `square`, its corner."""
    largest = min(size_max, pavement.rows, pavement.columns)
    size = int(rng.integers(min(size_min, largest), largest, endpoint=True))
    return square(size), rng.integers(0, (pavement.rows - size + 1, pavement.columns - size + 1))


def corners(pavement: Pavement, group: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """List all legal corners (row, column) of ``group``, ``(m, 2)``, shuffled."""
    high, wide = (pavement.rows, pavement.columns) - group.max(axis=1)
    return np.stack(np.divmod(rng.permutation(high * wide), wide), axis=1)


def cells(pavement: Pavement, side: int, rng: np.random.Generator) -> tuple[np.ndarray, int]:
    """List the corners ``(m, 2)`` of the squares of a grid at a random offset that fit; and their
    side, at most that of the pavement, in cells."""
    side = min(side, pavement.rows, pavement.columns)
    down, along = rng.integers(0, side, 2)
    rows = np.arange(down, pavement.rows - side + 1, side)
    columns = np.arange(along, pavement.columns - side + 1, side)
    return np.stack(np.meshgrid(rows, columns, indexing="ij"), axis=-1).reshape(-1, 2), side


def rule_checks() -> dict[str, Check]:
    """Return the checks of the parameters that decide which moves of a group are admissible."""
    return {
        "tolerance": (lambda step: step is None or step >= 0, "0 m or more, or none for any"),
        "change": (lambda step: step >= 0, "0 m or more"),
        "choice": (lambda count: 1 <= count <= MAX_PIXELS, f"1…{MAX_PIXELS}"),
    }


def macro_block_sides(
    operator, grid: Pavement, parents: Sequence[Genome], smallest: float, largest: float
) -> tuple[int, int]:
    """Compute the least and the largest side of an ``operator``'s macro-blocks, in cells;
    ``smallest`` and ``largest`` are the defaults, metres."""
    low = in_cells(operator, "size_min", smallest, grid, parents)
    high = in_cells(operator, "size_max", largest, grid, parents)
    if low > high:
        given = [key for key in ("side_max", "size_max") if getattr(operator, key) is not None]
        if given:
            fault = f"{high} cells of {grid.block} px", f"no less than the least side, {low} cells"
            raise at_fault(operator.name, {given[0]: fault})
    return low, max(low, high)


class Footings(NamedTuple):
    """The buildings of several maps on one pavement, and the blocks that they touch.

    Block b of map m is row m·n + b, with n blocks of the pavement; numbers of buildings run from 0
    through all maps. Labels decide what a building is: buildings separated by gaps and steps, or
    whole built components.

    starts, labels, pixels : row r holds ``pixels[k]`` pixels of building ``labels[k]`` for each
        k in ``starts[r] : starts[r + 1]``.
    spans, places : building i touches blocks ``places[spans[i] : spans[i + 1]]`` of its map.
    whose, whole : the map of each building, and its pixels.
    """

    starts: np.ndarray
    labels: np.ndarray
    pixels: np.ndarray
    spans: np.ndarray
    places: np.ndarray
    whose: np.ndarray
    whole: np.ndarray


def footings_of(pavement: Pavement, maps: Sequence[np.ndarray]) -> Footings:
    """Tabulate the `Footings` on ``pavement`` of ``maps`` of labels: int32 ``(H, W)``, 0 on open
    ground, 1…n on n buildings (``CityMap.building_labels``) or components (``CityMap.labels``)."""
    counts = [int(labels.max()) for labels in maps]
    whose = np.repeat(np.arange(len(maps)), counts)
    first = np.cumsum(counts) - counts
    rows = [
        pavement.blocks(np.where(labels > 0, labels + np.int32(start - 1), -1))
        for labels, start in zip(maps, first, strict=True)
    ]
    starts, labels, pixels = tallied(np.concatenate(rows).reshape(len(rows) * len(pavement), -1))
    shape = starts.size - 1, whose.size
    by_building = scipy.sparse.csr_array((pixels, labels, starts), shape=shape).tocsc()
    spans = by_building.indptr.astype(np.int64)
    places = by_building.indices.astype(np.int64) % len(pavement)
    whole = np.bincount(labels, pixels, whose.size).astype(np.int64)
    return Footings(starts, labels, pixels, spans, places, whose, whole)


class Rearrangement:
    """The fabric of one parent, rearranged by moves of groups of cells.

    A group is ``(2, g)`` cells, rows and columns from its corner; it moves from one corner to
    another (row, column), in cells.

    grid : the cells, n of them of side B, see `common_grid`.
    blocks : float32 ``(n, B, B)``, the intended map, cut along the grid.
    genome : the parent with the domain blocks, and after `_lay` the lifs, that moves carried. Its
        cells ``stone`` stand in those of the grid, under the isometries ``turn``.
    """

    def __init__(self, parent: Genome, name: str):
        self.grid = common_grid(name, [parent])
        self.blocks = self.grid.blocks(raw_heights(parent)).copy()
        self.genome = parent
        self.stone = np.arange(len(self.grid))
        self.turn = np.zeros(len(self.grid), np.uint8)
        self._locked = np.zeros(len(self.grid), bool)
        if parent.condensation is not None:
            self._locked = self.grid.blocks(parent.condensation.mask).any(axis=(1, 2))
        self._forget()

    def _forget(self) -> None:
        """Drop what was computed of the map before a move."""
        self._components: Footings | None = None
        self._turned: tuple[np.ndarray, list[int]] | None = None

    def grow_group(
        self, group: np.ndarray, corner: np.ndarray, limit: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """Extend a group over all built components it touches, repeatedly, so that it cuts none.
        Returns the new group and its corner; no cells beyond ``limit`` cells."""
        if self._components is None:
            city = CityMap(self.grid.raster(self.blocks), self.genome.metres_per_pixel)
            self._components = footings_of(self.grid, [city.labels])
        every = self._components
        whole = every.whole
        owner, kept = np.zeros(self.stone.size, np.int64), np.zeros(whole.size, bool)
        seed, columns = self._places(group, corner), self.grid.columns
        places, _ = grown(seed, columns, owner, 0, every, every, whole, kept, 0.0, limit)
        if not places.size:
            return group[:, :0], corner
        blocks = np.stack(np.divmod(places, self.grid.columns))
        corner = blocks.min(axis=1)
        return blocks - corner[:, None], corner

    def find_move(
        self,
        group: np.ndarray,
        starts: np.ndarray,
        ends: np.ndarray,
        rules,
        *,
        exchanged: bool = False,
        isos: np.ndarray | None = None,
    ) -> int | None:
        """Find, among the moves from ``starts`` to ``ends`` (``(m, 2)``, or one corner for all),
        the number of the best move; None if no move is admissible.

        Two ``exchanged`` places must both be admissible.

        rules : the operator, with its ``tolerance``, ``change`` and ``choice`` (see `GeneCopy`).
        isos : ``(m,)``, the isometry of the group in each move, all from one start; None for none.
        """
        maps, columns, groups = self.blocks[None], [self.grid.columns], group[None]
        if isos is None:
            isos = np.zeros(max(len(np.atleast_2d(starts)), len(np.atleast_2d(ends))), np.int64)
        else:
            maps, columns = self._turned_maps()
            groups = self._turned_groups(group, starts)
            corner = groups.min(axis=2)
            groups, starts = groups - corner[:, :, None], corner[isos]
        pairs = np.broadcast_arrays(np.atleast_2d(starts), np.atleast_2d(ends))
        starts, ends = (np.array(corner, order="C") for corner in pairs)
        tolerance = np.inf if rules.tolerance is None else rules.tolerance
        sides = np.stack([outline_sides(cells) for cells in groups])
        move = best_move(
            self.blocks, maps, self.grid.columns, np.array(columns), np.ascontiguousarray(groups),
            sides, isos, starts, ends, exchanged, tolerance, rules.change, rules.choice,
        )  # fmt: skip
        return None if move < 0 else int(move)

    def _turned_maps(self) -> tuple[np.ndarray, list[int]]:
        """Cut the map under all isometries, (8, n, B, B); with the cells in a row of each."""
        if self._turned is None:
            raster = self.grid.raster(self.blocks)
            every = (turn_blocks(self.grid, raster, iso) for iso in range(isometries.COUNT))
            maps, columns = zip(*every, strict=True)
            self._turned = np.stack(maps), list(columns)
        return self._turned

    def _turned_groups(self, group: np.ndarray, start: np.ndarray) -> np.ndarray:
        """Turn the cells of a group at ``start`` like each of the turned maps, (8, 2, g)."""
        places, shape = group + np.reshape(start, (2, 1)), (self.grid.rows, self.grid.columns)
        return np.stack([turn_places(places, shape, iso) for iso in range(isometries.COUNT)])

    def turned_ends(
        self, group: np.ndarray, start: np.ndarray, rng
    ) -> tuple[np.ndarray, np.ndarray]:
        """Draw an isometry for each cell, in random order; keep those where the turned ``group``
        lies on the map, clear of its present place. Returns isometries ``(m,)`` and corners
        ``(m, 2)``."""
        rows, columns = self.grid.rows, self.grid.columns
        ends = np.stack(np.divmod(rng.permutation(rows * columns), columns), axis=1)
        isos = rng.integers(0, isometries.COUNT, len(ends))
        shape = group.max(axis=1) + 1
        size = np.where(
            np.array([swaps_axes(iso) for iso in range(8)])[isos, None], shape[::-1], shape
        )
        clear = ((ends >= start + shape) | (ends + size <= start)).any(axis=1)
        fits = clear & (ends + size <= (rows, columns)).all(axis=1)
        return isos[fits], ends[fits]

    def plain_ends(self, group: np.ndarray, start: np.ndarray, rng) -> np.ndarray:
        """List the corners ``(m, 2)``, shuffled, at which ``group`` is clear of its present
        place."""
        tall, wide = group.max(axis=1) + 1
        ends = corners(self.grid, group, rng)
        return ends[(np.abs(ends - start) >= (tall, wide)).any(axis=1)]

    def rearrange(
        self,
        draw: Callable[[], tuple[np.ndarray, np.ndarray]],
        count: int,
        rng: np.random.Generator,
        rules,
        *,
        copied: bool = False,
        carried: bool = False,
        turned: bool = False,
    ) -> int:
        """Move ``count`` groups, each from ``draw`` as (group, start), by `find_move`. Returns the
        number of moves.

        A group changes places with what stands there, or is ``copied`` over it. With ``turned``,
        each place has a drawn isometry. Locked groups (condensation) do not move.
        """
        lay = self.copy if copied else self.exchange
        moved = 0
        for _ in range(count):
            for _ in range(_TRIES):
                group, start = draw()
                if not group.size or self._locked[self._places(group, start)].any():
                    continue
                isos = None
                if turned:
                    isos, ends = self.turned_ends(group, start, rng)
                else:
                    ends = self.plain_ends(group, start, rng)
                move = self.find_move(group, start, ends, rules, exchanged=not copied, isos=isos)
                if move is not None:
                    iso = 0 if isos is None else int(isos[move])
                    there = turn_places(group, group.max(axis=1) + 1, iso)
                    if not copied and self._locked[self._places(there, ends[move])].any():
                        continue
                    lay(group, start, ends[move], carried=carried, iso=iso)
                    moved += 1
                    break
        return moved

    def copy(self, group: np.ndarray, start, end, *, carried: bool = False, iso: int = 0) -> None:
        """Lay a copy of the group at ``start`` at ``end``, under an isometry; with ``carried``,
        domain blocks inside the group follow."""
        shape = group.max(axis=1) + 1
        here = self._places(group, start)
        there = self._places(turn_places(group, shape, iso), end)
        self._forget()
        self._put(there, iso, *self._take(here))
        if carried:
            self._lay()
            follows = np.zeros(self.stone.size, bool)
            follows[there] = True
            theirs = self.grid.raster(follows)[self.genome.pavement.corners]
            self._carry(theirs & self._inside(here), shape, start, end, iso)

    def exchange(
        self, group: np.ndarray, start, end, *, carried: bool = False, iso: int = 0
    ) -> None:
        """Exchange the groups at ``start`` and ``end``, clear of each other: the first under an
        isometry, the other under its inverse. With ``carried``, domain blocks inside either follow,
        also those of lifs elsewhere."""
        shape, back = group.max(axis=1) + 1, int(isometries.INVERSE[iso])
        turned = turn_places(group, shape, iso)
        here, there = self._places(group, start), self._places(turned, end)
        self._forget()
        ours, theirs = self._take(here), self._take(there)
        self._put(there, iso, *ours)
        self._put(here, back, *theirs)
        if carried:
            self._lay()
            forth, other = self._inside(here), self._inside(there)
            self._carry(forth, shape, start, end, iso)
            self._carry(other, turned.max(axis=1) + 1, end, start, back)

    def _take(self, places: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Copy the content of cells: heights, cells of the parent, isometries."""
        return self.blocks[places], self.stone[places], self.turn[places]

    def _put(self, places: np.ndarray, iso: int, blocks, stone, turn) -> None:
        """Lay the content of other cells in the cells ``places``, under an isometry."""
        self.blocks[places] = isometries.apply(iso, blocks)
        self.stone[places] = stone
        self.turn[places] = isometries.COMPOSITION[iso, turn]

    def draft(self, made: dict) -> Draft:
        """Draft the child of all moves."""
        self._lay()
        return Draft(self.genome, self.grid.raster(self.blocks), made)

    def _lay(self) -> None:
        """Move the lifs as the moves since the last call say."""
        places = np.arange(self.stone.size)
        if np.array_equal(self.stone, places) and not self.turn.any():
            return
        row, column = np.divmod(self.stone.reshape(self.grid.rows, -1), self.grid.columns)
        nothing = np.zeros(row.shape, np.uint8)
        pieces = Pieces(self.grid.block, nothing, row, column, self.turn.reshape(row.shape))
        self.genome = laid([self.genome], pieces).genome
        self.stone, self.turn = places, np.zeros_like(self.turn)

    def _places(self, group: np.ndarray, corner) -> np.ndarray:
        """Number the cells of ``group`` at ``corner``."""
        return (group[0] + corner[0]) * self.grid.columns + group[1] + corner[1]

    def _inside(self, places: np.ndarray) -> np.ndarray:
        """Find the lifs whose domain block lies wholly in the cells ``places``: bool ``(n,)``."""
        cell, rows, columns = self.grid.block, self.grid.rows, self.grid.columns
        summed = np.zeros((rows + 1, columns + 1), np.int64)
        summed[1:, 1:].flat[places] = 1
        summed = summed.cumsum(axis=0).cumsum(axis=1)
        genome = self.genome
        top, left = genome.y // cell, genome.x // cell
        bottom, right = -(-(genome.y + genome.dy) // cell), -(-(genome.x + genome.dx) // cell)
        within = summed[bottom, right] - summed[top, right]
        within += summed[top, left] - summed[bottom, left]
        return (genome.dx > 0) & (within == (bottom - top) * (right - left))

    def _carry(self, lifs: np.ndarray, shape, start, end, iso: int) -> None:
        """Move the domain blocks of ``lifs`` (bool ``(n,)``) with a rectangle of cells of this
        ``shape`` from ``start`` to ``end``, under an isometry."""
        genome, cell = self.genome, self.grid.block
        y, x, dy, dx = (
            getattr(genome, name)[lifs].astype(np.int64) for name in ("y", "x", "dy", "dx")
        )
        inside = np.stack([y, x]) - np.reshape(start, (2, 1)) * cell
        size = tuple(int(side) * cell for side in shape)
        far = inside + np.stack([dy, dx]) - 1
        ends = (turn_places(corner, size, iso) for corner in (inside, far))
        corner = np.minimum(*ends) + np.reshape(end, (2, 1)) * cell
        if swaps_axes(iso):
            dy, dx = dx, dy
        values = {"y": corner[0], "x": corner[1], "dy": dy, "dx": dx}
        values["iso"] = isometries.COMPOSITION[genome.iso[lifs], isometries.INVERSE[iso]]
        columns = {name: getattr(genome, name).copy() for name in values}
        for name, column in columns.items():
            column[lifs] = values[name]
        self.genome = derived(genome, **columns)
