"""The lifs of a fabric: those of the originals, laid as their cells are."""

from collections.abc import Sequence

import numpy as np

from evocity.errors import GenomeError, OperatorError, keyword
from evocity.genome import Genome, Pieces, laid, merged


def lifs_laid(
    parents: Sequence[Genome],
    cell: int,
    which: np.ndarray,
    row: np.ndarray,
    column: np.ndarray,
    iso: np.ndarray,
) -> Genome:
    """A genome of the parents' lifs, laid cell by cell.

    parents : of one pixel size, of any range blocks that cells can be cut out of.
    cell : side of a cell, px.
    which, row, column, iso : int ``(rows, columns)`` each: which parent stands at a cell, which
        cell of it, under which isometry.

    A domain block keeps its place beside its range block, turned with it, and is moved inside
    the map if it would reach beyond. Leaves are split where a group's border runs through them.

    Raises `OperatorError` for range blocks that cannot be halved to what the cells ask for, and for
    a map smaller than a domain block.
    """
    bare = [parent.replace(condensation=None) for parent in parents]
    pieces = Pieces(cell, which, row, column, iso)
    largest = max(int(max(one.dx.max(), one.dy.max())) for one in parents)
    if largest > min(which.shape) * cell:
        raise OperatorError(
            f"growth: a genome of {which.shape[0] * cell} × {which.shape[1] * cell} px",
            f"sides of {largest} px or more: as large is a domain block laid in it",
            "choose a larger height and width",
        )
    try:
        child = laid(bare, pieces, carried=True).genome
    except GenomeError as error:
        sides = " and ".join(str(p.pavement.finest) for p in parents)
        raise OperatorError(
            f"growth: {error.found}, laid in cells of {cell} px",
            "range blocks whose sides halve to one another, and cells of whole ones",
            f"grow with {keyword('cell')} a multiple of {sides} px, or encode the maps again",
        ) from None
    return merged(child, max(parent.pavement.coarsest for parent in parents))
