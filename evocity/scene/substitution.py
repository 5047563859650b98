"""Substitution of generated buildings by library objects that nearly fill the same ground."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import shapely
import shapely.affinity

from evocity.citymap import STOREY, CityMap, Classes, Walls
from evocity.errors import MapError, check_number
from evocity.formats import Copies
from evocity.scene.library import LEAST, Library
from evocity.scene.matching import (
    SCALE,
    Boards,
    Placing,
    Sides,
    frames_of,
    match_objects,
    place_objects,
)
from evocity.views.limit_tables import read_only

#: Metres that an object may exceed its building's footprint on open ground, up to a third of the
#: way to the next building. 6 m: half a house's depth.
MARGIN = 6.0
#: The least fit, as intersection over union.
LEAST_IOU = 0.6

# Fits with a smaller difference in IoU are ties.
_TIE = 0.01
# Shares of the margin at which the ground about a building is bounded.
_RINGS = (0.125, 0.25, 0.5, 1.0)
# So many of the most similar objects are measured on boards. There, rounds of finer steps improve
# so many of the best placings: degrees, share of a scale, metres. Then polygons improve the best,
# and the next best where none of them fits.
_LAST = (1.0, 0.015, 0.25)
_TRIED = 200
_STEPS = (
    *((40, (6.0, 0.06, 1.5)), (40, (6.0, 0.06, 1.5))),
    *((24, (4.0, 0.04, 0.8)), (24, (4.0, 0.04, 0.8))),
    *((24, (2.0, 0.03, 0.5)), (24, (2.0, 0.03, 0.5)), (24, _LAST)),
)
_FINELY = (_LAST, _LAST)
_TURNS = ((0, 4), (4, 12), (12, 24))
# Factors by which an object shrinks until it fits.
_SHRINKS = (1.0, 0.99, 0.975, 0.95, 0.92, 0.89)
# The search drops placings that miss a fit by more than this, forbidden ground included.
_HOPE = 0.2
# Objects are smaller by so many metres, and may then have so many m² on forbidden ground: rounding.
_SLACK, _GRAIN = 2e-3, 1e-8


@dataclass(frozen=True, eq=False)
class Substitution:
    """Buildings of a map, some of them replaced by objects of a library.

    polygons : the footprints of the n buildings, an object array ``(n,)``, without overlaps. The
        order and the reference system of the polygons are those of ``walls``.
    heights : the height of each building in metres, float64 ``(n,)``.
    objects : for each building, the index of an object in the library, int32 ``(n,)``. If no
        object fits a building, the array ``objects`` has the number -1 for this building, and the
        building keeps its own form.
    transforms : the affine transform of each object, float64 ``(n, 2, 3)``; NaN for a building
        without an object. A transform converts metres (x, y) around the object's centroid into the
        city's reference system: x' = a x + b y + c, with (a, b, c) the first row.
    vertical : float64 ``(n,)``: the factor that scales the height of each object; NaN for a
        building without an object.
    iou : float64 ``(n,)``: intersection over union of the object and the building's own polygon;
        NaN for a building without an object.
    attached : bool ``(n,)``: whether the building touches neighbours wall to wall.
    walls, library : the walls and the library that the substitution was made from.
    """

    polygons: np.ndarray
    heights: np.ndarray
    objects: np.ndarray
    transforms: np.ndarray
    vertical: np.ndarray
    iou: np.ndarray
    attached: np.ndarray
    walls: Walls
    library: Library

    def __len__(self) -> int:
        return len(self.polygons)

    @property
    def ids(self) -> tuple[str | None, ...]:
        """The id of the object that replaces each building; None where the building keeps its own
        form."""
        return tuple(None if k < 0 else self.library.ids[k] for k in self.objects)

    @cached_property
    def counts(self) -> dict[str, int]:
        """Numbers of buildings: ``isolated`` and ``attached`` ones; ``small`` ones, under
        `evocity.scene.library.LEAST` m², which count only there; the replaced ones of each,
        ``isolated_fitted`` and so on; the replaced ones of all, ``fitted``, and the others,
        ``kept``."""
        small = shapely.area(np.array(self.walls.polygons, dtype=object).reshape(-1)) < LEAST
        fitted = self.objects >= 0
        kinds = {
            "isolated": ~self.attached & ~small,
            "attached": self.attached & ~small,
            "small": small,
        }
        kinds |= {f"{name}_fitted": chosen & fitted for name, chosen in kinds.items()}
        kinds |= {"fitted": fitted, "kept": ~fitted}
        return {name: int(np.count_nonzero(chosen)) for name, chosen in kinds.items()}

    def copies(
        self, offset: tuple[float, float], chosen: np.ndarray, more: int = 0
    ) -> Copies | None:
        """Return copies of the objects that replace the buildings in the mask ``chosen``, bool
        ``(n,)``; coordinates are metres from ``offset``. The result ends with ``more`` additional
        entries, for solids that are not copies. The result is None if no object replaces a chosen
        building."""
        objects = np.r_[self.objects[chosen], np.full(more, -1)]
        used, of = np.unique(objects, return_inverse=True)
        used, of = used[used >= 0], of - int((objects < 0).any())
        if not len(used):
            return None
        frames, library = frames_of(self.library), self.library
        shapes = np.empty(len(used), object)
        for k, number in enumerate(used):
            angle, x, y = frames[number]
            turned = shapely.affinity.translate(library.polygons[number], -x, -y)
            shapes[k] = shapely.affinity.rotate(turned, -angle, origin=(0, 0), use_radians=True)
        # split the transform into scale and turn
        laid = np.concatenate([self.transforms[chosen], np.full((more, 2, 3), np.nan)])
        own, x, y = frames[objects].T
        c, s = np.cos(own), np.sin(own)
        along = laid[:, :, 0] * c[:, None] + laid[:, :, 1] * s[:, None]
        across = laid[:, :, 1] * c[:, None] - laid[:, :, 0] * s[:, None]
        turns = np.arctan2(-across[:, 0], across[:, 1])
        wide = along[:, 0] * np.cos(turns) + along[:, 1] * np.sin(turns)
        up = np.r_[self.vertical[chosen], np.full(more, np.nan)]
        middles = np.stack([x, y], axis=1)
        places = (laid[:, :, :2] @ middles[:, :, None])[:, :, 0] + laid[:, :, 2] - offset
        names = tuple(library.ids[number] for number in used)
        scales = np.stack([wide, np.hypot(*across.T), up], axis=1)
        return Copies(names, shapes, library.heights[used], of, scales, turns, places)

    @property
    def attribution(self) -> str:
        """Attribution lines that the licences of the placed objects require."""
        used = np.unique(self.objects[self.objects >= 0])
        lines = (self.library.attributions[k] for k in used)
        return "; ".join(dict.fromkeys(line for line in lines if line))


def substituted(
    city: CityMap,
    library: Library,
    rng: np.random.Generator,
    *,
    walls: Walls | None = None,
    classes: Classes | None = None,
    margin: float = MARGIN,
    least: float = LEAST_IOU,
) -> Substitution:
    """Replace buildings of a map by objects of a library.

    Each building takes the object that fills its footprint best, among the objects of the
    building's class. The height of the object differs from the height of the building by at most a
    storey (3 m). The object may be turned by any angle and mirrored, and its axes may be scaled by
    at most 15 %.

    The object stands within the footprint and a ``margin`` around it. Each point of the margin is
    at least twice as far from any other building as from the building itself. No object crosses a
    neighbouring building, and the middle third of a street or passage stays open. If the building
    stands wall to wall with neighbours, the object is aligned with the party walls and stays
    between them. If no object fits a building, the building keeps its own form. The generator
    ``rng`` chooses between objects that fit equally well.

    Parameters
    ----------
    rng : the random generator; the same seed gives the same buildings.
    walls : walls of the city from `CityMap.walled`; None means `CityMap.walls`.
    classes : classes of the city from `CityMap.classified`; None means `CityMap.classes`.
    margin : width of the margin around a footprint, metres, 0 or more.
    least : the lowest intersection over union that counts as a fit, above 0, at most 1.

    Raises `MapError` for numbers out of range.

    Sources: Marsault 2002 (§6.2) and 2005 (§3.1) propose libraries of objects. Each object has the
    height and the footprint of the building that it replaces. According to the papers, libraries of
    objects have "not been already implemented"; the method here comes from evocity. A map of about
    300 buildings and a library of a thousand objects take about 1 s.
    """
    check_number("margin", margin, 0, 100, "metres, 0 to 100", MapError)
    overlap = "intersection over union, above 0, at most 1"
    check_number("least", least, 1e-9, 1, overlap, MapError)
    walls = city.walls if walls is None else walls
    classes = city.classes if classes is None else classes
    polygons = np.array(walls.polygons, dtype=object).reshape(-1)
    kinds = [classes.names[k] for k in classes.of_buildings[walls.buildings - 1]]
    # from the map's corner, to the micrometre: the fit does not depend on the place on Earth
    offset = np.array(city.north_west)
    local = shapely.transform(polygons, lambda points: np.round(points - offset, 6))
    deep, wide = (side * city.metres_per_pixel for side in city.shape)
    left, top = city.north_west - offset
    ground = _Ground(local, margin, shapely.box(left, top - deep, left + wide, top))
    draws = rng.random((len(polygons), 2))
    placing = match_objects(local, ground.party, walls.heights, kinds, library, STOREY, _TRIED)
    best = _search(placing, ground, library, draws, least)
    return _make_substitution(best, polygons, offset, ground, walls, library)


class _Ground:
    """The ground on which each building, or its object, may stand.

    polygons : the buildings. allowed : these, and ``margin`` about them except where another
    building is less than twice as far. attached : bool, which touch others. party : radians, the
    direction of their party walls, up to quarter turns; NaN without party walls.
    """

    def __init__(self, polygons: np.ndarray, margin: float, frame: shapely.Polygon):
        self.polygons = polygons
        self.areas, self.sides = shapely.area(polygons), Sides(polygons)
        tree = shapely.STRtree(polygons)
        one, other = tree.query(polygons, predicate="intersects")
        one, other = one[one != other], other[one != other]
        self.allowed = shapely.intersection(self._margins(tree, margin), frame)
        shared = shapely.intersection(polygons[one], polygons[other])
        length = shapely.length(shared)
        self.attached = np.zeros(len(polygons), bool)
        self.attached[one[shapely.intersects(polygons[one], polygons[other])]] = True
        self.party = np.full(len(polygons), np.nan)
        met = length > 0.5
        if met.any():
            self.party = _directions(shared[met], one[met], len(polygons))
        self.open = Sides(self.allowed)

    def _margins(self, tree: shapely.STRtree, margin: float) -> np.ndarray:
        """Return the polygons with rings about them; each point of a ring is at least twice as far
        from all other polygons."""
        rings = [self.polygons]
        for share in _RINGS if margin else ():
            ring = shapely.buffer(self.polygons, share * margin, quad_segs=4)
            one, other = tree.query(ring, predicate="dwithin", distance=2 * share * margin)
            one, other = one[one != other], other[one != other]
            wide = shapely.buffer(self.polygons, 2 * share * margin, quad_segs=4)
            begins = np.searchsorted(one, np.arange(len(ring) + 1))
            for k in np.unique(one):
                beside = shapely.union_all(wide[other[begins[k] : begins[k + 1]]])
                ring[k] = shapely.difference(ring[k], beside)
            rings.append(ring)
        return shapely.union_all(np.stack(rings), axis=0)


def _directions(lines: np.ndarray, owner: np.ndarray, count: int) -> np.ndarray:
    """Compute the mean direction of each owner's ``lines``, weighted by length, in radians
    ``(count,)`` up to quarter turns; NaN without lines."""
    parts, which = shapely.get_parts(lines, return_index=True)
    straight = shapely.get_type_id(parts) == 1
    points, line = shapely.get_coordinates(parts[straight], return_index=True)
    step = np.diff(points, axis=0)
    same = line[1:] == line[:-1]
    whose = owner[which[straight][line[1:][same]]]
    x, y = step[same].T
    turn, length = 4 * np.arctan2(y, x), np.hypot(x, y)
    cosine = np.bincount(whose, length * np.cos(turn), minlength=count)
    sine = np.bincount(whose, length * np.sin(turn), minlength=count)
    found = np.arctan2(sine, cosine) / 4
    found[np.bincount(whose, minlength=count) == 0] = np.nan
    return found


def _search(
    placing: Placing, ground: _Ground, library: Library, draws: np.ndarray, least: float
) -> tuple[Placing, np.ndarray]:
    placing = placing.join(_center_on_buildings(placing, ground.polygons))
    boards = Boards(ground.polygons, ground.allowed, library)
    score = boards.measure(placing)
    for most, step in _STEPS:
        kept = _top_ranked(placing.building, score, most)
        placing, score = placing.select(kept), score[kept]
        placing, score = _improve(placing, score, boards.measure, step)
    hope = score > least - _HOPE
    placing, score = placing.select(hope), score[hope]
    found, scores = placing.select(np.zeros(0, int)), np.zeros(0)
    exactly = _PolygonScore(ground, library)
    for begin, end in _TURNS:  # the next best where the best do not fit
        waiting = ~np.isin(placing.building, found.building)
        left, worth = placing.select(waiting), score[waiting]
        rank = np.setdiff1d(
            _top_ranked(left.building, worth, end), _top_ranked(left.building, worth, begin)
        )
        fitted, new = exactly.fit(left.select(rank), least)
        found, scores = found.join(fitted), np.concatenate([scores, new])
    chosen = _draw_ties(found.building, scores, draws)
    return found.select(chosen), scores[chosen]


def _center_on_buildings(placing: Placing, polygons: np.ndarray) -> Placing:
    """Move the objects' centroids onto those of their buildings: shapes of several wings may match
    better than in the rectangles about them."""
    there = shapely.get_coordinates(shapely.centroid(polygons)).reshape(-1, 2)
    numbers = placing.numbers.copy()
    numbers[:, 3:] += there[placing.building] - placing.matrices[:, :, 2]
    return replace(placing, numbers=numbers)


class _PolygonScore:
    """Exact measurement of placings, by polygons."""

    def __init__(self, ground: _Ground, library: Library):
        self.ground, self.library, self.sides = ground, library, Sides(library.polygons)
        self.areas = shapely.area(library.polygons)

    def fit(self, placing: Placing, least: float) -> tuple[Placing, np.ndarray]:
        """Improve placings, and return those that fit on allowed ground, and their IoU."""
        score = self.measure(placing)
        for step in _FINELY:
            placing, score = _improve(placing, score, self.measure, step)
        placing, score = self._shrink_to_fit(placing, least)
        return placing.select(score >= least), score[score >= least]

    def measure(self, placing: Placing) -> np.ndarray:
        """Compute the IoU of each placing, less four times its share on forbidden ground."""
        return self._areas(placing)[0]

    def _areas(self, placing: Placing) -> tuple[np.ndarray, np.ndarray]:
        """Compute `measure`, and the area on forbidden ground, m²."""
        ground, areas = self.ground, self.areas[placing.object]
        areas = areas * placing.numbers[:, 1] * placing.numbers[:, 2]
        common = self.sides.shared_areas(placing, ground.sides)
        beyond = areas - self.sides.shared_areas(placing, ground.open)
        union = areas + ground.areas[placing.building] - common
        return common / union - 4 * beyond / areas, beyond

    def _shrink_to_fit(self, placing: Placing, least: float) -> tuple[Placing, np.ndarray]:
        """Shrink each placing until it stands on allowed ground, and return its IoU: below 0 where
        it never does."""
        done, score = placing, np.full(len(placing), -1.0)
        waiting = np.arange(len(placing))
        for shrink in _SHRINKS:
            trial = placing.select(waiting).shrink(shrink, _SLACK, self.library)
            found, beyond = self._areas(trial)
            fits = (beyond <= _GRAIN) & trial.within_scale
            at = waiting[fits]
            done, score[at] = done.assign(at, trial.select(fits)), found[fits]
            waiting = waiting[~fits & (found > least - _HOPE)]
            if not len(waiting):
                break
        return done, score


def _improve(
    placing: Placing,
    score: np.ndarray,
    measure: Callable[[Placing], np.ndarray],
    step: tuple[float, float, float],
) -> tuple[Placing, np.ndarray]:
    """Improve each placing: try a step up and down of each of its numbers in turn."""
    for column, size in (
        (0, np.radians(step[0])),
        (1, step[1]),
        (2, step[1]),
        (3, step[2]),
        (4, step[2]),
    ):
        for sign in (1, -1):
            other = placing.shift(column, sign * size)
            found = measure(other)
            better = found > score + 1e-4
            placing, score = placing.where(better, other), np.where(better, found, score)
    return placing, score


def _top_ranked(group: np.ndarray, score: np.ndarray, most: int) -> np.ndarray:
    """Return the indices of the ``most`` best of each group, by rising group."""
    order = np.lexsort((np.arange(len(score)), -score, group))
    ranked = group[order]
    rank = np.arange(len(ranked)) - np.searchsorted(ranked, ranked)
    return order[rank < most]


def _draw_ties(group: np.ndarray, score: np.ndarray, draws: np.ndarray) -> np.ndarray:
    """Draw one of each group's best, which differ by less than `_TIE`."""
    order = _top_ranked(group, score, len(score))
    chosen = []
    for k in np.unique(group):
        own = order[group[order] == k]
        tied = own[score[own] >= score[own[0]] - _TIE]
        chosen.append(tied[int(draws[k, 0] * len(tied))])
    return np.array(chosen, int)


def _make_substitution(best, polygons, offset, ground, walls, library) -> Substitution:
    placing, score = best
    count, at = len(polygons), placing.building
    shapes, heights = polygons.copy(), walls.heights.astype(np.float64)
    objects = np.full(count, -1, np.int32)
    transforms, (vertical, iou) = np.full((count, 2, 3), np.nan), np.full((2, count), np.nan)
    objects[at], iou[at] = placing.object, score
    matrices = placing.matrices
    matrices[:, :, 2] += offset
    transforms[at] = matrices
    stood = place_objects(placing, library.polygons)
    shapes[at] = shapely.transform(stood, lambda points: points + offset)
    own = library.heights[placing.object]
    vertical[at] = np.clip(heights[at] / own, 1 - SCALE, 1 + SCALE)
    heights[at] = own * vertical[at]
    columns = map(read_only, (heights, objects, transforms, vertical, iou))
    return Substitution(shapes, *columns, ground.attached, walls, library)
