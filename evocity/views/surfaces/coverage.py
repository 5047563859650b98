"""Buildings and the ground between them as one coverage: its kinds, and how it is made."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import shapely

from evocity.views.buildings import outlines
from evocity.views.connected_components import pieces
from evocity.views.streets import ALLEY_WIDTH, StreetGraph
from evocity.views.surfaces.faces import (
    cut_into_faces,
    dissolve,
    join_small,
    pair_segments,
    segments_of,
    widen_necks,
)
from evocity.views.surfaces.regions import (
    cut_out,
    lane_region,
    square_regions,
    street_regions,
    water_region,
)
from evocity.views.walls import Walls
from evocity.views.walls.coverage import find_pinched

#: Kinds of surfaces, in their order. The kind "ground" holds the rest.
KINDS = ("ground", "street", "pavement", "square", "court", "green", "water")
#: Grid of all corners, metres; a smaller one for pixels of less than 25 times this.
GRID = 0.01
#: Smaller patches of ground join a neighbour, m²; so do patches narrower than this, metres.
LEAST, THIN = 6.0, 0.8
#: A court has walls along at least this share of its outline.
WALLED = 0.6
#: Green has room for a disc of this diameter, metres: it is wider than a street.
WIDE = 25.0


@dataclass(frozen=True, eq=False)
class GroundCover:
    """Buildings and ground as one valid coverage: no gaps, no overlaps, the same points on both
    sides of each edge. Corners lie on a grid of `GRID`, so no edge is shorter.

    buildings : objects ``(n,)``, the polygon of each building, in the order of the footprints from
        which the coverage was made. surfaces : objects ``(k,)``, polygons of the ground. kinds :
        str ``(k,)``, one of `KINDS`. streets : str ``(k,)``, the kind of street of a carriageway,
        ``""`` for other surfaces. squares : int32 ``(k,)``, the number of a square in
        `StreetGraph.places`, −1 for other surfaces.
    kerbs : shapely multilinestring, the edges between carriageways and higher ground.
    grid : side of the grid of corners, metres.
    kept : bool ``(n,)``, whether a building has its polygon of the coverage; a footprint that would
        touch itself on the grid keeps its own corners.
    """

    buildings: np.ndarray
    surfaces: np.ndarray
    kinds: np.ndarray
    streets: np.ndarray
    squares: np.ndarray
    kerbs: shapely.MultiLineString
    grid: float
    kept: np.ndarray

    def __len__(self) -> int:
        return len(self.surfaces)


def ground_cover(
    buildings: np.ndarray,
    site: np.ndarray,
    graph: StreetGraph,
    lanes: StreetGraph,
    pixel: float,
    corner: tuple[float, float],
    *,
    offset: tuple[float, float] = (0.0, 0.0),
    water: np.ndarray | None = None,
) -> GroundCover:
    """Make one coverage of ``buildings`` and the ground around them.

    buildings, site : valid polygons, metres; what the site leaves out is not on the map. graph :
        the streets; lanes : the streets with narrow lanes; coordinates of both are less by
        ``offset`` in the result. pixel : side of a pixel,
        metres. corner : (x, y) of the map's north-west corner, in the coordinates of the polygons.
        water : bool ``(H, W)``, open ground that is water; None for a map without any.

    Streets reach from wall to wall; a kerb divides each into a carriageway and pavements. Lanes are
    pavements. Squares
    are those of the graph, with the walls around them. Other ground is a court if walls enclose
    most of it, green if it is wider than streets, and else just ground. About .5 s at 256².

    Source: snap rounding by GEOS (Hobby 1999, Computational Geometry 13:199-214).
    """
    moved = -np.array(offset)
    built = shapely.disjoint_subset_union_all(buildings)
    whole = shapely.disjoint_subset_union_all(site)
    dry = ground = shapely.difference(whole, built)
    wet = shapely.Polygon()
    if water is not None:
        wet = water_region(water, ground, pixel, corner)
        dry = shapely.difference(ground, wet)
    places = square_regions(graph, moved, dry, pixel)
    dry = cut_out(dry, places)
    streets, carriageways = street_regions(graph, moved, dry, built, pixel)
    paths = lane_region(lanes, moved, dry, pixel)
    grid = GRID if pixel >= 25 * GRID else pixel / 25
    buildings = widen_necks(buildings, grid)
    areas = [
        *buildings,
        *site,
        wet,
        *places,
        streets,
        paths,
        *(surface for _, surface in carriageways),
    ]
    faces = cut_into_faces(np.array(areas, dtype=object), grid)
    # of all regions that hold a face the first counts; 0 is what no region holds
    regions = [wet, *places, *(surface for _, surface in carriageways), streets, paths]
    points = shapely.STRtree(shapely.points(faces.inside))
    labels = _holders(points, regions) + 1
    owner = _holders(points, buildings)
    outside = (owner < 0) & (_holders(points, [whole]) < 0)
    solid = (owner >= 0) | outside
    labels = np.where(owner >= 0, len(regions) + 1 + owner, np.where(outside, -1, labels))
    labels = join_small(faces, labels, solid, LEAST, THIN)
    polygons, of = dissolve(faces, labels)
    footprints, kept = _footprints(polygons, of - len(regions) - 1, buildings)
    surface = (of >= 0) & (of <= len(regions))
    polygons, of = polygons[surface], of[surface]
    names = np.array(
        [
            "ground",
            "water",
            *["square"] * len(places),
            *["street"] * len(carriageways),
            "pavement",
            "pavement",
        ],
        dtype="U8",
    )
    kinds = names[of]
    rest = np.flatnonzero(kinds == "ground")
    kinds[rest] = _kinds_of_rest(polygons[rest], footprints)
    first = 2 + len(places)
    ways = np.array(["", *(kind for kind, _ in carriageways)], dtype=object)
    streets = ways[np.where(kinds == "street", of - first + 1, 0)].astype(str)
    squares = np.where(kinds == "square", of - 2, -1).astype(np.int32)
    order = np.argsort([KINDS.index(kind) for kind in kinds.tolist()], kind="stable").astype(int)
    kerbs = _kerbs(polygons, kinds, footprints)
    return GroundCover(
        buildings=footprints,
        surfaces=polygons[order],
        kinds=kinds[order],
        streets=streets[order],
        squares=squares[order],
        kerbs=kerbs,
        grid=grid,
        kept=kept,
    )


class _Map(Protocol):
    """What `cover_map` reads of a `CityMap`."""

    metres_per_pixel: float
    site: np.ndarray | None

    @property
    def shape(self) -> tuple[int, int]: ...

    @property
    def south_west(self) -> tuple[float, float]: ...

    @property
    def walls(self) -> Walls: ...

    @property
    def street_graph(self) -> StreetGraph: ...

    @property
    def alley_graph(self) -> StreetGraph: ...

    def street_graph_of(self, **how: Any) -> StreetGraph: ...


def cover_map(
    city: _Map, buildings: np.ndarray | None = None, water: np.ndarray | None = None
) -> GroundCover:
    """Make the `ground_cover` of a map, in metres from its south-west corner.

    buildings : footprints in these coordinates, objects ``(n,)``; None means the walls of the map.
    water : as of `ground_cover`.
    """
    pixel, offset = city.metres_per_pixel, city.south_west
    corner = (0.0, city.shape[0] * pixel)
    if buildings is None:
        walls = np.array(city.walls.polygons, dtype=object)
        buildings = shapely.transform(walls, lambda points: points - offset)
    graphs = city.street_graph, city.alley_graph
    if water is not None:
        lanes = city.street_graph_of(water=water, least_width=ALLEY_WIDTH)
        graphs = city.street_graph_of(water=water), lanes
    site = np.ones(city.shape, bool) if city.site is None else city.site
    outer = np.array(outlines(pieces(site)[0], pixel, corner), dtype=object)
    return ground_cover(buildings, outer, *graphs, pixel, corner, offset=offset, water=water)


def _holders(points: shapely.STRtree, areas: Sequence[shapely.Geometry] | np.ndarray) -> np.ndarray:
    """Find the first of ``areas``, polygons or multipolygons, around each of ``points``: int64
    ``(n,)``, -1 for none."""
    holder = np.full(len(points), -1)
    parts, of = shapely.get_parts(np.array(areas, dtype=object), return_index=True)
    if len(parts):
        part, point = points.query(parts, predicate="contains")
        order = np.argsort(-of[part], kind="stable")  # the first area is written last
        holder[point[order]] = of[part[order]]
    return holder


def _footprints(
    polygons: np.ndarray, of: np.ndarray, buildings: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the polygon of each building in the coverage, and whether it is one sound polygon;
    other buildings keep theirs."""
    footprints, own = buildings.copy(), np.flatnonzero(of >= 0)
    kept = np.bincount(of[own], minlength=len(buildings)) == 1
    single = own[kept[of[own]]]
    sound = ~find_pinched(polygons[single]) if len(single) else np.ones(0, bool)
    kept[of[single[~sound]]] = False
    footprints[of[single[sound]]] = polygons[single[sound]]
    return footprints, kept


def _kinds_of_rest(polygons: np.ndarray, footprints: np.ndarray) -> np.ndarray:
    """Name ground that no region holds: court, green, or ground."""
    kinds = np.full(len(polygons), "ground", dtype="U8")
    if not len(polygons):
        return kinds
    bits, owner = segments_of(polygons)
    walls, _ = segments_of(footprints)
    number, _ = pair_segments(np.concatenate([bits, walls]))
    wall = np.isin(number[: len(bits)], number[len(bits) :])
    length = np.hypot(*(bits[:, 1] - bits[:, 0]).T)
    share = np.bincount(owner, length * wall, minlength=len(polygons)) / np.bincount(
        owner, length, minlength=len(polygons)
    )
    room = 2 * shapely.length(shapely.maximum_inscribed_circle(polygons, 1.0))
    kinds[room >= WIDE] = "green"
    kinds[share >= WALLED] = "court"
    return kinds


def _kerbs(polygons: np.ndarray, kinds: np.ndarray, footprints: np.ndarray) -> shapely.Geometry:
    """Find the edges that carriageways share with all that is not a carriageway."""
    carriageway = kinds == "street"
    bits, _ = segments_of(polygons[carriageway])
    others, _ = segments_of(np.concatenate([polygons[~carriageway], footprints]))
    number, _ = pair_segments(np.concatenate([bits, others]))
    shared = np.isin(number[: len(bits)], number[len(bits) :])
    return shapely.multilinestrings(shapely.linestrings(bits[shared]))
