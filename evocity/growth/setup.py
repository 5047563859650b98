"""The function `grow`: checks of its parameters, defaults, set-up of the plane."""

import math
from collections.abc import Sequence

import numpy as np

from evocity.coding.decode import decode
from evocity.errors import OperatorError, check_number, is_number, is_whole, keyword, setting
from evocity.genome import Genome
from evocity.growth.fabric import FARTHEST, Growth
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
from evocity.growth.quarter_plane import QuarterPlane
from evocity.growth.shares import Share, Shares
from evocity.operators.parameters import check_generator

#: The default side of a cell, metres.
CELL = 8.0
#: The default tolerance, metres.
TOLERANCE = 6.0
#: The default side of a quarter, metres, and how far sides differ from it, as a share.
QUARTER, SPREAD = 200.0, 0.36
#: The smallest side of a quarter, metres; the largest, as a share of the originals' shortest side.
LEAST_QUARTER, LARGEST = 40.0, 0.55


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
    tolerance: float = TOLERANCE,
    candidates: int = 600,
    turned: bool = True,
    streets: bool = False,
    size_min: int | None = None,
    size_max: int | None = None,
) -> Growth:
    """Grow an endless city fabric around the map of a genome, from groups of cells of this map.

    The original map stays unchanged, and the fabric around it is computed on demand (Marsault 2005
    §4.2). A group is a rectangle of cells of the original's decoded map, under one of the 8
    isometries. The rim of a group of cells overlaps the surroundings of the group. Candidates for
    each group are drawn at random, and the candidates that differ least from the surroundings are
    kept. Overlapping groups are cut along the line of least difference, which mostly follows
    streets (Kwatra and others 2003, Graphcut textures).

    A candidate is admissible if the mean difference of heights along the candidate's outline is at
    most ``tolerance``, as in `PavementFusion`. Among admissible candidates, the function prefers
    small differences and rarely used cells, so that cells from the whole original appear. A
    candidate that continues the copied pixels of a neighbouring group is chosen only after all
    other candidates. Within a tile, no candidate repeats a window of 64 × 64 px that the original
    does not repeat.

    With ``streets``, the fabric has a network of continuous streets. Avenues divide the plane into
    districts, and straight streets divide each district into quarters. Each quarter copies the
    buildings at one place of an original, and turns them by any angle to follow the quarter's
    streets. A street cuts a building only along the building's front, and small pieces are left
    out. Inside a quarter, streets of the original end at the surrounding streets, or continue
    beyond these streets. Street lengths in the fabric stay near those of the originals.

    The first number of the generator `rng` is the seed; seed and position determine the content of
    the fabric. The fabric grows in tiles of about 128 px, and each tile depends only on its
    neighbourhood (`evocity.growth.lattice`). The arguments ``height``, ``width`` and ``corner``
    only select the rectangle to be written; the fabric does not depend on them.

    Parameters
    ----------
    genome : original genome, or several genomes of equal pixel size, each of at least 6 × 6 cells.
        The first original appears in the fabric. Groups of cells come from all originals; the
        parameter ``share`` sets the proportions.
    height, width : size of the rectangle to be written, px; None means the size of the first
        original.
    rng : generator whose first number becomes the seed of all random draws.
    corner : row and column of the first original in the rectangle to be written, counted in cells.
        If ``corner`` is None, a single original lies in the middle of the rectangle; the first of
        several originals lies at the west edge.
    share : share of each original in the fabric. If ``share`` is None, the shares form a ramp from
        the first original in the west to the last original in the east. If ``share`` is a number
        from 0 to 1, this number is the constant share of the second of two originals. If ``share``
        is a sequence, the sequence has a constant share for each original. The parameter ``share``
        may be an array ``(h, w)``, or a sequence of such arrays, one for each original. Arrays of
        shares cover the rectangle ``share_over``, and the edge values of an array continue outside
        the rectangle. If ``share`` is a function, the function returns the share for the row and
        the column of a pixel.
    share_over : rectangle (top, left, height, width), px, that a ramp or an array of shares covers.
        The rows and columns of ``share_over`` count from the north-west corner of the rectangle to
        be written. If ``share_over`` is None, a ramp or an array of shares covers the rectangle to
        be written.
    cell : side of the square cells, px, 2 to 11; the side must divide the sides of the originals.
        If ``cell`` is None, the side of a cell is about 8 m, and a multiple of the range blocks'
        side if possible.
    side_min, side_max : smallest and largest side of a group of cells including the rim, metres,
        rounded to cells. The smallest side must be 3 cells or more, and the largest side must be 5
        cells or more. Each side of a group must be at most 56 px, and less than the sides of the
        originals. By default, the largest side of a group is half the originals' shortest side, and
        the smallest side is half the largest side.
    tolerance : largest mean difference of heights along the outline of a group of cells, metres.
    candidates : number of candidates for each group of cells, 1 or more.
    turned : whether groups may be rotated and mirrored; if false, streets keep their directions. If
        ``turned`` is false, the buildings of a quarter between streets turn by at most 45°.
    streets : whether the plane consists of quarters between streets, instead of groups of cells.
        With ``streets``, the bounds ``side_min`` and ``side_max`` apply to quarters, from 40 m to
        0.55 of the originals' shortest side. By default, quarters have sides of about 130 to 270 m.
        With ``streets``, the parameter ``candidates`` applies to quarters, and ``tolerance`` must
        keep its default.
    size_min, size_max : deprecated forms of ``side_min`` and ``side_max``, counted in range blocks
        of equal size.

    Raises
    ------
    OperatorError : a parameter is out of range.
    GenomeError : the decoding of an original diverges.
    """
    originals = _originals(genome)
    _check_call(rng, tolerance, candidates)
    cell = _cell(originals, cell)
    bounds = {"side_min": side_min, "side_max": side_max, "size_min": size_min}
    bounds["size_max"] = size_max
    sides = _quarter_sides(originals, tolerance, bounds) if streets else None
    sides = sides or _sides(originals, cell, bounds)
    p = originals[0].pavement
    shape = (p.height if height is None else height), (p.width if width is None else width)
    place = _place(p, shape, corner, cell, len(originals))
    shares = Shares(len(originals), share, *_over(share_over, shape, place))
    seed = int(rng.integers(0, 1 << 63))
    how = {
        "tolerance": float(tolerance),
        "candidates": int(candidates),
        "turned": bool(turned),
    }
    cities = [decode(original).city for original in originals]
    pixel = originals[0].metres_per_pixel
    if streets:
        del how["tolerance"]
        plane = QuarterPlane(cities, cell, sides, shares, seed, **how)
        how["streets"] = True
    else:
        lattice = Lattice(p.height // cell, p.width // cell, TILE // cell, *sides)
        plane = Plane([city.heights for city in cities], cell, lattice, shares, seed, **how)
        sides = [side * cell for side in sides]
    made = {
        "operator": "growth",
        "seed": seed,
        "corner": [at // cell for at in place],
        "cell": cell,
        "side_min": sides[0] * pixel,
        "side_max": sides[1] * pixel,
        **how,
    }
    if len(originals) > 1:
        made["share"] = shares.label
    return Growth(originals, plane, shape, place, made).at(0, 0, *shape)


def _originals(genome) -> tuple[Genome, ...]:
    several = (genome,) if isinstance(genome, Genome) else genome
    if not isinstance(several, Sequence) or not several or isinstance(several, str):
        several = (genome,)
    wrong = [item for item in several if not isinstance(item, Genome)]
    if wrong:
        raise OperatorError(
            f"growth: an object of the class {type(wrong[0]).__name__} cannot grow",
            "an object of the class Genome, or a sequence of such objects",
            "encode a map first: evocity.encode(city).genome",
        )
    pixels = sorted({genome.metres_per_pixel for genome in several})
    if len(pixels) > 1:
        raise OperatorError(
            "growth: the genomes have pixels of different sides, "
            f"{' and '.join(f'{side:g}' for side in pixels)} m",
            "genomes with pixels of the same side",
            "read the maps again with the same metres_per_pixel",
        )
    return tuple(several)


def _check_call(rng, tolerance, candidates) -> None:
    check_generator("growth", rng)
    if not (isinstance(tolerance, int | float) and tolerance >= 0):  # NaN fails too
        raise OperatorError(
            f"growth: {setting('tolerance', tolerance)} is out of range",
            "a tolerance of 0 m or more",
            "leave the parameter 'tolerance' out to use 6 m",
        )
    expected = "a whole number of candidates, from 1 to 1048576"
    remedy = "leave candidates out to use 600 candidates"
    check_number("candidates", candidates, 1, 1 << 20, expected, OperatorError, remedy, whole=True)


def _cell(originals: Sequence[Genome], cell) -> int:
    """Compute the side of a cell, px, or raise `OperatorError`."""
    maps = [(original.pavement.height, original.pavement.width) for original in originals]
    common, shortest = math.gcd(*sum(maps, ())), min(map(min, maps))
    fit = [
        side
        for side in range(MIN_CELL, MAX_CELL + 1)
        if common % side == 0 and shortest // side > LEAST_LARGEST
    ]
    if cell is None and fit:
        ideal = CELL / originals[0].metres_per_pixel
        blocks = _blocks_of(originals)
        whole = [side for side in fit if all(block and side % block == 0 for block in blocks)]
        return min(whole or fit, key=lambda side: abs(math.log(side / ideal)))
    if is_whole(cell) and cell in fit:
        return int(cell)
    found = " and ".join(f"{height} × {width}" for height, width in maps)
    found = (
        f"maps of {found} px" if cell is None else f"{setting('cell', cell)}, maps of {found} px"
    )
    expected = f"a divisor of the sides, one of {', '.join(map(str, fit))} px"
    remedy = "choose one of these, or leave cell out"
    if not fit:
        least = LEAST_LARGEST + 1
        expected = f"at least {least} × {least} whole cells of {MIN_CELL} to {MAX_CELL} px"
        remedy = "crop the maps, or read them larger"
    raise OperatorError(f"growth: {found}", expected, remedy)


def _blocks_of(originals: Sequence[Genome]) -> set[int | None]:
    """Collect the sides of range blocks, px; None for leaves of several sides."""
    pavements = (original.pavement for original in originals)
    return {p.block if p.uniform else None for p in pavements}


def _sides(originals, cell: int, parameters: dict) -> tuple[int, int]:
    """Compute the sides of the groups, in cells, or raise `OperatorError`."""
    pavements = [original.pavement for original in originals]
    shortest = min(min(p.height, p.width) // cell for p in pavements)
    most = min(MAX_GROUP // cell, shortest - 1)
    metre = 1 / (cell * originals[0].metres_per_pixel)
    bounds, given = {}, {}
    for name in ("min", "max"):
        side, size = parameters[f"side_{name}"], parameters[f"size_{name}"]
        if side is not None and size is not None:
            raise OperatorError(
                f"growth: {setting(f'side_{name}', side)} is given together with "
                f"{setting(f'size_{name}', size)}",
                "only one of the two bounds, either in metres or in range blocks",
                f"leave the parameter 'size_{name}' out",
            )
        if side is not None:
            given[f"side_{name}"] = side
            bounds[name] = round(side * metre) if is_number(side) and math.isfinite(side) else -1
        elif size is not None:
            given[f"size_{name}"] = size
            bounds[name] = _in_cells(originals, f"size_{name}", size, cell)
    default = min(most, max(shortest // 2, LEAST_LARGEST))
    largest = bounds.get("max", max(default, bounds.get("min", 0)))
    smallest = bounds.get("min", max(MIN_GROUP, largest // 2 + 1))
    if MIN_GROUP <= smallest <= largest <= most and largest >= LEAST_LARGEST:
        return smallest, largest
    in_metres = [f"{side / metre:g}" for side in (MIN_GROUP, most, LEAST_LARGEST)]
    raise OperatorError(
        "growth: " + ", ".join(setting(key, value) for key, value in given.items()),
        f"{in_metres[0]} to {in_metres[1]} m, {MIN_GROUP} to {most} cells of {cell} px, "
        f"the smaller at most the larger, the larger {in_metres[2]} m or more",
        "change these sides, or leave them out",
    )


def _quarter_sides(originals, tolerance: float, parameters: dict) -> tuple[float, float]:
    """Compute the bounds of the sides of quarters, px, or raise `OperatorError`."""
    other = {name: parameters[name] for name in ("size_min", "size_max")}
    other = {name: value for name, value in other.items() if value is not None}
    if tolerance != TOLERANCE:
        other["tolerance"] = tolerance
    if other:
        raise OperatorError(
            "growth along streets: "
            + ", ".join(setting(name, value) for name, value in other.items()),
            "only parameters that apply to quarters",
            f"leave out {', '.join(map(keyword, other))}, or grow without streets",
        )
    pixel = originals[0].metres_per_pixel
    shortest = min(min(one.pavement.height, one.pavement.width) for one in originals) * pixel
    most = LARGEST * shortest
    usual = min(QUARTER, most / (1 + SPREAD))
    low, high = parameters["side_min"], parameters["side_max"]
    if high is None:
        high = max((1 + SPREAD) * usual, low if is_number(low) else 0)
    if low is None and is_number(high):
        low = max(min((1 - SPREAD) * usual, high), min(LEAST_QUARTER, high))
    if all(map(is_number, (low, high))) and LEAST_QUARTER <= low <= high <= most * (1 + 1e-9):
        return low / pixel, high / pixel
    given = [
        setting(name, parameters[name])
        for name in ("side_min", "side_max")
        if parameters[name] is not None
    ]
    if most < LEAST_QUARTER:
        raise OperatorError(
            f"growth along streets: a map with a side of {shortest:g} m",
            f"sides of at least {LEAST_QUARTER / LARGEST:.0f} m",
            "read the map larger, or grow without streets",
        )
    raise OperatorError(
        f"growth along streets: {', '.join(given)}",
        f"{LEAST_QUARTER:g} to {most:g} m, the smaller at most the larger",
        "change these sides, or leave them out",
    )


def _in_cells(originals, name: str, size, cell: int) -> int:
    """Convert a size in range blocks to cells."""
    blocks = _blocks_of(originals)
    block = blocks.pop()
    if blocks or block is None:
        raise OperatorError(
            f"growth: {setting(name, size)} does not apply to range blocks of several sides",
            f"the parameter '{name.replace('size', 'side')}' with a bound in metres",
            f"replace '{name}' by '{name.replace('size', 'side')}'",
        )
    if not is_whole(size):
        return -1
    return round(size * block / cell)


def _over(over, shape, place) -> tuple[tuple[int, int], tuple[int, int]]:
    """Compute the size of the rectangle under a share, and the first original's corner in it."""
    if over is None:
        return shape, place
    if (
        not isinstance(over, Sequence)
        or len(over) != 4
        or not all(is_whole(part) and abs(part) <= FARTHEST for part in over)
        or min(over[2:]) < 1
    ):
        raise OperatorError(
            f"growth: {setting('share_over', over)} is not a rectangle",
            "whole numbers of pixels (top, left, height, width), with height and width of 1 or "
            "more",
            "leave the parameter 'share_over' out to spread the share over the whole written map",
        )
    return tuple(over[2:]), (place[0] - over[0], place[1] - over[1])


def _place(p, shape, corner, cell: int, count: int) -> tuple[int, int]:
    """Compute (row, column) of the first original's north-west pixel in the rectangle."""
    if corner is None:
        free = (
            side - length if is_whole(side) else 0
            for side, length in zip(shape, (p.height, p.width), strict=True)
        )
        row, column = (side // cell // 2 for side in free)
        return row * cell, column * cell if count == 1 else 0
    if (
        not isinstance(corner, Sequence)
        or len(corner) != 2
        or not all(is_whole(at) and abs(at) < 1 << 40 for at in corner)
    ):
        raise OperatorError(
            f"growth: {setting('corner', corner)} is not a cell",
            f"two whole numbers (row, column), counted in cells of {cell} px",
            "leave the parameter 'corner' out to start in the middle",
        )
    return int(corner[0]) * cell, int(corner[1]) * cell
