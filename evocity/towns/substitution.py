"""Towns of a motif that replaces each of its own shapes, iterated."""

from collections.abc import Sequence

import numpy as np

from evocity.citymap import CityMap
from evocity.errors import MapError, is_number, is_whole, keyword
from evocity.towns.houses import check, check_town, height_of


def substitution_town(
    pixels: int = 256,
    metres_per_pixel: float = 2.0,
    *,
    rng: np.random.Generator | None = None,
    motif: str = "AAABB/AAABB/CC.BB/CCDDD/CCDDD",
    turns: str = "0123",
    iterations: int = 4,
    street: float = 18.0,
    narrowing: float = 0.5,
    least: float = 8.0,
    storeys: Sequence[int] = (2, 7),
) -> CityMap:
    """Draw a town from a motif of shapes and a rule that replaces each shape by the motif, again
    and again. The first replacements open the main streets, later replacements open lesser streets,
    and the last replacements open the gaps between houses. Source: Woloszyn 1998, described in
    Marsault 2002 §3.2 and 2005 §1.3.

    Parameters
    ----------
    pixels, metres_per_pixel : number of pixels along each side of the square map, and the side of a
        pixel in metres.
    rng : random generator that varies the height of houses by a storey; None for no variation.
    motif : rows of letters from north to south, separated by /. Equal letters of the motif form one
        rectangular shape, and each dot is open ground. The motif stretches over the shape that it
        replaces.
    turns : the rule: one digit for each shape, in the order in which the letters first appear. Each
        digit, 0…3, is the number of quarter turns of the motif that replaces a shape.
    iterations : number of replacements of shapes by the motif, 1…8.
    street : width of the streets that the first iteration opens, metres.
    narrowing : factor by which each iteration narrows the streets, above 0, at most 1.
    least : smallest width that a new shape may have, metres. The motif does not replace a shape if
        one of the new shapes would be narrower than ``least``.
    storeys : numbers of storeys of the lowest and of the highest houses; each iteration adds a part
        of the height.

    Raises `MapError` for a parameter out of range, or a motif with a shape that is not a rectangle.
    """
    extent = check_town(pixels, metres_per_pixel, rng, storeys, street=street, least=least)
    shapes_of = _parse_motif(motif, turns)
    check("iterations", iterations, is_whole(iterations) and 1 <= iterations <= 8, "1…8")
    check("narrowing", narrowing, is_number(narrowing) and 0 < narrowing <= 1, "above 0, at most 1")
    shapes = [(np.array([0.0, 0.0, extent, extent]), 0, 0.0)]  # y, x, y, x of the corners; turn
    for iteration in range(iterations):
        gap = street * narrowing**iteration / 2
        parted = []
        for corners, turn, level in shapes:
            parts = [
                (
                    _stretch(corners, part) + gap * np.array([1, 1, -1, -1]),
                    turn + more,
                    level + rise,
                )
                for part, more, rise in shapes_of[turn % 4]
            ]
            narrowest = min(float((part[2:] - part[:2]).min()) for part, _, _ in parts)
            parted += parts if narrowest >= least else [(corners, turn, level)]
        shapes = parted
    if len(shapes) == 1:
        raise MapError(
            f"a map of {extent:g} m is too small for the streets and shapes of the motif",
            f"room for shapes of {least:g} m or more between streets of {street:g} m",
            f"use more {keyword('pixels')}, a narrower {keyword('street')} or a smaller "
            f"{keyword('least')}",
        )
    heights = np.zeros((pixels, pixels), np.float32)
    for corners, _, level in shapes:
        top, left, bottom, right = np.ceil(corners / metres_per_pixel - 0.5).astype(int)
        heights[top:bottom, left:right] = height_of(level / iterations, storeys, rng)
    return CityMap(heights, metres_per_pixel, name="substitution-town")


def _parse_motif(motif: str, turns: str) -> list[list[tuple[np.ndarray, int, float]]]:
    """Parse the shapes of each turn of the motif: their corners (y, x, y, x, 0…1), their own
    further turn, and how much they raise their houses."""
    rows = motif.split("/") if isinstance(motif, str) else []
    even = len({len(row) for row in rows}) == 1 and len(rows[0]) > 0
    letters = [sign for sign in dict.fromkeys(motif) if sign not in "./"] if even else []
    grid = np.array([list(row) for row in rows]) if even else np.empty((0, 0), str)
    whole = all(_fills_its_bounds(grid == letter) for letter in letters)
    check(
        "motif",
        motif,
        2 <= len(letters) <= 64 and whole,
        "rows of one length with / between them, of two rectangles of letters or more",
    )
    check(
        "turns",
        turns,
        isinstance(turns, str) and len(turns) == len(letters) and set(turns) <= set("0123"),
        f"{len(letters)} digits 0…3, one for each letter of the motif",
    )
    turned = [np.rot90(grid, quarter) for quarter in range(4)]
    return [
        [(_bounds(laid == letter), int(turns[n]), n % 3 / 2) for n, letter in enumerate(letters)]
        for laid in turned
    ]


def _bounds(cells: np.ndarray) -> np.ndarray:
    rows, columns = np.nonzero(cells)
    corners = np.array([rows.min(), columns.min(), rows.max() + 1, columns.max() + 1])
    return corners / np.tile(cells.shape, 2)


def _fills_its_bounds(cells: np.ndarray) -> bool:
    top, left, bottom, right = np.round(_bounds(cells) * np.tile(cells.shape, 2)).astype(int)
    return bool(cells[top:bottom, left:right].all())


def _stretch(corners: np.ndarray, part: np.ndarray) -> np.ndarray:
    origin, size = corners[:2], corners[2:] - corners[:2]
    return np.tile(origin, 2) + part * np.tile(size, 2)
