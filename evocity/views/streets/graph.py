"""The street graph of a map: nodes, edges, widths, kinds, places and quarters."""

import dataclasses
import os
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from evocity.errors import MapError, check_number
from evocity.views.buildings import outlines
from evocity.views.connected_components import pieces
from evocity.views.ground.space import nearest_built
from evocity.views.limit_tables import read_only
from evocity.views.streets._kernels import middles, smoothed, straight_on, thickness
from evocity.views.streets.facades.widths import measure_facades
from evocity.views.streets.kinds import DensityAt, StreetKinds, packaged
from evocity.views.streets.lines import (
    Lines,
    along_hubs,
    build_lines,
    connected_to_frame,
    edge_values,
    select_streets,
)
from evocity.views.streets.places import Places, make_places
from evocity.views.streets.ribbons import cut_ribbons, sweep_discs
from evocity.views.streets.skeleton import Ground, skeleton

if TYPE_CHECKING:
    import shapely

#: Least width of a street, metres; narrower passages are gaps between houses and ways to courts.
LEAST_WIDTH = 8.0
#: Least width of an alley, metres.
ALLEY_WIDTH = 4.0
#: Least length of a dead end, in widths of the street where it begins.
SPURS = 1.0

#: Greatest width in `StreetGraph.width_map`, metres.
WIDEST = 100.0

# Rounds of smoothing of a line; its root of half is the reach, px, each way.
_ROUNDS = 18
# A street continues over a crossing if it turns by less than 45°; directions are taken so many
# pixels from the crossing.
_STRAIGHT, _SEEN = np.cos(np.pi / 4), 8


@dataclass(frozen=True, eq=False)
class StreetGraph:
    """Streets as a graph, with places and quarters. Arrays are read-only. The first access to
    widths from façade to façade, kinds, places or quarters computes them.

    nodes : float64 ``(n, 2)``, x and y of crossings, ends, and exits from the map. degree : int32
    ``(n,)``, number of ends of edges at each node. at_frame : bool ``(n,)``, whether streets leave
    the map there; never in a closed city.

    edges : m shapely lines, each from node ``ends[k, 0]`` to node ``ends[k, 1]``, smooth, in open
    ground. ends : int32 ``(m, 2)``. length : float64 ``(m,)``, metres. width, low, high : float64
    ``(m,)``, metres, median, least and greatest width from façade to façade across the edge, at
    ``measured`` places, int32 ``(m,)``; where no place has façades on both sides, ``measured`` is
    0, and the widths are those of the open ground. clear, least : float64 ``(m,)``, median and
    least width of the open ground between the nearest walls, metres; along a place, to the place's
    middle. street : int32 ``(m,)``, the number of an edge's street, from 0: edges that go on
    straight over a crossing belong to one street. kind : str ``(m,)``, from the table; ``"place"``
    where most of an edge lies in a place, ``"water"`` where most of it lies in water. leaves : bool
    ``(m,)``, whether an edge reaches the frame. place : int32 ``(m,)``, the place with most of the
    edge, −1 for none.

    places : `Places`. quarters : int32 ``(buildings,)``, from 0: the group of buildings between
    streets, for each building in the order of their labels. lines : bool ``(H, W)``, the pixels of
    the edges.
    """

    nodes: np.ndarray
    degree: np.ndarray
    at_frame: np.ndarray
    edges: "tuple[shapely.LineString, ...]"
    ends: np.ndarray
    length: np.ndarray
    clear: np.ndarray
    least: np.ndarray
    street: np.ndarray
    leaves: np.ndarray
    lines: np.ndarray
    _input: "_Input" = field(repr=False)

    def __len__(self) -> int:
        return len(self.edges)

    @property
    def width(self) -> np.ndarray:
        """Median width from façade to façade, metres, float64 ``(m,)``."""
        return self._widths[0]

    @property
    def low(self) -> np.ndarray:
        """Least width from façade to façade, metres, float64 ``(m,)``."""
        return self._widths[1]

    @property
    def high(self) -> np.ndarray:
        """Greatest width from façade to façade, metres, float64 ``(m,)``."""
        return self._widths[2]

    @property
    def measured(self) -> np.ndarray:
        """Number of places of each edge that have façades on both sides, int32 ``(m,)``."""
        return self._widths[3]

    @cached_property
    def _widths(self) -> tuple[np.ndarray, ...]:
        made, lines = self._input, self._input.lines
        across = measure_facades(
            made.points,
            lines.starts,
            lines.path,
            _walls(made),
            made.ground.across.ravel()[lines.path],
            along_hubs(lines, made.ground),
            lines.out[np.stack([lines.first, lines.last], 1)],
            made.pixel,
        )
        measured = (across.median, across.low, across.high)
        widths = [np.where(across.places, own, self.clear) for own in measured]
        return tuple(map(read_only, (*widths, across.places)))

    @property
    def places(self) -> Places:
        """Places: squares, and other ground as wide and compact."""
        return self._placed[0]

    @cached_property
    def _placed(self) -> tuple[Places, np.ndarray]:
        made = self._input
        return make_places(made.ground, made.middles, made.table, made.pixel, made.corner)

    @cached_property
    def place(self) -> np.ndarray:
        """The place with most of each edge, int32 ``(m,)``, −1 for none."""
        lines = self._input.lines
        count = len(lines.first)
        edge = np.repeat(np.arange(count), np.diff(lines.starts))
        where = np.pad(self._placed[1], 1, constant_values=-1).ravel()
        return read_only(_majority(edge, where[lines.path], count))

    @cached_property
    def kind(self) -> np.ndarray:
        """The kind of street of each edge, str ``(m,)``."""
        made, street = self._input, self.street
        lengths = np.bincount(street, self.length)[street]
        kind = made.table.named(self.width, lengths, made.densities)
        kind = kind.astype(np.result_type(kind.dtype, "U5"))  # "place" and "water" have room
        kind[self.place >= 0] = "place"
        if made.water is not None:
            water = np.pad(made.water, 1).astype(np.float32)
            kind[edge_values(made.lines, water)[0] > 0.5] = "water"
        return read_only(kind)

    @cached_property
    def quarters(self) -> np.ndarray:
        """The group of buildings between streets of each building, int32 ``(buildings,)``."""
        return read_only(_quarters(self._input.building_labels, self.lines))

    @cached_property
    def components(self) -> int:
        """Number of connected components of the graph, lone nodes included."""
        return self._input.lines.pieces()[0]

    @property
    def cycles(self) -> int:
        """Number of independent cycles: edges − nodes + components."""
        return len(self.edges) - len(self.nodes) + self.components

    @cached_property
    def width_map(self) -> np.ndarray:
        """Float32 ``(H, W)``: on open ground, courtyards too, the width in metres of the widest
        disc within it that covers a pixel, at most `WIDEST`; NaN elsewhere. It is the width of the
        street, right within a pixel. An open frame does not count as a wall. About 10 ms at
        256²."""
        made = self._input
        ground, pixel = made.raw(), made.pixel
        most = WIDEST / pixel
        widest = int(np.ceil(most**2 / 4))
        thick = np.zeros(ground.open.shape, np.float32)
        spare = np.full(thick.shape, -1, np.float32)
        if (far := ground.open & (ground.squares >= widest)).any():
            spare = (most / 2 - np.sqrt(nearest_built(far)[0])).astype(np.float32)
            thick[spare > 0] = most
        thickness(ground.open, ground.squares, ground.across, widest, spare, thick)
        np.minimum(thick, most, out=thick)
        thick = np.where(ground.open, thick * np.float32(pixel), np.float32(np.nan))
        return read_only(np.ascontiguousarray(thick[1:-1, 1:-1]))

    @property
    def _halves(self) -> np.ndarray:
        """Half the width at each point of the edges, edge after edge, metres."""
        made = self._input
        return made.ground.across.ravel()[made.lines.path] * (made.pixel / 2)

    def swept(self, chosen: np.ndarray | None = None) -> np.ndarray:
        """Make the uncut surfaces of the edges: the area of discs as wide as the ground that move
        along each edge. Surfaces cross walls by less than a pixel.

        chosen : bool ``(m,)``, the edges that have a surface; None means all."""
        made, halves, edges = self._input, self._halves, self.edges
        if chosen is not None:
            halves = halves[np.repeat(chosen, np.diff(made.lines.starts))]
            edges = [edge for edge, kept in zip(edges, chosen.tolist(), strict=True) if kept]
        return sweep_discs(edges, halves, made.pixel, 4)

    def ribbons(self, walls=None) -> np.ndarray:
        """Make the surfaces of streets: a smooth polygon or multipolygon for each edge, as wide as
        the street, cut at walls and at the frame. They overlap where streets meet.

        walls : polygons of buildings, such as ``city.walls.polygons``; None for the pixels' edges.
        About 0.2 s at 256².
        """
        made = self._input
        halves = self._halves
        shape = made.open_ground.shape
        own = np.ones(shape, bool) if made.site is None else made.site
        solid = [outlines(pieces(~own)[0], made.pixel, made.corner)]
        built = pieces(own & ~made.open_ground)[0]
        solid.append(outlines(built, made.pixel, made.corner) if walls is None else walls)
        solid = np.array([polygon for some in solid for polygon in some], dtype=object)
        left, top = made.corner
        window = left, top - shape[0] * made.pixel, left + shape[1] * made.pixel, top
        return cut_ribbons(sweep_discs(self.edges, halves, made.pixel), solid, window)


@dataclass(frozen=True, eq=False)
class _Input:
    """The input of a graph, kept for its lazy properties.

    middles : bool, the middles of the ground around which places are. points : float64 ``(k, 2)``,
    row and column of the points of all edges, px of the bordered ground. densities : GSI and FSI
    around each edge, float64 ``(m,)`` each; None if no kind depends on them.
    """

    ground: Ground
    lines: Lines
    middles: np.ndarray
    table: StreetKinds
    pixel: float
    corner: tuple[float, float]
    open_ground: np.ndarray
    building_labels: np.ndarray
    site: np.ndarray | None
    closed: bool
    water: np.ndarray | None
    points: np.ndarray
    densities: tuple[np.ndarray, np.ndarray] | None = None

    def raw(self) -> Ground:
        if not self.ground.middles.any():
            return self.ground
        return skeleton(self.open_ground, self.site, self.closed, None)


def street_graph(
    open_ground: np.ndarray,
    building_labels: np.ndarray,
    metres_per_pixel: float,
    corner: tuple[float, float],
    *,
    site: np.ndarray | None = None,
    closed: bool = False,
    least_width: float = LEAST_WIDTH,
    spurs: float = SPURS,
    places: bool = True,
    courts: bool = False,
    kinds: StreetKinds | str | os.PathLike | None = None,
    water: np.ndarray | None = None,
    density: DensityAt | None = None,
) -> StreetGraph:
    """Compute the street graph of open ground.

    Thinning reduces ground to lines in the middle between walls, and keeps its topology
    (`evocity.views.ground.streets`). Without removed passages, pruned dead ends and places, each
    piece of ground has one component. Each built component that does not touch the frame then has
    one independent cycle. Crossings within one disc of open ground are one node.

    open_ground : bool ``(H, W)``. building_labels : int32 ``(H, W)``, 0, or 1…n on n buildings.
    corner : (x, y) of the north-west corner, metres, x to the east, y to the north. site : bool
    ``(H, W)``, the map's own pixels, None for all. closed : whether the frame is a wall. The
    streets of an open city run out of the map.
    least_width : edges narrower at any point, metres, are left out. 0 keeps all.
    spurs : dead ends no longer than so many times the width of the ground where they begin are left
        out. 0 keeps all.
    places : whether streets run round places, along their walls; otherwise lines lead to their
        middles.
    courts : whether lines stay that have no way to the frame, by lines or over places.
    kinds : a `StreetKinds`, or the path of its TOML file; None for the table of this package.
    water : bool ``(H, W)``, open ground that is water; None for a map without any.
    density : computes GSI and FSI around places, as `CityMap.local_density_at`; needed for a table
    whose kinds depend on them.

    Raises `MapError` for a parameter that is not such a number or mask, or for a wrong table.

    Sources: homotopic skeleton, widths, places, quarters and kinds, open and closed city, Marsault
    2002 (§6.2) and 2005 (§3.3, fig. 12), which give no numbers; the method is ours. About 20 ms
    at 256²."""
    check_number("least_width", least_width, 0, np.inf, "metres, 0 or more", MapError)
    check_number("spurs", spurs, 0, np.inf, "a number of widths, 0 or more", MapError)
    if water is not None and (np.asarray(water).dtype != bool or water.shape != open_ground.shape):
        raise MapError(
            f"the parameter 'water' is an array of {np.asarray(water).dtype} with the shape "
            f"{np.shape(water)}",
            f"an array of booleans of the shape {open_ground.shape}, one for each pixel",
            "convert the array, for example water = numbers > 0",
        )
    table = packaged() if kinds is None else kinds
    table = table if isinstance(table, StreetKinds) else StreetKinds.read(table)
    pixel = float(metres_per_pixel)
    middle = max(table.place_width / pixel, 2.0) if places else None
    ground = skeleton(open_ground, site, closed, middle, least_width / pixel)
    lines = select_streets(build_lines(ground), ground, least_width / pixel, spurs, courts)
    seen = connected_to_frame(lines, ground)[1] | courts
    middles = seen & (ground.hubs[1:] != 1)
    made = _Input(
        ground, lines, middles, table, pixel, corner, open_ground, building_labels, site, closed,
        water, np.empty((0, 2)),
    )  # fmt: skip
    return _build(made, density)


def _build(made: _Input, density: DensityAt | None) -> StreetGraph:
    import shapely

    ground, lines, pixel = made.ground, made.lines, made.pixel
    outward = _frame_shift(lines, made)
    made = dataclasses.replace(made, lines=(lines := _repeat_ends(lines, outward)))
    many, count = len(lines.nodes), len(lines.first)
    pixels = np.column_stack(np.divmod(lines.nodes, ground.open.shape[1]))
    nodes, points = np.empty((many, 2)), np.empty((len(lines.path), 2))
    middles(lines.nodes, ground.squares, nodes)
    nodes = np.where(outward != 0, pixels + outward, nodes)
    ends = np.stack([nodes[lines.first], nodes[lines.last]], axis=1)
    smoothed(lines.starts, lines.path, ground.squares, ends, _ROUNDS, points)
    edge = np.repeat(np.arange(count), np.diff(lines.starts))
    clear, least = (values * pixel for values in edge_values(lines, ground.across))
    nodes, placed = (_to_metres(pairs, made) for pairs in (nodes, points))
    edges = shapely.linestrings(placed, indices=edge)
    frame = made.corner, made.open_ground.shape, pixel
    made = dataclasses.replace(
        made, points=points, densities=made.table.densities(edges, density, *frame)
    )
    length = shapely.length(edges)
    street = np.empty(count, np.int64)
    straight_on(lines.first, lines.last, _headings(points, lines.starts), _STRAIGHT, street)
    street = np.unique(street, return_inverse=True)[1]
    drawn = np.zeros(ground.open.shape, bool)
    drawn.ravel()[lines.path] = drawn.ravel()[lines.nodes] = True
    drawn = np.ascontiguousarray(drawn[1:-1, 1:-1])
    ends = np.column_stack([lines.first, lines.last]).astype(np.int32)
    arrays = {
        "nodes": nodes,
        "degree": np.bincount(ends.ravel(), minlength=many).astype(np.int32),
        "at_frame": lines.out,
        "ends": ends,
        "length": length,
        "clear": clear,
        "least": least,
        "street": street.astype(np.int32),
        "leaves": lines.out[lines.first] | lines.out[lines.last],
        "lines": drawn,
    }
    arrays = {name: read_only(array) for name, array in arrays.items()}
    return StreetGraph(edges=tuple(edges), _input=made, **arrays)


def _walls(made: _Input) -> np.ndarray:
    """Mark open ground, walls, and what lies beyond an open map: uint8, bordered, 0, 1 and 2."""
    within = np.ones(made.open_ground.shape, bool) if made.site is None else made.site
    beyond = np.uint8(1 if made.closed else 2)
    walls = np.where(within, (~made.open_ground).astype(np.uint8), beyond)
    return np.pad(walls, 1, constant_values=beyond)


def _to_metres(points: np.ndarray, made: _Input) -> np.ndarray:
    """Convert ``points``, (row, column) of the bordered grid, to x and y."""
    left, top = made.corner
    x = left + (points[:, 1] - 0.5) * made.pixel
    return np.column_stack([x, top - (points[:, 0] - 0.5) * made.pixel])


def _frame_shift(lines: Lines, made: _Input) -> np.ndarray:
    """Compute the shift of nodes at the frame from the middles of their pixels to its edge: (n, 2),
    px."""
    own = np.ones(made.open_ground.shape, bool) if made.site is None else made.site
    within, columns = np.pad(own, 1).ravel(), made.ground.open.shape[1]
    moved = np.zeros((len(lines.nodes), 2))
    for down, along in ((0, 1), (0, -1), (1, 0), (-1, 0)):
        beyond = lines.out & ~within[lines.nodes + down * columns + along]
        moved[beyond] = down / 2, along / 2
    return moved


def _repeat_ends(lines: Lines, outward: np.ndarray) -> Lines:
    """Repeat the ends of lines at the frame: once in the middle of the pixel, from which no wall is
    in the way, and once on the frame."""
    moved, times = outward.any(axis=1), np.ones(len(lines.path), np.int64)
    times[lines.starts[:-1]] += moved[lines.first]
    times[lines.starts[1:] - 1] += moved[lines.last]
    starts = np.concatenate([[0], np.cumsum(times)])[lines.starts]
    return dataclasses.replace(lines, starts=starts, path=np.repeat(lines.path, times))


def _headings(points: np.ndarray, starts: np.ndarray) -> np.ndarray:
    """Compute unit vectors into each edge, from its first point and from its last: (m, 2, 2)."""
    begin, end = starts[:-1], starts[1:] - 1
    seen = np.minimum(_SEEN, end - begin)
    ways = np.stack(
        [points[begin + seen] - points[begin], points[end - seen] - points[end]], axis=1
    )
    return ways / np.maximum(np.hypot(ways[..., :1], ways[..., 1:]), 1e-12)


def _majority(edge: np.ndarray, values: np.ndarray, count: int) -> np.ndarray:
    """Find the value, 0 or more, of over half the pixels of each edge: int32 (count,), −1 for
    none."""
    majority = np.full(count, -1, np.int32)
    sizes = np.bincount(edge, minlength=count)
    pairs, times = np.unique(np.column_stack([edge, values]), axis=0, return_counts=True)
    most = (2 * times > sizes[pairs[:, 0]]) & (pairs[:, 1] >= 0)
    majority[pairs[most, 0]] = pairs[most, 1]
    return majority


def _quarters(building_labels: np.ndarray, lines: np.ndarray) -> np.ndarray:
    """Find the piece between ``lines`` of each building: int32, from 0."""
    between, _ = pieces(~lines)
    own = np.zeros(building_labels.max(initial=0) + 1, np.int64)
    own[building_labels] = between
    return np.unique(own[1:], return_inverse=True)[1].astype(np.int32)
