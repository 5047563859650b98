"""`grow`: what a fabric is to be grown from, and how."""

import math
from collections.abc import Sequence

import numpy as np

from evocity.coding.decode import decode
from evocity.errors import OperatorError, setting, shown
from evocity.genome import Genome
from evocity.growth.fabric import FARTHEST, Growth, is_whole
from evocity.growth.lattice import (
    LEAST_LARGEST,
    MAX_CELL,
    MAX_GROUP,
    MIN_CELL,
    MIN_GROUP,
    TILE,
    Lattice,
)
from evocity.growth.plane import Plane
from evocity.growth.shares import Share, Shares

#: Side of a cell, metres, where nothing else is said.
CELL = 8.0


def grow(
    genome: Genome | Sequence[Genome],
    height: int | None = None,
    width: int | None = None,
    rng: np.random.Generator | None = None,
    *,
    corner: tuple[int, int] | None = None,
    share: Share | None = None,
    share_over: tuple[int, int, int, int] | None = None,
    cell: int | None = None,
    side_min: float | None = None,
    side_max: float | None = None,
    tolerance: float = 6.0,
    candidates: int = 600,
    turned: bool = True,
    size_min: int | None = None,
    size_max: int | None = None,
) -> Growth:
    """Lay groups of a genome's fabric beyond its extent, into a fabric without end.

    The original stays as it is, and the fabric grows around it (Marsault 2005 §4.2), laid when
    a window of it is asked for. A group is a rectangle of cells of the original's decoded map, laid
    under one of the 8 isometries, that laps over what stands by a rim. Of the candidates drawn,
    those that differ least from what stands are cut out along the least step (a least cut of the
    cells: Kwatra et al. 2003, Graphcut textures), which mostly follows streets. A candidate is
    admissible as in `PavementFusion`: where along this outline, what it brings and what stands
    there differ by at most ``tolerance`` metres on average. Of the admissible, the one of little
    step whose cells were laid least is taken, so that all of the original has its share; those
    that go on where a neighbour came from only if all others fail; and none that would make two
    windows of 64 × 64 px alike, of those in its tile, but those that the original itself repeats.

    What stands at a place is a function of the generator's first draw and of the place: the plane
    is laid in tiles of some 128 px, in phases of which each knows a bounded neighbourhood, see
    `evocity.growth.lattice`. ``height``, ``width`` and ``corner`` say which rectangle of it is
    written, and change nothing in it.

    Parameters
    ----------
    genome : the original, or several of one pixel size. The first stands in the fabric; groups
        are laid of all, by their ``share``. Each is of 6 × 6 cells or more.
    height, width : of the rectangle that is written, px; None for the first original's.
    rng : the seed of all that is drawn is drawn from it.
    corner : (row, column), in cells, of the first original's north-west cell in that rectangle;
        None for the middle (of several: the middle of the west edge).
    share : which original groups come from. None for a ramp across the rectangle, from the first
        original in the west to the last in the east; else the share of the second of two, 0 to 1,
        or one number an original: as it is, as an array laid over the rectangle (``(h, w)``, or
        one such an original), whose edges go on beyond it, or as a function of the pixel's
        (row, column) in it, which must always say the same of the same pixel.
    share_over : (top, left, height, width) of the rectangle that the ramp or the array lies over,
        px, in rows and columns of the one that is written; None for that one itself.
    cell : side of the squares that groups are cut from and cut along, px, 2 to 11: a divisor of
        the originals' sides. None: a side of about 8 m; where range blocks are uniform, one that
        they divide, if there is one.
    side_min, side_max : sides of the groups, rims included, metres, rounded to cells: 3 cells or
        more, the larger 5 or more; at most 56 px, and less than the originals have. None: the
        largest that leave a choice, and half of that.
    tolerance : S, metres.
    candidates : how many are drawn for each group, 1 or more.
    turned : whether groups may be turned and mirrored; else streets keep their directions.
    size_min, size_max : deprecated, the same as ``side_min`` and ``side_max`` in range blocks, for
        uniform pavements.

    Raises
    ------
    OperatorError : a parameter is out of its range; GenomeError : the code diverges.
    """
    originals = _originals(genome)
    _check_call(rng, tolerance, candidates)
    cell = _cell(originals, cell)
    shortest = min(min(p.height, p.width) // cell for p in (one.pavement for one in originals))
    sides = _sides(originals, cell, shortest, side_min, side_max, size_min, size_max)
    p = originals[0].pavement
    shape = (p.height if height is None else height), (p.width if width is None else width)
    place = _place(p, shape, corner, cell, len(originals))
    lattice = Lattice(p.height // cell, p.width // cell, TILE // cell, *sides)
    shares = Shares(len(originals), share, *_over(share_over, shape, place))
    metres = [side * cell * originals[0].metres_per_pixel for side in sides]
    seed = int(rng.integers(0, 1 << 63))
    plane = Plane(
        [decode(one).city.heights for one in originals], cell, lattice, shares, seed,
        tolerance=float(tolerance), candidates=int(candidates), turned=bool(turned),
    )  # fmt: skip
    made = {
        "operator": "growth",
        "seed": seed,
        "corner": [at // cell for at in place],
        "cell": cell,
        "side_min": metres[0],
        "side_max": metres[1],
        "tolerance": float(tolerance),
        "candidates": int(candidates),
        "turned": bool(turned),
    }
    if len(originals) > 1:
        made["share"] = shares.told
    return Growth(originals, plane, shape, place, made).at(0, 0, *shape)


def _originals(genome) -> tuple[Genome, ...]:
    several = (genome,) if isinstance(genome, Genome) else genome
    if not isinstance(several, Sequence) or not several or isinstance(several, str):
        several = (genome,)
    wrong = [one for one in several if not isinstance(one, Genome)]
    if wrong:
        raise OperatorError(
            f"growth: a {type(wrong[0]).__name__} to grow",
            "a Genome, or several",
            "encode a map first: evocity.encode(city).genome",
        )
    pixels = sorted({one.metres_per_pixel for one in several})
    if len(pixels) > 1:
        raise OperatorError(
            f"growth: genomes of {' and '.join(f'{side:g}' for side in pixels)} m a pixel",
            "genomes of one pixel size",
            "read the maps again with the same metres_per_pixel",
        )
    return tuple(several)


def _check_call(rng, tolerance, candidates) -> None:
    if not isinstance(rng, np.random.Generator):
        raise OperatorError(
            f"growth: rng = {shown(rng)}",
            "a NumPy Generator",
            "pass numpy.random.default_rng(seed)",
        )
    if not (isinstance(tolerance, int | float) and tolerance >= 0):  # NaN is not
        raise OperatorError(
            f"growth: {setting('tolerance', tolerance)}", "0 m or more", "leave it out for 6 m"
        )
    if not is_whole(candidates) or not 1 <= candidates <= 1 << 20:
        raise OperatorError(
            f"growth: {setting('candidates', candidates)}",
            "a whole number, 1 to 1048576",
            "leave it out for 600",
        )


def _cell(originals: Sequence[Genome], cell) -> int:
    """Side of a cell, px, or `OperatorError`."""
    common = math.gcd(
        *(side for one in originals for side in (one.pavement.height, one.pavement.width))
    )
    shortest = min(min(one.pavement.height, one.pavement.width) for one in originals)
    fit = [
        side
        for side in range(MIN_CELL, MAX_CELL + 1)
        if common % side == 0 and shortest // side > LEAST_LARGEST
    ]
    if cell is None and fit:
        wanted = CELL / originals[0].metres_per_pixel
        blocks = {_block_of(one) for one in originals}
        whole = [side for side in fit if all(block and side % block == 0 for block in blocks)]
        return min(whole or fit, key=lambda side: abs(math.log(side / wanted)))
    if not is_whole(cell) or cell not in fit:
        found = " and ".join(f"{one.pavement.height} × {one.pavement.width}" for one in originals)
        raise OperatorError(
            f"growth: {setting('cell', cell)}, maps of {found} px" if cell is not None
            else f"growth: maps of {found} px",
            f"a divisor of the sides, one of {', '.join(map(str, fit))} px" if fit
            else f"{LEAST_LARGEST + 1} × {LEAST_LARGEST + 1} cells or more of "
            f"{MIN_CELL} to {MAX_CELL} px, whole ones",
            "choose one of these, or leave cell out" if fit
            else "crop the maps, or read them larger",
        )  # fmt: skip
    return int(cell)


def _block_of(genome: Genome) -> int | None:
    """Side of the range blocks, px, if they are all of one."""
    return genome.pavement.block if genome.pavement.uniform else None


def _sides(
    originals, cell: int, shortest: int, side_min, side_max, size_min, size_max
) -> tuple[int, int]:
    """Sides of the groups, in cells, or `OperatorError`."""
    most = min(MAX_GROUP // cell, shortest - 1)
    metre = 1 / (cell * originals[0].metres_per_pixel)
    bounds, given = {}, {}
    for name, side, size in (("min", side_min, size_min), ("max", side_max, size_max)):
        if side is not None and size is not None:
            raise OperatorError(
                f"growth: {setting(f'side_{name}', side)} and {setting(f'size_{name}', size)}",
                "one of them: both are the same bound, in metres and in range blocks",
                f"leave size_{name} out",
            )
        if side is not None:
            given[f"side_{name}"] = side
            real = isinstance(side, int | float) and not isinstance(side, bool)
            bounds[name] = round(side * metre) if real and math.isfinite(side) else -1
        elif size is not None:
            given[f"size_{name}"] = size
            bounds[name] = _in_cells(originals, f"size_{name}", size, cell)
    usual = min(most, max(shortest // 2, LEAST_LARGEST))
    largest = bounds.get("max", max(usual, bounds.get("min", 0)))
    smallest = bounds.get("min", max(MIN_GROUP, largest // 2 + 1))
    if MIN_GROUP <= smallest <= largest <= most and largest >= LEAST_LARGEST:
        return smallest, largest
    in_metres = [f"{side / metre:g}" for side in (MIN_GROUP, most, LEAST_LARGEST)]
    raise OperatorError(
        "growth: " + ", ".join(setting(key, value) for key, value in given.items()),
        f"{in_metres[0]} to {in_metres[1]} m, {MIN_GROUP} to {most} cells of {cell} px, "
        f"the smaller at most the larger, which is {in_metres[2]} m or more",
        "change them, or leave them out",
    )


def _in_cells(originals, name: str, size, cell: int) -> int:
    """A size in range blocks as one in cells."""
    blocks = {_block_of(one) for one in originals}
    block = blocks.pop()
    if blocks or block is None:
        raise OperatorError(
            f"growth: {setting(name, size)} in range blocks, which are of several sides",
            f"{name.replace('size', 'side')}, in metres",
            f"leave {name} out",
        )
    if not is_whole(size):
        return -1
    return round(size * block / cell)


def _over(over, shape, place) -> tuple[tuple[int, int], tuple[int, int]]:
    """(height, width) of what a share lies over, and the first original's corner in it."""
    if over is None:
        return shape, place
    if (
        not isinstance(over, Sequence)
        or len(over) != 4
        or not all(is_whole(part) and abs(part) <= FARTHEST for part in over)
        or min(over[2:]) < 1
    ):
        raise OperatorError(
            f"growth: {setting('share_over', over)}",
            "(top, left, height, width) in pixels, whole numbers, height and width 1 or more",
            "leave it out for the map that is written",
        )
    return tuple(over[2:]), (place[0] - over[0], place[1] - over[1])


def _place(p, shape, corner, cell: int, count: int) -> tuple[int, int]:
    """(row, column) of the first original's north-west pixel in the rectangle."""
    if corner is None:
        free = (
            side - own if is_whole(side) else 0
            for side, own in zip(shape, (p.height, p.width), strict=True)
        )
        row, column = (side // cell // 2 for side in free)
        return row * cell, column * cell if count == 1 else 0
    if (
        not isinstance(corner, Sequence)
        or len(corner) != 2
        or not all(is_whole(at) and abs(at) < 1 << 40 for at in corner)
    ):
        raise OperatorError(
            f"growth: {setting('corner', corner)}",
            f"(row, column) in cells of {cell} px, whole numbers",
            "leave it out for the middle",
        )
    return int(corner[0]) * cell, int(corner[1]) * cell
