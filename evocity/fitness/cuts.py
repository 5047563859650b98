"""Cut buildings: where buildings of source cities end on a map though they go on in their city."""

from collections.abc import Sequence

import numpy as np
import scipy

from evocity.citymap import CityMap
from evocity.fitness import _kernels
from evocity.fitness.copies import Origins, places_of_origin
from evocity.fitness.heredity import source_maps
from evocity.fitness.measure import Undefined
from evocity.fitness.registry import fitness
from evocity.genome import Genome

#: Pixels by which a building must go on beyond its last pixel: less is the raster of a turned wall.
BEYOND = 3
#: Pixels around a pixel whose places of origin give its own: codes of turned walls are off by two.
AROUND = 4
#: Metres behind the walls of a street in which ground still belongs to the street.
BEHIND = 3.0
# Pixels beside a pixel, the nearest first.
_BESIDE = ((0, 1), (0, -1), (1, 0), (-1, 0), (1, 1), (1, -1), (-1, 1), (-1, -1))
#: Largest share of the outline of a building that may be cut away from fronts.
LOOSE = 0.05


@fitness(goal="max", range=(0, 1))
def integrity_along_fronts(city: CityMap, genome: Genome, sources: Sequence[CityMap]) -> float:
    """Share of built ground in buildings that are whole, or cut only along the front of a street.

    The measure `integrity` counts only buildings that are whole in every pixel. The measure
    `integrity_along_fronts` also counts buildings that an operator turned toward their street by
    any angle and cut along the street.

    The genome gives the source city and the place of origin of each pixel, as for `repetition`. A
    range block has one of eight isometries, so places of turned buildings are up to two pixels off.
    A plane through the places of origin around each pixel gives the exact place and the true turn.
    A piece is connected built ground whose places of origin lie in one building of a source city. A
    pixel of a piece is cut in a direction if the building continues for 3 px or more in this
    direction in its source city, but not on the map. The directions are the four directions of the
    raster. A cut lies along a front if a street begins at the cut. The ground of a street is open
    ground around the middle lines of `CityMap.alley_graph`, as far as the nearest wall plus 3 m.
    The border of the map is not a cut. A piece counts if cuts that do not lie along a front take up
    at most 5 % of its outline.

    Formula: Σ pixels of the pieces that count / Σ pixels of all pieces. The measure sets the
    outline of a piece of n pixels to 4 √n.
    Unit: none. Range: 0 to 1. Empty map: NaN (no built ground comes from a building of a source
    city).
    Source: our own; Marsault 2002 §6.1 wishes for operators that keep the identity of buildings.

    >>> heights = np.zeros((32, 32))
    >>> heights[4:12, 4:20] = 9
    >>> lone = CityMap(heights, 2.0)
    >>> code = evocity.encode(lone).genome
    >>> integrity_along_fronts(evocity.decode(code).city, genome=code, sources=[lone])
    1.0
    """
    _, counts, loose = cut_pieces(city, genome, sources)
    if not counts.size:
        return Undefined("no built ground comes from a building of a source city")
    kept = loose <= LOOSE * 4 * np.sqrt(counts)
    return float(counts[kept].sum() / counts.sum())


def cut_pieces(
    city: CityMap, genome: Genome, sources: Sequence[CityMap]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Find the pieces of buildings of source cities on a map. See `integrity_along_fronts`.

    Returns int32 ``(H, W)``, 0 or the number of the piece, 1…n; int64 ``(n,)``, the pixels of each
    piece; and int64 ``(n,)``, its cuts away from fronts, in sides of pixels. The parameters and
    errors are those of `evocity.fitness.whole_buildings`. About 70 ms at 256² once the street
    graph is there.
    """
    places = places_of_origin(city, genome)
    row, column, slopes = _fitted(places, city.shape)
    maps = source_maps(genome, sources)
    names = {name: k for k, name in enumerate(dict.fromkeys(genome.cities))}
    owner = np.zeros(city.shape, np.int64)
    first, tables = 1, {}
    for source in maps.values():
        number = names[source.name]
        if number in tables:
            continue
        tables[number] = source.building_labels, first
        mine = places.number == number
        owner[places.rows[mine], places.columns[mine]] = _nearest_building(
            tables[number], row[mine], column[mine]
        )
        first += int(source.building_labels.max(initial=0))
    pieces, count = _label(owner)
    counts = np.bincount(pieces.ravel(), minlength=count + 1)[1:]
    loose = np.zeros(count, np.int64)
    street = _street_ground(city)
    here = owner[places.rows, places.columns]
    for down, along in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        beyond = np.zeros(here.size, np.int64)
        there = (
            row + BEYOND * (slopes[0] * down + slopes[2] * along),
            column + BEYOND * (slopes[1] * down + slopes[3] * along),
        )
        for number, table in tables.items():
            mine = places.number == number
            beyond[mine] = _buildings_at(table, there[0][mine], there[1][mine])
        goes_on = (here > 0) & (beyond == here)
        rows, columns, whose = (one[goes_on] for one in (places.rows, places.columns, here))
        inside = np.ones(rows.size, bool)
        seen, open_to_street = np.zeros(rows.size, bool), np.zeros(rows.size, bool)
        for step in range(1, BEYOND + 1):
            y, x = rows + step * down, columns + step * along
            inside &= (y >= 0) & (y < city.shape[0]) & (x >= 0) & (x < city.shape[1])
            y, x = np.clip(y, 0, city.shape[0] - 1), np.clip(x, 0, city.shape[1] - 1)
            seen |= owner[y, x] == whose
            open_to_street |= street[y, x]
        cut = inside & ~seen & ~open_to_street
        loose += np.bincount(pieces[rows[cut], columns[cut]], minlength=count + 1)[1:]
    return pieces, counts, loose


def _fitted(places: Origins, shape: tuple[int, int]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Fit the places of origin of ``n`` pixels to those around them: rows and columns ``(n,)``, and
    the steps of both for a pixel down and a pixel along, ``(4, n)``."""
    here = places.rows, places.columns
    number = np.full(shape, -1, np.int64)
    row, column = np.zeros(shape), np.zeros(shape)
    turns = np.zeros((4, *shape))
    number[here], row[here], column[here] = places.number, places.row, places.column
    turns[:, *here] = places.a[2:]
    fitted, slopes = np.zeros((2, *shape)), np.zeros((4, *shape))
    _kernels.fit_places(number, row, column, turns, AROUND, fitted, slopes)
    return fitted[0][here], fitted[1][here], slopes[:, *here]


def _nearest_building(
    table: tuple[np.ndarray, int], row: np.ndarray, column: np.ndarray
) -> np.ndarray:
    """Return the buildings at places of a city as `_buildings_at`; for ground beside a building,
    this building."""
    found = _buildings_at(table, row, column)
    for down, along in _BESIDE:
        ground = found == 0
        found[ground] = _buildings_at(table, row[ground] + down, column[ground] + along)
    return found


def _buildings_at(table: tuple[np.ndarray, int], row: np.ndarray, column: np.ndarray) -> np.ndarray:
    """Return the buildings at places of a city, numbered from ``first``; 0 for none."""
    labels, first = table
    row, column = (np.rint(one).astype(np.int64) for one in (row, column))
    inside = (row >= 0) & (row < labels.shape[0]) & (column >= 0) & (column < labels.shape[1])
    found = np.zeros(row.size, np.int64)
    found[inside] = labels[row[inside], column[inside]]
    return np.where(found > 0, found + first - 1, 0)


def _label(owner: np.ndarray) -> tuple[np.ndarray, int]:
    """Number the connected regions of equal values above 0, 1…n; pixels connect by sides."""
    numbers = np.arange(owner.size).reshape(owner.shape)
    pairs = []
    for one, other in (
        (np.s_[1:], np.s_[:-1]),
        (np.s_[:, 1:], np.s_[:, :-1]),
    ):
        same = (owner[one] == owner[other]) & (owner[one] > 0)
        pairs.append((numbers[one][same], numbers[other][same]))
    left, right = (np.concatenate(side) for side in zip(*pairs, strict=True))
    graph = scipy.sparse.coo_array(
        (np.ones(left.size, bool), (left, right)), shape=(owner.size, owner.size)
    )
    _, component = scipy.sparse.csgraph.connected_components(graph, directed=False)
    component = component.reshape(owner.shape)
    built = owner > 0
    pieces = np.zeros(owner.shape, np.int32)
    found, number = np.unique(component[built], return_inverse=True)
    pieces[built] = number + 1
    return pieces, found.size


def _street_ground(city: CityMap) -> np.ndarray:
    """Mark the open ground of streets: discs around their middle lines, from wall to wall."""
    lines = city.alley_graph.lines
    if not lines.any():
        return np.zeros(city.shape, bool)
    away, (row, column) = scipy.ndimage.distance_transform_edt(~lines, return_indices=True)
    reach = city.distance_to_built[row, column] + BEHIND
    return city.open_ground & (away * city.metres_per_pixel <= reach)
