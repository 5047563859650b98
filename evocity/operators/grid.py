"""The grid that crossings follow, and sizes in metres as cells of it.

Operators cut and lay fabric along the sides of cells. On a uniform pavement these are its range
blocks; leaves are split where the side of a cell runs through them.
"""

from collections.abc import Callable, Sequence

import numpy as np

from evocity.errors import GenomeError, OperatorError
from evocity.genome import Genome
from evocity.operators.parameters import at_fault
from evocity.pavement import Pavement, common_refinement, quartered

#: Cells among leaves are the largest of their sides within this, metres: finer ones would split
#: more leaves than buildings need, coarser ones cut buildings.
CELL = 8.0


def common_grid(name: str, parents: Sequence[Genome], largest: float = CELL) -> Pavement:
    """The cells along which ``parents`` can be crossed, as a uniform pavement: their range blocks
    if those are all of one side; else of the largest side among all that is at most ``largest``
    metres.

    Raises `OperatorError`, in the name of the operator, where the parents' range blocks cannot be
    refined to each other.
    """
    pavements = list(dict.fromkeys(parent.pavement for parent in parents))
    first = pavements[0]
    if len(pavements) == 1 and first.uniform:
        return first
    try:
        if not quartered(pavements):
            common_refinement(pavements)  # raises if there is none
        sides = np.unique([side for p in pavements for side in p.levels])
        within = sides[sides * parents[0].metres_per_pixel <= largest]
        cell = int(within.max(initial=sides.min()))
        grid = Pavement(first.height, first.width, cell)
    except GenomeError as error:
        raise OperatorError(f"{name}: {error.found}", error.expected, error.remedy) from None
    return grid


def in_cells(
    name: str,
    key: str,
    metres: float | None,
    blocks: int | None,
    usual: float,
    grid: Pavement,
    parents: Sequence[Genome],
    power: int = 1,
) -> int:
    """A size as a number of cells of the ``grid``, 1 or more.

    metres : the size as given, or None.
    blocks : the same by its older key, in range blocks, or None. That has a meaning only where
        all range blocks have one side.
    usual : metres, if neither is given.
    power : 1 for sides, 2 for areas (m², and numbers of cells).

    Raises `OperatorError` for a size in range blocks of leaves, with the metres to write.
    """
    pixel = parents[0].metres_per_pixel
    if blocks is not None:
        if any(parent.pavement != grid for parent in parents):
            write = (blocks ** (1 / power) * 4 * pixel) ** power
            unit = "m" if power == 1 else "m²"
            raise at_fault(
                name,
                {key: (f"{blocks} range blocks", "has no meaning among leaves of many sides")},
                f"write it in {unit}: {METRES[key]} = {write:g}, which is {blocks} range blocks of "
                f"4 px",
            )
        return blocks
    size = (usual if metres is None else metres) ** (1 / power) / (grid.block * pixel)
    return max(1, round(size**power))


#: Older keys, in range blocks, and the keys that took their place, in metres.
METRES = {
    "size_min": "side_min",
    "size_max": "side_max",
    "grain": "grain_side",
    "group": "group_side",
    "limit": "area_max",
    "positions": "places",
}


def side_checks(operator, *keys: str, least: int = 1) -> dict[str, tuple[Callable, str]]:
    """Checks, for `check_parameters`, of sizes by their keys in metres and by the older ones, of
    which only one may be given."""
    checks: dict[str, tuple[Callable, str]] = {}
    for key in keys:
        metric, values = METRES[key], vars(operator)
        checks[metric] = (
            lambda size: size is None or 0 < size <= MOST,
            f"above 0, at most {MOST:g} m",
        )
        checks[key] = (
            lambda size, metric=metric, values=values: (
                size is None or (least <= size <= MOST and values[metric] is None)
            ),
            f"{least} range block{'s' * (least > 1)} or more, none where {metric} is given",
        )
    return checks


def span_checks(operator, smallest: float) -> dict[str, tuple[Callable, str]]:
    """`side_checks` of a least and a largest side, "size_min" and "size_max": neither may be above
    the other where both are told in one unit. ``smallest`` is the least in metres unless told.

    In two units they can be compared on a grid alone: see `in_cells`.
    """
    values, checks = vars(operator), side_checks(operator, "size_min", "size_max")

    def least_side() -> float:
        if values["side_min"] is not None:
            return values["side_min"]
        return smallest if values["size_min"] is None else 0

    def spans(key: str, least: Callable[[], float | None], told: str) -> None:
        fits, allowed = checks[key]
        checks[key] = (
            lambda size: fits(size) and (size is None or not size < (least() or 0)),
            f"{allowed}, and {told}",
        )

    spans("side_max", least_side, f"no less than side_min, {smallest:g} m unless told")
    spans("size_max", lambda: values["size_min"], "no less than size_min")
    return checks


#: The largest size that is one, metres.
MOST = 1e7
