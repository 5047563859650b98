"""Grids of cells that operators cut and lay along: sizes in metres as cells, rotation of cells.

On a uniform pavement the cells are its range blocks; leaves split where the side of a cell crosses
them.
"""

from collections.abc import Callable, Sequence

import numpy as np

from evocity import isometries
from evocity.errors import GenomeError, OperatorError
from evocity.genome import Genome
from evocity.operators.parameters import MOST_METRES, Check, at_fault
from evocity.pavement import Pavement, common_refinement, quartered

#: The largest side of cells among leaves, metres: finer cells would split more leaves than
#: buildings need, coarser cells would cut buildings.
CELL = 8.0

#: Deprecated keys, in range blocks, and their successors, in metres.
METRES = {
    "size_min": "side_min",
    "size_max": "side_max",
    "grain": "grain_side",
    "group": "group_side",
    "limit": "area_max",
    "positions": "places",
}


def common_grid(name: str, parents: Sequence[Genome], largest: float = CELL) -> Pavement:
    """Find the cells along which ``parents`` can be crossed, as a uniform pavement: their range
    blocks if all have one side; else cells of the largest side of all within ``largest`` metres.

    Raises `OperatorError`, in the name of the operator, where no refinement of the parents' range
    blocks exists.
    """
    pavements = list(dict.fromkeys(parent.pavement for parent in parents))
    first = pavements[0]
    if len(pavements) == 1 and first.uniform:
        return first
    if not quartered(pavements):
        refinement(name, pavements)  # raises without a refinement
    sides = np.unique([side for p in pavements for side in p.levels])
    within = sides[sides * parents[0].metres_per_pixel <= largest]
    return Pavement(first.height, first.width, int(within.max(initial=sides.min())))


def refinement(name: str, pavements: Sequence[Pavement]) -> Pavement:
    """Find the common refinement of ``pavements``. Raises `OperatorError`, in the name of the
    operator, where no refinement exists."""
    try:
        return common_refinement(pavements)
    except GenomeError as error:
        raise OperatorError(f"{name}: {error.found}", error.expected, error.remedy) from None


def in_cells(operator, key: str, default: float, grid: Pavement, parents, power: int = 1) -> int:
    """Convert a size of an ``operator`` to a number of cells of the ``grid``, 1 or more.

    key : the deprecated key, in range blocks, which has a meaning only where all range blocks have
        one side; its successor in `METRES` is in metres.
    default : metres, without either.
    power : 1 for sides, 2 for areas (m², and numbers of cells).

    Raises `OperatorError` for a size in range blocks of leaves, with the metres to write.
    """
    pixel, blocks = parents[0].metres_per_pixel, getattr(operator, key)
    metres = getattr(operator, METRES[key])
    if blocks is not None:
        if any(parent.pavement != grid for parent in parents):
            write = (blocks ** (1 / power) * 4 * pixel) ** power
            unit = "m" if power == 1 else "m²"
            raise at_fault(
                operator.name,
                {key: (f"{blocks} range blocks", "has no meaning among leaves of many sides")},
                f"write it in {unit}: {METRES[key]} = {write:g}, which is {blocks} range blocks of "
                f"4 px",
            )
        return blocks
    size = (default if metres is None else metres) ** (1 / power) / (grid.block * pixel)
    return max(1, round(size**power))


def side_checks(operator, *keys: str, least: int = 1) -> dict[str, Check]:
    """Make checks of sizes by their keys in metres and by the deprecated ones; only one of the two
    may be given."""
    checks: dict[str, Check] = {}
    for key in keys:
        metric, values = METRES[key], vars(operator)
        checks[metric] = (
            lambda size: size is None or 0 < size <= MOST_METRES,
            f"above 0, at most {MOST_METRES:g} m",
        )
        checks[key] = (
            lambda size, metric=metric, values=values: (
                size is None or (least <= size <= MOST_METRES and values[metric] is None)
            ),
            f"{least} range block{'s' * (least > 1)} or more, none where {metric} is given",
        )
    return checks


def span_checks(operator, smallest: float) -> dict[str, Check]:
    """Make `side_checks` of a least and a largest side, "size_min" and "size_max", in this order in
    either unit. ``smallest`` is the default of the least, metres.

    Sides in two units can be compared on a grid only: see `in_cells`.
    """
    values, checks = vars(operator), side_checks(operator, "size_min", "size_max")

    def least_side() -> float:
        if values["side_min"] is not None:
            return values["side_min"]
        return smallest if values["size_min"] is None else 0

    def add_order(key: str, least: Callable[[], float | None], words: str) -> None:
        fits, allowed = checks[key]
        checks[key] = (
            lambda size: fits(size) and (size is None or not size < (least() or 0)),
            f"{allowed}, and {words}",
        )

    add_order("side_max", least_side, f"no less than side_min, by default {smallest:g} m")
    add_order("size_max", lambda: values["size_min"], "no less than size_min")
    return checks


def swaps_axes(iso: int) -> bool:
    """Tell whether an isometry turns rows into columns."""
    return bool(isometries.AFFINE[iso, 2] == 0)


def turn_places(places: np.ndarray, shape: tuple[int, int], iso: int) -> np.ndarray:
    """Turn ``places`` ``(2, g)``, rows and columns of a rectangle of this ``shape``, by an
    isometry; the result counts from the turned rectangle's north-west corner."""
    a = isometries.AFFINE[isometries.INVERSE[iso]]
    last_row, last_column = (size - 1 for size in (shape if a[3] == 0 else shape[::-1]))
    row, column = places
    return np.stack(
        [
            a[0] * last_row + a[2] * row + a[4] * column,
            a[1] * last_column + a[3] * row + a[5] * column,
        ]
    )


def turn_blocks(grid: Pavement, raster: np.ndarray, iso: int) -> tuple[np.ndarray, int]:
    """Turn a ``raster`` (H, W) by an isometry and cut it along the cells of the ``grid``; returns
    ``(n, B, B)``, and the number of cells in a row."""
    side, columns = grid.block, grid.rows if swaps_axes(iso) else grid.columns
    cut = isometries.apply(iso, raster).reshape(-1, side, columns, side)
    return np.ascontiguousarray(cut.swapaxes(1, 2)).reshape(-1, side, side), columns
