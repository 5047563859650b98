"""Well-known shapes by name."""

from collections.abc import Callable
from itertools import product

import numpy as np

from evocity.errors import add_near_miss, spell
from evocity.shapes.languages import ShapeError
from evocity.shapes.primitives import Primitive
from evocity.shapes.shape import Shape
from evocity.shapes.wires import wire


def _sierpinski() -> Shape:
    at = [(0, 0), (0.5, 0), (0.25, np.sqrt(3) / 4)]
    triangle = Primitive.polygon([(0, 0), (1, 0), (0.5, np.sqrt(3) / 2)])
    return Shape([[[0.5, 0, x], [0, 0.5, y]] for x, y in at], triangle)


def _koch() -> Shape:
    return wire([0j, 1 / 3, 0.5 + 1j * np.sqrt(3) / 6, 2 / 3, 1])


def _dragon() -> Shape:
    """Heighway's."""
    return wire([0j, 0.5 + 0.5j, 1], arcs=[(0, 1), (2, 1)])


def _levy() -> Shape:
    return wire([0j, 0.5 + 0.5j, 1])


def _carpet() -> Shape:
    at = [(x / 3, y / 3) for x, y in product(range(3), repeat=2) if (x, y) != (1, 1)]
    return Shape([[[1 / 3, 0, x], [0, 1 / 3, y]] for x, y in at], "square")


def _fern() -> Shape:
    """Barnsley's."""
    rows = [
        (0, 0, 0, 0.16, 0, 0),
        (0.85, 0.04, -0.04, 0.85, 0, 1.6),
        (0.2, -0.26, 0.23, 0.22, 0, 1.6),
        (-0.15, 0.28, 0.26, 0.24, 0, 0.44),
    ]
    return Shape([[[a, b, e], [c, d, f]] for a, b, c, d, e, f in rows])


def _menger() -> Shape:
    cells = [cell for cell in product(range(3), repeat=3) if cell.count(1) < 2]
    third = np.eye(3) / 3
    return Shape([np.column_stack([third, np.array(cell) / 3]) for cell in cells], "cube")


_KNOWN: dict[str, Callable[[], Shape]] = {
    "sierpinski": _sierpinski,
    "koch": _koch,
    "dragon": _dragon,
    "levy": _levy,
    "carpet": _carpet,
    "fern": _fern,
    "menger": _menger,
}
#: The names of well-known shapes.
KNOWN = tuple(_KNOWN)


def known(name: str) -> Shape:
    """Make the well-known shape called ``name``, one of the names in `KNOWN`. Raises `ShapeError`
    if `KNOWN` does not contain the name.

    Sources: Sierpinski 1915 and 1916, von Koch 1904, Davis & Knuth 1970 (Heighway's dragon), Lévy
    1938, Barnsley 1988 (fern), Menger 1926.
    """
    if name not in _KNOWN:
        raise ShapeError(
            add_near_miss(f"shape {spell(name)}", name, _KNOWN),
            f"one of {', '.join(KNOWN)}",
            "choose one of these shapes",
        )
    return _KNOWN[name]()
