"""Towns drawn by a rule: parents whose plan is known, and what a plan becomes when it is bred.

substitution  a motif put in the place of each of its own shapes, again and again
concentric    streets in rings about a place, crossed by roads and lanes
chessboard    square blocks, closed ones and open ones in turn
radial        streets from a place outwards, ever more of them, and few across
"""

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from evocity.citymap import CityMap
from evocity.towns.houses import (
    built_up,
    check,
    check_lengths,
    check_roads,
    check_storeys,
    checked_grid,
    keys,
)
from evocity.towns.substitution import substitution_town


def concentric_town(
    pixels: int = 256,
    metres_per_pixel: float = 2.0,
    *,
    rng: np.random.Generator | None = None,
    place: float = 26.0,
    street: float = 10.0,
    roads: int = 6,
    ring: float = 38.0,
    block: float = 90.0,
    depth: float = 11.0,
    frontage: float = 14.0,
    storeys: Sequence[int] = (2, 6),
) -> CityMap:
    """Streets in rings about a place, crossed by roads and lanes; houses fall outwards.

    Parameters
    ----------
    pixels, metres_per_pixel, rng, storeys : as in `substitution_town`; houses also differ in depth.
    place : its radius, metres.
    street : width of the streets and roads, metres; lanes have half of it.
    roads : how many lead to the place, 3…360.
    ring : breadth of the rings of blocks between two streets, metres.
    block : length of the blocks along a ring, from lane to lane, metres; about that.
    depth : of the houses, metres; what is left within a block is its court.
    frontage : width of the houses, metres; about that.

    Raises
    ------
    MapError : a parameter is out of bounds.
    """
    extent = checked_grid(pixels, metres_per_pixel, rng)
    check_lengths(metres_per_pixel, street=street, ring=ring, depth=depth)
    check_lengths(metres_per_pixel, place=place, block=block, frontage=frontage)
    check_storeys(storeys)
    check_roads(roads)
    r, angle = _polar(pixels, metres_per_pixel)
    pitch = ring + street
    number, outward = np.divmod(r - place, pitch)
    middle = np.maximum(place + number * pitch + ring / 2, 1)
    each = np.maximum(np.round(2 * np.pi * middle / roads / block), 1)  # blocks between two roads
    turned = angle * roads * each
    along, width = turned % 1, 2 * np.pi * r / (roads * each)
    road = np.round(turned) % each == 0
    lane = np.minimum(along, 1 - along) * width - np.where(road, street, street / 2) / 2
    across = np.minimum(outward, ring - outward)
    inside = np.where(number < 0, -1, np.minimum(across, lane))
    houses = np.maximum(np.round(2 * np.pi * middle / (roads * each) / frontage), 1)
    lots = keys(number, np.floor(turned), outward > ring / 2, np.floor(along * houses))
    level = 1 - r / (extent / 2)
    heights = built_up(inside, lots, level, depth, storeys, metres_per_pixel, rng)
    return CityMap(heights, metres_per_pixel, name="concentric-town")


def chessboard_town(
    pixels: int = 256,
    metres_per_pixel: float = 2.0,
    *,
    rng: np.random.Generator | None = None,
    block: float = 72.0,
    street: float = 12.0,
    depth: float = 12.0,
    frontage: float = 14.0,
    gap: float = 5.0,
    storeys: Sequence[int] = (2, 5),
) -> CityMap:
    """Square blocks on a grid: high closed ones about a court, and low open ones, rows of single
    houses before their gardens, in turn.

    Parameters
    ----------
    pixels, metres_per_pixel, rng, storeys : as in `substitution_town`; houses also differ in depth.
    block : side of the blocks, metres; about that: a whole number of them fills the map.
    street : width of the streets, metres.
    depth, frontage : of the houses, metres.
    gap : between the single houses, and before them, metres.

    Raises
    ------
    MapError : a parameter is out of bounds.
    """
    extent = checked_grid(pixels, metres_per_pixel, rng)
    check_lengths(metres_per_pixel, block=block, street=street, depth=depth, gap=gap)
    check_lengths(metres_per_pixel, frontage=frontage)
    check_storeys(storeys)
    pitch = extent / max(round(extent / (block + street)), 1)
    check("street", street, street < pitch, f"less than the {pitch:g} m from block to block")
    length = pitch - street
    at = (np.arange(pixels) + 0.5) * metres_per_pixel
    number, within = np.divmod(at, pitch)
    within -= street / 2
    row, column = number[:, None], number[None, :]
    v, u = np.broadcast_arrays(within[:, None], within[None, :])
    north, west = np.minimum(v, length - v), np.minimum(u, length - u)
    closed = (row + column) % 2 == 0
    houses = max(round(length / frontage), 1)
    first, second = v > length / 2, u > length / 2
    faces_street = ~closed | (north <= west)
    along = np.clip(np.where(faces_street, u, v) / length * houses, 0, houses - 1e-9)
    lots = keys(row, column, faces_street, np.where(faces_street, first, second), np.floor(along))
    beside = np.minimum(along % 1, 1 - along % 1) * length / houses - gap / 2
    inside = np.minimum(north, west)
    single = np.where((beside >= 0) & (west >= 0), north - gap, -1)
    inside = np.where(closed, inside, single)
    heights = built_up(inside, lots, closed, depth, storeys, metres_per_pixel, rng)
    return CityMap(heights, metres_per_pixel, name="chessboard-town")


def radial_town(
    pixels: int = 256,
    metres_per_pixel: float = 2.0,
    *,
    rng: np.random.Generator | None = None,
    place: float = 34.0,
    street: float = 12.0,
    roads: int = 8,
    spacing: float = 52.0,
    block: float = 60.0,
    depth: float = 12.0,
    frontage: float = 14.0,
    storeys: Sequence[int] = (2, 7),
) -> CityMap:
    """Streets that lead from a place outwards; a new one begins between two where these are far
    enough apart, at a ring street; lanes cross between.

    Parameters
    ----------
    pixels, metres_per_pixel, rng, storeys : as in `substitution_town`; houses also differ in depth.
    place : its radius, metres.
    street : width of the streets, metres; lanes have half of it.
    roads : how many begin at the place, 3…360.
    spacing : between two streets where one of them begins, metres.
    block : length of the blocks along a street, metres; about that.
    depth, frontage : of the houses, metres.

    Raises
    ------
    MapError : a parameter is out of bounds.
    """
    extent = checked_grid(pixels, metres_per_pixel, rng)
    check_lengths(metres_per_pixel, place=place, street=street, depth=depth)
    check_lengths(metres_per_pixel, spacing=spacing, block=block, frontage=frontage)
    check_storeys(storeys)
    check_roads(roads)
    r, angle = _polar(pixels, metres_per_pixel)
    first = max(roads * spacing / math.pi, 1.01 * place)  # where the roads are 2 spacings apart
    doubled = np.maximum(np.floor(np.log2(r / first)) + 1, 0)
    inner, outer = np.where(doubled > 0, first * 2.0 ** (doubled - 1), place), first * 2.0**doubled
    streets = roads * 2**doubled
    turned, width = angle * streets, 2 * np.pi * r / streets
    along = turned % 1
    to_street = np.minimum(along, 1 - along) * width - street / 2
    count = np.maximum(np.round((outer - inner) / block), 1)
    length = (outer - inner) / count
    number, outward = np.divmod(r - inner, length)
    near = np.where(number > 0, street / 4, np.where(doubled > 0, street / 2, 0))
    far = np.where(number < count - 1, street / 4, street / 2)
    to_lane = np.minimum(outward - near, length - outward - far)
    inside = np.where(r < place, -1, np.minimum(to_street, to_lane))
    on_street = to_street < to_lane
    share = np.where(on_street, outward / length, along)
    houses = np.maximum(np.round(np.where(on_street, length, width) / frontage), 1)
    other = np.where(on_street, along, outward / length) > 0.5
    lots = keys(doubled, number, np.floor(turned), on_street, other, np.floor(share * houses))
    level = 1 - r / (extent / 2)
    heights = built_up(inside, lots, level, depth, storeys, metres_per_pixel, rng)
    return CityMap(heights, metres_per_pixel, name="radial-town")


#: The towns that can be drawn, by name.
PATTERNS: Mapping[str, Callable[..., CityMap]] = {
    "substitution": substitution_town,
    "concentric": concentric_town,
    "chessboard": chessboard_town,
    "radial": radial_town,
}


def _polar(pixels: int, side: float) -> tuple[np.ndarray, np.ndarray]:
    """Distance from the middle of the map, metres, and direction, 0…1, of each pixel's centre."""
    at = (np.arange(pixels) - (pixels - 1) / 2) * side
    y, x = at[:, None], at[None, :]
    return np.maximum(np.hypot(y, x), 1e-9), np.arctan2(y, x) / (2 * np.pi) % 1


__all__ = [
    "PATTERNS",
    "chessboard_town",
    "concentric_town",
    "radial_town",
    "substitution_town",
]
