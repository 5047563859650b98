"""Choice of the shape of each roof: which walls have eaves and which have gables, and the pitch."""

from dataclasses import dataclass

import numpy as np
import shapely

from evocity.io.roof_shapes import SHAPES
from evocity.scene.roofs.plans import Sides

#: Numbers of the shapes of roofs in `evocity.io.roof_shapes.SHAPES`.
FLAT, SKILLION, GABLED, HIPPED, PYRAMIDAL = range(5)

#: Most width of a wing under one ridge, metres.
WIDEST = 16.0
#: Heights of the eaves below and above which roofs are flat, metres.
LOWEST, HIGHEST = 2.0, 28.0
#: Area below which roofs are flat, m².
SMALLEST = 6.0
#: Most share of a plan that lies farther than half of `WIDEST` from all walls.
DEEP = 0.35
#: Height of the eaves up to which a building counts as a house, metres.
HOUSE = 10.0
#: Height and area below which a building is a shed, metres, m².
SHED = 4.0, 30.0
#: Length by width of the least rectangle from which on free ends are gables.
LONG = 1.25
#: Pitches, degrees, of plans up to 4 m and from 8 m deep: sheds, houses, other buildings. The
#: depth goes from the eaves to the ridge.
_PITCHES = ((15.0, 12.0), (40.0, 30.0), (32.0, 26.0))
#: Pitches below which roofs are flat, degrees: of mono-pitched roofs, of others.
_LEAST = 6.0, 12.0


@dataclass(frozen=True, eq=False)
class Choice:
    """The shape of each roof.

    may : bool ``(n,)``: buildings that may have a pitched roof, by height, width and walls.
    moves : float64 ``(r,)``, of each side: 1 with eaves, 0 with a gable.
    plain : float64 ``(r,)``, the same with eaves on all free walls, if the first has no roof.
    shed : bool ``(n,)``; mono : bool ``(n,)``: sheds, and plans of one slope.
    """

    may: np.ndarray
    moves: np.ndarray
    plain: np.ndarray
    shed: np.ndarray
    mono: np.ndarray


def given_shapes(polygons: np.ndarray, shapes: np.ndarray | None) -> np.ndarray:
    """Return the shape that the source gives each building, int64 ``(n,)``, or -1: the one with
    the largest area among the points in a polygon."""
    given = np.full(len(polygons), -1)
    if shapes is None:
        return given
    point, own = shapely.STRtree(polygons).query(
        shapely.points(shapes[:, :2]), predicate="intersects"
    )
    areas = np.zeros((len(polygons), len(SHAPES)))
    np.add.at(areas, (own, shapes[point, 2].astype(int)), shapes[point, 3])
    some = areas.any(axis=1)
    given[some] = areas[some].argmax(axis=1)
    return given


def choose_shapes(
    polygons: np.ndarray,
    eaves: np.ndarray,
    able: np.ndarray,
    sides: Sides,
    given: np.ndarray,
) -> Choice:
    """Choose the shape of each roof.

    polygons : objects ``(n,)``, metres. eaves : float64 ``(n,)``, metres above the ground.
    able : bool ``(n,)``: the buildings whose class may have roofs.
    given : int ``(n,)``: the number of the shape that the source gives, or -1. It comes before the
        rules below, and pitched shapes also stand on high buildings.

    Sheds, and buildings with one façade or a higher building behind, have one slope. Houses have
    gables at the free ends of long plans and eaves on all sides of short plans. Higher buildings
    have hips at free ends. Party walls are gables always.
    """
    count = len(polygons)
    area = shapely.area(polygons)
    free = ~sides.party
    facade = np.bincount(sides.owner, sides.lengths * free, minlength=count)
    facades = np.bincount(sides.owner, free, minlength=count)
    may = able & (eaves >= LOWEST) & (area >= SMALLEST) & (facade > 2.0) & (given != FLAT)
    may &= (eaves <= HIGHEST) | (given > FLAT)
    deep = np.zeros(count)
    if may.any():
        inner = shapely.buffer(polygons[may], -WIDEST / 2, quad_segs=2, join_style="mitre")
        deep[may] = shapely.area(inner) / area[may]
    may &= deep <= DEEP
    shed = (eaves < SHED[0]) & (area < SHED[1])
    alone = np.bincount(sides.owner, sides.party, minlength=count) == 0
    house = eaves <= HOUSE
    long = _elongation(polygons, may & house) >= LONG
    # one slope: away from the wall of a higher building, or down to the only façade
    leaning = np.bincount(sides.owner, sides.high, minlength=count) > 0
    mono = shed | (facades == 1) | (leaning & (area < 4 * SHED[1]))
    mono = may & ((given == SKILLION) | (mono & (given < 0)))
    gable = (given == GABLED) | (house & (long | ~alone) & (given < 0))
    plain = free.astype(np.float64)
    moves = plain.copy()
    moves[sides.ends & gable[sides.owner]] = 0.0
    # a plan needs a slope
    left = np.bincount(sides.owner, sides.lengths * moves, minlength=count)
    lost = left < 0.3 * facade
    moves[lost[sides.owner]] = plain[lost[sides.owner]]
    slope = _longest(sides, free, count)
    chosen = mono[sides.owner]
    moves[chosen] = (slope[sides.owner] == np.arange(len(sides.owner)))[chosen]
    return Choice(may, moves, plain, shed, mono)


def _longest(sides: Sides, free: np.ndarray, count: int) -> np.ndarray:
    """Return the longest free side of each building, int64 ``(count,)``; a side that faces the wall
    of a higher building comes before all others."""
    faced = np.zeros((count, 2))
    for axis in range(2):
        weight = sides.ways[:, axis] * sides.lengths * sides.high
        faced[:, axis] = np.bincount(sides.owner, weight, minlength=count)
    against = -(sides.ways * faced[sides.owner]).sum(axis=1)
    size = np.hypot(*faced.T)[sides.owner]
    opposite = (size > 0) & (against > 0.7 * size)
    worth = np.where(free, sides.lengths + 1e4 * opposite, -1.0)
    order = np.lexsort((worth, sides.owner))
    longest = np.full(count, -1)
    longest[sides.owner[order]] = order
    return longest


def _elongation(polygons: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """Compute length by width of the least rectangle about each of the ``chosen``."""
    found = np.ones(len(polygons))
    if chosen.any():
        boxes = shapely.oriented_envelope(polygons[chosen])
        points = shapely.get_coordinates(shapely.get_exterior_ring(boxes)).reshape(-1, 5, 2)
        sides = np.hypot(*np.moveaxis(np.diff(points[:, :3], axis=1), 2, 0))
        found[chosen] = sides.max(axis=1) / np.maximum(sides.min(axis=1), 1e-9)
    return found


def slopes_of(
    depth: np.ndarray, eaves: np.ndarray, choice: Choice, storey: float, ridges: np.ndarray
) -> np.ndarray:
    """Return the rise per metre of each roof, float64 ``(n,)``; 0 where the roof is flat.

    depth : float64 ``(n,)``, from the eaves to the ridge, metres. eaves, storey : metres.
    ridges : bool ``(n,)``, whether the height is that of the ridge; the eaves then lie below.

    A roof rises by two storeys at most on a house and one and a half otherwise, and by no more than
    .8 of the height of the eaves.
    """
    house = eaves <= HOUSE
    share = np.clip((depth - 4) / 4, 0, 1)
    kind = np.where(choice.shed, 0, np.where(house, 1, 2))
    steep, low = np.array(_PITCHES)[kind].T
    pitch = steep + (low - steep) * share
    pitch = np.where(choice.mono & ~choice.shed, np.minimum(pitch, 20.0), pitch)
    most = np.where(house, 2.0, 1.5) * storey
    most = np.minimum(most, np.where(ridges, 0.4, 0.8) * eaves)
    slope = np.minimum(np.tan(np.radians(pitch)), most / np.maximum(depth, 1e-9))
    least = np.tan(np.radians(np.where(choice.mono, *_LEAST)))
    return np.where(choice.may & (slope >= least), slope, 0.0)
