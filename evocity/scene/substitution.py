"""Generated buildings give way to objects of a library that nearly fill the same ground."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from numbers import Real

import numpy as np
import shapely
import shapely.affinity

from evocity.citymap import STOREY, CityMap, Classes, Walls
from evocity.errors import MapError, keyword, setting
from evocity.formats import Copies
from evocity.scene.library import LEAST, Library
from evocity.scene.likeness import SCALE, Boards, Placing, Sides, frames_of, likest, placed

#: An object may stand so far out of its building's footprint, metres, on open ground; but no
#: farther than a third of the way to the next building. 6 m: half a house's depth.
MARGIN = 6.0
#: What fills less than this, as intersection over union, is no fit.
LEAST_IOU = 0.6

# Fits whose IoU differs by less are ties.
_TIE = 0.01
# At what shares of the margin the ground about a building is bounded.
_RINGS = (0.125, 0.25, 0.5, 1.0)
# So many of the likest objects are tried on boards; how many of the best placings are bettered
# there, step by step finer: degrees, share of a scale, metres. Then the best are bettered on
# polygons, and the next where none of them fits.
_LAST = (1.0, 0.015, 0.25)
_TRIED = 200
_STEPS = (
    *((40, (6.0, 0.06, 1.5)), (40, (6.0, 0.06, 1.5))),
    *((24, (4.0, 0.04, 0.8)), (24, (4.0, 0.04, 0.8))),
    *((24, (2.0, 0.03, 0.5)), (24, (2.0, 0.03, 0.5)), (24, _LAST)),
)
_FINELY = (_LAST, _LAST)
_TURNS = ((0, 4), (4, 12), (12, 24))
# How an object shrinks where it does not fit; the last tells that it does not.
_SHRINKS = (1.0, 0.99, 0.975, 0.95, 0.92, 0.89)
# What is worse than a fit by more than this, what lies where it must not counted, is given up.
_HOPE = 0.2
# So much smaller than it might be an object is, metres, and what of it may then lie where it must
# not, m²: rounding.
_SLACK, _GRAIN = 2e-3, 1e-8


@dataclass(frozen=True, eq=False)
class Substitution:
    """Buildings of a map, some of them objects of a library.

    polygons : objects ``(n,)``, where each stands now, in the order of ``walls``, in its reference
        system. None overlaps another.
    heights : float64 ``(n,)``, metres.
    objects : int32 ``(n,)``: which of the library's objects it is; -1 where none fitted, and the
        building keeps its own form.
    transforms : float64 ``(n, 2, 3)``: from the object's metres about its centroid to the map's
        system, x' = a x + b y + c; NaN where there is none.
    vertical : float64 ``(n,)``: by how much its height is scaled; NaN where there is none.
    iou : float64 ``(n,)``: intersection over union with the building's own polygon; NaN where there
        is none.
    attached : bool ``(n,)``: which stand wall to wall with others.
    walls, library : what was given.
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
        """Of each the id of its object, None where it keeps its own form."""
        return tuple(None if k < 0 else self.library.ids[k] for k in self.objects)

    @cached_property
    def counts(self) -> dict[str, int]:
        """How many buildings are ``isolated`` and how many ``attached``, how many are ``small``,
        under `evocity.scene.library.LEAST` m², and counted there alone; of each how many were
        fitted, ``isolated_fitted`` and so on; how many of all were ``fitted``, or ``kept`` their
        own form."""
        small = shapely.area(np.array(self.walls.polygons, dtype=object).reshape(-1)) < LEAST
        fitted = self.objects >= 0
        told = {
            "isolated": ~self.attached & ~small,
            "attached": self.attached & ~small,
            "small": small,
        }
        told |= {f"{name}_fitted": one & fitted for name, one in told.items()}
        told |= {"fitted": fitted, "kept": ~fitted}
        return {name: int(np.count_nonzero(one)) for name, one in told.items()}

    def copies(
        self, offset: tuple[float, float], chosen: np.ndarray, more: int = 0
    ) -> Copies | None:
        """Which of the buildings ``chosen``, bool ``(n,)``, are copies of which objects, in metres
        from ``offset``; after them ``more`` that are none. None if no object is among them."""
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
        # what is scaled and turned in one, parted again
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
        """The lines that the licences of the objects used here ask for."""
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
    """Put objects of a library where the buildings of a map are.

    Each building takes an object of its own class whose height differs by at most a storey (3 m),
    turned by any angle, mirrored or not, each axis scaled by at most 15 %, so that it fills the
    building's footprint best. It stands within the footprint and ``margin`` about it, on the map,
    where any other building is at least twice as far: so no object crosses a neighbour, and of a
    street or passage the middle third stays open. Of objects that fill it alike one is drawn. A
    house that stands wall to wall with others is turned along its party walls, and stays between
    them. What nothing fits keeps its own form.

    Parameters
    ----------
    rng : what ties are drawn by; the same seed gives the same buildings.
    walls : of the city, otherwise fitted (`CityMap.walled`); None for `CityMap.walls`.
    classes : of the city, by another table (`CityMap.classified`); None for `CityMap.classes`.
    margin : metres, 0 or more.
    least : least intersection over union that is a fit, above 0, at most 1.

    Raises `MapError` for numbers that are none of these.

    Sources: libraries of objects under the constraint of heights and of the footprint, Marsault
    2002 (000 §6.2) and 2005 (001 §3.1), where it was "not been already implemented"; how, ours.
    About 1 s for 300 buildings and some thousand objects.
    """
    _check("margin", margin, 0, 100, "metres, 0 to 100")
    _check("least", least, 1e-9, 1, "intersection over union, above 0, at most 1")
    walls = city.walls if walls is None else walls
    classes = city.classes if classes is None else classes
    polygons = np.array(walls.polygons, dtype=object).reshape(-1)
    kinds = [classes.names[k] for k in classes.of_buildings[walls.buildings - 1]]
    # from the map's corner, to the micrometre: the same is fitted wherever on Earth it lies
    offset = np.array(city.origin or (0.0, city.shape[0] * city.metres_per_pixel))
    local = shapely.transform(polygons, lambda points: np.round(points - offset, 6))
    ground = _Ground(local, margin, _frame(city, offset))
    draws = rng.random((len(polygons), 2))
    placing = likest(local, ground.party, walls.heights, kinds, library, STOREY, _TRIED)
    best = _best(placing, ground, library, draws, least)
    return _told(best, polygons, offset, ground, walls, library)


def _check(name: str, value: object, low: float, high: float, wanted: str) -> None:
    if not (isinstance(value, Real) and low <= value <= high):
        raise MapError(setting(name, value), wanted, f"correct {keyword(name)}, or leave it out")


def _frame(city: CityMap, offset: np.ndarray) -> shapely.Polygon:
    """The map's rectangle."""
    deep, wide = (side * city.metres_per_pixel for side in city.shape)
    left, top = city.origin or (0.0, deep)
    left, top = left - offset[0], top - offset[1]
    return shapely.box(left, top - deep, left + wide, top)


class _Ground:
    """Where each building, and what takes its place, may stand.

    polygons : as they are. allowed : these, and ``margin`` about them but for what is less than
    twice as far from others. attached : bool, which touch others. party : radians, the direction
    of their party walls, up to quarter turns; NaN where there are none.
    """

    def __init__(self, polygons: np.ndarray, margin: float, frame: shapely.Polygon):
        self.polygons = polygons
        self.areas, self.sides = shapely.area(polygons), Sides(polygons)
        tree = shapely.STRtree(polygons)
        one, other = tree.query(polygons, predicate="intersects")
        one, other = one[one != other], other[one != other]
        self.allowed = shapely.intersection(self._about(tree, margin), frame)
        shared = shapely.intersection(polygons[one], polygons[other])
        length = shapely.length(shared)
        self.attached = np.zeros(len(polygons), bool)
        self.attached[one[shapely.intersects(polygons[one], polygons[other])]] = True
        self.party = np.full(len(polygons), np.nan)
        met = length > 0.5
        if met.any():
            self.party = _directions(shared[met], one[met], len(polygons))
        self.open = Sides(self.allowed)

    def _about(self, tree: shapely.STRtree, margin: float) -> np.ndarray:
        """The polygons, and what is about them: in rings, each as far as it reaches from its own
        polygon or nearer, and twice as far from all others."""
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
    """Radians ``(count,)``, up to quarter turns: the mean direction of each owner's ``lines``, by
    length; NaN where there are none."""
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


def _best(
    placing: Placing, ground: _Ground, library: Library, draws: np.ndarray, least: float
) -> tuple[Placing, np.ndarray]:
    """One placing a building that has any, and its IoU."""
    placing = placing.joined(_centred(placing, ground.polygons))
    boards = Boards(ground.polygons, ground.allowed, library)
    score = boards.measured(placing)
    for most, step in _STEPS:
        kept = _first(placing.building, score, most)
        placing, score = placing.only(kept), score[kept]
        placing, score = _bettered(placing, score, boards.measured, step)
    hope = score > least - _HOPE
    placing, score = placing.only(hope), score[hope]
    found, scores = placing.only(np.zeros(0, int)), np.zeros(0)
    exactly = _Exactly(ground, library)
    for begin, end in _TURNS:  # the next best where the best do not fit
        waiting = ~np.isin(placing.building, found.building)
        left, worth = placing.only(waiting), score[waiting]
        rank = np.setdiff1d(_first(left.building, worth, end), _first(left.building, worth, begin))
        fitted, new = exactly.fitted(left.only(rank), least)
        found, scores = found.joined(fitted), np.concatenate([scores, new])
    chosen = _drawn(found.building, scores, draws)
    return found.only(chosen), scores[chosen]


def _centred(placing: Placing, polygons: np.ndarray) -> Placing:
    """The placings with the objects' centroids on those of their buildings: shapes of several wings
    may be more alike so than in the rectangles about them."""
    there = shapely.get_coordinates(shapely.centroid(polygons)).reshape(-1, 2)
    numbers = placing.numbers.copy()
    numbers[:, 3:] += there[placing.building] - placing.matrices[:, :, 2]
    return replace(placing, numbers=numbers)


class _Exactly:
    """Placings measured by their polygons."""

    def __init__(self, ground: _Ground, library: Library):
        self.ground, self.library, self.sides = ground, library, Sides(library.polygons)
        self.areas = shapely.area(library.polygons)

    def fitted(self, placing: Placing, least: float) -> tuple[Placing, np.ndarray]:
        """Those of the placings, bettered, that fit where they may stand, and their IoU."""
        score = self.measured(placing)
        for step in _FINELY:
            placing, score = _bettered(placing, score, self.measured, step)
        placing, score = self._shrunk(placing, least)
        return placing.only(score >= least), score[score >= least]

    def measured(self, placing: Placing) -> np.ndarray:
        """IoU of each placing, less four times the share of it that lies where it must not."""
        return self._told(placing)[0]

    def _told(self, placing: Placing) -> tuple[np.ndarray, np.ndarray]:
        """As `measured`; and how much lies where it must not, m²."""
        ground, areas = self.ground, self.areas[placing.object]
        areas = areas * placing.numbers[:, 1] * placing.numbers[:, 2]
        common = self.sides.shared(placing, ground.sides)
        beyond = areas - self.sides.shared(placing, ground.open)
        union = areas + ground.areas[placing.building] - common
        return common / union - 4 * beyond / areas, beyond

    def _shrunk(self, placing: Placing, least: float) -> tuple[Placing, np.ndarray]:
        """Each placing, shrunk until it stands where it may, and its IoU: below 0 where none
        does."""
        done, score = placing, np.full(len(placing), -1.0)
        waiting = np.arange(len(placing))
        for shrink in _SHRINKS:
            trial = placing.only(waiting).shrunk(shrink).slackened(_SLACK, self.library)
            found, beyond = self._told(trial)
            fits = (beyond <= _GRAIN) & trial.within_scale
            at = waiting[fits]
            done, score[at] = done.replaced(at, trial.only(fits)), found[fits]
            waiting = waiting[~fits & (found > least - _HOPE)]
            if not len(waiting):
                break
        return done, score


def _bettered(
    placing: Placing,
    score: np.ndarray,
    measure: Callable[[Placing], np.ndarray],
    step: tuple[float, float, float],
) -> tuple[Placing, np.ndarray]:
    """Each placing, or the best of some about it, one number of it changed after the other."""
    for column, size in (
        (0, np.radians(step[0])),
        (1, step[1]),
        (2, step[1]),
        (3, step[2]),
        (4, step[2]),
    ):
        for sign in (1, -1):
            other = placing.changed(column, sign * size)
            found = measure(other)
            better = found > score + 1e-4
            placing, score = placing.where(better, other), np.where(better, found, score)
    return placing, score


def _first(group: np.ndarray, score: np.ndarray, most: int) -> np.ndarray:
    """Numbers of the ``most`` best of each group, by rising group."""
    order = np.lexsort((np.arange(len(score)), -score, group))
    ranked = group[order]
    rank = np.arange(len(ranked)) - np.searchsorted(ranked, ranked)
    return order[rank < most]


def _drawn(group: np.ndarray, score: np.ndarray, draws: np.ndarray) -> np.ndarray:
    """Of each group's best, which differ by less than `_TIE`, one, by its own draw."""
    order = _first(group, score, len(score))
    chosen = []
    for k in np.unique(group):
        own = order[group[order] == k]
        tied = own[score[own] >= score[own[0]] - _TIE]
        chosen.append(tied[int(draws[k, 0] * len(tied))])
    return np.array(chosen, int)


def _told(best, polygons, offset, ground, walls, library) -> Substitution:
    placing, score = best
    count, at = len(polygons), placing.building
    shapes, heights = polygons.copy(), walls.heights.astype(np.float64)
    objects = np.full(count, -1, np.int32)
    transforms, vertical, iou = (
        np.full((count, 2, 3), np.nan),
        np.full(count, np.nan),
        np.full(count, np.nan),
    )
    objects[at], iou[at] = placing.object, score
    matrices = placing.matrices
    matrices[:, :, 2] += offset
    transforms[at] = matrices
    stood = placed(placing, library.polygons)
    shapes[at] = shapely.transform(stood, lambda points: points + offset)
    own = library.heights[placing.object]
    vertical[at] = np.clip(heights[at] / own, 1 - SCALE, 1 + SCALE)
    heights[at] = own * vertical[at]
    columns = (heights, objects, transforms, vertical, iou)
    for array in columns:
        array.setflags(write=False)
    return Substitution(shapes, *columns, ground.attached, walls, library)


__all__ = ["LEAST_IOU", "MARGIN", "Substitution", "substituted"]
