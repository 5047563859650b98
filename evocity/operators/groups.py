"""Groups of lifs taken to other places of one map: which groups, where to, and what goes along."""

from collections.abc import Callable, Sequence

import numpy as np

from evocity import isometries
from evocity.citymap import MAX_PIXELS, CityMap
from evocity.genome import Genome, Pieces, laid
from evocity.operators._kernels import best_move, grown, outline_sides
from evocity.operators.crossing import Draft, raw_heights
from evocity.operators.footings import Footings, footings_of
from evocity.operators.grid import common_grid, in_cells, span_checks
from evocity.operators.parameters import Check, at_fault
from evocity.operators.turning import swaps, turned_blocks, turned_places
from evocity.pavement import Pavement

#: Groups drawn until one has a place to go to.
_TRIES = 64


def square(size: int) -> np.ndarray:
    """The cells of a macro-block, ``(2, size²)``: rows and columns from its corner."""
    return np.stack(np.divmod(np.arange(size * size), size))


def macro_block(
    pavement: Pavement, size_min: int, size_max: int, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """A macro-block of random side and place: its cells as `square` gives them, its corner."""
    largest = min(size_max, pavement.rows, pavement.columns)
    size = int(rng.integers(min(size_min, largest), largest, endpoint=True))
    return square(size), rng.integers(0, (pavement.rows - size + 1, pavement.columns - size + 1))


def corners(pavement: Pavement, group: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """All cells (row, column), ``(m, 2)``, at which the corner of ``group`` may lie, shuffled."""
    high, wide = (pavement.rows, pavement.columns) - group.max(axis=1)
    return np.stack(np.divmod(rng.permutation(high * wide), wide), axis=1)


def cells(pavement: Pavement, side: int, rng: np.random.Generator) -> tuple[np.ndarray, int]:
    """Corners ``(m, 2)`` of the squares of a grid laid at a random offset, those that fit; and
    their side, ``side`` or what the pavement has room for, in cells."""
    side = min(side, pavement.rows, pavement.columns)
    down, along = rng.integers(0, side, 2)
    rows = np.arange(down, pavement.rows - side + 1, side)
    columns = np.arange(along, pavement.columns - side + 1, side)
    return np.stack(np.meshgrid(rows, columns, indexing="ij"), axis=-1).reshape(-1, 2), side


def move_checks() -> dict[str, Check]:
    """Checks of the parameters of `Rearrangement.best`, for `check_parameters`."""
    return {
        "tolerance": (lambda step: step is None or step >= 0, "0 m or more, or none for any"),
        "change": (lambda step: step >= 0, "0 m or more"),
        "choice": (lambda count: 1 <= count <= MAX_PIXELS, f"1…{MAX_PIXELS}"),
    }


def macro_block_checks(operator, smallest: float) -> dict[str, Check]:
    """Checks of the parameters of `Rearrangement.rearrange` and `macro_block`; ``smallest`` as in
    `macro_block_sides`."""
    return {
        **span_checks(operator, smallest),
        "count": (lambda count: 1 <= count <= 1000, "1…1000"),
        **move_checks(),
    }


def macro_block_sides(
    operator, grid: Pavement, parents: Sequence[Genome], smallest: float, largest: float
) -> tuple[int, int]:
    """The least and the largest side of an ``operator``'s macro-blocks, in cells; ``smallest`` and
    ``largest``, metres, unless it was told."""
    low = in_cells(
        operator.name, "size_min", operator.side_min, operator.size_min, smallest, grid, parents
    )
    high = in_cells(
        operator.name, "size_max", operator.side_max, operator.size_max, largest, grid, parents
    )
    if low > high:
        given = [key for key in ("side_max", "size_max") if getattr(operator, key) is not None]
        if given:
            found = f"{high} cells of {grid.block} px", f"no less than the least side, {low} cells"
            raise at_fault(operator.name, {given[0]: found})
    return low, max(low, high)


class Rearrangement:
    """The fabric of one parent taken to other places, one group of cells after another.

    A group is given by its cells ``(2, g)``, rows and columns from its corner, and moves from
    a corner to another (row, column), in cells.

    Attributes
    ----------
    grid : the cells, n of them of side B, see `common_grid`.
    blocks : float32 ``(n, B, B)``, the map that is meant to be laid, cut along the grid.
    genome : the parent with its domain blocks carried along by the moves made so far, and its
        lifs where these carried them; the cells ``stone`` of it stand in those of the grid, under
        the isometries ``turn``.
    """

    def __init__(self, parent: Genome, name: str):
        self.grid = common_grid(name, [parent])
        self.blocks = self.grid.blocks(raw_heights(parent)).copy()
        self.genome = parent
        self.stone = np.arange(len(self.grid))
        self.turn = np.zeros(len(self.grid), np.uint8)
        self._held = np.zeros(len(self.grid), bool)
        if parent.condensation is not None:
            self._held = self.grid.blocks(parent.condensation.mask).any(axis=(1, 2))
        self._forget()

    def _forget(self) -> None:
        """The map has changed: what was computed of it holds no longer."""
        self._components: Footings | None = None
        self._turned: tuple[np.ndarray, list[int]] | None = None

    def grown(
        self, group: np.ndarray, corner: np.ndarray, limit: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """The cells of a group and of all built components it touches, and so on, so that none is
        cut, as another group and its corner; no cells where these are more than ``limit``."""
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

    def best(
        self,
        group: np.ndarray,
        starts: np.ndarray,
        ends: np.ndarray,
        *,
        exchanged: bool = False,
        tolerance: float | None,
        change: float,
        choice: int,
        isos: np.ndarray | None = None,
    ) -> int | None:
        """Of the moves from ``starts`` to ``ends`` (``(m, 2)``, or one corner for all), index of
        the most seamless of the first ``choice`` that are admissible, None if none is.

        An admissible one steps by at most ``tolerance`` metres (None: any) on average along its
        outline, at both places if they are ``exchanged``, and changes the map by more than
        ``change`` metres on average.

        isos : ``(m,)``, the isometry under which the group is laid in each move, all from one
            start; None for none.
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
        found = best_move(
            self.blocks,
            maps,
            self.grid.columns,
            np.array(columns),
            np.ascontiguousarray(groups),
            np.stack([outline_sides(one) for one in groups]),
            isos,
            starts,
            ends,
            exchanged,
            np.inf if tolerance is None else tolerance,
            change,
            choice,
        )
        return None if found < 0 else int(found)

    def _turned_maps(self) -> tuple[np.ndarray, list[int]]:
        """The map under all isometries as blocks, (8, n, B, B), and how many each has a row."""
        if self._turned is None:
            raster = self.grid.raster(self.blocks)
            every = (turned_blocks(self.grid, raster, iso) for iso in range(isometries.COUNT))
            maps, columns = zip(*every, strict=True)
            self._turned = np.stack(maps), list(columns)
        return self._turned

    def _turned_groups(self, group: np.ndarray, start: np.ndarray) -> np.ndarray:
        """Where the cells of a group at ``start`` lie on each of the turned maps, (8, 2, g)."""
        places, shape = group + np.reshape(start, (2, 1)), (self.grid.rows, self.grid.columns)
        return np.stack([turned_places(places, shape, iso) for iso in range(isometries.COUNT)])

    def turned_elsewhere(
        self, group: np.ndarray, start: np.ndarray, rng
    ) -> tuple[np.ndarray, np.ndarray]:
        """All cells, shuffled, each with an isometry drawn for it, but for those where ``group``
        would not lie on the map so turned, or not clear of where it is now: isometries ``(m,)``
        and corners ``(m, 2)``."""
        rows, columns = self.grid.rows, self.grid.columns
        ends = np.stack(np.divmod(rng.permutation(rows * columns), columns), axis=1)
        isos = rng.integers(0, isometries.COUNT, len(ends))
        shape = group.max(axis=1) + 1
        size = np.where(np.array([swaps(iso) for iso in range(8)])[isos, None], shape[::-1], shape)
        clear = ((ends >= start + shape) | (ends + size <= start)).any(axis=1)
        fits = clear & (ends + size <= (rows, columns)).all(axis=1)
        return isos[fits], ends[fits]

    def elsewhere(self, group: np.ndarray, start: np.ndarray, rng) -> np.ndarray:
        """All corners, ``(m, 2)``, shuffled, at which ``group`` lies clear of where it is now."""
        tall, wide = group.max(axis=1) + 1
        ends = corners(self.grid, group, rng)
        return ends[(np.abs(ends - start) >= (tall, wide)).any(axis=1)]

    def rearrange(
        self,
        draw: Callable[[], tuple[np.ndarray, np.ndarray]],
        count: int,
        rng: np.random.Generator,
        *,
        copied: bool = False,
        carried: bool = False,
        turned: bool = False,
        tolerance: float | None,
        change: float,
        choice: int,
    ) -> int:
        """Take ``count`` groups, each drawn by ``draw`` as (group, start), to the most seamless
        of ``choice`` admissible places elsewhere; returns how many had one.

        The group is exchanged with what stands there, or ``copied`` onto it. Where ``turned``, an
        isometry is drawn for each place. What is locked (condensation) is laid nowhere else.
        """
        lay = self.copy if copied else self.exchange
        moved = 0
        for _ in range(count):
            for _ in range(_TRIES):
                group, start = draw()
                if not group.size or self._held[self._places(group, start)].any():
                    continue
                isos = None
                if turned:
                    isos, ends = self.turned_elsewhere(group, start, rng)
                else:
                    ends = self.elsewhere(group, start, rng)
                found = self.best(
                    group,
                    start,
                    ends,
                    exchanged=not copied,
                    tolerance=tolerance,
                    change=change,
                    choice=choice,
                    isos=isos,
                )
                if found is not None:
                    iso = 0 if isos is None else int(isos[found])
                    there = turned_places(group, group.max(axis=1) + 1, iso)
                    if not copied and self._held[self._places(there, ends[found])].any():
                        continue
                    lay(group, start, ends[found], carried=carried, iso=iso)
                    moved += 1
                    break
        return moved

    def copy(self, group: np.ndarray, start, end, *, carried: bool = False, iso: int = 0) -> None:
        """Lay a copy of the group at ``start`` at ``end``, under an isometry; domain blocks inside
        the group go along with the copy if they are to be ``carried``."""
        shape = group.max(axis=1) + 1
        here = self._places(group, start)
        there = self._places(turned_places(group, shape, iso), end)
        self._forget()
        self._put(there, iso, *self._standing(here))
        if carried:
            self._lay()
            follows = np.zeros(self.stone.size, bool)
            follows[there] = True
            theirs = self.grid.raster(follows)[self.genome.pavement.corners]
            self._carry(theirs & self._inside(here), shape, start, end, iso)

    def exchange(
        self, group: np.ndarray, start, end, *, carried: bool = False, iso: int = 0
    ) -> None:
        """Exchange the groups at ``start`` and ``end``, clear of one another: the first is laid
        under an isometry, the other under its inverse. Domain blocks inside either, whosever they
        are, go along with it if they are to be ``carried``."""
        shape, back = group.max(axis=1) + 1, int(isometries.INVERSE[iso])
        turned = turned_places(group, shape, iso)
        here, there = self._places(group, start), self._places(turned, end)
        self._forget()
        ours, theirs = self._standing(here), self._standing(there)
        self._put(there, iso, *ours)
        self._put(here, back, *theirs)
        if carried:
            self._lay()
            forth, other = self._inside(here), self._inside(there)
            self._carry(forth, shape, start, end, iso)
            self._carry(other, turned.max(axis=1) + 1, end, start, back)

    def _standing(self, places: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Copies of what stands in cells: their map, their stones, how these are turned."""
        return self.blocks[places], self.stone[places], self.turn[places]

    def _put(self, places: np.ndarray, iso: int, blocks, stone, turn) -> None:
        """Lay what stood elsewhere in the cells ``places``, under an isometry."""
        self.blocks[places] = isometries.apply(iso, blocks)
        self.stone[places] = stone
        self.turn[places] = isometries.COMPOSITION[iso, turn]

    def draft(self, made: dict) -> Draft:
        """The child with all moves made."""
        self._lay()
        return Draft(self.genome, self.grid.raster(self.blocks), made)

    def _lay(self) -> None:
        """Bring the lifs to where the moves since the last call have carried them."""
        places = np.arange(self.stone.size)
        if np.array_equal(self.stone, places) and not self.turn.any():
            return
        row, column = np.divmod(self.stone.reshape(self.grid.rows, -1), self.grid.columns)
        nothing = np.zeros(row.shape, np.uint8)
        pieces = Pieces(self.grid.block, nothing, row, column, self.turn.reshape(row.shape))
        self.genome = laid([self.genome], pieces).genome
        self.stone, self.turn = places, np.zeros_like(self.turn)

    def _places(self, group: np.ndarray, corner) -> np.ndarray:
        """Indices of the cells of ``group`` at ``corner``."""
        return (group[0] + corner[0]) * self.grid.columns + group[1] + corner[1]

    def _inside(self, places: np.ndarray) -> np.ndarray:
        """Bool ``(n,)``: lifs whose domain block lies wholly in the cells ``places``."""
        cell, rows, columns = self.grid.block, self.grid.rows, self.grid.columns
        summed = np.zeros((rows + 1, columns + 1), np.int64)
        summed[1:, 1:].flat[places] = 1
        summed = summed.cumsum(axis=0).cumsum(axis=1)
        one = self.genome
        top, left = one.y // cell, one.x // cell
        bottom, right = -(-(one.y + one.dy) // cell), -(-(one.x + one.dx) // cell)
        within = summed[bottom, right] - summed[top, right]
        within += summed[top, left] - summed[bottom, left]
        return (one.dx > 0) & (within == (bottom - top) * (right - left))

    def _carry(self, lifs: np.ndarray, shape, start, end, iso: int) -> None:
        """Take the domain blocks of ``lifs`` (bool ``(n,)``) along with a rectangle of cells of
        this ``shape`` that is laid from ``start`` at ``end`` under an isometry."""
        one, cell = self.genome, self.grid.block
        y, x, dy, dx = (
            getattr(one, name)[lifs].astype(np.int64) for name in ("y", "x", "dy", "dx")
        )
        inside = np.stack([y, x]) - np.reshape(start, (2, 1)) * cell
        size = tuple(int(side) * cell for side in shape)
        far = inside + np.stack([dy, dx]) - 1
        ends = (turned_places(one, size, iso) for one in (inside, far))
        corner = np.minimum(*ends) + np.reshape(end, (2, 1)) * cell
        if swaps(iso):
            dy, dx = dx, dy
        values = {"y": corner[0], "x": corner[1], "dy": dy, "dx": dx}
        values["iso"] = isometries.COMPOSITION[one.iso[lifs], isometries.INVERSE[iso]]
        columns = {name: getattr(one, name).copy() for name in values}
        for name, column in columns.items():
            column[lifs] = values[name]
        self.genome = one.replace(**columns)
