"""`grow`: which groups of lifs are laid where."""

import itertools
from collections.abc import Callable, Sequence

import numpy as np

from evocity import isometries
from evocity.citymap import MAX_PIXELS, MAX_SIDE
from evocity.coding.decode import decode
from evocity.errors import OperatorError, shown
from evocity.genome import Genome
from evocity.growth._kernels import ANCHORED, WINDOW, lay_groups
from evocity.growth.fabric import LAYS, Growth
from evocity.growth.windows import Windows
from evocity.pavement import Pavement

#: Largest side of a group, pixels: what a group repeats is smaller than a window of `WINDOW`.
MAX_GROUP = ANCHORED - 1
#: Smallest side of a group, range blocks: a rim on either side to be cut in, and a core.
MIN_GROUP = 3

# Outlines are cut for so many of the candidates at a time; places are laid so many at a time.
_KEPT, _BATCH = 20, 32


def grow(
    genome: Genome,
    height: int,
    width: int,
    rng: np.random.Generator,
    *,
    corner: tuple[int, int] | None = None,
    size_min: int | None = None,
    size_max: int | None = None,
    tolerance: float = 6.0,
    candidates: int = 600,
    turned: bool = True,
    progress: Callable[[int, int], None] | None = None,
) -> Growth:
    """Lay groups of a genome's lifs beyond its extent, into a fabric of any size.

    The original stays as it is, and the fabric grows around it, place by place (Marsault 2005
    §4.2). A group is a rectangle of the original's range blocks, laid under one of the 8
    isometries, that laps over what stands by a rim. Of the candidates drawn, those that differ
    least from what stands are cut out along the least step (a least cut of the blocks: Kwatra
    et al. 2003, Graphcut textures), which mostly follows streets. A candidate is admissible as in
    `PavementFusion`: where along this outline, what it brings and what stands there differ by
    at most ``tolerance`` metres on average. Of the admissible, the one of little step whose
    lifs were laid least is taken, so that all of the original has its share; those that go on
    where a neighbour came from only if all others fail; and none that would make two windows
    of 64 × 64 px alike, but those that the original itself repeats.

    Parameters
    ----------
    genome : the original: 3 × 3 range blocks or more, of at most 18 px.
    height, width : of the fabric, px: multiples of B, not less than the original's.
    rng : draws the places and the candidates.
    corner : (row, column), in range blocks, of the original's north-west block in the fabric;
        None for the middle.
    size_min, size_max : sides of the groups, rims included, in range blocks: 3 or more, at most
        56 px, and no more than the original has. None: the largest that leave a choice, and
        half of that.
    tolerance : S, metres.
    candidates : how many are drawn for each group, 1 or more.
    turned : whether groups may be turned and mirrored; else streets keep their directions.
    progress : called with (done, total), counted in places.

    Returns
    -------
    Growth : ``made`` tells the number of groups, the mean ``step`` along their outlines, how
        many were laid without an admissible candidate (``forced``: the least step was taken),
        and how many make windows of 64 px come twice (``repeated``: every candidate did).

    Raises
    ------
    OperatorError : a parameter is out of its range; GenomeError : the code diverges.
    """
    _check_call(genome, rng, tolerance, candidates)
    p = genome.pavement
    pavement = _pavement(p, height, width)
    row, column = _corner(p, pavement, corner)
    size_min, size_max = _sizes(p, size_min, size_max)
    heights = decode(genome).city.heights + np.float32(0)  # no −0: it would not be like 0
    stones = np.full((pavement.rows, pavement.columns), -1, np.int32)
    own = np.arange(len(p), dtype=np.int32).reshape(p.rows, p.columns)
    stones[row : row + p.rows, column : column + p.columns] = 8 * own
    original = (row, column, row + p.rows, column + p.columns)
    places = _places(pavement, original, size_min, size_max, rng)
    isos = np.arange(isometries.COUNT if turned else 1)
    windows = Windows(heights, isos, (row * p.block, column * p.block), pavement.width)
    uses = np.ones(len(p), np.int64)
    steps, twice = np.empty(len(places)), np.empty(len(places), bool)
    for start in range(0, len(places), _BATCH):
        some = slice(start, start + _BATCH)
        count = len(places[some])
        draws = rng.integers(0, 1 << 62, (count, candidates))
        windows.make_room(count)
        grown = lay_groups(
            stones, original, heights, LAYS, isos, p.block, places[some], draws, float(tolerance),
            _KEPT, uses, windows.common, windows.allowed, windows.coarse, windows.fine,
            steps[some], twice[some],
        )  # fmt: skip
        windows.filled = [old + new for old, new in zip(windows.filled, grown, strict=True)]
        if progress is not None:
            progress(start + count, len(places))
    steps = steps[np.isfinite(steps)]
    made = {
        "operator": "growth",
        "corner": [row, column],
        "size_min": size_min,
        "size_max": size_max,
        "tolerance": float(tolerance),
        "candidates": int(candidates),
        "turned": bool(turned),
        "groups": steps.size,
        "step": round(float(steps.mean()), 4) if steps.size else 0.0,
        "forced": int((steps > tolerance).sum()),
        "repeated": int(twice.sum()),
    }
    stones.setflags(write=False)
    return Growth(genome, heights, pavement, (row, column), stones, steps, made)


def _places(
    pavement: Pavement,
    original: tuple[int, int, int, int],
    size_min: int,
    size_max: int,
    rng: np.random.Generator,
) -> np.ndarray:
    """Places of groups, int64 ``(n, 4)``: top, left, tall, wide, in blocks, in order of laying.

    Cores of drawn sides tile the fabric in bands, each lapped over its neighbours by a rim. They
    go away from the original, to the south-east, the south-west and the north, so that what
    stands always lies behind.
    """
    rim = (size_min + 1) // 4
    shortest, longest = size_min - 2 * rim, size_max - 2 * rim
    row, column = original[:2]
    rows, columns = pavement.rows, pavement.columns

    def spans(first: int, last: int) -> list[tuple[int, int]]:
        ends = [first]
        while ends[-1] < last:
            ends.append(min(last, ends[-1] + int(rng.integers(shortest, longest + 1))))
        return list(itertools.pairwise(ends))

    bands = [
        *((band, spans(column, columns)) for band in spans(row, rows)),
        *((band, spans(0, column)[::-1]) for band in spans(row, rows)),
        *((band, spans(0, columns)) for band in spans(0, row)[::-1]),
    ]
    places = []
    for (top, bottom), cores in bands:
        top, bottom = max(top - rim, 0), min(bottom + rim, rows)
        for left, right in cores:
            left, right = max(left - rim, 0), min(right + rim, columns)
            if not (
                original[0] <= top
                and original[1] <= left
                and bottom <= original[2]
                and right <= original[3]
            ):
                places.append((top, left, bottom - top, right - left))
    return np.array(places, np.int64).reshape(-1, 4)


def _check_call(genome, rng, tolerance, candidates) -> None:
    if not isinstance(rng, np.random.Generator):
        raise OperatorError(
            f"growth: rng = {shown(rng)}",
            "a NumPy Generator",
            "pass numpy.random.default_rng(seed)",
        )
    if not isinstance(genome, Genome):
        raise OperatorError(
            f"growth: a {type(genome).__name__} to grow",
            "a Genome",
            "encode a map first: evocity.encode(city).genome",
        )
    p = genome.pavement
    if MIN_GROUP * p.block > MAX_GROUP or min(p.rows, p.columns) < MIN_GROUP:
        raise OperatorError(
            f"growth: {p.rows} × {p.columns} range blocks of {p.block} px",
            f"{MIN_GROUP} × {MIN_GROUP} range blocks or more, of at most {MAX_GROUP // MIN_GROUP} "
            f"px: groups of {MIN_GROUP} must be smaller than a window of {WINDOW} px",
            "encode the map again with block=4",
        )
    if not (isinstance(tolerance, int | float) and tolerance >= 0):  # NaN is not
        raise OperatorError(
            f"growth: tolerance = {shown(tolerance)}", "0 m or more", "leave it out for 6 m"
        )
    if not _whole(candidates) or not 1 <= candidates <= 1 << 20:
        raise OperatorError(
            f"growth: candidates = {shown(candidates)}",
            "a whole number, 1 to 1048576",
            "leave it out for 600",
        )


def _pavement(p: Pavement, height: int, width: int) -> Pavement:
    """The fabric's pavement, or `OperatorError`."""
    sides = {"height": (height, p.height), "width": (width, p.width)}
    faults = {}
    for name, (side, least) in sides.items():
        if not _whole(side) or side % p.block or not least <= side <= MAX_SIDE:
            near = _near(side, p.block, least) if _whole(side) else f"{least} or more"
            faults[f"{name} = {shown(side)}"] = f"{name} {near}"
    if faults:
        raise OperatorError(
            f"growth: {', '.join(faults)}",
            f"multiples of {p.block} px, from the original's {p.height} × {p.width} to {MAX_SIDE}: "
            + ", ".join(faults.values()),
            "choose one of these sizes",
        )
    if height * width > MAX_PIXELS:
        raise OperatorError(
            f"growth: height = {height}, width = {width}: {height * width / 1e6:.0f} million px",
            f"at most {MAX_PIXELS // 10**6} million, about 11 500 × 11 500",
            "choose a smaller size",
        )
    return Pavement(int(height), int(width), p.block)


def _near(side: int, block: int, least: int) -> str:
    """The sizes nearest to ``side`` that would do, in words."""
    low, high = max(side // block * block, least), max(-(-side // block) * block, least)
    most = MAX_SIDE // block * block
    return " or ".join(dict.fromkeys(str(min(one, most)) for one in (low, high)))


def _corner(p: Pavement, pavement: Pavement, corner) -> tuple[int, int]:
    free = pavement.rows - p.rows, pavement.columns - p.columns
    if corner is None:
        return free[0] // 2, free[1] // 2
    if (
        not isinstance(corner, Sequence)
        or len(corner) != 2
        or not all(_whole(at) and 0 <= at <= most for at, most in zip(corner, free, strict=True))
    ):
        raise OperatorError(
            f"growth: corner = {shown(corner)}",
            f"(row, column) in range blocks, rows 0 to {free[0]}, columns 0 to {free[1]}",
            "leave it out for the middle",
        )
    return int(corner[0]), int(corner[1])


def _sizes(p: Pavement, size_min, size_max) -> tuple[int, int]:
    """Sides of the groups, in blocks, or `OperatorError`."""
    most = min(MAX_GROUP // p.block, p.rows, p.columns)
    given = {"size_min": size_min, "size_max": size_max}
    wrong = {k: v for k, v in given.items() if v is not None and not _whole(v)}
    if not wrong:
        usual = min(most, max(min(p.rows, p.columns) // 2, MIN_GROUP))
        largest = max(usual, size_min or 0) if size_max is None else size_max
        smallest = max(MIN_GROUP, largest // 2 + 1) if size_min is None else size_min
        if MIN_GROUP <= smallest <= largest <= most:
            return int(smallest), int(largest)
        wrong = {k: v for k, v in given.items() if v is not None}
    raise OperatorError(
        "growth: " + ", ".join(f"{key} = {shown(value)}" for key, value in wrong.items()),
        f"{MIN_GROUP} to {most} range blocks of {p.block} px, size_min at most size_max",
        "change them, or leave them out",
    )


def _whole(value) -> bool:
    return isinstance(value, int | np.integer) and not isinstance(value, bool)
