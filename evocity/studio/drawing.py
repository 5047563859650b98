"""What a user draws over two picked parents: a lock and a mask, in cells; what the drawing board is
told of the parents, so that macro-blocks lie on their grid and a λ is painted lifs by lifs."""

from collections.abc import Sequence
from typing import Annotated

import numpy as np
from pydantic import Field

from evocity.citymap import CityMap
from evocity.coding.decoded import decoded
from evocity.condensation import Condensation
from evocity.errors import RunError
from evocity.fitness import Part
from evocity.genome import Genome
from evocity.operators.grid import common_grid
from evocity.studio.asked import Body

#: Cells along a side of the map that something is painted in, at most.
MOST_CELLS = 64
#: What it is called, and the part of the map that is marked on it.
BOARD, MARKED = "the drawing board", "the marked part"


class Mask(Body):
    """Squares of ``cell`` px from the north-west, row by row: ``1`` where one is marked; the last
    of a row or column may reach beyond the map."""

    cell: Annotated[int, Field(ge=1, lt=2**15)]
    marked: Annotated[str, Field(min_length=1, max_length=MOST_CELLS**2, pattern="^[01]+$")]


class Drawing(Body):
    """What is ``locked``: there the child has the first parent's heights. ``within`` what the
    measures are taken of, the whole map where it is None or nothing is marked."""

    locked: Mask | None = None
    within: Mask | None = None


def cell_of(height: int, width: int) -> int:
    """The side of the cells of a map, px: `MOST_CELLS` along it at most."""
    return -(-max(height, width) // MOST_CELLS)


def pixels_of(mask: Mask, height: int, width: int) -> np.ndarray:
    """Bool ``(H, W)``: the pixels that are marked. Raises `RunError` for a mask of another map."""
    rows, columns = -(-height // mask.cell), -(-width // mask.cell)
    if len(mask.marked) != rows * columns:
        raise RunError(
            f"a mask of {len(mask.marked)} cells of {mask.cell} px",
            f"{rows} × {columns} cells on a map of {height} × {width} px",
            "draw it on this run's map",
        )
    cells = np.frombuffer(mask.marked.encode(), np.uint8).reshape(rows, columns) == ord("1")
    return np.kron(cells, np.ones((mask.cell,) * 2, bool))[:height, :width]


def locked_by(drawing: Drawing, parents: Sequence[Genome]) -> Condensation | None:
    """The layer that is locked in a child of ``parents``: what the run locks, then the heights of
    the first where the ``drawing`` marks; None where nothing is. Raises `RunError` if it marks the
    whole map."""
    kept = parents[0].condensation
    if drawing.locked is None:
        return kept
    city: CityMap = decoded(parents[0]).city
    mask = pixels_of(drawing.locked, *city.shape)
    if mask.all():
        raise RunError("the whole map is locked", "pixels that are free to be bred", "lock less")
    if not mask.any():
        return kept
    layer = Condensation.cut(city, mask)
    return layer if kept is None else kept.over(layer)


def measured_by(drawing: Drawing, parents: Sequence[Genome]) -> Part | None:
    """The part of the map that measures are taken of by a ``drawing``; None for the whole."""
    if drawing.within is None:
        return None
    pavement = parents[0].pavement
    mask = pixels_of(drawing.within, pavement.height, pavement.width)
    return Part(MARKED, mask) if mask.any() else None


def board_of(parents: Sequence[Genome]) -> tuple[dict, bytes]:
    """What the board is told of two ``parents``: rows, columns, metres a pixel; the side of the
    ``grid`` that macro-blocks lie on, px, and of a ``cell`` to paint in, as large at least; how
    many ``lifs`` the first has. Of each of these row, column and side, px, int32. Raises
    `OperatorError` where the parents have no grid in common."""
    first = parents[0]
    pavement, grid = first.pavement, common_grid(BOARD, parents).block
    about = {
        "height": pavement.height,
        "width": pavement.width,
        "metres": float(first.metres_per_pixel),
        "cell": max(cell_of(pavement.height, pavement.width), grid),
        "grid": grid,
        "lifs": len(pavement),
    }
    sides = np.broadcast_to(pavement.side, len(pavement))
    return about, np.column_stack([*pavement.corners, sides]).astype("<i4").tobytes()


__all__ = [
    "BOARD",
    "MARKED",
    "MOST_CELLS",
    "Drawing",
    "Mask",
    "board_of",
    "cell_of",
    "locked_by",
    "measured_by",
    "pixels_of",
]
