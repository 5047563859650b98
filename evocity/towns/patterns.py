"""Concentric, chessboard and radial towns, and the table of all drawn towns.

substitution  a motif that replaces each of its own shapes, iterated
concentric    streets in rings about a place, crossed by roads and lanes
chessboard    square blocks, closed and open ones in turn
radial        streets from a place outwards, which multiply, and lanes across
"""

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from evocity.citymap import CityMap
from evocity.errors import is_whole
from evocity.towns.houses import build_town, check, check_town, keys
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
    """Draw a town with a central place, ring streets around it, and roads and lanes that cross the
    ring streets. Houses become lower with their distance from the central place.

    Parameters
    ----------
    pixels, metres_per_pixel, rng, storeys : as in `substitution_town`; the generator ``rng`` varies
        both the height and the depth of houses.
    place : radius of the central place, metres.
    street : width of the streets and roads, metres; lanes are half as wide.
    roads : number of roads that lead to the central place, 3…360.
    ring : breadth of a ring of blocks between two streets, metres.
    block : approximate length of the blocks along a ring, from lane to lane, metres.
    depth : depth of the houses, metres; the rest of a block is a court.
    frontage : approximate width of the houses, metres.

    Raises `MapError` for a parameter out of range.
    """
    lengths = {"street": street, "ring": ring, "depth": depth}
    lengths |= {"place": place, "block": block, "frontage": frontage}
    r, angle, level = _polar(pixels, metres_per_pixel, rng, storeys, roads, lengths)
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
    name = "concentric-town"
    return build_town(name, inside, lots, level, depth, storeys, metres_per_pixel, rng)


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
    """Draw a town of square blocks on a grid. Closed and open blocks alternate. The houses of a
    closed block are high, and surround a court in the block. An open block has rows of low single
    houses, each with a garden behind the house.

    Parameters
    ----------
    pixels, metres_per_pixel, rng, storeys : as in `substitution_town`; the generator ``rng`` varies
        both the height and the depth of houses.
    block : approximate side of the blocks, metres; a whole number of blocks fills the map.
    street : width of the streets, metres.
    depth, frontage : depth and width of the houses, metres.
    gap : width of the gaps between single houses, and of the gaps in front of single houses,
        metres.

    Raises `MapError` for a parameter out of range.
    """
    lengths = {"block": block, "street": street, "depth": depth, "gap": gap, "frontage": frontage}
    extent = check_town(pixels, metres_per_pixel, rng, storeys, **lengths)
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
    name = "chessboard-town"
    return build_town(name, inside, lots, closed, depth, storeys, metres_per_pixel, rng)


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
    """Draw a town with streets that lead outwards from a central place. At each ring street, a new
    street begins between two streets that are far enough apart. Lanes cross the blocks between
    streets.

    Parameters
    ----------
    pixels, metres_per_pixel, rng, storeys : as in `substitution_town`; the generator ``rng`` varies
        both the height and the depth of houses.
    place : radius of the central place, metres.
    street : width of the streets, metres; lanes are half as wide.
    roads : number of streets that begin at the central place, 3…360.
    spacing : distance from a new street to its neighbouring streets at the point where the new
        street begins, metres.
    block : approximate length of the blocks along a street, metres.
    depth, frontage : depth and width of the houses, metres.

    Raises `MapError` for a parameter out of range.
    """
    lengths = {"place": place, "street": street, "depth": depth}
    lengths |= {"spacing": spacing, "block": block, "frontage": frontage}
    r, angle, level = _polar(pixels, metres_per_pixel, rng, storeys, roads, lengths)
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
    name = "radial-town"
    return build_town(name, inside, lots, level, depth, storeys, metres_per_pixel, rng)


#: The functions that draw towns, by name.
PATTERNS: Mapping[str, Callable[..., CityMap]] = {
    "substitution": substitution_town,
    "concentric": concentric_town,
    "chessboard": chessboard_town,
    "radial": radial_town,
}


def _polar(
    pixels: int, side: float, rng, storeys: Sequence[int], roads: int, lengths: dict[str, float]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Compute each pixel centre's distance from the map's middle, metres; its direction, 0…1; and
    the level of houses there. Raises `MapError` for a parameter out of range."""
    extent = check_town(pixels, side, rng, storeys, **lengths)
    check("roads", roads, is_whole(roads) and 3 <= roads <= 360, "a whole number, 3…360")
    at = (np.arange(pixels) - (pixels - 1) / 2) * side
    y, x = at[:, None], at[None, :]
    r = np.maximum(np.hypot(y, x), 1e-9)
    return r, np.arctan2(y, x) / (2 * np.pi) % 1, 1 - r / (extent / 2)
