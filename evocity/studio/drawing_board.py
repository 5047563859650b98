"""The drawing board: a lock and a mask that a user draws over two picked parents, in cells; the
grid of macro-blocks and the lifs of the parents."""

from collections.abc import Sequence
from typing import Annotated

import numpy as np
from PIL import Image
from pydantic import Field

from evocity.citymap import CityMap
from evocity.coding.decoding_cache import decoded
from evocity.condensation import Condensation
from evocity.errors import RunError
from evocity.fitness import Part
from evocity.genome import Genome
from evocity.operators.grid import common_grid
from evocity.pictures.colours import INK
from evocity.studio.request_fields import Body

#: Cells along a side of the map, at most.
MOST_CELLS = 64
#: The names of the board and of the marked part of the map, in messages.
BOARD, MARKED = "the drawing board", "the marked part"


class Mask(Body):
    """Squares of ``cell`` px from the north-west, row by row: ``1`` is marked."""

    cell: Annotated[int, Field(ge=1, lt=2**15)]
    marked: Annotated[str, Field(min_length=1, max_length=MOST_CELLS**2, pattern="^[01]+$")]


class Drawing(Body):
    """``locked``: where the child has the heights of the first parent. ``within``: where to
    measure."""

    locked: Mask | None = None
    within: Mask | None = None


def marked_pixels(mask: Mask, height: int, width: int) -> np.ndarray:
    """Return the marked pixels, bool ``(H, W)``. Raises `RunError` for a mask of another map."""
    rows, columns = -(-height // mask.cell), -(-width // mask.cell)
    if len(mask.marked) != rows * columns:
        raise RunError(
            f"the mask has {len(mask.marked)} cells with sides of {mask.cell} px",
            f"{rows} × {columns} cells on a map of {height} × {width} px",
            "draw the mask on a map of this run",
        )
    cells = np.frombuffer(mask.marked.encode(), np.uint8).reshape(rows, columns) == ord("1")
    return np.kron(cells, np.ones((mask.cell,) * 2, bool))[:height, :width]


def lock_layer(drawing: Drawing, parents: Sequence[Genome]) -> Condensation | None:
    """Return the locked layer of a child: the lock of the run, then the heights of the first parent
    where the ``drawing`` marks; None without any lock."""
    kept = parents[0].condensation
    if drawing.locked is None:
        return kept
    city: CityMap = decoded(parents[0]).city
    mask = marked_pixels(drawing.locked, *city.shape)
    if mask.all():
        raise RunError(
            "the lock covers the whole map",
            "some pixels that the child may change",
            "erase the lock from a part of the map",
        )
    if not mask.any():
        return kept
    layer = Condensation.cut(city, mask)
    return layer if kept is None else kept.over(layer)


def measured_part(drawing: Drawing, parents: Sequence[Genome]) -> Part | None:
    """Return the part of the map where measures are taken; None for the whole map."""
    if drawing.within is None:
        return None
    pavement = parents[0].pavement
    mask = marked_pixels(drawing.within, pavement.height, pavement.width)
    return Part(MARKED, mask) if mask.any() else None


def hatched(mask: np.ndarray) -> Image.Image:
    """Draw diagonal lines where ``mask``, bool ``(H, W)``, is true; the rest is transparent."""
    rows, columns = np.indices(mask.shape)
    step = max(6, mask.shape[1] // 24)
    pixels = np.zeros((*mask.shape, 4), np.uint8)
    pixels[mask & ((rows + columns) % step < max(1, step // 4))] = (*INK, 255)
    return Image.fromarray(pixels)


def board_of(parents: Sequence[Genome]) -> tuple[dict, bytes]:
    """Return the board of two ``parents``: rows, columns, metres per pixel, side of the ``grid`` of
    macro-blocks and of a ``cell``, px, and the number of ``lifs``; row, column and side of each,
    int32."""
    first = parents[0]
    pavement, grid = first.pavement, common_grid(BOARD, parents).block
    about = {
        "height": pavement.height,
        "width": pavement.width,
        "metres": float(first.metres_per_pixel),
        "cell": max(-(-max(pavement.height, pavement.width) // MOST_CELLS), grid),
        "grid": grid,
        "lifs": len(pavement),
    }
    sides = np.broadcast_to(pavement.side, len(pavement))
    return about, np.column_stack([*pavement.corners, sides]).astype("<i4").tobytes()
